//! Real E57 files, compared with other readers.

use super::*;
use crate::check::{Read, read_all, shared};
use ::e57::CartesianCoordinate;
use contract::Kind;

/// Mean, smallest and largest world coordinates, metres.
type Summary = [[f64; 3]; 3];

/// Valid points of each scan and their world coordinates, as pye57 0.4 (libE57Format) reads them.
#[rustfmt::skip]
const READ: &[(&str, &[(usize, Summary)])] = &[
    ("cry__bunnyFloat.e57", &[(30_571, [[-0.027513, 0.103078, 0.008644], [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799]])]),
    ("cry__bunnyInt21.e57", &[(30_571, [[-0.027513, 0.103078, 0.008644], [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799]])]),
    ("cry__bunnyInt32.e57", &[(30_571, [[-0.027513, 0.103078, 0.008644], [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799]])]),
    ("cry__empty_pc.e57", &[(0, [[0.0; 3]; 3])]),
    ("cry__float_intensity_without_min_max.e57", &[(1, [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])]),
    ("cry__integer_intensity.e57", &[(2, [[2.75, 3.85, 4.95], [1.1, 2.2, 3.3], [4.4, 5.5, 6.6]])]),
    ("cry__las2e57_no_images_tag.e57", &[(153, [[-0.005869, -0.000843, -0.000229], [-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]])]),
    ("cry__original_guids.e57", &[(1, [[1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]])]),
    ("cry__scaled_integer_intensity.e57", &[(2, [[2.75, 3.85, 4.95], [1.1, 2.2, 3.3], [4.4, 5.5, 6.6]])]),
    ("cry__tinyCartesianFloatRgb.e57", &[(2090, [[-8.044145, 6.012533, 297.002204], [-9.77953, 4.513879, 295.524689], [-6.774238, 7.51546, 298.532166]])]),
    ("cry__tiny_pc_and_images.e57", &[(2, [[0.5, 0.5, 0.5], [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])]),
    ("cry__tiny_pc_with_extension.e57", &[(1, [[1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]])]),
    ("e5p__pipeSpherical.e57", &[(1220, [[-0.682755, -4.865977, 1.580514], [-1.237929, -5.127488, 1.437208], [-0.31987, -4.570024, 1.843003]])]),
    ("lef__ColouredCubeFloat.e57", &[(7680, [[-0.006474, 0.002326, -0.003983], [-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]])]),
    ("lef__ZeroPoints.e57", &[(0, [[0.0; 3]; 3])]),
    ("lef__bunnyDouble.e57", &[(30_571, [[-0.027513, 0.103078, 0.008644], [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799]])]),
    ("pdal__A_B.e57", &[(2, [[-42.6409, 1.9652, 0.5884], [-42.6423, 1.8726, 0.5101], [-42.6395, 2.0578, 0.6667]]), (4, [[-44.551975, -1.06335, 0.106525], [-44.952202, -1.3493, -0.6077], [-44.300098, -0.886, 0.3694]])]),
    ("pdal__A_moved_B.e57", &[(2, [[-42.6409, 1.9652, 0.5884], [-42.6423, 1.8726, 0.5101], [-42.6395, 2.0578, 0.6667]]), (4, [[-43.719212, 0.991253, 0.106525], [-44.119438, 0.705303, -0.6077], [-43.467335, 1.168603, 0.3694]])]),
    ("pye__testWithNormals.e57", &[(2, [[1.5, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])]),
    ("pye__translationWithoutRotation.e57", &[(4, [[4.5, 5.5, 6.0], [4.0, 5.0, 6.0], [5.0, 6.0, 6.0]])]),
    ("tbx__doubleFloat.e57", &[(10, [[550_000_000_000_000.1, 560_000_000_000_000.1, 569_000_000_000_000.1], [100_000_000_000_000.02, 110_000_000_000_000.03, 120_000_000_000_000.02], [1_000_000_000_000_000.1, 1_010_000_000_000_000.1, 1_020_000_000_000_000.1]])]),
    ("tbx__intColor.e57", &[(10, [[5.5, 5.6, 5.69], [1.0, 1.1, 1.2], [10.0, 10.1, 10.2]])]),
    ("tbx__loadSingleScan.e57", &[(10, [[5.5, 5.6, 5.69], [1.0, 1.1, 1.2], [10.0, 10.1, 10.2]]), (10, [[6.5, 5.8, 8.69], [2.0, 1.3, 4.2], [11.0, 10.3, 13.2]]), (10, [[7.5, 6.0, 11.69], [3.0, 1.5, 7.2], [12.0, 10.5, 16.2]]), (10, [[8.5, 6.2, 14.69], [4.0, 1.7, 10.2], [13.0, 10.7, 19.2]])]),
    ("tbx__noNormals.e57", &[(10, [[5.5, 5.6, 5.69], [1.0, 1.1, 1.2], [10.0, 10.1, 10.2]])]),
    ("tbx__twoScans.e57", &[(10, [[5.5, 5.6, 5.69], [1.0, 1.1, 1.2], [10.0, 10.1, 10.2]]), (10, [[5.5, 5.6, 5.69], [1.0, 1.1, 1.2], [10.0, 10.1, 10.2]])]),
    ("pumpAVisualReferenceImage.e57", &[(155_201, [[-0.482686, -2.636015, -0.947162], [-2.903763, -5.301102, -1.899704], [1.721603, -0.792648, 1.843002]])]),
    ("kurt_2scans_cartesian.e57", &[(79_868, [[1.608407, 0.862601, 0.588169], [0.0, -1.18613, -2.22064], [30.991301, 12.5529, 9.43721]]), (80_047, [[3.059066, 0.608406, 0.411208], [1.561801, -1.180405, -2.040884], [33.378865, 11.229214, 7.853923]])]),
    ("kurt_2scans_spherical.e57", &[(79_868, [[1.608407, 0.862601, 0.588169], [-0.0, -1.18613, -2.22064], [30.9913, 12.5529, 9.43721]]), (80_047, [[3.059066, 0.608406, 0.411208], [1.561801, -1.180405, -2.040884], [33.378866, 11.229214, 7.853923]])]),
];

/// Files that are refused, and words of the error.
const REFUSED: &[(&str, &str)] = &[
    ("cry__corrupt_crc.e57", "checksum"),
    ("e5p__empty.e57", "empty"),
    ("e5p__invalid.e57", "truncated"),
    ("lef__bad-crc.e57", "checksum"),
];

/// Files with pictures only.
const NO_SCAN: &[&str] = &["cry__empty.e57", "lef__PinholeImageWithDistortionParameters.e57"];

pub(super) fn settings() -> Settings {
    Settings { strip_points: 1000, ..Settings::default() }
}

pub(super) fn read(path: &Path, want: Want) -> Result<Vec<Read>> {
    read_all(&*open(path, &settings())?, want, &settings())
}

/// World coordinates of all valid points, as the crate `e57` reads them.
fn oracle(path: &Path) -> Vec<Vec<[f64; 3]>> {
    let mut reader = E57Reader::from_file(path).expect("valid");
    let clouds = reader.pointclouds();
    clouds
        .iter()
        .map(|cloud| {
            let points = reader.pointcloud_simple(cloud).expect("valid");
            points
                .filter_map(|p| match p.expect("valid").cartesian {
                    CartesianCoordinate::Valid { x, y, z } => Some([x, y, z]),
                    _ => None,
                })
                .collect()
        })
        .collect()
}

#[test]
fn compatibility_files_are_read_in_full_or_refused() {
    let Some(folder) = shared("e57-compat") else { return };
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .expect("listed")
        .map(|f| f.expect("listed").file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".e57"))
        .collect();
    names.sort();
    assert!(names.len() >= 31);
    for name in names {
        let path = folder.join(&name);
        if let Some((_, words)) = REFUSED.iter().find(|(n, _)| *n == name) {
            let error = open(&path, &settings()).err().expect("refused");
            assert!(
                error.kind() == Kind::BadInput && error.to_string().contains(words),
                "{name}: {error}"
            );
        } else if NO_SCAN.contains(&name.as_str()) {
            assert!(open(&path, &settings()).expect(&name).scans().is_empty(), "{name}");
        } else {
            let expected = READ
                .iter()
                .find(|(n, _)| *n == name)
                .unwrap_or_else(|| panic!("{name}: no expectation"));
            same_as_others(&path, expected.1);
        }
    }
}

/// Compares with the figures of pye57, and point by point with the crate `e57`.
fn same_as_others(path: &Path, expected: &[(usize, Summary)]) {
    let reader = open(path, &settings()).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let scans = read_all(&*reader, Want::Coordinates, &settings())
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let everything = read_all(&*reader, Want::Everything, &settings()).expect("as before");
    assert_eq!(scans.len(), expected.len(), "{}", path.display());
    let oracle = oracle(path);
    for (n, (scan, (n_points, summary))) in scans.iter().zip(expected).enumerate() {
        let place = format!("{} scan {n}", path.display());
        assert_eq!(oracle[n].len(), *n_points, "{place}");
        assert_eq!(scan.n_places, *n_points as u64, "{place}");
        assert!(
            reader.masks()[n].n_points.is_none_or(|known| known == *n_points as u64),
            "{place}"
        );
        assert_eq!((&scan.place, &scan.xyz), (&everything[n].place, &everything[n].xyz), "{place}");
        if *n_points == 0 {
            assert!(scan.xyz.is_empty());
            continue;
        }
        if summary[2][0] > 1e9 {
            // Coordinates of 10¹⁵ m: points far from the others are dropped, and the rest keep
            // their places.
            assert!(scan.place.len() < *n_points, "{place}");
            continue;
        }
        assert_eq!(scan.place, (0..*n_points as u64).collect::<Vec<_>>(), "{place}");
        // Single precision about the scanner: 4 µm at 60 m.
        let off =
            |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
        let near = |a: &Summary, b: &Summary| (0..3).all(|k| off(&a[k], &b[k]) < 2e-5);
        assert!(near(&scan.summary(), summary), "{place}: {:?}", scan.summary());
        assert!(scan.world.iter().zip(&oracle[n]).all(|(a, b)| off(a, b) < 1e-5), "{place}");
        assert!(
            everything[n].attributes.world.iter().zip(&oracle[n]).all(|(a, b)| off(a, b) < 1e-9),
            "{place}"
        );
    }
}

#[test]
fn real_scans_agree_with_other_readers() {
    for (folder, name) in [
        ("e57-real-pump", "pumpAVisualReferenceImage.e57"),
        ("kurt3d-corridor", "kurt_2scans_cartesian.e57"),
        ("kurt3d-corridor", "kurt_2scans_spherical.e57"),
    ] {
        let Some(folder) = shared(folder) else { return };
        let expected = READ.iter().find(|(n, _)| *n == name).expect("in the table");
        same_as_others(&folder.join(name), expected.1);
        let reader = open(&folder.join(name), &settings()).expect("valid");
        for scan in 0..reader.scans().len() {
            let sample = reader.sample(scan, 10_000).expect("valid");
            assert_eq!(sample.len(), 10_000, "{name}");
            assert!(
                reader.scans()[scan].scanner_known && sample.iter().all(|s| s.native.is_some()),
                "{name}"
            );
        }
    }
}

#[test]
fn what_is_not_known_is_said() {
    let Some(folder) = shared("e57-compat") else { return };
    for (name, known) in [
        ("lef__bunnyDouble.e57", false),
        ("tbx__noNormals.e57", true),
        ("pye__translationWithoutRotation.e57", true),
    ] {
        let reader = open(&folder.join(name), &settings()).expect("valid");
        assert_eq!(reader.scans()[0].scanner_known, known, "{name}");
        assert!(
            known || reader.scans()[0].notes.iter().any(|n| n.contains("scanner is not known")),
            "{name}"
        );
    }
}
