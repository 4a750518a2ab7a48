//! E57 files written by the tests, whole and damaged.

use super::tests::{read, settings};
use super::*;
use crate::check::{ScratchFile, below, shared};
use ::e57::{
    E57Writer, IntensityLimits, Quaternion, RawValues, Record, RecordDataType, RecordName,
    RecordValue, Transform, Translation,
};
use rand::SeedableRng;
use rand_xoshiro::SplitMix64;

/// Fields and points of a scan to write.
pub(super) struct Own {
    pub(super) prototype: Vec<Record>,
    pub(super) points: Vec<RawValues>,
    pub(super) transform: Option<Transform>,
}

pub(super) fn record(name: RecordName, data_type: RecordDataType) -> Record {
    Record { name, data_type }
}

/// A structured scan with scaled integers of 21 bits, doubles and singles mixed, invalid flags,
/// intensity, colour and odd bit widths.
fn own(n_points: usize) -> Own {
    let scaled =
        RecordDataType::ScaledInteger { min: -1_000_000, max: 1_000_000, scale: 1e-4, offset: 0.5 };
    let prototype = vec![
        record(RecordName::CartesianX, scaled),
        Record::CARTESIAN_Y_F64,
        Record::CARTESIAN_Z_F32,
        Record::CARTESIAN_INVALID_STATE,
        record(RecordName::RowIndex, RecordDataType::Integer { min: 0, max: 999 }),
        record(RecordName::ColumnIndex, RecordDataType::Integer { min: -3, max: 70_000 }),
        record(RecordName::Intensity, RecordDataType::Integer { min: 0, max: 4095 }),
        Record::COLOR_RED_U8,
        Record::COLOR_GREEN_U8,
        record(RecordName::ColorBlue, RecordDataType::Integer { min: 9, max: 9 }),
    ];
    let points = (0..n_points as i64)
        .map(|n| {
            vec![
                RecordValue::ScaledInteger(n * 37 % 1_000_000),
                RecordValue::Double(if n % 11 == 4 { f64::NAN } else { n as f64 * 1e-3 }),
                RecordValue::Single(n as f32 * -2e-3),
                RecordValue::Integer(if n % 7 == 3 { n % 2 + 1 } else { 0 }),
                RecordValue::Integer(n % 1000),
                RecordValue::Integer(n / 1000),
                RecordValue::Integer(n % 4096),
                RecordValue::Integer(n % 256),
                RecordValue::Integer(255),
                RecordValue::Integer(9),
            ]
        })
        .collect();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let transform = Transform {
        rotation: Quaternion { w: half, x: 0.0, y: 0.0, z: half },
        translation: Translation { x: 100.0, y: 200.0, z: 300.0 },
    };
    Own { prototype, points, transform: Some(transform) }
}

/// Writes scans with the crate `e57`; `mend` may change the XML description.
pub(super) fn write(name: &str, scans: Vec<Own>, mend: impl Fn(String) -> String) -> ScratchFile {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").expect("plain");
    for (n, own) in scans.into_iter().enumerate() {
        let mut cloud = writer.add_pointcloud(&format!("scan {n}"), own.prototype).expect("plain");
        cloud.set_transform(own.transform);
        if own.points.len() > 1 {
            cloud.set_intensity_limits(Some(IntensityLimits {
                intensity_min: Some(RecordValue::Integer(0)),
                intensity_max: Some(RecordValue::Integer(2000)),
            }));
        }
        own.points.into_iter().for_each(|p| cloud.add_point(p).expect("plain"));
        cloud.finalize().expect("plain");
    }
    writer.finalize_customized_xml(|xml| Ok(mend(xml))).expect("plain");
    drop(writer);
    ScratchFile::new(name, bytes.get_ref())
}

#[test]
fn own_file_comes_back_with_gaps_and_attributes() {
    let n_points = 30_000;
    let file = write("own.e57", vec![own(n_points), own(1), own(0), own(5000)], |xml| xml);
    let scans = read(&file.0, Want::Everything).expect("valid");
    assert_eq!(scans.len(), 4);
    assert_eq!(scans.iter().map(|s| s.xyz.len()).collect::<Vec<_>>()[1..3], [1, 0]);
    let mut at = 0;
    for (place, n) in (0..).zip((0..n_points as i64).filter(|n| n % 7 != 3)) {
        if n % 11 != 4 {
            let [x, y, z] = [
                (n * 37 % 1_000_000) as f64 * 1e-4 + 0.5,
                n as f64 * 1e-3,
                f64::from(n as f32 * -2e-3),
            ];
            assert_eq!(scans[0].place[at], place);
            assert_eq!(scans[0].xyz[at], [x as f32, y as f32, z as f32]);
            let want = [100.0 - y, 200.0 + x, 300.0 + z];
            assert!((0..3).all(|i| (scans[0].attributes.world[at][i] - want[i]).abs() < 1e-9));
            // Half of them lie outside the limits that the file states, so that the limits are
            // ignored.
            let level = ((n % 4096) as f64 / 4095.0 * 65_535.0).round() as u16;
            assert_eq!(scans[0].attributes.intensity[at], level);
            assert_eq!(scans[0].attributes.color[at][..2], [(n % 256) as u16 * 257, 65_535]);
            at += 1;
        }
    }
    assert_eq!(at, scans[0].xyz.len());
    let reader = open(&file.0, &settings()).expect("valid");
    assert_eq!(reader.masks()[0].n_points, None);
    assert_eq!(reader.masks()[2].n_points, Some(0));
    let sample = reader.sample(0, 400).expect("valid");
    assert_eq!(sample.len(), 400);
    assert_eq!(sample[0].native, Some([0, 0]));
    assert!(sample[399].native.is_some_and(|[_, col]| col >= 22), "runs are spread");
}

#[test]
fn bounds_of_a_turned_scan_are_those_of_its_points() {
    let mut turned = own(4000);
    // A diagonal line turned by 45°, far from the corners of its box. It begins 35 mm from the
    // scanner, where points do not count as beams without return.
    for (n, point) in turned.points.iter_mut().enumerate() {
        let along = n.max(20) as f64 * 1e-3;
        point[0] = RecordValue::ScaledInteger((along * 1e4) as i64 - 5000);
        point[1] = RecordValue::Double(along);
        point[2] = RecordValue::Single(along as f32);
        point[3] = RecordValue::Integer(0);
    }
    if let Some(pose) = &mut turned.transform {
        let (w, z) = (0.125 * std::f64::consts::PI).sin_cos();
        pose.rotation = Quaternion { w: z, x: 0.0, y: 0.0, z: w };
    }
    let file = write("turned.e57", vec![turned], |xml| xml);
    let sources =
        crate::open(std::slice::from_ref(&file.0), None, &settings(), &contract::OneByOne);
    let described = crate::describe(&sources.expect("valid"), &contract::OneByOne).remove(0);
    let scan = &described.scans[0];
    let [bounds, stated] = [&scan.bounds, &scan.stated_bounds].map(|b| b.as_ref().expect("known"));
    // Turned by 45° the diagonal is the y axis, from 0.020 · √2 to 3.999 · √2.
    let [from, to] = [0.020, 3.999].map(|along| 200.0 + along * 2.0_f64.sqrt());
    let wanted = [[100.0, from, 300.020], [100.0, to, 303.999]];
    for (got, wanted) in [bounds.min, bounds.max].iter().zip(wanted) {
        assert!((0..3).all(|i| (got[i] - wanted[i]).abs() < 1e-3), "{got:?} {wanted:?}");
    }
    assert!(stated.min[0] < 98.0 && stated.max[0] > 102.0, "{stated:?}");
    let text = described.to_string();
    assert!(
        text.contains("    bounds: 100.000 200.028 300.020 to 100.000 205.655 303.999"),
        "{text}"
    );
}

#[test]
fn masks_are_as_long_as_the_file_says_though_their_last_points_are_dropped() {
    let mut tail = own(200);
    for point in &mut tail.points[150..] {
        point[1] = RecordValue::Double(f64::INFINITY);
    }
    let n_valid = |until: i64| (0..until).filter(|n| n % 7 != 3).count() as u64;
    let file = write("tail.e57", vec![tail, own(5)], |xml| xml);
    let scans = read(&file.0, Want::Everything).expect("valid");
    assert_eq!((scans[0].n_places, scans[1].n_places), (n_valid(200), 4));
    assert!(scans[0].place.last().is_some_and(|last| *last < n_valid(150)));
}

#[test]
fn counts_that_lie_are_refused() {
    let n_points = 3000;
    for (says, words) in [
        ("3001", "ends after"),
        ("2999", "holds more"),
        ("99999999999", "cannot hold"),
        ("18446744073709551615", "cannot hold"),
    ] {
        let file = write(&format!("lie-{says}.e57"), vec![own(n_points)], |xml| {
            xml.replace("recordCount=\"3000\"", &format!("recordCount=\"{says}\""))
        });
        let error =
            read(&file.0, Want::Coordinates).err().unwrap_or_else(|| panic!("{says} was taken"));
        assert!(error.to_string().contains(words), "{error}");
        assert!(error.to_string().contains("scan \"scan 1\""), "{error}");
    }
}

#[test]
fn poses_and_fields_that_make_no_sense_are_refused() {
    let mended = |name: &str, from: &str, to: &str| {
        let file = write(name, vec![own(10)], |xml| {
            assert!(xml.contains(from), "{xml}");
            xml.replace(from, to)
        });
        open(&file.0, &settings()).err().map(|e| e.to_string())
    };
    let cases = [
        ("<w type=\"Float\">0.7071067811865476</w>", "<w type=\"Float\">7</w>", "quaternion"),
        ("<x type=\"Float\">100</x>", "<x type=\"Float\">NaN</x>", "translation"),
        ("<cartesianZ", "<sphericalZ", "tag"),
        ("scale=\"0.0001\"", "scale=\"0\"", "scale"),
        ("fileOffset=\"48\"", "fileOffset=\"4800000\"", "offset"),
        (
            "type=\"Integer\" minimum=\"0\" maximum=\"999\"",
            "type=\"String\"",
            "unsupported content",
        ),
    ];
    for (n, (from, to, words)) in cases.into_iter().enumerate() {
        let error = mended(&format!("mended-{n}.e57"), from, to)
            .unwrap_or_else(|| panic!("{to} was taken"));
        assert!(error.contains(words) || words == "tag", "{to}: {error}");
    }
}

#[test]
fn a_bomb_of_constants_is_refused() {
    let narrow = RecordDataType::Integer { min: 1, max: 2 };
    let file = write(
        "bomb.e57",
        vec![Own {
            prototype: [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ]
                .map(|name| record(name, narrow.clone()))
                .into(),
            points: vec![vec![RecordValue::Integer(1); 3]],
            transform: None,
        }],
        |xml| {
            let constant = xml.replace("maximum=\"2\"", "maximum=\"1\"");
            constant.replace("recordCount=\"1\"", "recordCount=\"99999999999999\"")
        },
    );
    let error = open(&file.0, &settings()).err().expect("refused");
    assert!(error.to_string().contains("cannot hold"), "{error}");
}

/// Makes the checksums of all pages valid, so that damage reaches the code behind them.
fn seal(bytes: &mut [u8]) {
    for page in bytes.chunks_exact_mut(1024) {
        let sum = crc32c::crc32c(&page[..1020]).to_be_bytes();
        page[1020..].copy_from_slice(&sum);
    }
}

#[test]
fn broken_bytes_are_found_and_never_fatal() {
    let valid = write("valid.e57", vec![own(300), own(200)], |xml| xml);
    let bytes = std::fs::read(&valid.0).expect("just written");
    let whole = format!("{:?}", read(&valid.0, Want::Everything).expect("valid"));
    let mut dice = SplitMix64::seed_from_u64(7);
    for round in 0..600 {
        let mut broken = bytes.clone();
        let at = below(&mut dice, broken.len());
        broken[at] ^= 1 << below(&mut dice, 8);
        let file = ScratchFile::new("flip.e57", &broken);
        // With its checksum wrong, a page that is needed is refused; padding is not needed.
        if let Ok(scans) = read(&file.0, Want::Everything) {
            assert_eq!(format!("{scans:?}"), whole, "byte {at}");
        }
        drop(file);
        if round % 2 == 0 {
            seal(&mut broken);
            let file = ScratchFile::new("sealed.e57", &broken);
            let _either = read(&file.0, Want::Everything);
        }
    }
    for len in (0..bytes.len()).step_by(509).chain((0..bytes.len()).step_by(1024)) {
        let file = ScratchFile::new("cut.e57", &bytes[..len]);
        assert!(read(&file.0, Want::Coordinates).is_err(), "{len}");
    }
}

#[test]
fn real_files_broken_behind_their_checksums_are_never_fatal() {
    let Some(folder) = shared("e57-compat") else { return };
    let mut dice = SplitMix64::seed_from_u64(8);
    for name in [
        "pye__testWithNormals.e57",
        "tbx__twoScans.e57",
        "pdal__A_B.e57",
        "cry__las2e57_no_images_tag.e57",
    ] {
        let bytes = std::fs::read(folder.join(name)).expect("there");
        for _round in 0..150 {
            let mut broken = bytes.clone();
            for _bit in 0..=below(&mut dice, 3) {
                let at = below(&mut dice, broken.len());
                broken[at] ^= 1 << below(&mut dice, 8);
            }
            seal(&mut broken);
            let file = ScratchFile::new("real.e57", &broken);
            let _either = read(&file.0, Want::Everything);
        }
    }
}

#[test]
fn a_description_of_a_million_levels_is_never_fatal() {
    let file = write("deep.e57", vec![own(10)], |xml| {
        let deep = format!("{}{}", "<a>".repeat(1_000_000), "</a>".repeat(1_000_000));
        xml.replace("</e57Root>", &format!("{deep}</e57Root>"))
    });
    let error = open(&file.0, &settings()).err().expect("refused").to_string();
    assert!(error.contains("description") && error.contains("in one another"), "{error}");
}

#[test]
fn a_description_that_grows_is_bounded_by_settings_that_are_named() {
    let file = write("wide.e57", vec![own(10)], |xml| {
        let wide: String = (0..300).map(|i| format!(" a{i}=''")).collect();
        xml.replace("</e57Root>", &format!("<x{wide}/></e57Root>"))
    });
    let most = Settings { max_xml_attributes: 300, ..settings() };
    let wide = open(&file.0, &most).err().map(|e| e.to_string());
    assert_eq!(wide, None, "it is within the limit");
    for (few, setting) in [
        (settings(), "ingest.max_xml_attributes"),
        (Settings { max_xml_nodes: 200, ..most.clone() }, "ingest.max_xml_nodes"),
        (Settings { max_xml_bytes: 100, ..most.clone() }, "ingest.max_xml_bytes"),
    ] {
        let error = open(&file.0, &few).err().expect(setting).to_string();
        assert!(error.contains("description") && error.contains(setting), "{error}");
    }
}
