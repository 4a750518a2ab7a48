//! Writes a small output folder with every kind of file, reads it back with other crates, and runs
//! `scripts/check_outputs.py` on it, which uses laspy, pye57 and PDAL where Python has them.
#![allow(clippy::print_stderr)]

mod common;

use common::{N, clouds, copc, folder, label};
use contract::{
    Certainty, DETERMINED_SIGMA, Fit, InputId, JointFit, Label, LinkEvidence, Mask, MaskId,
    RunnerUp, Verdict,
};
use export::*;
use geometry::{Pose, Vector};
use std::path::Path;

#[test]
fn e57_scans_come_back_with_pose_and_raster() {
    let path = folder("e57").join("scans.e57");
    write_e57(&path);
    let mut reader = e57::E57Reader::from_file(&path).expect("opens");
    let clouds = reader.pointclouds();
    assert_eq!(clouds.len(), 3);
    assert_eq!(clouds[1].name.as_deref(), Some("scan_1"));
    let transform = clouds[1].transform.clone().expect("pose");
    assert!(
        (transform.translation.x - 2.5).abs() < 1e-12
            && (transform.rotation.z - 0.3_f64.sin()).abs() < 1e-12
    );
    assert_eq!(clouds[2].records, 0);
    let raw: Vec<_> =
        reader.pointcloud_raw(&clouds[1]).expect("reads").map(|p| p.expect("reads")).collect();
    assert_eq!(raw.len(), 300 * 211);
    let invalid = raw.iter().filter(|v| v[3] == e57::RecordValue::Integer(2)).count();
    assert_eq!(invalid, (0..300 * 211).filter(|i| i % 17 == 0).count());
    assert_eq!(raw[212][4..6], [e57::RecordValue::Integer(1), e57::RecordValue::Integer(1)]);
    assert_eq!(raw[212][0], e57::RecordValue::Single(212.0 * 0.001));
    let first = std::fs::read(&path).expect("reads");
    write_e57(&path);
    assert!(first == std::fs::read(&path).expect("reads"), "the same scene gives the same bytes");
}

fn write_e57(path: &Path) {
    let mut scans = E57Scans::create(path).expect("create");
    for k in 0..3_u32 {
        let turn = Vector::z() * 0.6 * f64::from(k);
        let scan = GridScan {
            name: format!("scan_{k}"),
            world_from_scan: Pose::new(Vector::new(2.5 * f64::from(k), 1.0, 1.5), turn),
            n_rows: 300,
            n_cols: 211,
        };
        let n = if k == 2 { 0 } else { 300 * 211_u32 };
        let points = (0..n).map(|i| {
            let xyz = (i % 17 != 0).then_some([i as f32 * 0.001, 1.0, (i % 50) as f32]);
            Ok(GridPoint { xyz, row: i / 211, col: i % 211, intensity: (i % 60_000) as u16 })
        });
        assert_eq!(scans.add(&scan, points).expect("add"), u64::from(n));
    }
    scans.finish().expect("finish");
}

fn fit() -> Fit {
    let joint = |name: &str, value, sigma: f64| JointFit {
        name: name.into(),
        value,
        sigma,
        certainty: Certainty::of(sigma, false, DETERMINED_SIGMA),
        ..JointFit::default()
    };
    Fit {
        model: 0,
        model_name: "box".into(),
        world_from_base: Pose::new(Vector::new(400_001.0, 5_000_002.0, 100.0), Vector::z() * 0.5),
        base_sigma: [1e-4, 1e-4, 1e-4, 1e-5, f64::NAN, 1e-5],
        joints: vec![joint("z_turn", 0.25, 1e-4), joint("a_lift", -1.0, 1.8)],
        covariance: Vec::new(),
        score: 0.97,
        explained: 2.0,
        rms: 0.002,
        links: vec![LinkEvidence {
            name: "base".into(),
            seen: 0.6,
            matched: 0.9,
            violated: 0.0,
            n_points: 900,
            rms: f64::NAN,
        }],
        runner_up: Some(RunnerUp {
            model: "other".into(),
            score: 0.2,
            same_model: false,
            margin: 0.9,
        }),
        alike: vec!["box_long".into()],
        verdict: Verdict::Doubtful,
        reasons: vec!["joint is not determined: \"a_lift\"".into()],
        ..Fit::default()
    }
}

fn sample(out: &Path) {
    let written = clouds(out, N - 5, [false, false], 1 << 20);
    let mask = Mask {
        id: MaskId(0),
        input: InputId(0),
        name: "plant.las".into(),
        n_points: Some(N as u64),
    };
    let mut writer = MaskWriter::create(out, mask.id).expect("create");
    let labels: Vec<Label> = (0..N - 5).map(label).collect();
    let mut padded = LabelColumns::of(&labels[N - 5 - 777..]);
    padded.pad(777 + 5);
    for piece in labels[..N - 5 - 777].chunks(777) {
        writer.push(&LabelColumns::of(piece)).expect("push");
    }
    writer.push(&padded).expect("dropped points");
    let n_points = writer.len();
    writer.finish().expect("finish");
    let links = ["base", "arm", "hand"].map(String::from);
    let robots: Vec<_> = (0..2)
        .map(|i: usize| {
            RobotEntry::new(
                &format!("R{}", i + 1),
                &fit(),
                &links,
                Some(("hand".into(), Pose::identity())),
            )
        })
        .collect();
    write_table(out, &robots).expect("table");
    write_e57(&out.join("scans.e57"));
    assert!(copc(out, 2));
    let result = ResultFile {
        schema: SCHEMA.into(),
        version: "0.1.0".into(),
        robots,
        labels: LabelFiles {
            table: "labels/table.json".into(),
            scans: vec![ScanLabels::new(&mask, n_points)],
        },
        inputs: vec![InputEntry {
            path: "plant.las".into(),
            format: "las".into(),
            n_bytes: 1,
            digest: String::new(),
            n_scans: 1,
            n_points,
            n_dropped: 5,
            units: None,
            notes: Vec::new(),
            scans: Vec::new(),
        }],
        stages: vec![StageEntry {
            name: "segment".into(),
            n_in: 1,
            n_out: written.tiles.len() as u64,
        }],
        warnings: Vec::new(),
        review: Vec::new(),
        rescan: None,
    };
    result.write(out).expect("result");
}

#[test]
fn the_result_comes_back_as_written_and_python_reads_it_all() {
    let out = folder("sample");
    sample(&out);
    let text = std::fs::read_to_string(out.join("result.json")).expect("reads");
    assert!(!text.contains("NaN") && !text.contains("inf"));
    let back: ResultFile = serde_json::from_str(&text).expect("parses");
    assert_eq!(back.robots[1].id, "R2");
    assert_eq!(back.robots[0].joints.0[0].0, "z_turn", "joints keep the order of the model");
    assert_eq!(back.robots[0].sigma.0[1], ("a_lift".into(), 1.8));
    assert_eq!(back.robots[0].base_sigma.rotation[1], None);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/check_outputs.py");
    let python = std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into());
    let has_laspy =
        std::process::Command::new(&python).args(["-c", "import laspy, numpy"]).output();
    if !has_laspy.is_ok_and(|o| o.status.success()) {
        eprintln!("skipped: no python3 with laspy and numpy");
        return;
    }
    let checked = std::process::Command::new(&python).arg(script).arg(&out).output().expect("runs");
    let said = String::from_utf8_lossy(&checked.stdout).into_owned()
        + &String::from_utf8_lossy(&checked.stderr);
    assert!(checked.status.success(), "{said}");
    eprintln!("{said}");
}

#[test]
#[ignore = "measures: run with --release -- --ignored --nocapture"]
fn how_fast_clouds_and_scans_are_written() {
    let out = folder("speed");
    let n = 3_000_000;
    for compress in [false, true] {
        let start = std::time::Instant::now();
        clouds(&out, n, [compress, false], 64 << 20);
        eprintln!(
            "clouds, compressed {compress}: {:.2} M points/s",
            n as f64 / 1e6 / start.elapsed().as_secs_f64()
        );
    }
    let start = std::time::Instant::now();
    let mut scans = E57Scans::create(out.join("speed.e57")).expect("create");
    let scan = GridScan {
        name: "s".into(),
        world_from_scan: Pose::identity(),
        n_rows: 1000,
        n_cols: 3000,
    };
    let points = (0..3_000_000_u32).map(|i| {
        let xyz = Some([i as f32 * 1e-3, 2.0, 3.0]);
        Ok(GridPoint { xyz, row: i % 1000, col: i / 1000, intensity: 7 })
    });
    scans.add(&scan, points).expect("add");
    scans.finish().expect("finish");
    eprintln!("e57: {:.2} M points/s", 3.0 / start.elapsed().as_secs_f64());
    std::fs::remove_dir_all(out).expect("cleared");
}

#[test]
fn a_list_of_places_that_a_mask_does_not_have_is_refused() {
    let path = folder("places").join("0.superseded.npy");
    let write = |places: &[u64]| {
        let mut list = NpyWriter::<u64>::create(&path).expect("opens");
        list.push(places).expect("writes");
        list.finish().expect("ends");
    };
    write(&[1, 5, 9]);
    assert_eq!(read_places(&path, 10).expect("reads"), [1, 5, 9]);
    assert!(read_places(&path, 9).is_err());
    for wrong in [&[5, 1][..], &[5, 5]] {
        write(wrong);
        assert!(read_places(&path, 10).is_err());
    }
}

#[test]
fn a_space_of_no_voxels_is_refused_whatever_its_file_is() {
    let out = folder("no_voxels");
    let entry = |size: [usize; 3]| -> SpaceEntry {
        serde_json::from_value(serde_json::json!({
            "grid": "space.npy", "octomap": "", "unknown": "", "edge": 0.05, "origin": [0.0, 0.0, 0.0],
            "size": size, "octomap_shift": [0.0, 0.0, 0.0], "unknown_m3": 0.0, "free_m3": 0.0,
        }))
        .expect("an entry")
    };
    std::fs::write(out.join("space.npy"), "nothing").expect("writes");
    assert!(entry([0, 2, 2]).read(&out).is_err());
    std::fs::write(out.join("space.npy"), vec![0; 128 + 4]).expect("writes");
    assert_eq!(entry([1, 2, 2]).read(&out).expect("reads").voxels().len(), 4);
    assert!(entry([1, 2, 3]).read(&out).is_err());
}
