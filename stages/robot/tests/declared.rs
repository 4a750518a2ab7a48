//! URDFs and meshes that declare encodings, quaternions or units, which readers treat differently.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

mod common;

use ::robot::Severity;
use common::{Folder, LIMIT, link, meshed, says};

/// A robot with a box and a rotated joint, whose link and mesh file have a non-ASCII letter.
fn turned(declared: &str, version: &str, origin: &str) -> String {
    format!(
        "<?xml version='1.0'{declared}?><robot name='r'{version}>{}<link name='gr\u{fc}n'><visual>\
         <geometry><box size='1 1 1'/></geometry></visual></link><joint name='j' type='revolute'>\
         <parent link='a'/><child link='gr\u{fc}n'/><origin xyz='0 0 1' {origin}/><axis xyz='0 0 1'/>\
         {LIMIT}</joint></robot>",
        link("a")
    )
}

#[test]
fn a_urdf_is_read_in_the_encoding_that_it_declares() {
    let latin = turned(" encoding='ISO-8859-1'", "", "");
    let latin: Vec<u8> = latin.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let wide = turned(" encoding='UTF-16'", "", "");
    let wide: Vec<u8> =
        std::iter::once(0xFEFF).chain(wide.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    for bytes in [latin, wide, turned("", "", "").into_bytes()] {
        let (model, _) = Folder::new().with("robot.urdf", bytes).load();
        assert!(model.link("gr\u{fc}n").is_some(), "{:?}", model.links[1].name);
    }
    let folder = Folder::new().with("robot.urdf", turned(" encoding='windows-1250'", "", ""));
    says(&folder, "\"windows-1250\"");
}

#[test]
fn an_axis_of_another_length_is_taken_as_a_unit_vector_and_named() {
    let with = |axis: &str| {
        let text = turned("", "", "").replace("xyz='0 0 1'/>", &format!("xyz='{axis}'/>"));
        let (model, said) = Folder::new().with("robot.urdf", text).load();
        assert!((model.joints[0].axis.norm() - 1.0).abs() < 1e-12, "{axis}");
        said.iter().any(|f| f.severity == Severity::Warning && f.what.contains("axis has length"))
    };
    assert_eq!(["0 0 1", "0.6 0 0.8", "0.577 0.577 0.577"].map(with), [false; 3]);
    assert_eq!(["0 0 2", "1 1 0", "0 0 0.001"].map(with), [true; 3]);
}

#[test]
fn a_quaternion_counts_from_version_1_1_on_and_lint_says_who_reads_it() {
    // A quarter turn about x, not of unit length, as people write it.
    let quat = "quat_xyzw='2 0 0 2'";
    let turn = |version: &str, origin: &str| {
        let (model, findings) =
            Folder::new().with("robot.urdf", turned("", version, origin)).load();
        let joint = &model.joints[0];
        let said: Vec<_> = findings.iter().map(|f| (f.severity, f.what.clone())).collect();
        (joint.parent_from_joint.rotation.euler_angles().0, said)
    };
    let (roll, said) = turn("", quat);
    assert!(roll.abs() < 1e-12, "{roll}");
    assert!(
        said.iter().any(|(s, w)| *s == Severity::Warning && w.contains("version 1.1")),
        "{said:?}"
    );
    for version in [" version='1.1'", " version='1.2'"] {
        let (roll, said) = turn(version, quat);
        assert!((roll - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{roll}");
        assert!(
            said.iter().any(|(s, w)| *s == Severity::Note && w.contains("most other")),
            "{said:?}"
        );
    }
    let (roll, said) = turn(" version='1.1'", "rpy='0.5 0 0'");
    assert!((roll - 0.5).abs() < 1e-12 && said.is_empty(), "{roll} {said:?}");
    for (origin, words) in [
        ("rpy='0 0 0' quat_xyzw='0 0 0 1'", "both rpy and quat_xyzw"),
        ("quat_xyzw='0 0 0 0'", "no orientation"),
        ("quat_xyzw='0 0 1'", "no orientation"),
        ("quat_xyzw='0 nan 0 1'", "no orientation"),
    ] {
        says(&Folder::new().with("robot.urdf", turned("", " version='1.1'", origin)), words);
    }
}

#[test]
fn the_unit_of_a_dae_is_said_since_others_pass_it_over() {
    let dae = |unit: &str| {
        format!(
            "<COLLADA>{unit}<library_geometries><geometry id='g'><mesh>\
             <source id='p'><float_array count='9'>0 0 0 1000 0 0 0 1000 0</float_array></source>\
             <vertices id='v'><input semantic='POSITION' source='#p'/></vertices>\
             <triangles><input semantic='VERTEX' source='#v' offset='0'/><p>0 1 2</p></triangles>\
             </mesh></geometry></library_geometries><library_visual_scenes><visual_scene>\
             <node><instance_geometry url='#g'/></node></visual_scene></library_visual_scenes></COLLADA>"
        )
    };
    let notes = |unit: &str, size: f64| {
        let (model, findings) = meshed("m.dae", dae(unit).as_bytes()).load();
        // All other links are boxes of a decimetre.
        let sizes = model.links.iter().map(|l| l.bounds.size()[0]);
        let largest = sizes.fold(0.0, f64::max);
        assert!((largest - size).abs() < 1e-6 * size, "{largest}");
        let about = |f: &&::robot::Finding| f.what.contains("unit");
        findings.iter().filter(about).map(|f| f.what.clone()).collect::<Vec<_>>()
    };
    let said = notes("<asset><unit meter='0.001'/></asset>", 1.0);
    assert!(
        said.len() == 1 && said[0].contains("0.001 m") && said[0].contains("1000 times"),
        "{said:?}"
    );
    let said = notes("<asset><unit meter='0.0254'/></asset>", 25.4);
    assert!(said.len() == 1 && said[0].contains("39.3701 times"), "{said:?}");
}
