//! Writes a small output folder of every kind of file, reads it back with the crates that others use, and has
//! `scripts/check_outputs.py` look at it with laspy, pye57 and PDAL where Python has them.
#![allow(clippy::print_stderr)]

use contract::{
    Fit, InputId, JointFit, Label, LinkEvidence, Mask, MaskId, PointKind, RunnerUp, Verdict,
};
use export::*;
use geometry::{Aabb, Pose, Vector};
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("folder");
    path
}

const N: usize = 20_000;

fn label(i: usize) -> Label {
    match i % 10 {
        0..3 => Label::FLOOR,
        3..6 => Label::FIXED,
        6 | 7 => Label { kind: PointKind::Link, robot: 0, link: (i / 10 % 3) as i16 },
        8 => Label { kind: PointKind::Attachment, robot: 1, link: 2 },
        _ => Label::UNCERTAIN,
    }
}

fn world(i: usize) -> [f64; 3] {
    let turn = i as f64 * 0.37;
    [
        400_000.0 + 15.0 * turn.sin(),
        5_000_000.0 + 12.0 * turn.cos(),
        100.0 + (i % 300) as f64 * 0.01,
    ]
}

fn intensity(i: usize) -> u16 {
    (i * 7 % 65536) as u16
}

fn source_id(i: usize) -> u16 {
    (i % 4) as u16 + 1
}

fn clouds(
    out: &Path,
    n: usize,
    [compress, with_color]: [bool; 2],
    waiting_bytes: usize,
) -> Written {
    let around =
        Aabb { min: [399_985.0, 4_999_988.0, 100.0], max: [400_015.0, 5_000_012.0, 103.0] };
    let las = LasSettings { with_color, ..LasSettings::new(Quantum::around(&around)) };
    let settings = Settings { compress, waiting_bytes, ..Settings::default() };
    let las = settings.records(&las);
    let mut clouds = Clouds::create(out, &las, &settings).expect("create");
    let mut tiles = Tiles::create(out, &las, &settings).expect("create").expect("asked");
    let pack = Pack::of_clouds(&las, &settings);
    // Strips of a length that divides nothing.
    let all: Vec<usize> = (0..n).collect();
    for strip in all.chunks(1013) {
        let world: Vec<_> = strip.iter().map(|&i| world(i)).collect();
        let labels: Vec<_> = strip.iter().map(|&i| label(i)).collect();
        let points = PointColumns {
            world: &world,
            labels: &labels,
            intensity: &strip.iter().map(|&i| intensity(i)).collect::<Vec<_>>(),
            color: &strip.iter().map(|&i| [i as u16, 2, 65535]).collect::<Vec<_>>(),
            gps_time: &strip.iter().map(|&i| i as f64 * 0.001).collect::<Vec<_>>(),
            source_id: &strip.iter().map(|&i| source_id(i)).collect::<Vec<_>>(),
            ..PointColumns::default()
        };
        let packed = pack.pack(&points).expect("packs");
        tiles.add(&packed, &contract::OneByOne).expect("adds");
        clouds.add(&packed).expect("adds");
    }
    let tiles = tiles.finish(&contract::OneByOne).expect("finish");
    let (robots, fixed) = clouds.finish().expect("finish");
    Written { tiles, robots, fixed }
}

fn read(path: &Path) -> (las::Header, Vec<las::Point>) {
    let mut reader = las::Reader::from_path(path).expect("opens");
    let points = reader.read_all().expect("reads").points().map(|p| p.expect("decodes")).collect();
    (reader.header().clone(), points)
}

#[test]
fn tiles_hold_every_point_once_whatever_the_memory_and_compression() {
    let mut seen: Option<Vec<(i64, u8, Vec<u8>)>> = None;
    let variants =
        [(false, false, 1 << 20), (false, false, 4000), (true, false, 4000), (true, true, 1 << 20)];
    for (k, (compress, with_color, memory)) in variants.into_iter().enumerate() {
        let out = folder(&format!("tiles_{k}"));
        let written = clouds(&out, N, [compress, with_color], memory);
        assert!(written.tiles.len() > 6);
        let mut all = Vec::new();
        for tile in &written.tiles {
            let (header, points) = read(&tile.path);
            assert_eq!(header.number_of_points(), tile.n_points);
            assert_eq!(points.len() as u64, tile.n_points);
            let bounds = header.bounds();
            assert!((bounds.min.x - tile.bounds.min[0]).abs() < 1e-9);
            for p in &points {
                assert!(tile.bounds.grown(1e-6).contains([p.x, p.y, p.z]));
                assert_eq!(p.color.is_some(), with_color);
                let i = (p.gps_time.expect("has time") * 1000.0).round() as i64;
                let xyz = world(i as usize);
                assert!((p.x - xyz[0]).abs() < 6e-5 && (p.y - xyz[1]).abs() < 6e-5);
                assert!((p.z - xyz[2]).abs() < 6e-5);
                let ids = (intensity(i as usize), source_id(i as usize));
                assert_eq!((p.intensity, p.point_source_id), ids);
                if let Some(color) = p.color {
                    assert_eq!([color.red, color.green, color.blue], [i as u16, 2, 65535]);
                }
                all.push((i, u8::from(p.classification), p.extra_bytes.clone()));
            }
        }
        all.sort();
        assert_eq!(all.len(), N);
        assert!(
            all.iter().enumerate().all(|(i, p)| p.0 == i as i64 && p.1 == class_of(label(i).kind))
        );
        assert_eq!(all[6].2, [1, 0, 1, 0]);
        assert_eq!(all[3].2, [0, 0, 0, 0]);
        assert_eq!(seen.get_or_insert_with(|| all.clone()), &all);
        let names: Vec<_> =
            std::fs::read_dir(out.join("tiles")).expect("folder").flatten().collect();
        assert_eq!(names.len(), written.tiles.len(), "nothing half-written is left");
        let (robots, fixed) = (written.robots, written.fixed.expect("asked"));
        assert_eq!(robots.n_points + fixed.n_points, N as u64);
        assert_eq!(read(&robots.path).1.len(), N * 3 / 10);
    }
}

/// Says nothing, and never stops.
struct Quiet;

impl CopcSteps for Quiet {
    fn begins(&self, _: &'static str, _: u64) {}
    fn is_at(&self, _: u64) {}
    fn ends(&self) -> contract::Result<()> {
        Ok(())
    }
}

fn copc(out: &Path, n_threads: usize) -> bool {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
    let write =
        || write_copc(out, &out.join(COPC), &out.join("scratch"), &std::sync::Arc::new(Quiet));
    pool.install(write).expect("writes")
}

#[test]
fn tiles_make_one_copc_file_the_same_for_any_number_of_threads() {
    let n = 700_000;
    let mut files = Vec::new();
    for (n_threads, compress) in [(1, false), (2, false), (3, true)] {
        let out = folder(&format!("copc_{n_threads}"));
        let written = clouds(&out, n, [compress, true], 1 << 20);
        assert!(copc(&out, n_threads));
        files.push(std::fs::read(out.join(COPC)).expect("reads"));
        assert!(files[0] == files[files.len() - 1], "{n_threads} threads");
        assert_eq!(std::fs::read_dir(out.join("scratch")).expect("lists").count(), 0);
        let (header, points) = read(&out.join(COPC));
        let vlr = &header.vlrs()[0];
        assert_eq!((vlr.user_id.as_str(), vlr.record_id), ("copc", 1));
        assert!(header.date().is_none());
        let line = |p: las::Point| {
            let i = (p.gps_time.expect("has time") * 1000.0).round() as i64;
            let color = p.color.expect("has color");
            let ids = (p.intensity, p.point_source_id, u8::from(p.classification), p.extra_bytes);
            (i, [p.x, p.y, p.z].map(f64::to_bits), [color.red, color.green, color.blue], ids)
        };
        let mut whole: Vec<_> = points.into_iter().map(line).collect();
        let of_tiles = written.tiles.iter().flat_map(|tile| read(&tile.path).1);
        let mut tiles: Vec<_> = of_tiles.map(line).collect();
        whole.sort();
        tiles.sort();
        assert_eq!(whole.len(), n);
        assert!(whole == tiles);
    }
    assert!(!copc(&folder("copc_of_nothing"), 1));
}

/// The header of a PLY file, and its points' bytes.
fn ply(path: &Path) -> (String, Vec<[u8; 34]>) {
    let bytes = std::fs::read(path).expect("reads");
    let end = b"end_header\n";
    let at = bytes.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
    let (points, rest) = bytes[at..].as_chunks::<34>();
    assert!(rest.is_empty());
    (String::from_utf8(bytes[..at].to_vec()).expect("text"), points.to_vec())
}

#[test]
fn ply_files_hold_each_point_once_moving_and_fixed_apart() {
    let out = folder("ply");
    let written = clouds(&out, N, [true, true], 1 << 20);
    let n = export::write_ply(&out, &out.join("export"), || Ok(()))
        .expect("writes")
        .expect("has tiles");
    assert_eq!(n.iter().sum::<u64>(), N as u64);
    let mut whole = Vec::new();
    for (name, n) in export::PLY.iter().zip(n) {
        let (header, points) = ply(&out.join("export").join(name));
        assert!(header.contains(&format!("element vertex {n}\n")), "{header}");
        assert_eq!(points.len() as u64, n);
        let moves = |p: &[u8; 34]| p[26] == 1 || p[26] == 2;
        assert!(points.iter().all(|p| moves(p) == (*name == export::PLY[0])));
        whole.extend(points);
    }
    let of_tiles = written.tiles.iter().flat_map(|tile| read(&tile.path).1);
    let mut tiles: Vec<[u64; 3]> = of_tiles.map(|p| [p.x, p.y, p.z].map(f64::to_bits)).collect();
    let number = |p: &[u8; 34], i: usize| {
        u64::from_le_bytes(p[8 * i..8 * i + 8].try_into().expect("eight bytes"))
    };
    // Colours, as the tiles have them.
    assert!(whole.iter().any(|p| p[31..] != [0; 3]));
    let mut found: Vec<[u64; 3]> = whole.iter().map(|p| [0, 1, 2].map(|i| number(p, i))).collect();
    tiles.sort_unstable();
    found.sort_unstable();
    assert!(tiles == found);
    assert!(
        export::write_ply(&folder("ply_of_nothing"), &out, || Ok(())).expect("looks").is_none()
    );
}

#[test]
fn bodies_are_an_extra_field_behind_labels() {
    let out = folder("bodies");
    let las = LasSettings::new(Quantum { scale: [1e-3; 3], offset: [0.0; 3] });
    let settings = Settings { bodies: true, fixed_cloud: false, ..Settings::default() };
    let las = settings.records(&las);
    let mut tiles = Tiles::create(&out, &las, &settings).expect("create").expect("asked");
    let points = PointColumns {
        world: &[[1.0; 3], [2.0; 3]],
        labels: &[label(6), Label::FLOOR],
        body: &[70_000, 0],
        ..PointColumns::default()
    };
    let packed = Pack::of_clouds(&las, &settings).pack(&points).expect("packs");
    tiles.add(&packed, &contract::OneByOne).expect("adds");
    let written = tiles.finish(&contract::OneByOne).expect("finish");
    let (_, points) = read(&written[0].path);
    let mut extra: Vec<_> = points.iter().map(|p| p.extra_bytes.clone()).collect();
    extra.sort();
    assert_eq!(extra, [vec![0; 8], vec![1, 0, 1, 0, 0x70, 0x11, 1, 0]]);
}

#[test]
fn a_dropped_file_leaves_nothing_and_an_empty_cloud_is_whole() {
    let out = folder("dropped");
    let path = out.join("a.las");
    let settings = LasSettings::new(Quantum { scale: [1e-4; 3], offset: [0.0; 3] });
    let mut writer = LasWriter::create(&path, settings.clone()).expect("create");
    let at = |world| PointColumns { world, labels: &[Label::FIXED], ..PointColumns::default() };
    writer.push(&at(&[[0.0; 3]])).expect("push");
    let error = writer.push(&at(&[[1e9, 0.0, 0.0]])).expect_err("too far for i32");
    assert!(error.to_string().contains("a.las"), "{error}");
    drop(writer);
    assert_eq!(std::fs::read_dir(&out).expect("folder").count(), 0);
    for compress in [false, true] {
        let settings = LasSettings { compress, ..settings.clone() };
        LasWriter::create(&path, settings).expect("create").finish().expect("finish");
        assert!(read(&path).1.is_empty());
    }
}

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
        determined: sigma.is_finite(),
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
        labels: Labels {
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
            notes: Vec::new(),
        }],
        stages: vec![StageEntry {
            name: "segment".into(),
            n_in: 1,
            n_out: written.tiles.len() as u64,
        }],
        warnings: Vec::new(),
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
    write(&[5, 1]);
    assert!(read_places(&path, 10).is_err());
}
