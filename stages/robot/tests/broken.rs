//! Broken libraries are explained; nothing panics, hangs or leaves the folder.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

mod common;

use ::robot::{Library, Model, Settings};
use common::{Folder, LIMIT, arm, body, joint, link, meshed, robot, says};

#[test]
fn broken_urdfs_are_named() {
    let two = link("a") + &link("b");
    let moving =
        |rest: &str| robot(&(two.clone() + &joint("j", "revolute", "a", "b", "0 0 1", rest)));
    let cases = [
        (String::new(), "not well-formed XML"),
        ("<robot>".to_owned(), "not well-formed XML"),
        ("<sdf/>".to_owned(), "opens with"),
        (robot(""), "has no links"),
        (robot(&two), "one root link, this one has 2"),
        (robot(&(link("a") + &link("a"))), "is there twice \"a\""),
        (robot(&(two.clone() + &joint("j", "revolute", "a", "c", "0 0 1", LIMIT))), "no link \"c\""),
        (robot(&(two.clone() + &joint("j", "spiral", "a", "b", "0 0 1", LIMIT))), "\"spiral\""),
        (robot(&(two.clone() + &joint("j", "floating", "a", "b", "0 0 1", ""))), "\"floating\""),
        (robot(&(two.clone() + &joint("j", "revolute", "a", "b", "0 nan 1", LIMIT))), "finite number"),
        (robot(&(two.clone() + &joint("j", "revolute", "a", "b", "0 x 1 1", LIMIT))), "finite number"),
        (robot(&(two.clone() + &joint("j", "revolute", "a", "b", "0 1", LIMIT))), "finite number"),
        (moving(LIMIT).replace("0 1 0", "0 0 0"), "axis has length zero"),
        (moving("<limit lower='1' upper='-1'/>"), "lower limit is above"),
        (moving("<limit lower='-180' upper='180'/>"), "look like degrees"),
        (moving("<mimic joint='x'/>"), "not there \"x\""),
        (moving("<mimic joint='j'/>"), "in a circle"),
        (moving("").replace("revolute", "prismatic"), "without limits"),
        (moving("").replace("<parent link='a'/>", ""), "has no <parent>"),
        (robot(&(two.clone()
            + &joint("j", "revolute", "a", "b", "0 0 1", LIMIT)
            + &joint("k", "revolute", "b", "a", "0 0 1", LIMIT))), "this one has 0"),
        (robot(&(two.clone()
            + &joint("j", "revolute", "a", "b", "0 0 1", LIMIT)
            + &joint("k", "revolute", "a", "b", "0 0 1", LIMIT))), "more than one joint"),
        (robot("<link name='a'/>"), "no link has a surface"),
        ("<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:include filename='x'/></robot>".to_owned(), "xacro"),
        ("<a>".repeat(200_000), "256 elements in one another"),
    ];
    for (text, words) in cases {
        says(&Folder::new().with("robot.urdf", text), words);
    }
    let mimics = two
        + &link("c")
        + &joint("j", "revolute", "a", "b", "0 0 1", "<mimic joint='k'/>")
        + &joint("k", "revolute", "b", "c", "0 0 1", "<mimic joint='j'/>");
    says(&Folder::new().with("robot.urdf", robot(&mimics)), "in a circle");
}

#[test]
fn capsules_about_a_link_that_has_a_visual_are_no_surface() {
    let body = "<collision><geometry><cylinder radius='0.2' length='0.5'/></geometry></collision>";
    let capsule = format!("<link name='capsule'>{body}</link>");
    let arm = |kind: &str| {
        let two = link("a") + &link("b") + &capsule;
        let limit = if kind == "fixed" { "" } else { LIMIT };
        let moving = joint("j", "revolute", "a", "b", "0 0 1", LIMIT);
        robot(&(two + &moving + &joint("k", kind, "b", "capsule", "0 0 1", limit)))
    };
    for (kind, stands_in) in [("fixed", false), ("revolute", true)] {
        let folder = Folder::new().with("robot.urdf", arm(kind));
        let (model, findings) = folder.load();
        let capsule = &model.links[model.link("capsule").unwrap()];
        assert_eq!(!capsule.mesh.triangles.is_empty(), stands_in, "{kind}");
        assert_eq!(!capsule.bounds.is_empty(), stands_in, "{kind}");
        assert_eq!(
            findings.iter().any(|f| f.what.contains("is used instead")),
            stands_in,
            "{kind}"
        );
    }
}

#[test]
fn deep_nesting_does_not_overflow() {
    let deep = format!("<robot>{}{}</robot>", "<x>".repeat(100_000), "</x>".repeat(100_000));
    says(&Folder::new().with("robot.urdf", deep), "");
    let dae =
        format!("<COLLADA>{}{}</COLLADA>", "<node>".repeat(100_000), "</node>".repeat(100_000));
    says(&meshed("m.dae", dae.as_bytes()), "m.dae");
}

#[test]
fn a_file_that_is_wrong_in_a_hundred_thousand_places_is_soon_explained() {
    let odd = "<visual/>\n".repeat(100_000);
    let folder = Folder::new()
        .with("robot.urdf", robot(&(arm(3) + &format!("<link name='x'>{odd}</link>"))));
    let found = ::robot::Library::lint(&folder.library(), &Settings::default());
    assert!((100..400).contains(&found.len()), "{}", found.len());
    assert!(found.iter().any(|f| f.what.contains("there are more than these 100")), "{found:?}");
    assert!(found.iter().any(|f| f.place.contains("robot.urdf:7: visual")), "{found:?}");
}

#[test]
fn broken_sheets_are_named() {
    let sheet =
        |text: &str| Folder::new().with("robot.urdf", robot(&arm(3))).with("robot.toml", text);
    let cases = [
        ("main_chain = 3", "robot.toml"),
        ("colour = 'red'", "unknown field"),
        ("urdf = 'other.urdf'", "missing"),
        ("urdf = '../../other.urdf'", "missing"),
        ("[main_chain]\ntip = 'x'", "no such link \"x\""),
        ("[main_chain]\nroot = 'l2'\ntip = 'l1'", "is not connected"),
        ("[effector]\nlinks = ['x']", "no such link \"x\""),
        ("[[link]]\nname = 'x'", "no such link"),
        ("[[link]]\nname = 'l1'\nsymmetry = { axis = [0, 0, 0] }", "no axis"),
        ("[[sub_chain]]\nurdf = 'sub.urdf'", "missing"),
        ("[[sub_chain]]\npassive = ['x']", "not there"),
        ("[[sub_chain]]\npassive = ['j1']", "no closure determines"),
        (
            "[[sub_chain]]\nclosures = [{ link_a = 'l1', xyz_a = [0, 0, 0], link_b = 'l2', xyz_b = [0, 0, 0] }]",
            "does not say which joints",
        ),
        (
            "[[sub_chain]]\npassive = ['j3']\nclosures = [{ link_a = 'x', xyz_a = [0, 0, 0], link_b = 'l2', xyz_b = [0, 0, 0] }]",
            "no link \"x\"",
        ),
        (
            "[[sub_chain]]\npassive = ['j1']\nclosures = [{ link_a = 'l3', xyz_a = [0, 0, 0], link_b = 'l2', xyz_b = [0, 0, 0] }]",
            "no passive joint lies between",
        ),
        (
            "[[sub_chain]]\npassive = ['j1', 'j2', 'j3']\nclosures = [{ link_a = 'l3', xyz_a = [0, 0, 0], link_b = 'l0', xyz_b = [0, 0, 0] }]",
            "determine 2 joints",
        ),
        (
            "[[sub_chain]]\nkind = 'RPR'\npassive = ['j2', 'j3']\nclosures = [{ link_a = 'l3', xyz_a = [0, 0, 0], link_b = 'l0', xyz_b = [0, 0, 0] }]",
            "do not make the kind of loop",
        ),
    ];
    for (text, words) in cases {
        says(&sheet(text), words);
    }
}

#[test]
fn empty_and_wrong_libraries_are_explained() {
    let dir = tempfile::tempdir().unwrap();
    let settings = Settings::without_clouds();
    let error = Library::load(dir.path(), &settings).unwrap_err().to_string();
    assert!(error.contains("no robot") && error.contains("robot.urdf"), "{error}");
    let error = Library::load(&dir.path().join("nowhere"), &settings).unwrap_err().to_string();
    assert!(error.contains("nowhere"), "{error}");
    assert!(!Library::lint(&dir.path().join("nowhere"), &settings).is_empty());
    let folder = Folder::new().with("robot.urdf", "<robot/>");
    let error = Library::load(&folder.library(), &settings).unwrap_err().to_string();
    assert!(error.contains("model") && error.contains("no links"), "{error}");
    assert!(Model::load(&folder.path(), &settings).is_err());
    // A broken model does not prevent the others from loading.
    let folder =
        Folder::new().with("robot.urdf", "<robot/>").with("../good/any.urdf", robot(&arm(3)));
    let library = Library::load(&folder.library(), &settings).unwrap();
    assert_eq!(library.models.len(), 1);
    assert!(library.findings.iter().any(|f| f.model == "good" && f.what.contains("taken instead")));
}

fn stl(n_claimed: u32, n: usize, head: &[u8]) -> Vec<u8> {
    let mut bytes = head.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(n_claimed.to_le_bytes());
    for k in 0..n {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, k as f32]];
        bytes.extend([0; 12]);
        bytes.extend(corners.iter().flatten().flat_map(|v: &f32| v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn broken_meshes_are_named() {
    let dae = |geometry: &str| {
        format!(
            "<COLLADA><library_geometries><geometry id='g'><mesh>{geometry}</mesh></geometry></library_geometries>\
             <library_visual_scenes><visual_scene id='s'><node id='n'><instance_geometry url='#g'/></node>\
             </visual_scene></library_visual_scenes></COLLADA>"
        )
    };
    let source = "<source id='p'><float_array id='f' count='9'>0 0 0 1 0 0 0 1 0</float_array></source>\
                  <vertices id='v'><input semantic='POSITION' source='#p'/></vertices>";
    let faces = |p: &str| {
        format!(
            "{source}<triangles><input semantic='VERTEX' source='#v' offset='0'/><p>{p}</p></triangles>"
        )
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("m.stl", Vec::new(), "too short"),
        ("m.stl", b"solid x".to_vec(), "ends before"),
        (
            "m.stl",
            b"solid x\nfacet\nouter loop\nvertex 0 0\nendloop\nendsolid".to_vec(),
            "three numbers",
        ),
        ("m.stl", stl(4_000_000_000, 2, b"x"), "counts 4000000000 triangles, the file holds 2"),
        ("m.stl", stl(0, 0, b"x"), "no triangles"),
        ("m.obj", b"v 0 0 0\nf 1 2 3".to_vec(), "not there"),
        ("m.obj", b"v 0 0 x".to_vec(), "three numbers"),
        ("m.obj", vec![0xff; 10], "UTF-8"),
        ("m.dae", b"<COLLADA>".to_vec(), "not well-formed"),
        ("m.dae", dae(&faces("0 1 7")).into_bytes(), "not among"),
        ("m.dae", dae(&faces("0 1 x")).into_bytes(), "not an index"),
        (
            "m.dae",
            dae(&faces("0 1 2").replace("count='9'", "count='9000000000'")).into_bytes(),
            "claims",
        ),
        ("m.dae", dae(&faces("0 1 2").replace("#v", "#w")).into_bytes(), "no positions"),
        (
            "m.dae",
            dae(&faces("0 1 2"))
                .replace("<instance_geometry", "<instance_node url='#n'/><instance_geometry")
                .into_bytes(),
            "in a circle",
        ),
        ("m.ply", b"ply".to_vec(), "not read"),
    ];
    for (path, bytes, words) in cases {
        says(&meshed(path, &bytes), words);
    }
    let (model, _) = meshed("m.dae", dae(&faces("0 1 2")).as_bytes()).load();
    assert_eq!(model.links[1].mesh.triangles.len(), 1);
    let (model, _) = meshed("m.stl", &stl(2, 2, b"solid by the header")).load();
    assert_eq!(model.links[1].mesh.triangles.len(), 2);
    let (model, _) =
        meshed("m.obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1/1 2//2 3 -1").load();
    assert_eq!((model.links[1].mesh.triangles.len(), model.links[1].mesh.vertices.len()), (2, 4));
}

#[test]
fn paths_stay_inside() {
    let good = stl(2, 2, b"x");
    let at = |path: &str| Folder::new().with("robot.urdf", robot(&body(path)));
    for path in
        ["package://model/m.stl", "package://any/m.stl", "m.stl", "./x/../m.stl", "sub\\m.stl"]
    {
        let folder = at(path).with("m.stl", &good).with("sub/m.stl", &good).with("x/y", "");
        assert_eq!(folder.lint(), Vec::<String>::new(), "{path}");
    }
    let folder = at("package://other/m.stl").with("../other/m.stl", &good);
    assert_eq!(folder.lint(), Vec::<String>::new());
    says(&at("Meshes/M.STL").with("meshes/m.stl", &good), "other upper and lower case");
    says(&at("m.stl"), "missing");
    says(&at("../../outside.stl").with("../../outside.stl", &good), "leads out");
    says(&at("http://host/m.stl"), "network");
    says(&at("file:///etc/hostname"), "link b");
    says(&at("file://$(find pkg)/m.stl"), "xacro");
    #[cfg(unix)]
    {
        let folder = at("m.stl").with("../../outside.stl", &good);
        std::os::unix::fs::symlink(
            folder.library().join("../outside.stl"),
            folder.path().join("m.stl"),
        )
        .unwrap();
        says(&folder, "leads out");
    }
}

#[cfg(unix)]
#[test]
fn links_that_lead_out_are_refused_by_name_and_others_are_followed() {
    use std::os::unix::fs::symlink;
    let urdf = robot(&arm(3));
    for name in ["robot.urdf", "robot.toml"] {
        let text = if name == "robot.toml" { "" } else { urdf.as_str() };
        let other = if name == "robot.toml" { "robot.urdf" } else { "unused.txt" };
        let folder = Folder::new()
            .with(other, &urdf)
            .with("../../outside", text)
            .with("../shared/inside", text);
        let link = folder.path().join(name);
        symlink("../../outside", &link).unwrap();
        let found = folder.lint();
        assert!(found.iter().any(|f| f.contains(name) && f.contains("leads out")), "{found:#?}");
        assert!(Model::load(&folder.path(), &Settings::without_clouds()).is_err(), "{name}");
        std::fs::remove_file(&link).unwrap();
        symlink("../shared/inside", &link).unwrap();
        assert!(Model::load(&folder.path(), &Settings::without_clouds()).is_ok(), "{name}");
        // A link to a missing file is not reported as a missing file.
        std::fs::remove_file(&link).unwrap();
        symlink("../nowhere", &link).unwrap();
        assert!(Model::load(&folder.path(), &Settings::without_clouds()).is_err(), "{name}");
    }
    // A link in place of a model's folder is refused, too.
    let folder = Folder::new().with("robot.urdf", &urdf).with("../../far/robot.urdf", &urdf);
    symlink("../far", folder.library().join("far")).unwrap();
    says(&folder, "far: is a link that leads out");
    symlink("model", folder.library().join("near")).unwrap();
    let library = Library::load(&folder.library(), &Settings::without_clouds()).unwrap();
    assert_eq!(library.models.len(), 2);
}

#[cfg(target_os = "linux")]
#[test]
fn pipes_and_devices_in_a_library_are_refused_at_once() {
    let folder = Folder::new().with("robot.urdf", robot(&arm(3)));
    let pipe = folder.path().join("robot.toml");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    says(&folder, "not a regular file");
}

#[test]
fn what_grows_is_bounded_and_the_setting_is_named() {
    let with = |folder: &Folder, settings: &Settings| -> Vec<String> {
        let found = Library::lint(&folder.library(), settings);
        found.iter().map(|f| f.what.clone()).collect()
    };
    let named = |folder: &Folder, settings: &Settings, setting: &str| {
        let found = with(folder, settings);
        assert!(found.iter().any(|f| f.contains(setting)), "{setting}: {found:#?}");
        let found = with(folder, &Settings::default());
        assert!(!found.iter().any(|f| f.contains("--set")), "{setting}: {found:#?}");
    };
    let all = Settings::default();
    // Four nodes, each with ten instances of the next: ten thousand times one triangle of a source
    // with 99 corners.
    let levels: String = (0..4)
        .map(|k| {
            let instances = format!("<instance_node url='#n{}'/>", k + 1).repeat(10);
            format!("<node id='n{k}'>{instances}</node>")
        })
        .collect();
    let text = format!(
        "<COLLADA><library_geometries><geometry id='g'><mesh><source id='p'><float_array id='f' count='297'>{}\
         </float_array></source><triangles><input semantic='POSITION' source='#p' offset='0'/><p>0 1 2</p></triangles>\
         </mesh></geometry></library_geometries><library_nodes>{levels}<node id='n4'><instance_geometry url='#g'/></node>\
         </library_nodes><library_visual_scenes><visual_scene id='s'><node><instance_node url='#n0'/></node>\
         </visual_scene></library_visual_scenes></COLLADA>",
        "0 0 0 1 0 0 0 1 0 ".repeat(33)
    );
    let folder = meshed("m.dae", text.as_bytes());
    named(&folder, &Settings { max_mesh_growth: 1, ..all }, "robot.max_mesh_growth");
    named(&folder, &Settings { max_mesh_bytes: 100, ..all }, "robot.max_mesh_bytes");
    named(&folder, &Settings { max_xml_nodes: 60, ..all }, "robot.max_xml_nodes");
    let wide = text.replace("<mesh>", "<mesh a='' b='' c='' d=''>");
    let folder = meshed("m.dae", wide.as_bytes());
    named(&folder, &Settings { max_xml_attributes: 3, ..all }, "robot.max_xml_attributes");
    let folder = Folder::new().with("robot.urdf", robot(&arm(3)));
    named(&folder, &Settings { max_urdf_bytes: 100, ..all }, "robot.max_urdf_bytes");
    named(&folder, &Settings { max_xml_nodes: 10, ..all }, "robot.max_xml_nodes");
}

#[test]
fn scale_origin_and_several_visuals_add_up() {
    let mesh = stl(1, 1, b"x");
    let text = "<link name='a'>\
        <visual><origin xyz='1 0 0' rpy='0 0 1.5707963267948966'/><geometry><mesh filename='m.stl' scale='0.001 0.001 0.001'/></geometry></visual>\
        <visual><origin xyz='0 0 2'/><geometry><cylinder radius='0.5' length='1'/></geometry></visual>\
        <collision><geometry><box size='9 9 9'/></geometry></collision></link>";
    let (model, _) = Folder::new().with("robot.urdf", robot(text)).with("m.stl", mesh).load();
    let bounds = model.links[0].bounds;
    for (got, expected) in
        bounds.min.iter().chain(&bounds.max).zip([-0.5, -0.5, 0.0, 1.0, 0.5, 2.5])
    {
        assert!((got - expected).abs() < 1e-6, "{bounds:?}");
    }
    let only = text.replace("visual", "collision");
    let folder = Folder::new().with("robot.urdf", robot(&only)).with("m.stl", stl(1, 1, b"x"));
    says(&folder, "no visual");
}
