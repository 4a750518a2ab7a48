//! Small clouds in every point format, as seeds.

use super::Seeds;
use crate::clouds::e57_parts;
use contract::{Label, PointKind};
use export::{E57Scans, GridPoint, GridScan, LasSettings, LasWriter, PointColumns};
use geometry::Pose;
use las::{Builder, Color, Point, Writer, point::Format};
use std::io::Cursor;
use std::path::Path;

/// Points of a cloud: more than one strip of three, and few enough to be mutated.
const N: usize = 12;

pub(super) fn put(seeds: &Seeds, scratch: &Path) {
    for format in 0..=10 {
        for compressed in [false, true] {
            // Waveform packets are never compressed.
            if compressed && matches!(format, 4 | 5 | 9 | 10) {
                continue;
            }
            let target = if compressed { "laz" } else { "las" };
            for extra in [0, 3] {
                if let Some(bytes) = las(format, compressed, extra) {
                    seeds.put(target, &format!("format-{format}-extra-{extra}"), bytes);
                }
            }
        }
    }
    let gridded = e57(&scratch.join("grid.e57"), 2);
    seeds.put("e57", "grid", e57_parts(&gridded));
    seeds.put("e57", "spherical", spherical(&e57_parts(&gridded)));
    seeds.put("e57", "one", e57_parts(&e57(&scratch.join("one.e57"), 1)));
    seeds.put("e57", "none", e57_parts(&e57(&scratch.join("none.e57"), 0)));
    let ptx = |columns: &str| {
        let line = |i: usize| format!("{} {} 0.5{columns}\n", i % 3, i / 3);
        let pose = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        format!("2\n3\n{pose}{}", (0..6).map(line).collect::<String>())
    };
    let all = [ptx(""), ptx(" 0.5"), ptx(" 1 2 3"), ptx(" 0.5 1 2 3")];
    seeds.put("ptx", "two", all.concat());
    seeds.put("ptx", "gap", ptx(" 0.5").replace("1 0 0.5 0.5", "0 0 0 0.5"));
    seeds.put_all("ptx", all);
    lists(seeds);
}

/// Lists of points: text, PLY and PCD.
fn lists(seeds: &Seeds) {
    let lines = |between: &str| -> String {
        (0..6)
            .map(|i| [i % 3, i / 3, 2, 9, 50, 60, 70].map(|v| v.to_string()).join(between) + "\n")
            .collect()
    };
    let spaced = lines(" ");
    seeds.put("cloud", "pts", format!("6\n{spaced}6\n{spaced}"));
    seeds.put("cloud", "csv", format!("x,y,z,intensity,red,green,blue\n{}", lines(",")));
    seeds.put("cloud", "named", format!("//X;Y;Z;I;R;G;B\n{}", lines(";")));
    let floats: Vec<u8> = (0..18_u8).flat_map(|i| f32::from(i % 5).to_le_bytes()).collect();
    let ply = |encoding: &str| {
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        format!("ply\nformat {encoding} 1.0\nelement vertex 6\n{xyz}end_header\n")
    };
    seeds.put("cloud", "ply-ascii", format!("{}{}", ply("ascii"), "1 2 3\n".repeat(6)));
    seeds.put("cloud", "ply", [ply("binary_little_endian").into_bytes(), floats.clone()].concat());
    seeds.put("cloud", "ply-big", [ply("binary_big_endian").into_bytes(), floats.clone()].concat());
    let pcd = |encoding: &str| {
        format!(
            "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 6\nHEIGHT 1\n\
             VIEWPOINT 1 2 3 1 0 0 0\nPOINTS 6\nDATA {encoding}\n"
        )
    };
    seeds.put("cloud", "pcd-ascii", format!("{}{}", pcd("ascii"), "1 2 3\n".repeat(6)));
    seeds.put("cloud", "pcd", [pcd("binary").into_bytes(), floats.clone()].concat());
    // Literals only: each is at most 32 bytes long.
    let packed: Vec<u8> =
        floats.chunks(32).flat_map(|c| [&[c.len() as u8 - 1][..], c].concat()).collect();
    let sizes = [packed.len() as u32, floats.len() as u32].map(u32::to_le_bytes).concat();
    seeds.put(
        "cloud",
        "pcd-packed",
        [pcd("binary_compressed").into_bytes(), sizes, packed].concat(),
    );
}

fn las(format: u8, compressed: bool, extra: u16) -> Option<Vec<u8>> {
    let mut builder = Builder::from((1, 4));
    builder.point_format = Format::new(format).ok()?;
    builder.point_format.is_compressed = compressed;
    builder.point_format.extra_bytes = extra;
    let kind = builder.point_format;
    let header = builder.into_header().ok()?;
    let mut writer = Writer::new(Cursor::new(Vec::new()), header).ok()?;
    for i in 0..N {
        let at = i as f64;
        let point = Point {
            x: at,
            y: 0.5 * at,
            z: 1.0,
            intensity: 100 * i as u16,
            point_source_id: 1 + (i % 2) as u16,
            gps_time: kind.has_gps_time.then_some(at),
            color: kind.has_color.then(|| Color::new(1, 2, 3)),
            nir: kind.has_nir.then_some(9),
            waveform: kind.has_waveform.then(Default::default),
            extra_bytes: vec![7; usize::from(extra)],
            ..Point::default()
        };
        writer.write_point(point).ok()?;
    }
    writer.close().ok()?;
    Some(writer.into_inner().ok()?.into_inner())
}

fn e57(path: &Path, n_scans: usize) -> Vec<u8> {
    let mut file = E57Scans::create(path).expect("an E57 file can be made");
    for i in 0..n_scans {
        let scan = GridScan {
            name: format!("scan {i}"),
            world_from_scan: Pose::translation(i as f64, 0.0, 1.0),
            n_rows: 3,
            n_cols: 4,
        };
        let points = (0..N as u32).map(|k| {
            let xyz = (k % 5 != 4).then(|| [1.0 + k as f32, 0.3 * (k % 3) as f32, 0.2]);
            Ok(GridPoint { xyz, row: k % 3, col: k / 3, intensity: 9 })
        });
        file.add(&scan, points).expect("a scan can be added");
    }
    file.finish().expect("an E57 file can be ended");
    std::fs::read(path).expect("the file")
}

/// The same description with spherical coordinates.
fn spherical(parts: &[u8]) -> Vec<u8> {
    let at = parts.windows(5).position(|w| w == b"<?xml").expect("a description");
    let text = String::from_utf8(parts[at..].to_vec()).expect("text");
    let names = [
        ("cartesianX", "sphericalRange"),
        ("cartesianY", "sphericalAzimuth"),
        ("cartesianZ", "sphericalElevation"),
        ("cartesianInvalidState", "sphericalInvalidState"),
    ];
    let text = names.iter().fold(text, |text, (from, to)| text.replace(from, to));
    [&parts[..at], text.as_bytes()].concat()
}

/// A tile with links and floor.
pub(super) fn write_tile(path: &Path, las: &LasSettings) {
    let world: Vec<[f64; 3]> = (0..N).map(|i| [i as f64, 0.5, 0.1]).collect();
    let label = |i: usize| match i % 2 {
        0 => Label::FLOOR,
        _ => Label { kind: PointKind::Link, robot: 0, link: 2 },
    };
    let labels: Vec<Label> = (0..N).map(label).collect();
    let columns = PointColumns {
        world: &world,
        labels: &labels,
        intensity: &[5; N],
        color: &[],
        gps_time: &[],
        body: &[],
        source_id: &[],
        scan: 1,
    };
    let mut writer = LasWriter::create(path, las.clone()).expect("a tile can be made");
    writer.push(&columns).expect("a tile takes points");
    writer.finish().expect("a tile can be ended");
}
