//! E57 files whose points are odd: beams without return at the origin, intensities outside their
//! limits, coarse coordinates.

use super::own_tests::{Own, record, write};
use super::tests::{read, settings};
use super::*;
use crate::oddities::Oddities;
use ::e57::{
    Quaternion, RawValues, Record, RecordDataType, RecordName, RecordValue, Transform, Translation,
};

/// A scan of single-precision points with an intensity of 0 to 4095 and no invalid flags.
fn singles(points: impl Iterator<Item = [f32; 3]>) -> Own {
    let prototype = vec![
        Record::CARTESIAN_X_F32,
        Record::CARTESIAN_Y_F32,
        Record::CARTESIAN_Z_F32,
        record(RecordName::Intensity, RecordDataType::Integer { min: 0, max: 4095 }),
    ];
    let values = |(n, p): (usize, [f32; 3])| -> RawValues {
        let xyz = p.map(RecordValue::Single);
        // `write` states limits of 0 to 2000, so one value in five hundred lies outside.
        let level = if n % 500 == 17 { 4000 } else { n as i64 % 2000 };
        xyz.into_iter().chain([RecordValue::Integer(level)]).collect()
    };
    Own { prototype, points: points.enumerate().map(values).collect(), transform: None }
}

/// A bumpy wall; three of four beams have no return.
fn with_no_returns(n: usize) -> impl Iterator<Item = [f32; 3]> {
    (0..n).map(|k| {
        let t = k as f32;
        if k % 4 == 1 { [4.0 + (t * 0.1).sin(), t * 1e-3, 0.5] } else { [0.0; 3] }
    })
}

fn posed() -> Option<Transform> {
    let rotation = Quaternion { w: 1.0, x: 0.0, y: 0.0, z: 0.0 };
    Some(Transform { rotation, translation: Translation { x: 10.0, y: 20.0, z: 1.5 } })
}

#[test]
fn returns_at_the_scanner_are_no_returns_and_keep_their_places() {
    let known = Own { transform: posed(), ..singles(with_no_returns(8000)) };
    // Without pose, rows and columns the scanner is unknown; the origin is no point of the room
    // all the same.
    let unknown = singles(with_no_returns(8000));
    let file = write("origin.e57", vec![known, unknown], |xml| xml);
    let reader = open(&file.0, &settings()).expect("valid");
    for (scan, is_known) in [(0, true), (1, false)] {
        let seed = &reader.scans()[scan];
        assert_eq!(seed.scanner_known, is_known);
        let said = seed.notes.iter().any(|n| n.starts_with("6000 of 8000 points looked at lie at"));
        assert!(said, "{:?}", seed.notes);
        assert_eq!(reader.masks()[scan].n_points, Some(8000));
    }
    let sample = reader.sample(0, 8000).expect("valid");
    assert!(sample.len() == 2000 && sample.iter().all(|s| s.xyz[0] > 2.0));
    for want in [Want::Coordinates, Want::Everything] {
        for scan in read(&file.0, want).expect("valid") {
            assert_eq!((scan.xyz.len(), scan.n_places), (2000, 8000));
            assert!(scan.place.iter().all(|place| place % 4 == 1));
        }
    }
}

#[test]
fn one_point_at_the_origin_of_a_cloud_without_scanner_stays() {
    let point = |k: usize| if k == 700 { [0.0; 3] } else { [k as f32 * 1e-3 - 0.7, 1.0, 2.0] };
    let file = write("one.e57", vec![singles((0..3000).map(point))], |xml| xml);
    let scans = read(&file.0, Want::Everything).expect("valid");
    assert_eq!(scans[0].xyz.len(), 3000);
}

#[test]
fn what_is_dropped_and_cut_is_counted() {
    let file = write(
        "counted.e57",
        vec![Own { transform: posed(), ..singles(with_no_returns(8000)) }],
        |xml| xml,
    );
    let reader = open(&file.0, &settings()).expect("valid");
    // The file is read twice; the counts must not add up.
    for _ in 0..2 {
        crate::reader::strips(&*reader, Want::Everything)
            .expect("opens")
            .for_each(|s| assert!(s.is_ok()));
        let said = reader.oddities(0).map(|odd: &Oddities| odd.said("one")).unwrap_or_default();
        assert!(
            said[0].starts_with("scan 'one': 6000 points lie at the scanner itself"),
            "{said:?}"
        );
        // Points 17, 1017, … of those whose number is one more than a multiple of four.
        let n_cut = (0..8000).filter(|k| k % 500 == 17 && k % 4 == 1).count();
        assert!(said[1].starts_with(&format!("scan 'one': {n_cut} intensities")), "{said:?}");
    }
}

#[test]
fn steps_of_single_precision_at_map_offsets_are_said() {
    let far = with_no_returns(8000).map(|p| [412_300.0 + p[0], 5_653_120.0 + 300.0 * p[1], p[2]]);
    // The same points with noise, so that they lie on no raster.
    let rough = |v: f32| v + 0.01 * (977.0 * v).sin();
    let fine = with_no_returns(8000).map(|p| if p == [0.0; 3] { p } else { p.map(rough) });
    let file = write("steps.e57", vec![singles(far), singles(fine)], |xml| xml);
    let reader = open(&file.0, &settings()).expect("valid");
    assert_eq!(reader.scans()[0].step, Some(0.5));
    let said = |n: &String| n.starts_with("coordinates come in steps of 0.50 m");
    assert!(reader.scans()[0].notes.iter().any(said), "{:?}", reader.scans()[0].notes);
    assert_eq!(reader.scans()[1].step, None);
}

#[test]
fn a_shared_case_has_a_quarter_of_its_points() {
    let case = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/cases/e57-returns-at-origin/phantom.e57");
    if !case.is_file() {
        crate::check::skipped("e57-returns-at-origin");
        return;
    }
    let scans = read(&case, Want::Everything).expect("valid");
    assert_eq!((scans[0].xyz.len(), scans[0].n_places), (2400, 9600));
}
