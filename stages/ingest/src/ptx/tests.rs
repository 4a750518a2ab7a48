//! Real PTX files compared with other readers, and files written by the tests, whole and damaged.

use super::*;
use crate::check::{Read, ScratchFile, below, read_all, shared};
use contract::Kind;
use rand::SeedableRng;
use rand_xoshiro::SplitMix64;
use std::path::Path;

/// Mean, smallest and largest world coordinates, metres.
type Summary = [[f64; 3]; 3];

/// Valid points of a scan, numbers of a line, world coordinates.
type Expected = (usize, usize, Summary);

/// Results for each scan as NumPy computes them from the text.
#[rustfmt::skip]
const READ: &[(&str, &[Expected])] = &[
    ("ptx-pts/pdal__1.2-with-color.ptx", &[(1065, 7, [[637_296.735_183, 851_249.538_488, 434.09784], [635_619.85, 848_899.7, 406.59], [638_982.55, 853_535.43, 586.38]])]),
    ("ptx-pts/pdal__complex-transform.ptx", &[(4, 7, [[-3.034384, -3.17147, -1.823662], [-3.034407, -3.173781, -1.825115], [-3.03436, -3.16853, -1.822068]])]),
    ("ptx-pts/pdal__no-color.ptx", &[(15, 4, [[636_334.331_333, 849_185.104_667, 428.594], [635_795.24, 848_991.01, 408.6], [637_012.24, 849_390.78, 446.39]])]),
    ("ptx-pts/ptx__points.ptx", &[(673, 7, [[15.025549, -28.454575, -2.432022], [10.194283, -29.615936, -3.049618], [27.249068, -25.521715, -1.934323]]), (90, 7, [[-16.911768, -6.674679, 0.5524], [-16.960412, -6.828534, 0.533912], [-16.86716, -6.533572, 0.576972]])]),
    ("kurt3d-corridor/kurt_2scans.ptx", &[(79_868, 4, [[1.608407, 0.862601, 0.588169], [0.0, -1.1861, -2.2206], [30.9913, 12.5529, 9.4372]]), (80_047, 4, [[3.059067, 0.608405, 0.411207], [1.56185, -1.180385, -2.040901], [33.378875, 11.229211, 7.853935]])]),
];

fn settings() -> Settings {
    Settings { strip_points: 1000, ..Settings::default() }
}

fn read(path: &Path, want: Want) -> Result<Vec<Read>> {
    read_all(&*open(path, &settings())?, want, &settings())
}

fn off(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
}

#[test]
fn real_files_are_read_in_full() {
    let Some(folder) = shared(".") else { return };
    for (name, expected) in READ {
        let path = folder.join(name);
        let reader = open(&path, &settings()).unwrap_or_else(|e| panic!("{e}"));
        let coordinates =
            read_all(&*reader, Want::Coordinates, &settings()).unwrap_or_else(|e| panic!("{e}"));
        let scans =
            read_all(&*reader, Want::Everything, &settings()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(scans.len(), expected.len(), "{name}");
        for (n, (n_points, n_columns, summary)) in expected.iter().enumerate() {
            assert_eq!(coordinates[n].xyz, scans[n].xyz, "{name}");
            assert_eq!(scans[n].place, (0..*n_points as u64).collect::<Vec<_>>(), "{name}");
            assert_eq!(reader.masks()[n].n_points, Some(*n_points as u64), "{name}");
            let got = scans[n].summary();
            // Coordinates of a map about their own middle: 1 mm at 2 km; a rotation of six digits:
            // 10 µm at 10 m.
            let tolerance = if summary[0][0] > 1e4 { 2e-4 } else { 3e-5 };
            assert!((0..3).all(|k| off(&got[k], &summary[k]) < tolerance), "{name}: {got:?}");
            assert_eq!(scans[n].attributes.color.is_empty(), *n_columns < 6, "{name}");
            assert_eq!(scans[n].attributes.intensity.len(), *n_points, "{name}");
            let sample = reader.sample(n, 500).expect("valid");
            assert_eq!(sample.len().min(100), (*n_points).min(100), "{name}");
            assert!(sample.iter().all(|s| s.native.is_some()), "{name}");
        }
        assert_eq!(reader.scans()[0].scanner_known, expected[0].2[0][0] < 1e4, "{name}");
    }
}

#[test]
fn corridor_is_the_same_in_all_formats() {
    let Some(folder) = shared("kurt3d-corridor") else { return };
    let e57 = |name: &str| {
        let reader = crate::e57::open(&folder.join(name), &settings()).expect("valid");
        (read_all(&*reader, Want::Coordinates, &settings()).expect("valid"), reader)
    };
    let (cartesian, reader) = e57("kurt_2scans_cartesian.e57");
    let (spherical, _) = e57("kurt_2scans_spherical.e57");
    let ptx = open(&folder.join("kurt_2scans.ptx"), &settings()).expect("valid");
    let text = read_all(&*ptx, Want::Coordinates, &settings()).expect("valid");
    for n in 0..2 {
        assert_eq!(cartesian[n].place, spherical[n].place);
        assert_eq!(cartesian[n].place, text[n].place);
        let worst = |other: &Read| {
            cartesian[n].world.iter().zip(&other.world).map(|(a, b)| off(a, b)).fold(0.0, f64::max)
        };
        // Single-precision angles at 33 m; four decimals and a pose of six.
        assert!(worst(&spherical[n]) < 1e-5, "{}", worst(&spherical[n]));
        assert!(worst(&text[n]) < 1e-4, "{}", worst(&text[n]));
        let native = |reader: &dyn Reader| {
            reader.sample(n, 500).expect("valid").iter().map(|s| s.native).collect::<Vec<_>>()
        };
        assert_eq!(native(&*reader)[..100], native(&*ptx)[..100], "rows run fastest in both");
    }
}

/// One scan: a turn by 90° about z and a position; then these lines.
fn block(n_cols: u64, n_rows: u64, points: &str) -> String {
    format!(
        "{n_cols}\n{n_rows}\n10 20 30\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n{points}"
    )
}

#[test]
fn own_file_comes_back() {
    let first = "1 2 3 0.5\n0 0 0 0.5\nnan 2 3 0.25\n0.0 -0.00 0 1\n  4\t5 6 1.5  \n-0.5 0 0 0\n";
    let second = "1 0 0 255 128 0\r\n0 0 0 0 0 0\r\n";
    let text = format!("\n{}\n\n{}", block(2, 3, first), block(1, 2, second).replace('\n', "\r\n"));
    let file = ScratchFile::new("own.ptx", text.as_bytes());
    let scans = read(&file.0, Want::Everything).expect("valid");
    assert_eq!(scans[0].place, [0, 2, 3]);
    assert_eq!(scans[0].xyz, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [-0.5, 0.0, 0.0]]);
    // Row vectors: x goes along the first row of the matrix, world y.
    assert!(off(&scans[0].world[0], &[10.0 - 2.0, 20.0 + 1.0, 33.0]) < 1e-12);
    assert_eq!(scans[0].attributes.intensity, [32_768, 65_535, 0]);
    assert_eq!(scans[1].attributes.color, [[65_535, 32_896, 0]]);
    let reader = open(&file.0, &settings()).expect("valid");
    assert_eq!(reader.masks()[0].n_points, Some(4));
    let sample = reader.sample(0, 100).expect("valid");
    assert_eq!(sample.last().expect("some").native, Some([2, 1]));
}

#[test]
fn points_at_the_scanner_and_intensities_of_another_scale_are_said() {
    // Zeros that the format does not know as such, and intensities as older exports have them.
    let line = |k: i32| match k % 4 {
        0 => "1e-7 0 -1e-7 0\n".to_owned(),
        _ => format!(
            "{:.3} {:.3} 1.5 {}\n",
            3.0 + f64::from(k).sin(),
            f64::from(k) * 0.01,
            k * 7 % 256
        ),
    };
    let text = block(20, 50, &(0..1000).map(line).collect::<String>());
    let file = ScratchFile::new("odd.ptx", text.as_bytes());
    let reader = open(&file.0, &settings()).expect("valid");
    let notes = &reader.scans()[0].notes;
    assert!(
        notes.iter().any(|n| n.starts_with("250 of 1000 points looked at lie at")),
        "{notes:?}"
    );
    assert!(notes.iter().any(|n| n.contains("0 to 255 are taken instead")), "{notes:?}");
    let scans = read(&file.0, Want::Everything).expect("valid");
    assert_eq!((scans[0].xyz.len(), scans[0].n_places), (750, 1000));
    let levels = &scans[0].attributes.intensity;
    assert_eq!(levels[0], 7 * 257);
    assert_eq!(levels.iter().collect::<std::collections::BTreeSet<_>>().len(), 192);
}

#[test]
fn broken_files_are_refused_with_their_line() {
    let points = "1 2 3 0.5\n4 5 6 0.5\n";
    let good = block(1, 2, points);
    let cases = [
        (String::new(), "no scan"),
        (block(1, 3, points), "ends after 2"),
        (block(99_999, 99_999, points), "too short"),
        (block(1, 1, points), "line 12"),
        (good.replace("4 5 6 0.5", "4 5 x 0.5"), "line 12: not a number, \"x\""),
        (good.replace("4 5 6 0.5", "4 5 6"), "line 12: line holds not 4"),
        (good.replace("1 2 3 0.5", "1 2 3 0.5 7"), "line 11: line of a point must hold"),
        (good.replace("1 2 3 0.5", "1,5 2 3 0.5"), "decimal point"),
        (good.replace("10 20 30 1", "10 20 30 0"), "last column"),
        (good.replace("10 20 30 1", "10 20 30 nan"), "last column"),
        (good.replace("0 1 0 0", "0 2 0 0"), "no rotation"),
        (
            good.replace("0 1 0 0\n-1 0 0 0\n0 0 1 0", "0 .001 0 0\n-.001 0 0 0\n0 0 .001 0"),
            "scales, by",
        ),
        (good.replace("0 0 1 0", "0 0 -1 0"), "mirrors"),
        (good.replace("0 0 1 0", "0 0 0 0"), "flattens"),
        (good.replace("10 20 30 1", "10 nan 30 1"), "no number"),
        (good.replacen("1\n", "-1\n", 1), "no count"),
        (good.replacen("1\n", "1.5\n", 1), "no count"),
        (good.split_once("-1 0 0").expect("there").0.into(), "within the header"),
        (good.clone() + "7 8 9 0.5\n", "more points than it announces"),
        (block(1, 1, &"1".repeat(9000)), "longer than"),
    ];
    for (n, (text, words)) in cases.iter().enumerate() {
        let file = ScratchFile::new(&format!("broken-{n}.ptx"), text.as_bytes());
        let error =
            read(&file.0, Want::Coordinates).err().unwrap_or_else(|| panic!("{words}: was taken"));
        assert!(
            error.to_string().contains(words) && error.kind() == Kind::BadInput,
            "{words}: {error}"
        );
    }
}

#[test]
fn broken_bytes_are_never_fatal() {
    let text = block(3, 40, &"1.25 -2.5 3.75 0.5 1 2 3\n0 0 0 0.5 0 0 0\n".repeat(60)).into_bytes();
    let mut dice = SplitMix64::seed_from_u64(3);
    for _round in 0..400 {
        let mut broken = text.clone();
        let at = below(&mut dice, broken.len());
        broken[at] ^= 1 << below(&mut dice, 8);
        let file = ScratchFile::new("flip.ptx", &broken);
        let _either = read(&file.0, Want::Everything);
    }
    for len in (0..text.len() - 14).step_by(37) {
        let file = ScratchFile::new("cut.ptx", &text[..len]);
        assert!(read(&file.0, Want::Coordinates).is_err(), "{len}");
    }
}
