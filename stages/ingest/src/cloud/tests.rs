//! Clouds written by the tests in every format, whole, damaged and with headers that lie, and real
//! PTS files.

use super::*;
use crate::check::{Read, ScratchFile, below, read_all, shared};
use contract::{Kind, ScannerPosition};
use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::SplitMix64;

/// Number of points of the written clouds: several stretches of text and several strips.
const N: usize = 10_000;

fn settings() -> Settings {
    Settings { strip_points: 3000, ..Settings::default() }
}

fn opened(path: &Path) -> Result<Box<dyn Reader>> {
    open(path, crate::format::detect(path)?, &settings())
}

fn read(path: &Path, want: Want) -> Result<Vec<Read>> {
    read_all(&*opened(path)?, want, &settings())
}

/// A point as it is written: coordinates that single precision holds, intensity and colour.
#[derive(Debug, Clone, Copy)]
struct Written {
    xyz: [f32; 3],
    intensity: u8,
    color: [u8; 3],
}

fn cloud(seed: u64) -> Vec<Written> {
    let mut rng = SplitMix64::seed_from_u64(seed);
    let mut one = |_| Written {
        xyz: [8.0, 6.0, 3.0].map(|size: f32| (rng.random_range(0.0..size) * 1e4).round() / 1e4),
        intensity: rng.random(),
        color: rng.random(),
    };
    (0..N).map(&mut one).collect()
}

fn text(points: &[Written], between: &str) -> String {
    let line = |p: &Written| {
        let ([x, y, z], i, [r, g, b]) = (p.xyz, p.intensity, p.color);
        [x, y, z].map(|v| v.to_string()).join(between)
            + &[i, r, g, b].map(|v| format!("{between}{v}")).concat()
            + "\n"
    };
    points.iter().map(line).collect()
}

/// Columns of the fields as bytes: x, y, z, intensity, colour.
fn columns(points: &[Written], is_big: bool) -> [Vec<Vec<u8>>; 5] {
    let float = |v: f32| if is_big { v.to_be_bytes().to_vec() } else { v.to_le_bytes().to_vec() };
    let axis = |k: usize| points.iter().map(|p| float(p.xyz[k])).collect();
    let packed = |p: &Written| {
        let [r, g, b] = p.color.map(u32::from);
        (r << 16 | g << 8 | b).to_le_bytes().to_vec()
    };
    [
        axis(0),
        axis(1),
        axis(2),
        points.iter().map(|p| vec![p.intensity]).collect(),
        points.iter().map(packed).collect(),
    ]
}

const VIEWPOINT: &str = "0 0 0 1 0 0 0";

fn pcd_header(n: usize, viewpoint: &str, encoding: &str) -> Vec<u8> {
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity rgb\n\
         SIZE 4 4 4 1 4\nTYPE F F F U U\nCOUNT 1 1 1 1 1\nWIDTH {n}\nHEIGHT 1\n\
         VIEWPOINT {viewpoint}\nPOINTS {n}\nDATA {encoding}\n"
    )
    .into_bytes()
}

fn pcd(points: &[Written], viewpoint: &str, encoding: &str) -> Vec<u8> {
    let mut file = pcd_header(points.len(), viewpoint, encoding);
    let columns = columns(points, false);
    match encoding {
        "binary" => (0..points.len()).for_each(|i| {
            columns.iter().for_each(|column| file.extend_from_slice(&column[i]));
        }),
        "binary_compressed" => {
            let whole: Vec<u8> = columns.concat().concat();
            let packed = lzf::packed(&whole);
            file.extend((packed.len() as u32).to_le_bytes());
            file.extend((whole.len() as u32).to_le_bytes());
            file.extend(packed);
        }
        _ => points.iter().for_each(|p| {
            let [r, g, b] = p.color.map(u32::from);
            let ([x, y, z], rgb) = (p.xyz, r << 16 | g << 8 | b);
            file.extend(format!("{x} {y} {z} {} {rgb}\n", p.intensity).bytes());
        }),
    }
    file
}

fn ply(points: &[Written], encoding: &str) -> Vec<u8> {
    let mut file = format!(
        "ply\nformat {encoding} 1.0\ncomment of a test\nelement odd 2\nproperty double a\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar intensity\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n",
        points.len()
    )
    .into_bytes();
    let columns = columns(points, encoding == "binary_big_endian");
    if encoding == "ascii" {
        file.extend(format!("1\n2\n{}3 0 1 2\n", text(points, " ")).bytes());
        return file;
    }
    file.extend([7; 16]);
    for (i, p) in points.iter().enumerate() {
        columns[..4].iter().for_each(|column| file.extend_from_slice(&column[i]));
        file.extend(p.color);
    }
    file.extend([3; 13]);
    file
}

fn every_format(points: &[Written]) -> Vec<(&'static str, Vec<u8>)> {
    let names = "//X;Y;Z;Intensity;R;G;B\n";
    let csv = text(points, ",");
    vec![
        ("a.pts", format!("{}\n{}", points.len(), text(points, " ")).into_bytes()),
        ("a.xyz", format!("# of a test\n\n{}", text(points, "\t")).into_bytes()),
        ("a.txt", format!("{names}{}", text(points, ";")).into_bytes()),
        (
            "a.csv",
            format!("\u{feff}x,y,z,intensity,red,green,blue\r\n{}", csv.replace('\n', "\r\n"))
                .into_bytes(),
        ),
        ("ascii.ply", ply(points, "ascii")),
        ("little.ply", ply(points, "binary_little_endian")),
        ("big.ply", ply(points, "binary_big_endian")),
        ("ascii.pcd", pcd(points, VIEWPOINT, "ascii")),
        ("binary.pcd", pcd(points, VIEWPOINT, "binary")),
        ("packed.pcd", pcd(points, VIEWPOINT, "binary_compressed")),
    ]
}

#[test]
fn a_cloud_is_the_same_in_all_formats() {
    let points = cloud(0x5e7);
    for (name, bytes) in every_format(&points) {
        let file = ScratchFile::new(name, &bytes);
        let reader = opened(&file.0).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(reader.masks()[0].n_points, Some(N as u64), "{name}");
        assert_eq!(reader.scans()[0].position, ScannerPosition::Unknown, "{name}");
        let scans = read_all(&*reader, Want::Everything, &settings()).expect("valid");
        let [scan] = &scans[..] else { panic!("{name}: not one scan") };
        assert_eq!(scan.place, (0..N as u64).collect::<Vec<_>>(), "{name}");
        let attributes = &scan.attributes;
        for (i, p) in points.iter().enumerate() {
            let off = (0..3).map(|k| (attributes.world[i][k] - f64::from(p.xyz[k])).abs());
            assert!(off.fold(0.0, f64::max) < 1e-6, "{name} {i}");
            assert_eq!(attributes.intensity[i], u16::from(p.intensity) * 257, "{name} {i}");
            assert_eq!(attributes.color[i], p.color.map(|v| u16::from(v) * 257), "{name} {i}");
        }
        let bare = read(&file.0, Want::Coordinates).expect("valid");
        assert_eq!(bare[0].xyz, scan.xyz, "{name}");
        partly(&*reader, name, &scan.attributes.world, &scan.xyz);
    }
}

/// Checks the ways to read a part of a cloud.
fn partly(reader: &dyn Reader, name: &str, world: &[[f64; 3]], xyz: &[[f32; 3]]) {
    let spread = reader.spread(0, 100, u64::MAX).expect("valid");
    let wanted: Vec<[f32; 3]> = xyz.iter().step_by(N / 100).copied().collect();
    assert_eq!(spread, wanted, "{name}");
    let sample = reader.sample(0, 600).expect("valid");
    assert_eq!(sample[..200], sample_at(xyz, (N as f64 * 0.45) as usize, 200), "{name}");
    let windows = WindowSample { n_windows: 7, n_points: 50 };
    for place in reader.window_starts(0, windows).into_iter().flatten() {
        let window = reader.window(place, 50).expect("valid");
        assert_eq!(window.points, world[place as usize..place as usize + 50], "{name}");
    }
}

fn sample_at(xyz: &[[f32; 3]], from: usize, n: usize) -> Vec<SampledPoint> {
    xyz[from..from + n].iter().map(|xyz| SampledPoint { xyz: *xyz, native: None }).collect()
}

#[test]
fn each_block_of_a_pts_file_is_a_scan() {
    let points = cloud(0xb10c);
    let (first, second) = points.split_at(N / 3);
    let block = |points: &[Written]| format!("{}\n{}", points.len(), text(points, " "));
    let whole = format!("{}{}0\n", block(first), block(second));
    let file = ScratchFile::new("blocks.pts", whole.as_bytes());
    let reader = opened(&file.0).expect("valid");
    let scans = read_all(&*reader, Want::Everything, &settings()).expect("valid");
    let n: Vec<usize> = scans.iter().map(|scan| scan.xyz.len()).collect();
    assert_eq!(n, [first.len(), second.len(), 0]);
    let alone = reader.read_scan(1).expect("text can be read by scan");
    let alone: Vec<[f32; 3]> = alone.flat_map(|strip| strip.expect("valid").xyz).collect();
    assert_eq!(alone, scans[1].xyz);
    let x = f64::from(second[7].xyz[0]);
    assert!((scans[1].attributes.world[7][0] - x).abs() < 1e-6);
}

#[test]
fn real_pts_files_are_read_in_full() {
    let Some(folder) = shared("ptx-pts") else { return };
    // CountedLines, and read with NumPy from the text.
    let read_as = [
        ("pdal__autzen.pts", 10, true, [636_110.300_003, 849_345.050_003, 512.139_999]),
        ("pdal__bunny_8.pts", 9, false, [-0.037_829, 0.127_94, 0.004_474]),
        ("pdal__test.pts", 19, true, [3.980_972, -2.006_119, -0.010_086]),
        ("tbx__simple_xyzrgb_pts.pts", 5, false, [0.0, 0.0, 0.0]),
    ];
    for (name, n, has_intensity, first) in read_as {
        let scans = read(&folder.join(name), Want::Everything);
        let scans = scans.unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((scans.len(), scans[0].xyz.len()), (1, n), "{name}");
        let notes = opened(&folder.join(name)).expect("valid").scans()[0].notes.join("; ");
        let is_longer = notes.contains("announces 8 points and holds 9: all are read");
        assert_eq!(is_longer, name.contains("bunny"), "{name}: {notes}");
        assert_eq!(scans[0].attributes.world[0], first, "{name}");
        assert_eq!(!scans[0].attributes.intensity.is_empty(), has_intensity, "{name}");
        assert_eq!(scans[0].attributes.color.is_empty(), name.contains("bunny"), "{name}");
    }
}

#[test]
fn a_viewpoint_is_the_scanner() {
    let points = cloud(0x71e);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let stated = format!("4.5 -3 1.6 {half} 0 0 {half}");
    for encoding in ["ascii", "binary", "binary_compressed"] {
        let name = format!("viewpoint-{encoding}.pcd");
        let file = ScratchFile::new(&name, &pcd(&points, &stated, encoding));
        let reader = opened(&file.0).expect("valid");
        let scan = &reader.scans()[0];
        assert_eq!(scan.position, ScannerPosition::Stated);
        let at: [f64; 3] = scan.world_from_scan.translation.vector.into();
        assert_eq!(at, [4.5, -3.0, 1.6]);
        let scans = read_all(&*reader, Want::Everything, &settings()).expect("valid");
        for (world, p) in scans[0].world.iter().zip(&points) {
            assert!((0..3).all(|k| (world[k] - f64::from(p.xyz[k])).abs() < 2e-6));
        }
    }
    for (viewpoint, what) in [
        ("1 2 3 0 0 0 0", "unit quaternion"),
        ("1 2 nan 1 0 0 0", "no number"),
        ("1 2 3", "seven numbers"),
    ] {
        let file = ScratchFile::new("wrong-viewpoint.pcd", &pcd(&points[..3], viewpoint, "binary"));
        let error = opened(&file.0).err().expect("refused").to_string();
        assert!(error.contains("VIEWPOINT") && error.contains(what), "{error}");
    }
}

#[test]
fn units_are_those_that_the_user_gives() {
    let points = cloud(0x111);
    let file = ScratchFile::new("mm.xyz", text(&points, " ").as_bytes());
    let settings = Settings { units: "mm".into(), ..settings() };
    let reader = open(&file.0, Format::Xyz, &settings).expect("valid");
    let scans = read_all(&*reader, Want::Everything, &settings).expect("valid");
    let x = f64::from(points[9].xyz[0]) * 1e-3;
    assert!((scans[0].attributes.world[9][0] - x).abs() < 1e-9);
}

#[test]
fn odd_points_are_dropped_and_keep_their_place() {
    let mut lines: Vec<String> = (0..1000).map(|i| format!("{i} {} 2.5\n", i % 7)).collect();
    for i in [3, 400, 401, 800] {
        lines[i] = "0 0 0\n".into();
    }
    lines[5] = "nan nan nan\n".into();
    lines[6] = "1e300 0 0\n".into();
    for i in 500..700 {
        lines[i] = "0 0 0\n".into();
    }
    let file = ScratchFile::new("odd.xyz", lines.concat().as_bytes());
    let reader = opened(&file.0).expect("valid");
    let scans = read_all(&*reader, Want::Everything, &settings()).expect("valid");
    assert_eq!(scans[0].place.len(), 1000 - 206);
    assert!(!scans[0].place.iter().any(|p| [3, 5, 6, 400, 500, 699, 800].contains(p)));
    let said = reader.oddities(0).map(|odd| odd.said("odd")).unwrap_or_default();
    assert!(said[0].contains("204 points"), "{said:?}");
}

#[test]
fn broken_files_are_refused_with_their_place() {
    let points = cloud(3);
    let short = text(&points[..5], " ");
    let pcd = |from: &str, to: &str| {
        let whole = pcd(&points[..5], VIEWPOINT, "binary");
        let n = whole.len() - 5 * 17;
        let header = String::from_utf8_lossy(&whole[..n]).replace(from, to);
        [header.as_bytes(), &whole[n..]].concat()
    };
    let ply = |from: &str, to: &str| {
        let whole = String::from_utf8(ply(&points[..5], "ascii")).expect("text");
        whole.replace(from, to).into_bytes()
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        (
            "n.pts",
            format!("9\n{short}").into(),
            "line 1: file announces \"9\" points here, but holds 5",
        ),
        (
            "n.pts",
            format!("99999999999999999999\n{short}").into(),
            "line 1: number of points is no count",
        ),
        ("w.xyz", format!("{short}1 2 three 4 5 6 7\n").into(), "line 6: not a number, \"three\""),
        (
            "c.xyz",
            format!("{short}1 2 3\n").into(),
            "line 6: line holds not 7 values as the first, but \"3\"",
        ),
        (
            "d.csv",
            "x;y;z\n1,5;2,5;3,0\n".into(),
            "not a number, \"1,5\"; numbers need a decimal point",
        ),
        ("l.xyz", format!("1 2 3\n{}\n", "4".repeat(5000)).into(), "line 2: line is longer"),
        (
            "n.pcd",
            pcd("POINTS 5", "POINTS 18446744073709551615"),
            "header: file is too short for the announced",
        ),
        ("n.pcd", pcd("POINTS 5", "POINTS 6"), "header: file is too short for the announced"),
        ("s.pcd", pcd("SIZE 4", "SIZE 3"), "field 'x' has an unknown type, \"F of 3 bytes\""),
        ("s.pcd", pcd("COUNT 1", "COUNT 99999999999"), "line 6: line does not hold one value"),
        ("s.pcd", pcd("COUNT 1", "COUNT 65000"), "a point is too long"),
        ("f.pcd", pcd("FIELDS x", "FIELDS u"), "FIELDS lacks x, y or z"),
        ("e.pcd", pcd("DATA binary", "DATA zip"), "line 11: DATA is not known, \"zip\""),
        ("h.pcd", b"VERSION 0.7\nFIELDS x y z\n".to_vec(), "line 2: header does not end"),
        ("n.ply", ply("vertex 5", "vertex 18446744073709551615"), "too short for the announced"),
        ("o.ply", ply("odd 2", "odd 99"), "too short for the announced"),
        ("p.ply", ply("property float y", "property list uchar float y"), "hold lists"),
        ("x.ply", ply("property float y", "property float u"), "lacks a property x, y or z"),
        ("t.ply", ply("float y", "half y"), "line 8: type is not known, \"half\""),
        ("e.ply", ply("element vertex", "element corner"), "no element \"vertex\""),
    ];
    for (name, bytes, wanted) in cases {
        let file = ScratchFile::new(name, &bytes);
        let error = read(&file.0, Want::Everything).err().unwrap_or_else(|| panic!("{name}: read"));
        let is_input = matches!(error.kind(), Kind::BadInput | Kind::Unsupported);
        assert!(is_input && error.to_string().contains(wanted), "{name}: {error}");
    }
}

#[test]
fn no_damage_panics_or_moves_other_points() {
    let points = cloud(5);
    let mut random = SplitMix64::seed_from_u64(0xda3a9e);
    let (mut n_refused, mut n_read) = (0, 0);
    for (name, whole) in every_format(&points[..300]) {
        for _ in 0..150 {
            let mut bytes = whole.clone();
            for _ in 0..=below(&mut random, 3) {
                let in_header = below(&mut random, 2) == 0;
                let at = below(&mut random, if in_header { 300 } else { bytes.len() });
                match below(&mut random, 4) {
                    0 => bytes[at] = random.next_u64() as u8,
                    1 => bytes.truncate(at.max(200)),
                    2 => bytes[at] = b"0123456789.- \n"[below(&mut random, 14)],
                    _ => drop(bytes.remove(at)),
                }
                if bytes.len() < 301 {
                    break;
                }
            }
            let file = ScratchFile::new(&format!("damaged-{name}"), &bytes);
            match read(&file.0, Want::Everything) {
                Ok(scans) => {
                    n_read += 1;
                    assert!(scans.iter().all(|s| s.xyz.iter().flatten().all(|v| v.is_finite())));
                }
                Err(error) => {
                    n_refused += 1;
                    assert!(!matches!(error.kind(), Kind::Bug | Kind::Io), "{name}: {error}");
                }
            }
        }
    }
    assert!(n_refused > 100 && n_read > 100, "{n_refused} {n_read}");
}

/// Processor time of this thread on Linux, seconds, whatever runs beside it.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    stat.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).expect("a number") / 1e9
}

/// A measurement, not a test: `cargo test --release -p ingest --lib -- --ignored --nocapture rate`.
#[test]
#[ignore = "a measurement"]
#[allow(clippy::print_stdout)] // it prints what it measures
fn rates_of_one_thread() {
    let points = cloud(8);
    let points: Vec<Written> = points.iter().cycle().take(2_000_000).copied().collect();
    for (name, bytes) in every_format(&points) {
        let file = ScratchFile::new(&format!("rate-{name}"), &bytes);
        let format = crate::format::detect(&file.0).expect("known");
        let start = processor_seconds();
        let reader = open(&file.0, format, &Settings::default()).expect("valid");
        let opened = processor_seconds() - start;
        let strips = crate::reader::strips(&*reader, Want::Everything).expect("valid");
        let n: usize = strips.map(|strip| strip.expect("valid").xyz.len()).sum();
        let all = processor_seconds() - start;
        println!(
            "{name}: {:.1} M points a second of processor time, opened in {opened:.3} s",
            n as f64 / all / 1e6
        );
    }
}
