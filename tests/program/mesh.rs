//! Collision meshes from outside: what is blocked by points is blocked by the mesh, the same bytes
//! for any number of threads, budgets of triangles, and requests that cannot be met.

use crate::common::palletiser;
use glamx::Vec3 as Vector;
use parry3d::query::PointQuery;
use parry3d::shape::ConvexPolyhedron;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use surface::{SurfaceMesh, TriangleGrid};

/// Beams of each scanner.
const N_BEAMS: u64 = 250_000;

fn program(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    command.current_dir(dir).args(args).args(["--progress", "none"]);
    command.output().expect("the program starts")
}

/// Exports a mesh; its bytes and its report.
fn mesh(dir: &Path, more: &[&str]) -> (Vec<u8>, Value) {
    let args = ["export", "out", "--to", "mesh", "--mesh-format", "ply"];
    let output = program(dir, &[&args, more].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read(dir.join("out/export/mesh").join(name)).expect("written");
    let report = serde_json::from_slice(&read("mesh.json")).expect("JSON");
    assert!(!dir.join("out/export/mesh/scratch").exists(), "the scratch folder is gone");
    (read("fixed.ply"), report)
}

/// A mesh that this program wrote as PLY.
fn of_ply(bytes: &[u8]) -> SurfaceMesh {
    let end = b"end_header\n";
    let head = bytes.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
    let text = std::str::from_utf8(&bytes[..head]).expect("text");
    let n = |what: &str| -> usize {
        let line = text.lines().find_map(|line| line.strip_prefix(what)).expect("a count");
        line.trim().parse().expect("a number")
    };
    let (body, faces) = bytes[head..].split_at(24 * n("element vertex "));
    let mut mesh = SurfaceMesh::default();
    for v in body.chunks_exact(24) {
        let at = |i: usize| f64::from_le_bytes(std::array::from_fn(|k| v[8 * i + k]));
        mesh.vertices.push([at(0), at(1), at(2)]);
    }
    for t in faces.chunks_exact(13) {
        let at = |i: usize| u32::from_le_bytes(std::array::from_fn(|k| t[1 + 4 * i + k]));
        mesh.triangles.push([at(0), at(1), at(2)]);
    }
    assert_eq!(mesh.triangles.len(), n("element face "));
    mesh
}

/// All points of the result that are labelled as fixed or floor.
fn fixed_points(dir: &Path) -> Vec<[f64; 3]> {
    let output = program(dir, &["export", "out", "--to", "ply"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(dir.join("out/export/fixed.ply")).expect("written");
    let end = b"end_header\n";
    let head = bytes.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
    let text = std::str::from_utf8(&bytes[..head]).expect("text");
    let sizes = text.lines().filter_map(|line| line.strip_prefix("property ")).map(|line| {
        let (kind, name) = line.split_once(' ').expect("a name");
        let size = match kind {
            "double" => 8,
            "uint8" => 1,
            _ => 4,
        };
        (name, size)
    });
    let sizes: Vec<(&str, usize)> = sizes.collect();
    let length = sizes.iter().map(|(_, n)| n).sum();
    let before = sizes.iter().take_while(|(name, _)| *name != "scalar_kind");
    let kind_at: usize = before.map(|(_, n)| n).sum();
    let points = bytes[head..].chunks_exact(length).filter(|p| matches!(p[kind_at], 0 | 3));
    let at = |p: &[u8], i: usize| f64::from_le_bytes(std::array::from_fn(|k| p[8 * i + k]));
    points.map(|p| [at(p, 0), at(p, 1), at(p, 2)]).collect()
}

/// The objects of an OBJ of this program.
fn of_obj(text: &str) -> Vec<SurfaceMesh> {
    let (mut out, mut first): (Vec<SurfaceMesh>, u32) = (Vec::new(), 1);
    for line in text.lines() {
        let mut words = line.split(' ');
        let what = words.next().expect("a word");
        let values: Vec<&str> = words.collect();
        match (what, out.last_mut()) {
            ("o", last) => {
                first += last.map_or(0, |last| last.vertices.len() as u32);
                out.push(SurfaceMesh::default());
            }
            ("v", Some(last)) => {
                last.vertices.push([0, 1, 2].map(|i| values[i].parse().expect("metres")));
            }
            ("f", Some(last)) => {
                let corner = |i: usize| values[i].parse::<u32>().expect("a corner") - first;
                last.triangles.push([0, 1, 2].map(corner));
            }
            _ => {}
        }
    }
    out
}

/// Whether a place lies in a convex piece, to the rounding of its file: on the inner side of all of
/// its planes, or, since rounding turns those of slivers, near the hull of its corners.
fn holds(piece: &SurfaceMesh, at: [f64; 3]) -> bool {
    let from = |v: &[f64; 3]| [0, 1, 2].map(|i| (v[i] - at[i]) as f32);
    let corners: Vec<Vector> = piece.vertices.iter().map(|v| Vector::from_array(from(v))).collect();
    let hull = ConvexPolyhedron::from_convex_hull(&corners);
    let is_within = |t: &[u32; 3]| {
        let [a, b, c] = piece.corners(*t).map(geometry::Point::from);
        let normal = (b - a).cross(&(c - a));
        normal.dot(&(geometry::Point::from(at) - a)) <= 1e-4 * normal.norm()
    };
    piece.triangles.iter().all(is_within)
        || hull.is_some_and(|hull| hull.distance_to_local_point(Vector::ZERO, true) <= 2e-4)
}

#[test]
fn what_points_block_the_mesh_blocks() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    palletiser(dir, 12, N_BEAMS);
    let run = program(dir, &["run", "scans/scans.e57", "--robots", "robots", "--out", "out"]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));

    let (bytes, report) = mesh(dir, &["--threads", "2"]);
    let (again, _) = mesh(dir, &["--threads", "1"]);
    assert!(bytes == again, "one thread writes another mesh");
    // What is left of the bound is for the noise of beams.
    assert!(report["measured_maximum"].as_f64().expect("measured") <= 0.00501, "{report}");
    let (all, free) = (&report["area"], &report["area_in_free_space"]);
    let share = free.as_f64().expect("known") / all.as_f64().expect("an area");
    assert!(share < 0.005, "{report}");

    // All points that are not of a robot are in the mesh, but for uncertain ones on its surface and
    // in the air beside it. These are known by the robots' models: without those they stay.
    let (_, kept) = mesh(dir, &["--robots", "nowhere"]);
    let n = |report: &Value, which: &str| report.pointer(which).and_then(Value::as_u64);
    let mut all = n(&report, "/points");
    for kind in ["on_robots", "in_the_air_beside_robots"] {
        let which = format!("/left_out/uncertain_points_{kind}");
        let own = n(&report, &which);
        assert!(own.is_some() && n(&kept, &which) == Some(0), "{report}");
        all = all.zip(own).map(|(a, b)| a + b);
    }
    assert!(all == n(&kept, "/points") && all > n(&report, "/points"), "{report}");

    // Also the fixed points that `check` doubts: wires and edges are among them.
    let surface = of_ply(&bytes);
    let fixed = fixed_points(dir);
    let grid = TriangleGrid::new(&surface, &geometry::Aabb::of(fixed.iter().copied()), 0.01);
    let n_beyond = fixed.iter().filter(|at| grid.square(**at, 0.0) > 0.01_f32.powi(2)).count();
    assert!(n_beyond == 0 && fixed.len() > 100_000, "{n_beyond} of {}", fixed.len());

    // A path into the floor is blocked at places that the mesh is near, too.
    let text = std::fs::read_to_string(dir.join("out/result.json")).expect("a result");
    let result: Value = serde_json::from_str(&text).expect("JSON");
    let joints = result["robots"][0]["joints"].as_object().expect("joints");
    let names: Vec<&str> = joints.keys().map(String::as_str).collect();
    let found: Vec<f64> = joints.values().map(|v| v.as_f64().expect("a value")).collect();
    let mut down = found.clone();
    (down[1], down[2]) = (1.2, 1.2);
    let line =
        |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
    let path = names.join(",") + "\n" + &line(&found) + &line(&down);
    std::fs::write(dir.join("path.csv"), path).expect("writes");
    let checked = program(dir, &["check", "out", "--trajectory", "path.csv", "--json"]);
    let checked: Value = serde_json::from_slice(&checked.stdout).expect("JSON");
    let mut n = 0;
    for contact in checked["contacts"].as_array().expect("contacts") {
        let is_solid = ["fixed", "floor"].iter().any(|what| contact["what"] == *what);
        if !is_solid || !["hit", "inside"].iter().any(|level| contact["level"] == *level) {
            continue;
        }
        let at = contact["at"].as_array().expect("a place");
        let at: [f64; 3] = std::array::from_fn(|i| at[i].as_f64().expect("metres"));
        // The bound, and the cell by which `check` knows a point.
        let reach = 0.01 + clearance::CELL;
        let bounds = geometry::Aabb { min: at, max: at };
        let far = TriangleGrid::new(&surface, &bounds, reach).square(at, 0.0).sqrt();
        assert!(f64::from(far) <= reach, "{far} m from the mesh: {contact}");
        n += 1;
    }
    assert!(n > 0, "the floor is in the way: {checked}");

    // A budget is kept to and the bound that it takes is stated.
    let (few, report) = mesh(dir, &["--triangles", "3000"]);
    assert!(of_ply(&few).triangles.len() <= 3000, "{report}");
    let (bound, most) = (&report["bound"], &report["measured_maximum"]);
    assert!(bound.as_f64() > Some(0.01) && most.as_f64() <= bound.as_f64(), "{report}");

    // Convex pieces are closed and cover the mesh's corners.
    let (few, report) = mesh(dir, &["--triangles", "3000", "--convex"]);
    let text = std::fs::read_to_string(dir.join("out/export/mesh/convex.obj")).expect("pieces");
    let pieces = of_obj(&text);
    assert_eq!(report["convex"]["pieces"].as_u64(), Some(pieces.len() as u64), "{report}");
    let corners = of_ply(&few).vertices;
    for at in corners.iter().step_by(corners.len() / 100) {
        assert!(pieces.iter().any(|piece| holds(piece, *at)), "{at:?}");
    }

    // One robot's surroundings, and what nobody saw of them.
    let (_, report) = mesh(dir, &["--robot", "R1", "--unknown"]);
    assert!(report["unknown"]["triangles"].as_u64() > Some(0), "{report}");
    assert!(report["region"].is_array(), "{report}");

    for (args, code) in [
        (&["--robot", "R7"][..], 4),
        (&["--bound", "0"], 2),
        (&["--bound", "NaN"], 2),
        (&["--triangles", "0"], 2),
    ] {
        let args = [&["export", "out", "--to", "mesh"], args].concat();
        assert_eq!(program(dir, &args).status.code(), Some(code), "{args:?}");
    }
    assert_eq!(program(dir, &["export", "out", "--to", "ply", "--unknown"]).status.code(), Some(2));
}
