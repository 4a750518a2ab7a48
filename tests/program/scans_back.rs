//! Scans given back, from outside: what the export of a result writes is the input but for the
//! moving points, with the same bytes on one thread and on two; another input than the run has read
//! is refused.

use crate::common::palletiser;
use std::path::Path;
use std::process::{Command, Output};

/// Beams of each scanner: few, since a robot of many points is found among them.
const N_BEAMS: u64 = 250_000;
/// Bytes before the first element of an array.
const NPY_HEADER: usize = 128;

fn call(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    command.current_dir(dir).args(args).args(["--progress", "none"]);
    command.output().expect("the program starts")
}

fn fine(dir: &Path, args: &[&str]) -> String {
    let output = call(dir, args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{args:?}: {said}");
    said
}

fn refused(dir: &Path, args: &[&str], code: i32) -> String {
    let output = call(dir, args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    said
}

/// The kinds of the points of a mask.
fn kinds(out: &Path, mask: usize) -> Vec<u8> {
    let path = out.join(format!("labels/{mask}.kind.npy"));
    std::fs::read(path).expect("a mask").split_off(NPY_HEADER)
}

/// Records of each scan: coordinates, state, class where there is one, everything else in words.
type Record = ([u64; 3], i64, Option<i64>, String);

fn records(path: &Path) -> Vec<Vec<Record>> {
    use e57::{RecordName as Name, RecordValue as Value};
    let mut reader = e57::E57Reader::from_file(path).expect("an E57 file");
    let clouds = reader.pointclouds();
    let read = |cloud: &e57::PointCloud| {
        let at = |name: &Name| cloud.prototype.iter().position(|r| r.name == *name);
        let xyz = [Name::CartesianX, Name::CartesianY, Name::CartesianZ];
        let xyz = xyz.map(|name| at(&name).expect("a coordinate"));
        let state = at(&Name::CartesianInvalidState).expect("a state");
        let class = at(&Name::Unknown { namespace: "sp".into(), name: "class".into() });
        let whole = |value: &Value| match value {
            Value::Integer(v) => *v,
            _ => -1,
        };
        let points = reader.pointcloud_raw(cloud).expect("points");
        let record = |record: e57::Result<Vec<Value>>| {
            let record = record.expect("a record");
            let bits = |at: usize| match record[at] {
                Value::Single(v) => u64::from(v.to_bits()),
                _ => 0,
            };
            let rest = (0..record.len().min(7)).filter(|at| *at != state);
            let rest = rest.map(|at| format!("{:?}", record[at])).collect::<String>();
            (xyz.map(bits), whole(&record[state]), class.map(|at| whole(&record[at])), rest)
        };
        points.map(record).collect()
    };
    clouds.iter().map(read).collect()
}

#[test]
fn only_the_moving_points_of_a_scan_differ() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    palletiser(dir, 11, N_BEAMS);
    fine(dir, &["run", "scans/scans.e57", "--robots", "robots", "--out", "out"]);
    let out = dir.join("out");
    let given = out.join("export/e57/scans.e57");
    let export = |more: &[&str]| {
        fine(dir, &[&["export", "out", "--to", "e57"], more].concat());
        std::fs::read(&given).expect("the scans")
    };
    let one = export(&["--threads", "1"]);
    assert!(one == export(&["--threads", "2"]), "one thread and two");
    let (before, after) = (records(&dir.join("scans/scans.e57")), records(&given));
    assert_eq!(before.len(), after.len());
    let mut n_moving = 0;
    for (mask, (before, after)) in before.iter().zip(&after).enumerate() {
        let mut kinds = kinds(&out, mask).into_iter();
        assert_eq!(before.len(), after.len());
        for (old, new) in before.iter().zip(after) {
            let kind = if old.1 == 0 { kinds.next() } else { None };
            let moves = matches!(kind, Some(1 | 2));
            n_moving += usize::from(moves);
            assert_eq!((&new.0, &new.3), (&old.0, &old.3));
            assert_eq!(new.1, if moves { 2 } else { old.1 });
            assert_eq!(new.2, Some(i64::from(kind.unwrap_or(255))));
        }
        assert_eq!(kinds.next(), None);
    }
    assert!(n_moving > 1000, "{n_moving}");

    let dropped = export(&["--drop-moving", "--without-labels"]);
    assert!(dropped.len() < one.len());
    let n = |scans: &[Vec<Record>]| scans.iter().map(Vec::len).sum::<usize>();
    assert_eq!(n(&records(&given)), n(&before) - n_moving);
    // What is not of this format, or not for it.
    assert!(refused(dir, &["export", "out", "--to", "ptx"], 4).contains("no ptx input"));
    refused(dir, &["export", "out", "--to", "ply", "--drop-moving"], 2);
    refused(dir, &["export", "out", "--to", "ptx", "--without-labels"], 2);
    refused(dir, &["export", "out", "--to", "ply", "--inputs", "."], 2);

    // The input moves, changes and goes.
    std::fs::create_dir(dir.join("moved")).expect("a folder");
    std::fs::rename(dir.join("scans/scans.e57"), dir.join("moved/scans.e57")).expect("moves");
    let said = refused(dir, &["export", "out", "--to", "e57"], 4);
    assert!(said.contains("scans/scans.e57") && said.contains("--inputs"), "{said}");
    assert!(one == export(&["--inputs", "moved"]));
    let mut bytes = std::fs::read(dir.join("moved/scans.e57")).expect("reads");
    bytes[100] ^= 1;
    std::fs::write(dir.join("moved/scans.e57"), &bytes).expect("writes");
    let said = refused(dir, &["export", "out", "--to", "e57", "--inputs", "moved"], 4);
    assert!(said.contains("its content differs"), "{said}");
    bytes.truncate(bytes.len() - 1024);
    std::fs::write(dir.join("moved/scans.e57"), &bytes).expect("writes");
    let said = refused(dir, &["export", "out", "--to", "e57", "--inputs", "moved"], 4);
    assert!(said.contains("bytes"), "{said}");
    // The earlier export is as it was.
    assert!(one == std::fs::read(&given).expect("the scans"));
}

#[test]
fn a_room_without_robots_comes_back_byte_for_byte() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    stillpoint::eval::demo::write_robots(&dir.join("robots")).expect("the library is written");
    let pose = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let mut text = format!("120\n60\n{pose}");
    for i in 0..120 * 60 {
        let (turn, rise) = (f64::from(i / 60) * 0.05, f64::from(i % 60) * 0.02 - 0.6);
        let (x, y, z) = (4.0 * turn.cos(), 4.0 * turn.sin(), 4.0 * rise.tan());
        text += &match i % 7 {
            0 => "0 0 0 0.5 0 0 0\r\n".to_owned(),
            _ => format!("{x:.4} {y:.4} {z:.4} 0.5 1 2 3\r\n"),
        };
    }
    for name in ["a", "b"] {
        std::fs::create_dir(dir.join(name)).expect("a folder");
        std::fs::write(dir.join(name).join("room.ptx"), &text).expect("writes");
    }
    let args = ["run", "a/room.ptx", "b/room.ptx", "--robots", "robots", "--out", "out"];
    fine(dir, &args);
    let said = fine(dir, &["export", "out", "--to", "ptx"]);
    assert!(said.contains("0 of 6171 points"), "{said}");
    for name in ["room.ptx", "2-room.ptx"] {
        let given = std::fs::read_to_string(dir.join("out/export/ptx").join(name)).expect("reads");
        assert!(given == text, "{name}");
    }
}
