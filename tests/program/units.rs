//! Units of inputs from outside: what files declare or a person gives is used and told, what cannot
//! be is refused with the likely unit, and no run writes more files than its plan says. Small
//! clouds are made here; the cases of public reports are read where they lie beside the repository.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use stillpoint::eval::demo::write_robots;

const US_FOOT: f64 = 1200.0 / 3937.0;
/// A map in US survey feet.
const FEET: &str = r#"PROJCS["Texas South Central (ftUS)",GEOGCS["NAD83",DATUM["NAD83",
    SPHEROID["GRS 1980",6378137,298.257]],UNIT["degree",0.0174532925199433]],
    UNIT["US survey foot",0.3048006096012192],AXIS["X",EAST],AXIS["Y",NORTH]]"#;

/// A map in metres.
const METRES: &str = r#"PROJCS["ETRS89 / UTM zone 32N",GEOGCS["ETRS89",DATUM["ETRS89",
    SPHEROID["GRS 1980",6378137,298.257]],UNIT["degree",0.0174532925199433]],
    UNIT["metre",1],AXIS["E",EAST],AXIS["N",NORTH]]"#;

/// A room of 6 × 5 × 3 m: floor and two walls, a point about every 0.1 m, in no coarse step.
fn room() -> Vec<[f64; 3]> {
    // Points at the ends of a surface stay where they are, so that bounds are known.
    let along = |k: usize, n: usize, i: usize| {
        let off = if k == 0 || k + 1 == n { 0 } else { i * 7919 % 1009 };
        0.1 * k as f64 + 0.03 * off as f64 / 1009.0
    };
    let grid = |n: usize, m: usize| {
        (0..n * m).map(move |i| [along(i / m, n, i), along(i % m, m, 3 * i + 1)])
    };
    let floor = grid(60, 50).map(|[x, y]| [x, y, 0.0]);
    let back = grid(60, 30).map(|[x, z]| [x, 5.0, z]);
    let side = grid(50, 30).map(|[y, z]| [0.0, y, z]);
    floor.chain(back).chain(side).collect()
}

/// A LAS 1.2 file of these points, metres, in units of so many metres, with such steps and offset
/// of the file's own unit.
fn las(
    points: &[[f64; 3]],
    metres: f64,
    (scale, offset): ([f64; 3], [f64; 3]),
    wkt: &str,
) -> Vec<u8> {
    let own = |p: &[f64; 3]| p.map(|v| v / metres);
    let mut vlr = Vec::new();
    if !wkt.is_empty() {
        vlr.extend([0; 2]);
        let mut user = b"LASF_Projection".to_vec();
        user.resize(16, 0);
        vlr.extend(user);
        vlr.extend(2112_u16.to_le_bytes());
        vlr.extend((wkt.len() as u16).to_le_bytes());
        vlr.extend([0; 32]);
        vlr.extend(wkt.as_bytes());
    }
    let mut out = vec![0; 227];
    out[..4].copy_from_slice(b"LASF");
    (out[24], out[25]) = (1, 2);
    out[94..96].copy_from_slice(&227_u16.to_le_bytes());
    out[96..100].copy_from_slice(&(227 + vlr.len() as u32).to_le_bytes());
    out[100..104].copy_from_slice(&u32::from(!wkt.is_empty()).to_le_bytes());
    out[105..107].copy_from_slice(&20_u16.to_le_bytes());
    out[107..111].copy_from_slice(&(points.len() as u32).to_le_bytes());
    for axis in 0..3 {
        let along = || points.iter().map(|p| own(p)[axis]);
        let (least, most) = (along().fold(f64::MAX, f64::min), along().fold(f64::MIN, f64::max));
        for (at, value) in [
            (131 + 8 * axis, scale[axis]),
            (155 + 8 * axis, offset[axis]),
            (179 + 16 * axis, most),
            (187 + 16 * axis, least),
        ] {
            out[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
    }
    out.extend(vlr);
    for point in points {
        for (axis, value) in own(point).into_iter().enumerate() {
            let count = ((value - offset[axis]) / scale[axis]).round() as i32;
            out.extend(count.to_le_bytes());
        }
        out.extend([0, 0, 0b1001, 0, 0, 0, 0, 0]);
    }
    out
}

/// Steps of a file in its own unit.
const STEPS: ([f64; 3], [f64; 3]) = ([1e-4; 3], [0.0; 3]);

struct Place {
    dir: tempfile::TempDir,
}

impl Place {
    /// A folder with a library of one arm.
    fn new() -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let robots = dir.path().join("robots");
        write_robots(&robots).expect("the library is written");
        for other in ["demo_welder_2600", "demo_palletiser_3200"] {
            let _ = std::fs::remove_dir_all(robots.join(other));
        }
        Self { dir }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).expect("writes");
    }

    fn call(&self, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
        command.current_dir(self.dir.path()).args(args).args(["--progress", "none"]);
        command.output().expect("the program starts")
    }

    fn run(&self, args: &[&str]) -> Output {
        self.call(&[&["run", "--robots", "robots", "--out", "out"], args].concat())
    }

    fn plan(&self, args: &[&str]) -> Output {
        self.call(&[&["plan", "--robots", "robots", "--out", "out"], args].concat())
    }

    fn inspect(&self, args: &[&str]) -> serde_json::Value {
        let output = self.call(&[&["inspect", "--json"], args].concat());
        assert_eq!(code(&output), 0, "{}", err(&output));
        serde_json::from_slice(&output.stdout).expect("JSON")
    }

    fn result(&self) -> serde_json::Value {
        let text = std::fs::read_to_string(self.path("out/result.json")).expect("a result");
        serde_json::from_str(&text).expect("JSON")
    }
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("a code, no signal")
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Files below a folder whose names end so.
fn files(dir: &Path, ending: &str) -> Vec<PathBuf> {
    let mut out = Vec::new();
    for entry in std::fs::read_dir(dir).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            out.extend(files(&path, ending));
        } else if path.to_string_lossy().ends_with(ending) {
            out.push(path);
        }
    }
    out.sort();
    out
}

/// Number of points of LAS files, and their bounds as the headers state them: least x, y, z,
/// greatest x, y, z.
fn content(files: &[PathBuf]) -> (u64, [f64; 6]) {
    let (mut n, mut bounds) = (0, [f64::MAX, f64::MAX, f64::MAX, f64::MIN, f64::MIN, f64::MIN]);
    for file in files {
        let bytes = std::fs::read(file).expect("a tile");
        let number = |at: usize| f64::from_le_bytes(*bytes[at..].first_chunk().expect("a header"));
        n += u64::from_le_bytes(*bytes[247..].first_chunk().expect("a header"));
        for axis in 0..3 {
            bounds[axis] = bounds[axis].min(number(187 + 16 * axis));
            bounds[3 + axis] = bounds[3 + axis].max(number(179 + 16 * axis));
        }
    }
    (n, bounds)
}

#[test]
fn inputs_of_several_units_become_one_cloud_in_metres() {
    let (place, room) = (Place::new(), room());
    place.write("bare.las", las(&room, 1.0, STEPS, ""));
    place.write("feet.las", las(&room, US_FOOT, STEPS, FEET));
    place.write("thou.las", las(&room, 1e-3, ([0.01; 3], [0.0; 3]), ""));
    let args = ["bare.las", "feet.las", "thou.las", "--units", "thou=mm"];
    let seen = place.inspect(&args);
    for (i, (origin, metres)) in
        [("assumed", 1.0), ("declared", US_FOOT), ("given", 1e-3)].into_iter().enumerate()
    {
        let input = &seen["inputs"][i];
        assert_eq!(input["units"]["origin"], origin, "{input}");
        let own = input["units"]["horizontal"]["metres"].as_f64().expect("a number");
        assert!((own / metres - 1.0).abs() < 1e-12, "{input}");
        let most = input["scans"][0]["stated_bounds"]["max"][0].as_f64().expect("a number");
        assert!((most - 5.9).abs() < 1e-6, "{input}");
    }
    let output = place.run(&args);
    assert_eq!(code(&output), 0, "{}", err(&output));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    for word in
        ["US survey foot (0.30480061 m), declared by its WKT", "given with --units", "assumed"]
    {
        assert!(said.contains(word), "{said}");
    }
    let result = place.result();
    assert_eq!(result["inputs"][1]["units"]["origin"], "declared");
    let tiles = files(&place.path("out/tiles"), ".las");
    assert_eq!(tiles.len(), 4, "as many as of one room");
    let (n, bounds) = content(&tiles);
    assert_eq!(n, 3 * room.len() as u64);
    for (own, right) in bounds.into_iter().zip([0.0, 0.0, 0.0, 5.9, 5.0, 2.9]) {
        assert!((own - right).abs() < 2e-4, "{bounds:?}");
    }
    // What is in metres is not said to be in feet.
    for tile in &tiles {
        let bytes = std::fs::read(tile).expect("a tile");
        assert!(!bytes.windows(15).any(|w| w == b"LASF_Projection"), "{}", tile.display());
    }
}

#[test]
fn a_system_in_metres_stands_in_every_tile() {
    let (place, room) = (Place::new(), room());
    place.write("hall.las", las(&room, 1.0, STEPS, METRES));
    let output = place.run(&["hall.las"]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    let tiles = files(&place.path("out/tiles"), ".las");
    assert_eq!(content(&tiles).0, room.len() as u64);
    for tile in &tiles {
        let bytes = std::fs::read(tile).expect("a tile");
        let has = |what: &[u8]| bytes.windows(what.len()).any(|w| w == what);
        assert!(has(METRES.as_bytes()) && has(b"LASF_Projection"), "{}", tile.display());
        assert_eq!(bytes[6] & 16, 16, "the text counts: {}", tile.display());
    }
    // Inputs that state different systems are not said to be in one of them.
    place.write("other.las", las(&room, 1.0, STEPS, &METRES.replace("32N", "33N")));
    let output = place.run(&["hall.las", "other.las"]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    for tile in files(&place.path("out/tiles"), ".las") {
        let bytes = std::fs::read(&tile).expect("a tile");
        assert!(!bytes.windows(15).any(|w| w == b"LASF_Projection"), "{}", tile.display());
    }
}

#[test]
fn clouds_of_the_wrong_size_end_with_the_likely_unit() {
    let (place, room) = (Place::new(), room());
    place.write("thou.las", las(&room, 1e-3, ([0.01; 3], [0.0; 3]), ""));
    place.write("bare.las", las(&room, 1.0, STEPS, ""));
    let hall: Vec<_> = room.iter().map(|p| [7.0 * p[0], 5.0 * p[1], 3.0 * p[2]]).collect();
    place.write("hall.las", las(&hall, 1.0, STEPS, ""));
    let mut ptx = format!("1\n{}\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n", room.len());
    ptx.push_str("1 0 0 0\n0 1 0 0\n0 0 1 0\n2000 2000 1000 1\n");
    for p in &room {
        let [x, y, z] = [p[0] - 2.0, p[1] - 2.0, p[2] - 1.0].map(|v| v * 1e3);
        let _ = writeln!(ptx, "{x} {y} {z} 0.5");
    }
    place.write("thou.ptx", ptx);
    for (args, words) in [
        (&["thou.las"][..], "give --units mm"),
        (&["thou.ptx"], "give --units mm"),
        (&["bare.las", "--units", "mm"], "give --units m"),
        // 45 mm in all: the library says that no arm of it can stand there.
        (&["hall.las", "--units", "mm"], "give --units m"),
    ] {
        let inspect = place.call(&[&["inspect"], args].concat());
        let all = [place.run(args), place.plan(args), inspect];
        // No library is given to `inspect`.
        let n = if args[0] == "hall.las" { 2 } else { 3 };
        for output in &all[..n] {
            assert_eq!(code(output), 4, "{args:?}: {}", err(output));
            assert!(err(output).contains(words), "{args:?}: {}", err(output));
            assert!(err(output).contains(args[0]), "{args:?}: {}", err(output));
        }
        assert!(!place.path("out/result.json").exists(), "{args:?}");
    }
    // With the unit, poses and coordinates are those of the room.
    let seen = place.inspect(&["thou.ptx", "--units", "mm"]);
    let at = &seen["inputs"][0]["scans"][0]["world_from_scan"]["xyz"];
    assert_eq!(at, &serde_json::json!([2.0, 2.0, 1.0]), "{seen}");
    let output = place.call(&["inspect", "bare.las", "--units", "mn"]);
    assert_eq!(code(&output), 2, "{}", err(&output));
    assert!(err(&output).contains("\"mn\"") && err(&output).contains("us-ft"), "{}", err(&output));
}

#[test]
fn degrees_are_refused_with_a_way_out() {
    let place = Place::new();
    let bytes = las(&room(), 1.0, STEPS, r#"GEOGCS["WGS 84",UNIT["degree",0.01745]]"#);
    place.write("degrees.las", bytes);
    let output = place.run(&["degrees.las"]);
    assert_eq!(code(&output), 4, "{}", err(&output));
    assert!(err(&output).contains("longitude") && err(&output).contains("--units m"));
    assert_eq!(code(&place.call(&["inspect", "degrees.las", "--units", "m"])), 0);
}

#[test]
fn a_run_writes_no_more_tiles_than_its_plan_allows() {
    let (place, room) = (Place::new(), room());
    place.write("thou.las", las(&room, 1e-3, ([0.01; 3], [0.0; 3]), ""));
    place.write("bare.las", las(&room, 1.0, STEPS, ""));
    // The plan knows it from a sample; a run, too.
    let wide = ["thou.las", "--units", "m", "--set", "export.max_tiles=1000"];
    for output in [place.plan(&wide), place.run(&wide)] {
        assert_eq!(code(&output), 5, "{}", err(&output));
        assert!(err(&output).contains("--units"), "{}", err(&output));
    }
    // Strays that no sample shows are counted before anything is written.
    let strays = (0..120).map(|i| [50.0 * f64::from(i), 900.0, 1.0]);
    let all: Vec<_> = room.iter().copied().chain(strays).collect();
    place.write("strays.las", las(&all, 1.0, STEPS, ""));
    let few = ["strays.las", "--set", "export.max_tiles=50"];
    let plan: serde_json::Value = {
        let output = place.plan(&[&few[..], &["--json"]].concat());
        assert_eq!(code(&output), 0, "{}", err(&output));
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    assert_eq!(plan["tiles"][1], 50);
    let output = place.run(&few);
    assert_eq!(code(&output), 5, "{}", err(&output));
    assert!(err(&output).contains("124 spatial tiles"), "{}", err(&output));
    assert!(files(&place.path("out"), ".las").is_empty());
    let output = place.run(&["strays.las", "--set", "export.max_tiles=124"]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    assert_eq!(files(&place.path("out/tiles"), ".las").len(), 124);
}

#[test]
fn legal_steps_of_the_whole_range_are_written_in_steps_that_hold() {
    let (place, room) = (Place::new(), room());
    // As PDAL's automatic scale: extent / (2³¹ - 1) from the least coordinate on.
    let scale = [5.9, 5.0, 2.9].map(|side| side / f64::from(i32::MAX));
    place.write("auto.las", las(&room, 1.0, (scale, [0.0; 3]), ""));
    let output = place.run(&["auto.las"]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    let (n, bounds) = content(&files(&place.path("out/tiles"), ".las"));
    assert_eq!(n, room.len() as u64);
    for (own, right) in bounds.into_iter().zip([0.0, 0.0, 0.0, 5.9, 5.0, 2.9]) {
        assert!((own - right).abs() < 1e-6, "{bounds:?}");
    }
}

#[test]
fn a_stray_point_is_dropped_counted_and_told() {
    let (place, room) = (Place::new(), room());
    let mut ptx = format!("1\n{}\n", room.len() + 1);
    ptx.push_str("0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    let on_map = room.iter().map(|p| [p[0] + 412_000.0, p[1] + 5_650_000.0, p[2] + 60.0]);
    // A digit is wrong: 300 km away.
    for [x, y, z] in on_map.chain([[712_000.0, 5_650_000.0, 60.0]]) {
        let _ = writeln!(ptx, "{x:.3} {y:.3} {z:.3} 0.5");
    }
    place.write("map.ptx", ptx);
    let output = place.run(&["map.ptx"]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    assert!(err(&output).contains(&format!("1 of {} points were dropped", room.len() + 1)));
    assert_eq!(place.result()["inputs"][0]["n_dropped"], 1);
    let (n, bounds) = content(&files(&place.path("out/tiles"), ".las"));
    assert_eq!(n, room.len() as u64);
    assert!((bounds[3] - 412_005.9).abs() < 1e-3, "steps stay fine: {bounds:?}");
    // Two scans in two frames are named, not written in steps of a centimetre.
    place.write("local.las", las(&room, 1.0, STEPS, ""));
    let output = place.run(&["map.ptx", "local.las"]);
    assert_eq!(code(&output), 4, "{}", err(&output));
    assert!(
        err(&output).contains("local.las") && err(&output).contains("frame"),
        "{}",
        err(&output)
    );
}

/// The cases of public reports, beside the repository.
#[test]
fn reported_cases_come_out_right() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases");
    let place = Place::new();
    let named = |name: &str| cases.join(name).to_string_lossy().into_owned();
    if !cases.is_dir() {
        skipped();
        return;
    }
    let bounds =
        |args: &[&str]| place.inspect(args)["inputs"][0]["scans"][0]["stated_bounds"].clone();
    let metres = bounds(&[&named("units-mm-and-feet/metres.las")]);
    let feet = bounds(&[&named("units-mm-and-feet/feet_wkt.las")]);
    let thou = bounds(&[&named("units-mm-and-feet/mm.las"), "--units", "mm"]);
    for side in ["min", "max"] {
        for axis in 0..3 {
            let right = metres[side][axis].as_f64().expect("a number");
            for own in [&feet, &thou] {
                let own = own[side][axis].as_f64().expect("a number");
                assert!((own - right).abs() < 1e-3, "{own} {right}");
            }
        }
    }
    for name in ["mm.las", "mm.e57"] {
        let output = place.plan(&[&named(&format!("units-mm-and-feet/{name}"))]);
        assert_eq!(code(&output), 4, "{}", err(&output));
        assert!(err(&output).contains("--units mm"), "{}", err(&output));
    }
    let at = place.inspect(&[&named("units-mm-and-feet/mm.e57"), "--units", "mm"]);
    assert_eq!(at["inputs"][0]["units"]["horizontal"]["metres"], 1e-3, "{at}");
    for (name, n) in [("room_auto_min.las", 2_400), ("auto_min_offset.las", 24_000)] {
        let output = place.run(&[&named(&format!("las-scale-of-full-range/{name}"))]);
        assert_eq!(code(&output), 0, "{}", err(&output));
        assert_eq!(content(&files(&place.path("out/tiles"), ".las")).0, n, "{name}");
    }
}

#[allow(clippy::print_stdout)] // the test says that it did not run
fn skipped() {
    println!("skipped: no cases beside the repository");
}
