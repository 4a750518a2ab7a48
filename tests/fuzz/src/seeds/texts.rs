//! Texts that people write, as seeds: one of each kind that the readers tell apart.

use super::Seeds;
use crate::robots::{OBJ, six_joints, with_mesh};
use simulate::demo_robots;
use std::path::Path;

pub(super) fn put(seeds: &Seeds, scratch: &Path) {
    put_settings(seeds, scratch);
    put_robots(seeds);
    put_meshes(seeds);
    put_results(seeds);
}

fn put_settings(seeds: &Seeds, scratch: &Path) {
    seeds.put_all("scanners", [
        "[[scanner]]\npoint_source_id = 1\nname = 'a'\nposition = [4.9, 1, 1.5]\nquaternion_wxyz = [0.876, 0, 0, 0.482]\n",
        "[[scanner]]\nposition = [0, 0, 0.0]\n[[scanner]]\nname = 'b'\nposition = [0, 0, 0.0]\n",
        r#"{"scanner": [{"point_source_id": 1, "name": "a", "position": [4.9, 1, 1.5], "quaternion_wxyz": [1, 0, 0, 0]}]}"#,
    ]);
    seeds.put(
        "settings",
        "means",
        "memory = \"8GiB\"\nthreads = 3\nscanners = \"s.toml\"\n[fit]\nbeam = 77\n",
    );
    seeds.put_all("review", [
        "[[robot]]\nat = [2.7, 0.0, 0.3]\nmodel = \"known\"\nverdict = \"accept\"\njoints = { j1 = -1.2 }\nrpy = [0.0, 0.0, 1.5]\n",
        "[[robot]]\nat = [2.7, 0.0, 0.3]\nradius = 0.5\nverdict = \"reject\"\n",
    ]);
    seeds.put_all("trajectory", [
        "time,a,b\n0,0.5,-1\n1.5,0.25,2\n",
        "# a comment\n\"Time\";\"a\";\"b\"\n\n0;0,5;-1\n1,5;0,25;2,0\n",
        "a b time\n0.5 -1 0\n0.25 2 1.5\n",
        r#"{"joint_names": ["a", "b"], "points": [{"positions": [0.5, -1], "time_from_start": {"sec": 0, "nanosec": 0}}]}"#,
        r#"{"joint_trajectory": {"joint_names": ["a"], "points": [{"positions": [0.5], "time_from_start": 0}]}}"#,
    ]);
    let models = crate::robots::models();
    let scene = simulate::paper_scene(1, &models[0], &[0.0; 6], 20_000);
    seeds.put("scene", "paper", scene.to_toml().expect("a scene can be written"));
    let hall =
        simulate::demo_scene(1, &demo_models(scratch)).expect("a scene of the demo's robots");
    seeds.put("scene", "hall", hall.to_toml().expect("a scene can be written"));
}

/// The robots of the demo.
fn demo_models(scratch: &Path) -> Vec<robot::Model> {
    let dir = scratch.join("demo");
    for (path, bytes) in demo_robots::files() {
        let path = dir.join(path);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder can be made");
        std::fs::write(path, bytes).expect("a file can be written");
    }
    let library = robot::Library::load(&dir, &robot::Settings::without_clouds()).expect("whole");
    library.models
}

/// A `robot.toml` with all that it may hold.
const SHEET: &str = "[main_chain]\nroot = 'l0'\ntip = 'l6'\n[effector]\nlinks = ['l6']\n\
    [[link]]\nname = 'l2'\nmesh_sigma = 0.002\nsymmetry = { axis = [0, 0, 1], through = [0, 0, 0], order = 4 }\n\
    [[sub_chain]]\nname = 'bars'\nkind = 'RRR'\npassive = ['j4', 'j5', 'j6']\n\
    closures = [{ link_a = 'l6', xyz_a = [0, 0, 0.1], link_b = 'l2', xyz_b = [0.1, 0, 0] }]\n";

fn put_robots(seeds: &Seeds) {
    let six = six_joints();
    seeds.put("urdf", "six", &six);
    seeds.put("urdf", "sheet", format!("{six}\0{SHEET}"));
    seeds.put("urdf", "mesh", with_mesh("m.obj"));
    seeds.put(
        "urdf",
        "package",
        with_mesh("package://urdf/m.obj").replace("1 1 1", ".001 .001 .001"),
    );
    seeds.put(
        "urdf",
        "mimic",
        six.replace(
            "</joint><joint name='j6'",
            "<mimic joint='j1' multiplier='2' offset='.1'/></joint><joint name='j6'",
        ),
    );
    let shapes = "<sphere radius='.1'/></geometry></visual><collision><geometry><cylinder radius='.1' length='.2'/></geometry></collision><visual><geometry><box size='1 1 1'/>";
    seeds.put("urdf", "shapes", with_mesh("m.obj").replace("<mesh filename='m.obj'/>", shapes));
    seeds.put("sheet", "all", SHEET);
    for kind in ["auto", "RPR", "RR", "general"] {
        seeds.put("sheet", kind, SHEET.replace("RRR", kind));
    }
    for (path, bytes) in demo_robots::files() {
        if path.ends_with("robot.toml") {
            seeds.put("sheet", &path.replace('/', "-"), bytes);
        } else if path.ends_with(".urdf") && bytes.len() < 20_000 {
            seeds.put("urdf", &path.replace('/', "-"), bytes);
        }
    }
}

fn put_meshes(seeds: &Seeds) {
    let mut stl = vec![b' '; 80];
    stl.extend(2_u32.to_le_bytes());
    for k in 0..2 {
        let corners: [[f32; 3]; 4] = [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, k as f32]];
        stl.extend(corners.iter().flatten().flat_map(|v| v.to_le_bytes()));
        stl.extend([0; 2]);
    }
    seeds.put("stl", "binary", stl);
    seeds.put("stl", "text", "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid x\n");
    seeds.put("obj", "whole", OBJ);
    seeds.put("obj", "polygons", "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3 -1\ng b\ns 1\nusemtl x\n");
    let source = "<source id='p'><float_array id='f' count='12'>0 0 0 1 0 0 0 1 0 0 0 1</float_array></source>\
                  <vertices id='v'><input semantic='POSITION' source='#p'/></vertices>";
    let input = "<input semantic='VERTEX' source='#v' offset='0'/>";
    let dae = |faces: &str, node: &str| {
        format!(
            "<COLLADA><asset><unit meter='0.001'/><up_axis>Y_UP</up_axis></asset><library_geometries><geometry id='g'><mesh>\
             {source}{faces}</mesh></geometry></library_geometries><library_nodes><node id='m'><instance_geometry url='#g'/></node>\
             </library_nodes><library_visual_scenes><visual_scene id='s'>{node}</visual_scene></library_visual_scenes>\
             <scene><instance_visual_scene url='#s'/></scene></COLLADA>"
        )
    };
    let node = "<node id='n'><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix><translate>1 2 3</translate><rotate>0 0 1 90</rotate>\
                <scale>2 2 2</scale><instance_geometry url='#g'/><node><instance_node url='#m'/></node></node>";
    seeds.put_all("dae", [
        dae(&format!("<triangles count='2'>{input}<p>0 1 2 0 1 3</p></triangles>"), node),
        dae(&format!("<polylist count='1'>{input}<vcount>4</vcount><p>0 1 2 3</p></polylist>"), node),
        dae(&format!("<polygons>{input}<p>0 1 2</p></polygons><tristrips>{input}<p>0 1 2 3</p></tristrips>"), node),
        dae(&format!("<trifans>{input}<p>0 1 2 3</p></trifans>"), "<node><instance_geometry url='#g'/></node>"),
    ]);
}

fn put_results(seeds: &Seeds) {
    let digest = format!("blake3:{}", "0".repeat(64));
    let manifest = |files: serde_json::Value| {
        serde_json::json!({
            "schema": "stillpoint.manifest/2", "key": "0".repeat(32), "summary": "2 robots", "warnings": ["a"],
            "partial": false, "files": files,
        })
    };
    let listed = serde_json::json!([{"path": "result.json", "n_bytes": 2, "digest": digest},
        {"path": "labels/0.kind.npy", "n_bytes": 200, "digest": "crc32c:00000000"}]);
    seeds.put("manifest", "whole", manifest(listed).to_string());
    seeds.put("manifest", "none", manifest(serde_json::json!([])).to_string());
    let pose = serde_json::json!({"xyz": [1.0, 2.0, 0.0], "quat_wxyz": [1.0, 0.0, 0.0, 0.0]});
    let robot = serde_json::json!({
        "id": "R1", "model": "m", "base_link": "base", "base_pose": pose,
        "base_sigma": {"xyz": [1e-4, 1e-4, null], "rotation": [1e-4, 1e-4, 1e-4]},
        "joints": {"a": 0.5, "flange": 0.3}, "sigma": {"a": 0.001, "flange": 1.8},
        "determined": {"a": true, "flange": false}, "links": ["base"], "verdict": "trusted", "score": 0.9,
        "reasons": ["why"], "alike": ["n"], "slides": ["a"], "equivalents": {"flange": [1.5]},
        "space": {"grid": "space.npy", "octomap": "o", "unknown": "u", "edge": 0.05, "origin": [0.0, 0.0, 0.0],
                  "size": [2, 2, 2], "octomap_shift": [0.0, 0.0, 0.0], "unknown_m3": 0.0, "free_m3": 0.0},
    });
    let scans = serde_json::json!([{"scan": "s", "input": 0, "n_points": 3, "kind": "labels/0.kind.npy",
        "robot": "labels/0.robot.npy", "link": "labels/0.link.npy"}]);
    let result = serde_json::json!({
        "schema": export::SCHEMA, "version": "0", "robots": [robot], "labels": {"table": "t", "scans": scans},
        "inputs": [], "stages": [], "warnings": [],
    });
    seeds.put("result", "whole", result.to_string());
}
