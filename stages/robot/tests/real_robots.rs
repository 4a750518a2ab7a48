//! Real robots, and meshes with known difficulties, load with the expected content.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

mod common;

use ::robot::{Library, Model, Role, Settings, Severity};
use common::{Folder, robot};

#[test]
fn every_shared_robot_loads() {
    let Some(dir) = common::shared("robots") else {
        return;
    };
    let library = Library::load(&dir, &Settings::without_clouds()).unwrap();
    assert!(
        library.findings.iter().all(|f| f.severity < Severity::Warning),
        "{:#?}",
        library.findings
    );
    // From the table of the collection: name, free joints, triangles (without the two boxes of the
    // gripper).
    let expected = [
        ("abb_irb2400_12_155", 6, 9254),
        ("abb_irb4600_20_250", 6, 36572),
        ("abb_irb6640_205_275", 6, 88845),
        ("abb_irb7600_150_350", 6, 29816),
        ("fanuc_m900ib_700", 6, 4384),
        ("fanuc_r2000ic_165f", 6, 69594),
        ("kuka_kr10_r1100_sixx", 6, 59781),
        ("kuka_kr210_r3100_ultra", 6, 123671),
        ("robotiq_2f_85", 1, 48296 + 2 * 12),
        ("yaskawa_es165", 6, 55602),
        ("yaskawa_mpl80", 5, 117781),
    ];
    assert_eq!(library.models.len(), expected.len());
    for (model, (name, n_free, n_triangles)) in library.models.iter().zip(expected) {
        assert_eq!((model.name.as_str(), model.free.len()), (name, n_free));
        let n: usize = model.links.iter().map(|l| l.mesh.triangles.len()).sum();
        // Triangles without area are left out.
        assert!(n <= n_triangles && n + 20 > n_triangles, "{name}: {n} of {n_triangles}");
        assert_eq!(model.is_tool(), name == "robotiq_2f_85");
        for (free, home) in model.home().iter().enumerate() {
            let [lower, upper] = model.limits(free);
            assert!(lower <= *home && *home <= upper);
        }
        for (at, joint) in model.joints.iter().enumerate() {
            assert!(joint.parent < joint.child);
            assert_eq!(model.links[joint.child].parent_joint, Some(at));
        }
    }
    let role = |model: &str, link: &str| {
        let model = &library.models[library.model(model).unwrap()];
        model.links[model.link(link).unwrap()].role
    };
    assert_eq!(role("fanuc_m900ib_700", "link_6"), Role::Main);
    assert_eq!(role("fanuc_m900ib_700", "plink_1"), Role::Sub);
    assert_eq!(role("fanuc_m900ib_700", "tool0"), Role::Effector);
    assert_eq!(role("abb_irb7600_150_350", "balancer_piston"), Role::Main);
}

#[test]
fn arms_of_depth_camera_scans_load() {
    let Some(dir) = common::shared("scans/robot-urdf") else {
        return;
    };
    let library = Library::load(&dir, &Settings::without_clouds()).unwrap();
    let names: Vec<_> = library.models.iter().map(|m| (m.name.as_str(), m.free.len())).collect();
    assert_eq!(names, [("lbr_med7", 7), ("xarm7", 7)]);
    let path = dir.join("xarm7/xarm7.urdf");
    assert_eq!(
        Model::load_urdf(&path, "xarm7", &Settings::without_clouds()).unwrap().0,
        library.models[1]
    );
}

/// File, number of triangles and bounds, from the README beside the files.
const HAZARDS: &[(&str, usize, [f64; 3], [f64; 3])] = &[
    ("kr210l150_link_6.dae", 11712, [0.0, -0.0990, -0.0986], [0.0375, 0.0988, 0.0991]),
    ("kr150_r3100_2_link_6.dae", 2280, [1.9199, -0.0710, 2.0390], [1.9650, 0.0710, 2.1810]),
    ("es200_120_link_r.stl", 7390, [-0.1110, -0.1430, -2.2110], [0.1110, 0.0810, -1.8930]),
    ("sia5d_link_u.dae", 1934, [-0.0575, -0.0760, -0.0575], [0.1450, 0.0550, 0.1150]),
    ("hc10dt_link_6_t.dae", 5058, [-0.0510, -0.0510, -0.1700], [0.0510, 0.0510, -0.0930]),
    ("robotiq_c2_joint_0_L.dae", 1612, [0.0225, 0.0305, -0.0065], [0.0683, 0.0498, 0.0287]),
];

#[test]
fn hazardous_meshes_have_the_expected_bounds() {
    let Some(dir) = common::shared("robots/_mesh_hazards") else {
        return;
    };
    for (file, n_triangles, min, max) in HAZARDS {
        let text = format!(
            "<link name='a'><visual><geometry><mesh filename='{file}'/></geometry></visual></link>"
        );
        let bytes = std::fs::read(dir.join(file)).unwrap();
        let (model, _) = Folder::new().with("robot.urdf", robot(&text)).with(file, bytes).load();
        let link = &model.links[0];
        println!("{file} {} {:?}", link.mesh.triangles.len(), link.bounds);
        let n = link.mesh.triangles.len();
        assert!(n <= *n_triangles && n + 20 > *n_triangles, "{file}: {n}");
        for k in 0..3 {
            assert!((link.bounds.min[k] - min[k]).abs() < 1e-4, "{file}: {:?}", link.bounds);
            assert!((link.bounds.max[k] - max[k]).abs() < 1e-4, "{file}: {:?}", link.bounds);
        }
    }
}
