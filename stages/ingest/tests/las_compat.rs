//! Every LAS and LAZ file of public test suites is read in full, with the count and bounds that
//! laspy 2.7 gives, or refused by name. The files are not part of the repository; without them
//! these tests report that they were skipped.
#![allow(clippy::unwrap_used, clippy::print_stderr)] // tests may panic, and say what they skip

use contract::OneByOne;
use ingest::{Settings, Sources, Want, open};
use std::path::{Path, PathBuf};

/// File, number of records, number of withheld records, smallest and largest coordinates.
type Row = (&'static str, u64, u64, [f64; 3], [f64; 3]);

#[rustfmt::skip]
const VALID: &[Row] = &[
    ("lgl__extrabytes.laz", 1065, 0, [635619.85, 848899.7, 406.59], [638982.55, 853535.43, 586.38]),
    ("lgl__pdrf10-1.4.las", 1024, 483, [-2141890547.0, -2147415624.0, -2147101580.0], [2146619417.0, 2139249378.0, 2146599318.0]),
    ("lgl__pdrf10-1.4.laz", 1024, 483, [-2141890547.0, -2147415624.0, -2147101580.0], [2146619417.0, 2139249378.0, 2146599318.0]),
    ("lgl__pdrf4-1.3.las", 1024, 0, [-70.0, -22.53, -10.0], [103.91, 90.0, 12.08]),
    ("lgl__pdrf4-1.3.laz", 1024, 0, [-70.0, -22.53, -10.0], [103.91, 90.0, 12.08]),
    ("lgl__pdrf5-1.3.las", 1024, 0, [-70.0, -22.53, -10.0], [103.91, 90.0, 12.08]),
    ("lgl__pdrf5-1.3.laz", 1024, 0, [-70.0, -22.53, -10.0], [103.91, 90.0, 12.08]),
    ("lgl__pdrf6-1.4.las", 1024, 494, [-2141972467.0, -2147415560.0, -2147167116.0], [2131726195.0, 2139347682.0, 2146599318.0]),
    ("lgl__pdrf6-1.4.laz", 1024, 494, [-2141972467.0, -2147415560.0, -2147167116.0], [2131726195.0, 2139347682.0, 2146599318.0]),
    ("lgl__pdrf8-1.4.las", 1024, 483, [-2141890547.0, -2147415624.0, -2147101580.0], [2146619417.0, 2139249378.0, 2146599318.0]),
    ("lgl__pdrf8-1.4.laz", 1024, 483, [-2141890547.0, -2147415624.0, -2147101580.0], [2146619417.0, 2139249378.0, 2146599318.0]),
    ("lgl__points-1.4.las", 3, 0, [0.0, 0.0, 0.0], [2.0, 1.0, 0.5]),
    ("ll__certainty3d-color-utm-feet-navd88.las", 10126, 0, [6326726.5361, 2068062.3854, 2700.5304], [6330162.9511, 2071932.2402, 2975.7119]),
    ("lpy__1_4_w_evlr.las", 1000, 0, [1694038.4456, 1816492.7063, 5592.7499], [1694539.677, 1816497.9763, 5599.0697]),
    ("lpy__1_4_w_evlr.laz", 1000, 0, [1694038.4456, 1816492.7063, 5592.7499], [1694539.677, 1816497.9763, 5599.0697]),
    ("lpy__append-bug.laz", 37805, 0, [698000.0, 6259242.79, 11.72], [699000.0, 6260000.0, 266.03]),
    ("lpy__extrabytes.las", 1065, 0, [635619.85, 848899.7, 406.59], [638982.55, 853535.43, 586.38]),
    ("lpy__file_with_both_wkt_and_geotiff_vlrs.las", 25408, 0, [2445180.0, 604300.0, 1352.7], [2445239.99, 604339.98, 1403.96]),
    ("lpy__fullwave.laz", 10750, 0, [194267.419, 8249096.014, 989.944], [194318.295, 8249137.34, 1003.704]),
    ("lpy__plane.laz", 28185, 0, [1423214.52, 4189096.63, 67.86], [1423216.76, 4189098.6, 67.9]),
    ("lpy__simple.copc.laz", 1065, 0, [635619.85, 848899.7, 406.59], [638982.55, 853535.43, 586.38]),
    ("lpy__simple1_1.las", 1065, 0, [635619.85, 848899.7, 406.59], [638982.55, 853535.43, 586.38]),
    ("lpy__simple1_3.las", 999, 0, [-235434.519, 5800843.145, 265.094], [-234935.841, 5800946.249, 273.811]),
    ("lpy__simple1_4.las", 22600, 0, [1.0, 1.0, 44.0], [226.0, 100.0, 254.0]),
    ("lpy__test1_4.las", 1000, 0, [1694038.4456, 1816492.7063, 5592.7499], [1694539.677, 1816497.9763, 5599.0697]),
    ("lpy__unregistered_extra_bytes.las", 4, 0, [1.0, 1.0, 1.0], [4.0, 4.0, 4.0]),
    ("lrs__32-1-472-150-76.laz", 5658, 0, [326400.01, 6724172.52, -0.37], [327199.99, 6724199.99, 202.74]),
    ("lrs__autzen.laz", 106, 0, [635616.31, 848977.79, 407.35], [638864.6, 853362.37, 536.84]),
    ("lz__5points_14.las", 5, 0, [630498.56, 4834748.73, 62.15], [630499.95, 4834749.66, 63.68]),
    ("pas__10_points_format_0.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_0.laz", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_1.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_1.laz", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_2.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_2.laz", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_3.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_3.laz", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_4.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_4.laz", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_5.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_5.laz", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_6.las", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_6.laz", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_7.las", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_7.laz", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_8.las", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_format_8.laz", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_with_extra_bytes_format_0.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_with_extra_bytes_format_10.las", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_with_extra_bytes_format_3.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_with_extra_bytes_format_4.las", 10, 0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_with_extra_bytes_format_6.las", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pas__10_points_with_extra_bytes_format_7.las", 10, 4, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0]),
    ("pdal__1.0_0.las", 1, 0, [470692.44, 4602888.9, 16.0], [470692.44, 4602888.9, 16.0]),
    ("pdal__1.0_1.las", 1, 0, [470692.44, 4602888.9, 16.0], [470692.44, 4602888.9, 16.0]),
    ("pdal__1.1_0.las", 1, 0, [470692.44, 4602888.9, 16.0], [470692.44, 4602888.9, 16.0]),
    ("pdal__1.2-empty-geotiff-vlrs.las", 43, 0, [-25.7918, -15.9695, -13.1125], [211.0853, 81.4608, 3.2833]),
    ("pdal__1.2-with-color.las", 1065, 0, [635619.85, 848899.7, 406.59], [638982.55, 853535.43, 586.38]),
    ("pdal__1.2_2.las", 1, 0, [470692.44, 4602888.9, 16.0], [470692.44, 4602888.9, 16.0]),
    ("pdal__1.2_3.las", 1, 0, [470692.44, 4602888.9, 16.0], [470692.44, 4602888.9, 16.0]),
    ("pdal__extrabytes.las", 1065, 0, [635619.85, 848899.7, 406.59], [638982.55, 853535.43, 586.38]),
    ("pdal__gps-time-nan.las", 1, 0, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ("pdal__hextest.las", 8, 0, [0.0, 0.0, 0.0], [2.0, 2.31, 0.0]),
    ("pdal__lots_of_vlr.las", 1, 0, [715001.346, 839349.171, 17.275], [715001.346, 839349.171, 17.275]),
    ("pdal__no-points.las", 0, 0, [0.0; 3], [0.0; 3]),
    ("pdal__noise-dirty.las", 1065, 0, [635619.85, 848899.7, 406.59], [638982.55, 853535.43, 586.38]),
    ("pdal__simple.laz", 1065, 0, [635619.85, 848899.7, 406.59], [638982.55, 853535.43, 586.38]),
    ("pdal__spurious.las", 1065, 0, [-124.0687, 44.05, 123.93], [-123.0625, 44.0625, 178.73]),
    ("tbx__rgb_magnitude_127.las", 4, 0, [0.0, 0.0, 0.0], [3.0, 0.0, 0.0]),
    ("tbx__scale_offset_las.las", 5, 0, [0.0, 0.0, 0.0], [2.0, 3.0, 4.0]),
    ("tbx__scale_offset_laz.laz", 5, 0, [0.0, 0.0, 0.0], [2.0, 3.0, 4.0]),
];

/// A file of one stream, written by LASzip 1.2, which laspy cannot read. Its uncompressed twin has
/// 1065 points.
const OLD_STREAM: Row = (
    "pdal__simple-laszip-compressor-version-1.2r0.laz",
    1065,
    0,
    [635_619.85, 848_899.7, 406.59],
    [638_982.55, 853_535.43, 586.38],
);

/// Files in which all points lie farther apart than any scanner reaches, so that none would be
/// left.
const ABSURD: [&str; 6] = [
    "lgl__pdrf10-1.4.las",
    "lgl__pdrf10-1.4.laz",
    "lgl__pdrf6-1.4.las",
    "lgl__pdrf6-1.4.laz",
    "lgl__pdrf8-1.4.las",
    "lgl__pdrf8-1.4.laz",
];

/// Files that are refused, and words of the error.
const BROKEN: &[(&str, &str)] = &[
    ("lz__broken_compressor.laz", "compressor type \"16\""),
    ("lz__broken_type.laz", "compression is not known"),
];

fn folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scans/las-compat");
    if !folder.is_dir() {
        eprintln!("skipped: no folder of compatibility files");
        return None;
    }
    Some(folder)
}

struct Read {
    n_points: u64,
    /// One past the largest place.
    end: u64,
    min: [f64; 3],
    max: [f64; 3],
}

fn read(sources: &Sources) -> contract::Result<Read> {
    let mut read =
        Read { n_points: 0, end: 0, min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };
    for input in &sources.inputs {
        for strip in sources.strips(input.id, Want::Everything)? {
            let strip = strip?;
            let attributes = strip.attributes.as_ref().expect("asked for");
            assert_eq!(attributes.world.len(), strip.len());
            assert_eq!(strip.place.len(), strip.len());
            assert!(strip.place.is_sorted());
            let first = strip.first_place + u64::from(strip.place[0]);
            assert!(first >= read.end || sources.scans.len() > 1, "places go forward");
            read.end = strip.first_place + u64::from(strip.place[strip.len() - 1]) + 1;
            read.n_points += strip.len() as u64;
            let pose = sources.scans[strip.scan.0 as usize].world_from_scan;
            for (world, local) in attributes.world.iter().zip(&strip.xyz) {
                let back = pose * nalgebra::Point3::from(local.map(f64::from));
                for a in 0..3 {
                    let slack =
                        1e-3 + local.iter().fold(0.0_f32, |m, v| m.max(v.abs())) as f64 * 2e-7;
                    assert!((back[a] - world[a]).abs() < slack, "{back} {world:?}");
                    read.min[a] = read.min[a].min(world[a]);
                    read.max[a] = read.max[a].max(world[a]);
                }
            }
        }
    }
    Ok(read)
}

#[test]
fn valid_files_are_read_in_full() {
    let Some(folder) = folder() else { return };
    // Plain numbers, whatever their unit: units are tested in `las_units.rs`.
    let settings = Settings { units: "m".into(), ..Settings::default() };
    for (name, n, withheld, min, max) in VALID.iter().chain([&OLD_STREAM]) {
        if ABSURD.contains(name) {
            let error = open(&[folder.join(name)], None, &settings, &OneByOne).err().expect(name);
            assert!(error.to_string().contains("lies within 100 km"), "{error}");
            continue;
        }
        let sources = open(&[folder.join(name)], None, &settings, &OneByOne)
            .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(sources.masks.len(), 1, "{name}");
        assert_eq!(sources.masks[0].n_points, Some(*n), "{name}");
        assert_eq!(sources.scans.len(), 1, "{name}");
        assert!(!sources.scans[0].has_beams() && !sources.scans[0].notes.is_empty(), "{name}");
        let read = read(&sources).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(read.n_points, n - withheld, "{name}");
        if *withheld > 0 || *n == 0 {
            continue;
        }
        for a in 0..3 {
            assert!((read.min[a] - min[a]).abs() < 1e-3, "{name}: {:?} {min:?}", read.min);
            assert!((read.max[a] - max[a]).abs() < 1e-3, "{name}: {:?} {max:?}", read.max);
        }
    }
}

#[test]
fn no_file_is_forgotten() {
    let Some(folder) = folder() else { return };
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let known = VALID.iter().chain([&OLD_STREAM]).any(|r| r.0 == name)
            || BROKEN.iter().any(|r| r.0 == name);
        assert!(known || !(name.ends_with(".las") || name.ends_with(".laz")), "{name}");
    }
}

#[test]
fn broken_files_are_refused_by_name() {
    let Some(folder) = folder() else { return };
    for (name, words) in BROKEN {
        let error = open(&[folder.join(name)], None, &Settings::default(), &OneByOne)
            .err()
            .expect(name)
            .to_string();
        assert!(error.contains(name) && error.contains(words), "{error}");
    }
}

/// Reads a damaged copy completely. Whether it ends with an error or a result does not matter, but
/// it must not panic or use more memory than the file can hold.
fn survives(path: &Path) -> bool {
    match open(&[path.to_owned()], None, &Settings::default(), &OneByOne) {
        Err(_) => false,
        Ok(sources) => sources
            .strips(sources.inputs[0].id, Want::Everything)
            .is_ok_and(|mut s| s.all(|s| s.is_ok())),
    }
}

#[test]
fn damage_is_an_error_or_harmless() {
    let Some(folder) = folder() else { return };
    let place = tempfile::tempdir().unwrap();
    let damaged = place.path().join("damaged");
    // The LAZ decoder panics on some damage, which is caught; its messages must not appear in the
    // output.
    std::panic::set_hook(Box::new(|_| {}));
    let mut bad = None;
    for name in [
        "pas__10_points_format_3.las",
        "pas__10_points_format_7.laz",
        "pas__10_points_format_1.laz",
        "lrs__autzen.laz",
        "lz__5points_14.las",
        "tbx__scale_offset_laz.laz",
        "lpy__simple.copc.laz",
        "pdal__simple.laz",
    ] {
        let good = std::fs::read(folder.join(name)).unwrap();
        let step = (good.len() / 24).max(1);
        // Setting up the decoder of layered points takes milliseconds, and this file has many
        // pieces.
        let dense = if name.contains("copc") { 61 } else { 7 };
        for at in (0..good.len().min(500)).step_by(dense).chain((0..good.len()).step_by(step)) {
            let mut flipped = good.clone();
            flipped[at] ^= 1 << (at % 8);
            std::fs::write(&damaged, &flipped).unwrap();
            let run = std::panic::catch_unwind(|| survives(&damaged));
            bad = bad.or(run.is_err().then(|| format!("{name}: byte {at} flipped")));
        }
        for len in (0..good.len()).step_by(step) {
            std::fs::write(&damaged, &good[..len]).unwrap();
            let run = std::panic::catch_unwind(|| survives(&damaged));
            let silent = matches!(run, Ok(true)) && len + 8 < good.len() && name.ends_with(".las");
            bad = bad.or((run.is_err() || silent).then(|| format!("{name}: cut to {len} bytes")));
        }
    }
    let _ = std::panic::take_hook();
    assert_eq!(bad, None);
}
