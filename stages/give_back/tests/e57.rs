//! E57 files given back: everything as it was but for the moving points, read with another reader.

mod common;

use common::{ByRule, DROPPED, FLAGGED, PLAIN, ReadScan, give, read, shared};
use e57::{
    E57Writer, Extension, IntensityLimits, PinholeImageProperties, Quaternion, Record,
    RecordDataType, RecordName, RecordValue, Transform, Translation,
};
use give_back::{GiveBack, GivenBack};
use std::io::Cursor;

fn ours(name: &str) -> RecordName {
    RecordName::Unknown { namespace: "sp".into(), name: name.into() }
}

/// Column of a field.
fn column(scan: &ReadScan, name: &RecordName) -> Option<usize> {
    scan.names.iter().position(|n| n == name)
}

const STATES: [(RecordName, RecordName); 2] = [
    (RecordName::CartesianX, RecordName::CartesianInvalidState),
    (RecordName::SphericalRange, RecordName::SphericalInvalidState),
];

/// Compares a file with what was given back of it.
fn same_but_for_the_moving(name: &str, original: &[u8], how: GiveBack) -> Vec<GivenBack> {
    let (bytes, counts) = give(original, how).unwrap_or_else(|e| panic!("{name}: {e}"));
    let ((before, blobs), (after, blobs_after)) = (read(original), read(&bytes));
    assert!(blobs == blobs_after, "{name}: pictures");
    assert_eq!(before.len(), after.len(), "{name}");
    for ((before, after), counts) in before.iter().zip(&after).zip(&counts) {
        assert_eq!(before.words, after.words, "{name}");
        let state = STATES.iter().find(|(axis, _)| column(before, axis).is_some());
        let state = state.and_then(|(_, state)| column(before, state));
        let (mut place, mut n_out) = (0, 0);
        let mut rows = after.records.iter();
        for old in &before.records {
            let is_valid = state.is_none_or(|at| old[at] == 0);
            let fate = is_valid.then(|| ByRule::fate(place));
            place += u64::from(is_valid);
            let is_out = fate.is_some_and(|fate| fate.is_out);
            n_out += u64::from(is_out);
            if is_out && how.drops {
                continue;
            }
            let new = rows.next().expect("as many records");
            for (at, field) in before.names.iter().enumerate() {
                let is_state = STATES.iter().any(|(_, state)| state == field);
                let want = if is_out && is_state { 2 } else { old[at] };
                assert_eq!(new[column(after, field).expect("a field")], want, "{name} {field:?}");
            }
            for (axis, state) in &STATES {
                if column(before, axis).is_some() && column(before, state).is_none() && !how.drops {
                    let at = column(after, state).expect("added");
                    assert_eq!(new[at], if is_out { 2 } else { 0 }, "{name}");
                }
            }
            let label = |what: &str| column(after, &ours(what)).map(|at| new[at]);
            let stated = fate.map_or([255, -1, -1], |fate| {
                [i64::from(fate.class), i64::from(fate.robot), i64::from(fate.link)]
            });
            let want = if how.says_labels { stated.map(Some) } else { [None; 3] };
            assert_eq!(["class", "robot", "link"].map(label), want, "{name}");
        }
        assert!(rows.next().is_none(), "{name}");
        assert_eq!(*counts, GivenBack { n_valid: place, n_out }, "{name}");
    }
    counts
}

/// A file with two scans of many kinds of fields, a picture and an extension.
fn own_file(n: u64) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "{file}").expect("starts");
    writer.register_extension(Extension::new("nor", "http://www.libe57.org/n.txt")).expect("new");
    let extra = |name: &str| RecordName::Unknown { namespace: "nor".into(), name: name.into() };
    let integer = |min, max| RecordDataType::Integer { min, max };
    let scaled =
        RecordDataType::ScaledInteger { min: -9000, max: 99_000, scale: 1e-3, offset: 0.0 };
    let fields = [
        (RecordName::RowIndex, integer(0, 799)),
        (RecordName::CartesianX, scaled.clone()),
        (RecordName::CartesianY, scaled.clone()),
        (RecordName::CartesianZ, RecordDataType::Double { min: None, max: None }),
        (RecordName::CartesianInvalidState, integer(0, 2)),
        (RecordName::ColumnIndex, integer(5, 5)),
        (RecordName::Intensity, integer(-3, 100)),
        (extra("normalX"), RecordDataType::Single { min: None, max: None }),
        (extra("wide"), integer(i64::MIN, i64::MAX)),
    ];
    let spherical = [
        (RecordName::SphericalRange, RecordDataType::Single { min: None, max: None }),
        (RecordName::SphericalAzimuth, scaled),
        (RecordName::SphericalElevation, RecordDataType::Single { min: None, max: None }),
        (RecordName::ColorRed, integer(0, 255)),
        (RecordName::ColorGreen, integer(0, 255)),
        (RecordName::ColorBlue, integer(0, 65_535)),
        (RecordName::TimeStamp, RecordDataType::Double { min: None, max: None }),
    ];
    let record = |(name, data_type): (RecordName, RecordDataType)| Record { name, data_type };
    for (scan, fields) in [fields.to_vec(), spherical.to_vec()].into_iter().enumerate() {
        let prototype: Vec<Record> = fields.into_iter().map(record).collect();
        let mut cloud =
            writer.add_pointcloud(&format!("{{{scan}}}"), prototype.clone()).expect("starts");
        cloud.set_name(Some("a <scan> & \"more\"".into()));
        cloud.set_temperature(Some(21.5));
        cloud.set_transform(Some(Transform {
            rotation: Quaternion { w: 0.8, x: 0.0, y: 0.0, z: 0.6 },
            translation: Translation { x: 1.0, y: -2.0, z: 3.0 },
        }));
        if scan == 0 {
            let [min, max] = [0, 90].map(|v| Some(RecordValue::Integer(v)));
            let limits = IntensityLimits { intensity_min: min, intensity_max: max };
            cloud.set_intensity_limits(Some(limits));
        }
        for i in 0..n / (1 + scan as u64) {
            let raw = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let value = |r: &Record| match r.data_type {
                RecordDataType::Single { .. } => RecordValue::Single(raw as f32 * 1e-18),
                RecordDataType::Double { .. } => RecordValue::Double(raw as f64 * 1e-17),
                RecordDataType::ScaledInteger { .. } => {
                    RecordValue::ScaledInteger(raw as i64 % 9000)
                }
                RecordDataType::Integer { min, max } => {
                    let span = max.wrapping_sub(min) as u64;
                    let above = if span == u64::MAX { raw } else { raw % (span + 1) };
                    RecordValue::Integer(min.wrapping_add(above as i64))
                }
            };
            cloud.add_point(prototype.iter().map(value).collect()).expect("fits");
        }
        cloud.finalize().expect("ends");
    }
    let mut image = writer.add_image("{image}").expect("starts");
    let picture: Vec<u8> = (0..200_001_u32).map(|i| (i % 251) as u8).collect();
    let mut bytes = Cursor::new(&picture);
    let properties = PinholeImageProperties {
        width: 10,
        height: 20,
        focal_length: 1.0,
        pixel_width: 1.0,
        pixel_height: 1.0,
        principal_x: 0.0,
        principal_y: 0.0,
    };
    image.add_pinhole(e57::ImageFormat::Jpeg, &mut bytes, properties, None).expect("is added");
    image.finalize().expect("ends");
    writer.finalize().expect("ends");
    drop(writer);
    file.into_inner()
}

#[test]
fn fields_of_every_kind_come_back() {
    for n in [1, 7, 8, 1000, 100_003] {
        let file = own_file(n);
        for how in [FLAGGED, PLAIN, DROPPED] {
            let counts = same_but_for_the_moving(&format!("{n} points"), &file, how);
            assert!(n < 1000 || counts.iter().all(|c| c.n_out > c.n_valid / 10), "{counts:?}");
        }
    }
}

#[test]
fn the_description_stays_but_for_what_must_change() {
    let file = own_file(50);
    let (bytes, _) = give(&file, FLAGGED).expect("is given back");
    let xml = |bytes: &[u8]| {
        let text = e57::E57Reader::new(Cursor::new(bytes)).expect("an E57 file").xml().to_owned();
        text.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let (old, new) = (xml(&file), xml(&bytes));
    let lines = |a: &[String], b: &[String]| -> Vec<String> {
        a.iter().filter(|line| !b.contains(line)).cloned().collect()
    };
    let gone = lines(&old, &new);
    // The root with its namespaces, its identifier, two sections, two ends of lists of fields, a
    // picture, the end.
    let words = ["<e57Root", "<guid", "<points", "</prototype>", "<jpegImage", "</e57Root"];
    assert!(gone.iter().all(|line| words.iter().any(|w| line.contains(w))), "{gone:#?}");
    let text = new.join("\n");
    assert!(text.contains("xmlns:sp=\"urn:x-stillpoint:e57:labels:1\""), "{text}");
    assert!(text.contains("sphericalInvalidState type=\"Integer\" minimum=\"0\" maximum=\"2\""));
}

#[test]
fn what_was_given_back_can_be_given_back() {
    let file = own_file(500);
    let (first, _) = give(&file, FLAGGED).expect("is given back");
    let (second, counts) = give(&first, FLAGGED).expect("is given back again");
    let text = e57::E57Reader::new(Cursor::new(&second)).expect("reads").xml().to_owned();
    for once in ["<sp:labels", "xmlns:sp="] {
        assert_eq!(text.matches(once).count(), 1, "{once}");
    }
    assert_eq!(text.matches("<sp:class ").count(), 2);
    // What was taken out the first time counts no more.
    let (scans, _) = read(&second);
    assert!(counts[1].n_valid < 250 && scans[1].records.len() == 250, "{counts:?}");
    let without = GiveBack { says_labels: false, ..FLAGGED };
    let (plain, _) = give(&first, without).expect("is given back plain");
    let text = e57::E57Reader::new(Cursor::new(&plain)).expect("reads").xml().to_owned();
    assert!(!text.contains("<sp:"), "{text}");
}

#[test]
fn real_and_odd_files_come_back() {
    let folders = [
        "e57-compat",
        "e57-real-pump",
        "kurt3d-corridor",
        "../cases/units-mm-and-feet",
        "../cases/e57-returns-at-origin",
    ];
    for folder in folders {
        let Some(folder) = shared(folder) else { return };
        let mut paths: Vec<_> = std::fs::read_dir(folder)
            .expect("a folder")
            .map(|f| f.expect("a file").path())
            .collect();
        paths.sort();
        for path in paths.iter().filter(|path| path.extension().is_some_and(|e| e == "e57")) {
            let (name, bytes) = (path.display().to_string(), std::fs::read(path).expect("reads"));
            if ["bad-crc", "corrupt", "invalid", "e5p__empty"].iter().any(|w| name.contains(w)) {
                assert!(give(&bytes, FLAGGED).is_err(), "{name}");
                continue;
            }
            for how in [FLAGGED, PLAIN, DROPPED] {
                same_but_for_the_moving(&name, &bytes, how);
            }
        }
    }
}

#[test]
fn broken_bytes_are_never_fatal() {
    let file = own_file(300);
    let mut dice = 7_u64;
    for _round in 0..300 {
        dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let mut broken = file.clone();
        // Pages get right checksums again, so that what they hold is looked at.
        let at = (dice >> 33) as usize % (file.len() / 1024) * 1024 + (dice >> 12) as usize % 1020;
        broken[at] ^= 1 << (dice >> 60 & 7);
        let page = at / 1024 * 1024;
        let sum = crc32c::crc32c(&broken[page..page + 1020]).to_be_bytes();
        broken[page + 1020..page + 1024].copy_from_slice(&sum);
        let _either = give(&broken, FLAGGED);
    }
    for n in 0..file.len() / 1024 {
        assert!(give(&file[..n * 1024], DROPPED).is_err(), "{n} pages");
    }
}
