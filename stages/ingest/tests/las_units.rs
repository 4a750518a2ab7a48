//! The units that the LAS and LAZ files of public test suites declare, by WKT 1 and 2, GeoTIFF keys
//! and codes of systems. The files are not part of the repository; without them this test reports
//! that it was skipped.
#![allow(clippy::unwrap_used, clippy::print_stderr)] // tests may panic, and say what they skip

use contract::{Kind, OneByOne};
use ingest::{Origin, Settings, Want, open};
use std::path::Path;

const FOOT: f64 = 0.3048;
const US_FOOT: f64 = 1200.0 / 3937.0;

/// File, and metres per unit of x and y, and of z, where it declares them.
#[rustfmt::skip]
const DECLARED: &[(&str, [f64; 2])] = &[
    // Only the code of the system tells the unit: California zone 5.
    ("ll__certainty3d-color-utm-feet-navd88.las", [US_FOOT, US_FOOT]),
    // The unit of heights is named foot with the length of a metre; that of x and y counts.
    ("lpy__1_4_w_evlr.las", [US_FOOT, US_FOOT]),
    ("lpy__1_4_w_evlr.laz", [US_FOOT, US_FOOT]),
    ("lpy__test1_4.las", [US_FOOT, US_FOOT]),
    ("lpy__append-bug.laz", [1.0, 1.0]),
    ("lpy__file_with_both_wkt_and_geotiff_vlrs.las", [US_FOOT, US_FOOT]),
    ("lpy__fullwave.laz", [1.0, 1.0]),
    ("lpy__plane.laz", [1.0, 1.0]),
    // Metres for x and y, feet for heights.
    ("lpy__simple.copc.laz", [1.0, US_FOOT]),
    ("lrs__32-1-472-150-76.laz", [1.0, 1.0]),
    ("lrs__autzen.laz", [FOOT, FOOT]),
    ("pdal__1.0_0.las", [1.0, 1.0]),
    ("pdal__1.2-empty-geotiff-vlrs.las", [1.0, 1.0]),
    ("pdal__lots_of_vlr.las", [US_FOOT, US_FOOT]),
];

/// Files that declare no unit.
const ASSUMED: [&str; 4] = [
    "lpy__simple1_3.las",
    "lz__5points_14.las",
    "pdal__1.2-with-color.las",
    "pdal__extrabytes.las",
];

/// Files that declare longitude and latitude.
const DEGREES: [&str; 3] = ["lpy__simple1_4.las", "pdal__no-points.las", "pdal__spurious.las"];

#[test]
fn real_files_are_read_in_the_units_that_they_declare() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scans/las-compat");
    if !folder.is_dir() {
        eprintln!("skipped: no folder of compatibility files");
        return;
    }
    let open = |name: &str, units: &str| {
        let settings = Settings { units: units.into(), ..Settings::default() };
        open(&[folder.join(name)], None, &settings, &OneByOne)
    };
    let largest = |name: &str, units: &str| -> [f64; 3] {
        let sources = open(name, units).unwrap();
        let mut most = [f64::NEG_INFINITY; 3];
        for strip in sources.strips(sources.inputs[0].id, Want::Everything).unwrap() {
            for p in strip.unwrap().attributes.unwrap().world {
                (0..3).for_each(|axis| most[axis] = most[axis].max(p[axis]));
            }
        }
        most
    };
    for (name, [across, up]) in DECLARED {
        let sources = open(name, "declared").unwrap_or_else(|e| panic!("{e}"));
        let units = sources.units(sources.inputs[0].id).unwrap();
        assert_eq!(units.origin, Origin::Declared, "{name}: {units}");
        for (own, right) in units.factors().into_iter().zip([across, across, up]) {
            assert!((own / right - 1.0).abs() < 1e-12, "{name}: {units}");
        }
        let (raw, own) = (largest(name, "m"), largest(name, "declared"));
        for (axis, factor) in units.factors().into_iter().enumerate() {
            assert!((own[axis] - raw[axis] * factor).abs() < 1e-6, "{name}: {raw:?} {own:?}");
        }
    }
    for name in ASSUMED {
        let sources = open(name, "declared").unwrap_or_else(|e| panic!("{e}"));
        let units = sources.units(sources.inputs[0].id).unwrap();
        assert!(units.origin == Origin::Assumed && units.is_metres(), "{name}: {units}");
    }
    for name in DEGREES {
        let error = open(name, "declared").err().expect(name);
        assert_eq!(error.kind(), Kind::Unsupported, "{error}");
        assert!(error.to_string().contains("--units m"), "{error}");
        assert!(open(name, "m").is_ok(), "{name}");
    }
}

/// File, and numbers and lengths of the records of its reference system; none where its unit is no
/// metre.
const SYSTEMS: &[(&str, &[(u16, usize)])] = &[
    // It has GeoTIFF keys, too, but its header says that the text counts.
    ("lpy__append-bug.laz", &[(2112, 1026)]),
    ("lpy__fullwave.laz", &[(2112, 1965)]),
    ("lpy__plane.laz", &[(34_735, 192), (34_736, 96), (34_737, 95)]),
    ("pdal__1.0_0.las", &[(34_735, 64), (34_737, 27)]),
    ("pdal__1.2-empty-geotiff-vlrs.las", &[(34_735, 56)]),
    ("lpy__simple.copc.laz", &[]),
    ("lpy__test1_4.las", &[]),
    ("pas__10_points_format_6.las", &[]),
];

#[test]
fn reference_systems_in_metres_are_handed_on() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scans/las-compat");
    if !folder.is_dir() {
        eprintln!("skipped: no folder of compatibility files");
        return;
    }
    for (name, records) in SYSTEMS {
        let sources = open(&[folder.join(name)], None, &Settings::default(), &OneByOne).unwrap();
        let system = sources.system().map_or(&[][..], |system| &system.records);
        let lengths: Vec<(u16, usize)> =
            system.iter().map(|(id, data)| (*id, data.len())).collect();
        assert_eq!(&lengths, records, "{name}");
    }
}
