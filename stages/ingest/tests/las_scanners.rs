//! LAS files written by the tests: how scanners apply to them, which points are dropped, and what
//! happens if the header is wrong.
#![allow(clippy::unwrap_used, clippy::print_stderr)] // tests may panic, and say what they skip

use contract::OneByOne;
use ingest::{
    Before, InputLooks, KeepLooks, KnownScanners, Settings, Sources, Want, open, open_known,
};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Point format 3 with `extra` bytes; each point is (x, y, z in millimetres, source id, withheld).
fn las(points: &[([i32; 3], u16, bool)], extra: usize) -> Vec<u8> {
    let record_len = 34 + extra;
    let mut header = las::raw::Header {
        version: las::Version::new(1, 2),
        header_size: 227,
        offset_to_point_data: 227,
        point_data_record_format: 3,
        point_data_record_length: record_len as u16,
        number_of_point_records: points.len() as u32,
        ..Default::default()
    };
    (header.x_scale_factor, header.y_scale_factor, header.z_scale_factor) = (0.001, 0.001, 0.001);
    header.x_offset = 1000.0;
    let of =
        |a: usize| points.iter().map(move |p| f64::from(p.0[a]) * 0.001 + [1000.0, 0.0, 0.0][a]);
    let (min, max) =
        (|a| of(a).fold(f64::INFINITY, f64::min), |a| of(a).fold(f64::NEG_INFINITY, f64::max));
    (header.min_x, header.min_y, header.min_z) = (min(0), min(1), min(2));
    (header.max_x, header.max_y, header.max_z) = (max(0), max(1), max(2));
    let mut bytes = Vec::new();
    header.write_to(&mut bytes).unwrap();
    assert_eq!(bytes.len(), 227);
    for (i, (xyz, id, withheld)) in points.iter().enumerate() {
        let mut record = vec![0; record_len];
        for a in 0..3 {
            record[4 * a..4 * a + 4].copy_from_slice(&xyz[a].to_le_bytes());
        }
        record[12..14].copy_from_slice(&(i as u16).to_le_bytes());
        record[15] = 5 | if *withheld { 0x80 } else { 0 };
        record[18..20].copy_from_slice(&id.to_le_bytes());
        record[20..28].copy_from_slice(&(i as f64).to_le_bytes());
        record[28..30].copy_from_slice(&7_u16.to_le_bytes());
        bytes.extend(record);
    }
    bytes
}

/// Points of three scanners in turn; every tenth is withheld.
fn mixed() -> Vec<([i32; 3], u16, bool)> {
    (0..5000_i32)
        .map(|i| ([i % 97 * 100, i % 89 * 100, i % 7 * 100], (i % 3) as u16, i % 10 == 0))
        .collect()
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn scanners(text: &str) -> KnownScanners {
    KnownScanners::parse(text).unwrap()
}

/// Number of points of each scan; checks world coordinates and that each place occurs once.
fn counts(sources: &Sources) -> Vec<usize> {
    let mut counts = vec![0; sources.scans.len()];
    for input in &sources.inputs {
        let mut places = Vec::new();
        for strip in sources.strips(input.id, Want::Everything).unwrap() {
            let strip = strip.unwrap();
            counts[strip.scan.0 as usize] += strip.len();
            places.extend(strip.place.iter().map(|p| strip.first_place + u64::from(*p)));
            let pose = sources.scans[strip.scan.0 as usize].world_from_scan;
            let attributes = strip.attributes.as_ref().unwrap();
            for (i, local) in strip.xyz.iter().enumerate() {
                let world = pose * nalgebra::Point3::from(local.map(f64::from));
                assert!((world - nalgebra::Point3::from(attributes.world[i])).norm() < 1e-5);
                let place = strip.first_place + u64::from(strip.place[i]);
                assert_eq!(u64::from(attributes.intensity[i]), place);
                assert_eq!(attributes.gps_time[i], place as f64);
                assert_eq!((attributes.classification[i], attributes.color[i]), (5, [7, 0, 0]));
            }
        }
        places.sort_unstable();
        assert!(places.windows(2).all(|w| w[0] < w[1]));
    }
    counts
}

#[test]
fn source_ids_go_to_their_scanners_and_the_rest_to_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "hall.las", &las(&mixed(), 3));
    let scanners = scanners(
        "[[scanner]]\npoint_source_id = 1\nname = 'one'\nposition = [1001, 2, 3]\nquaternion_wxyz = [0.5, 0.5, -0.5, 0.5]\n\
         [[scanner]]\npoint_source_id = 2\nposition = [1004, 5, 6]\n[[scanner]]\npoint_source_id = 9\nposition = [0, 0, 0]\n",
    );
    let settings = Settings { strip_points: 700, ..Settings::default() };
    let sources = open(&[path], Some(&scanners), &settings, &OneByOne).unwrap();
    let names: Vec<_> = sources.scans.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["one", "hall 2", "hall (rest)"]);
    assert!(
        sources.scans[0].has_beams()
            && sources.scans[1].has_beams()
            && !sources.scans[2].has_beams()
    );
    assert_eq!(sources.masks[0].n_points, Some(5000));
    let kept = |id: u16| mixed().iter().filter(|p| p.1 == id && !p.2).count();
    assert_eq!(counts(&sources), [kept(1), kept(2), kept(0)]);
}

/// Keeps what is learnt of one input.
#[derive(Default)]
struct OneKept(Mutex<Option<InputLooks>>);

impl KeepLooks for OneKept {
    fn known(&self, at: usize) -> Option<InputLooks> {
        assert_eq!(at, 0);
        self.0.lock().unwrap().clone()
    }

    fn keep(&self, _: usize, looks: &InputLooks) {
        let before = self.0.lock().unwrap().replace(looks.clone());
        assert!(before.is_none(), "what is known is not learnt again");
    }
}

#[test]
fn source_ids_are_read_once_by_all_that_share_what_they_learn() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "hall.las", &las(&mixed(), 0));
    let scanners = scanners(
        "[[scanner]]\npoint_source_id = 1\nposition = [1001, 2, 3]\n\
         [[scanner]]\npoint_source_id = 2\nposition = [1004, 5, 6]\n",
    );
    let (settings, kept) = (Settings::default(), OneKept::default());
    let names = || {
        let (paths, scanners) = (std::slice::from_ref(&path), Some(&scanners));
        let opened = open_known(Before::default(), paths, scanners, &settings, &kept, &OneByOne);
        opened.unwrap().scans.into_iter().map(|scan| scan.name).collect::<Vec<_>>()
    };
    let before = names();
    assert_eq!(before, ["hall 1", "hall 2", "hall (rest)"]);
    // Whoever reads the ids again finds others; that the file is the same is told by its digest.
    let others: Vec<_> = mixed().into_iter().map(|(xyz, _, held)| (xyz, 1, held)).collect();
    std::fs::write(&path, las(&others, 0)).unwrap();
    assert_eq!(names(), before);
    let opened = open(std::slice::from_ref(&path), Some(&scanners), &settings, &OneByOne).unwrap();
    assert_eq!(opened.scans.len(), 1);
}

#[test]
fn points_at_the_scanner_are_dropped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut points = mixed();
    // The scanner stands at 1004, 5, 6: every third point of its id is a beam without return.
    let mut n_none = 0;
    for (i, point) in points.iter_mut().enumerate().filter(|(_, p)| p.1 == 2) {
        if i % 9 == 2 {
            (point.0, n_none) =
                ([4000, 5000, 6000 + (i % 2) as i32], n_none + usize::from(!point.2));
        }
    }
    let path = write(folder.path(), "origin.las", &las(&points, 0));
    let scanners = scanners("[[scanner]]\npoint_source_id = 2\nposition = [1004, 5, 6]\n");
    let sources = open(&[path], Some(&scanners), &Settings::default(), &OneByOne).unwrap();
    let notes = &sources.scans[0].notes;
    assert!(
        notes.iter().any(|n| n.contains("points looked at lie at the scanner itself")),
        "{notes:?}"
    );
    let kept = |id: u16| points.iter().filter(|p| p.1 == id && !p.2).count();
    let all = counts(&sources);
    assert_eq!(all, [kept(2) - n_none, kept(0) + kept(1)]);
    let said = sources.oddities();
    assert_eq!(said.len(), 1);
    assert!(said[0].starts_with(&format!("scan 'origin 2': {n_none} points lie at")), "{said:?}");
}

#[test]
fn steps_too_coarse_for_any_robot_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let half = |p: &mut ([i32; 3], u16, bool)| p.0 = p.0.map(|v| v / 500 * 500);
    let mut points = mixed();
    points.iter_mut().for_each(half);
    let path = write(folder.path(), "coarse.las", &las(&points, 0));
    let sources = open(&[path], None, &Settings::default(), &OneByOne).unwrap();
    let notes = &sources.scans[0].notes;
    assert!(notes.iter().any(|n| n.contains("steps of 0.50 m")), "{notes:?}");
    let refusal = sources.check_steps().expect_err("it is refused").to_string();
    assert!(refusal.contains("coarse.las") && refusal.contains("steps of 0.50 m"), "{refusal}");
}

#[test]
fn entries_find_their_file_or_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = las(&mixed(), 0);
    let paths: Vec<_> =
        ["a.las", "b.las"].iter().map(|n| write(folder.path(), n, &bytes)).collect();
    let poses = scanners(
        "[[scanner]]\nname = 'b'\nposition = [1007, 0, 0]\n[[scanner]]\nname = 'c'\nposition = [1, 0, 0]\n",
    );
    let sources = open(&paths, Some(&poses), &Settings::default(), &OneByOne).unwrap();
    assert_eq!(sources.scans.len(), 2);
    assert!(!sources.scans[0].has_beams() && sources.scans[1].has_beams());
    assert_eq!(
        sources.scans[1].world_from_scan.translation.vector,
        nalgebra::Vector3::new(1007.0, 0.0, 0.0)
    );
    assert_eq!(
        sources.scans[0].world_from_scan.translation.vector,
        nalgebra::Vector3::new(1005.0, 4.0, 0.0)
    );
    assert!(
        sources.warnings.len() == 1 && sources.warnings[0].contains("scanner 2 (c)"),
        "{:?}",
        sources.warnings
    );

    let one = scanners("[[scanner]]\nposition = [1001, 0, 0]\n");
    let sources = open(&paths[..1], Some(&one), &Settings::default(), &OneByOne).unwrap();
    assert!(
        sources.warnings.is_empty() && sources.scans.len() == 1 && sources.scans[0].has_beams()
    );

    let far = scanners("[[scanner]]\nposition = [50000000, 0, 0]\n");
    let error =
        open(&paths[..1], Some(&far), &Settings::default(), &OneByOne).err().unwrap().to_string();
    assert!(error.contains("a.las") && error.contains("same frame"), "{error}");
}

#[test]
fn lies_of_a_header_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let good = las(&mixed(), 0);
    // Offset into the header, bytes to write there, words of the error.
    let cases: &[(usize, &[u8], &str)] = &[
        (107, &u32::MAX.to_le_bytes(), "only 5000 points"),
        (105, &20_u16.to_le_bytes(), "records of point format 3 need 34"),
        (104, &[11], "point format"),
        (104, &[3 | 0x80], "LASzip record is missing"),
        (24, &[1, 7], "LAS of version \"1.7\""),
        (96, &u32::MAX.to_le_bytes(), "outside the file"),
        (94, &12_u16.to_le_bytes(), "a header of version 1.2 has 227"),
        (131, &0_f64.to_le_bytes(), "scale of x"),
        (139, &f64::NAN.to_le_bytes(), "scale of y"),
        (155, &f64::INFINITY.to_le_bytes(), "offset of x"),
    ];
    for (at, bytes, words) in cases {
        let mut bad = good.clone();
        bad[*at..at + bytes.len()].copy_from_slice(bytes);
        let path = write(folder.path(), "bad.las", &bad);
        let error =
            open(&[path], None, &Settings::default(), &OneByOne).err().expect(words).to_string();
        assert!(error.contains("bad.las") && error.contains(words), "{error}");
    }
}

#[test]
fn what_is_no_scan_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let settings = Settings::default();
    for (name, bytes, words) in [
        ("empty.las", &b""[..], "empty"),
        ("x.ply", b"ply\nformat ascii 1.0\n", "header does not end"),
        ("x.pcd", b"nonsense", "the name ends in \"pcd\""),
        ("notes.txt", b"scanned on Monday\n", "does not begin with points"),
        ("x.las", b"nonsense", "the name ends in \"las\""),
        ("x.zip", b"PK\x03\x04", "archive"),
        ("x.rcp", b"\x00\x01", "ReCap"),
    ] {
        let path = write(folder.path(), name, bytes);
        let error = open(&[path], None, &settings, &OneByOne).err().expect(name).to_string();
        assert!(error.contains(name) && error.contains(words), "{error}");
    }
    let error =
        open(&[folder.path().to_owned()], None, &settings, &OneByOne).err().unwrap().to_string();
    assert!(error.contains("folder"), "{error}");
    assert!(open(&[folder.path().join("missing.las")], None, &settings, &OneByOne).is_err());
    assert!(open(&[], None, &settings, &OneByOne).is_err());
}

/// A measurement, not a test: `cargo test --release -p ingest --test las_scanners -- --ignored
/// --nocapture`.
#[test]
#[ignore = "a measurement"]
fn throughput() {
    let folder = tempfile::tempdir().unwrap();
    let points: Vec<_> = (0..10_000_000_i32)
        .map(|i| ([i % 9973 * 10, i % 8887 * 10, i % 701 * 10], 1, false))
        .collect();
    let path = write(folder.path(), "big.las", &las(&points, 0));
    for text in
        ["", "[[scanner]]\nposition = [1001, 2, 3]\nquaternion_wxyz = [0.5, 0.5, -0.5, 0.5]\n"]
    {
        let poses = (!text.is_empty()).then(|| scanners(text));
        let sources =
            open(std::slice::from_ref(&path), poses.as_ref(), &Settings::default(), &OneByOne)
                .unwrap();
        for want in [Want::Coordinates, Want::Everything] {
            let start = std::time::Instant::now();
            let n: usize =
                sources.strips(sources.inputs[0].id, want).unwrap().map(|s| s.unwrap().len()).sum();
            eprintln!(
                "{want:?}: {:.1} M points a second",
                n as f64 / start.elapsed().as_secs_f64() / 1e6
            );
        }
    }
}
