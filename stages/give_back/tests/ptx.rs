//! PTX files given back: lines of moving points are beams without return, all others stay.

mod common;

use common::{ByRule, give_ptx, shared};
use contract::is_ptx_no_return;
use give_back::GivenBack;

/// Header of a scan.
fn head(n_cols: usize, n_rows: usize, end: &str) -> String {
    let lines = ["0 0 0", "1 0 0", "0 1 0", "0 0 1", "1 0 0 0", "0 1 0 0", "0 0 1 0", "0 0 0 1"];
    [n_cols.to_string(), n_rows.to_string()]
        .iter()
        .map(String::as_str)
        .chain(lines)
        .map(|line| format!("{line}{end}"))
        .collect()
}

/// Compares a file with what was given back of it, line by line, and returns the numbers of points.
fn same_but_for_the_moving(bytes: &[u8], heads: &[(usize, usize)]) -> Vec<GivenBack> {
    let (out, counts) = give_ptx(bytes, heads.len()).expect("is given back");
    let split = |bytes: &[u8]| -> Vec<Vec<u8>> {
        bytes.split_inclusive(|b| *b == b'\n').map(<[u8]>::to_vec).collect()
    };
    let (before, after) = (split(bytes), split(&out));
    assert_eq!(before.len(), after.len());
    let mut at = 0;
    for ((n_lines, n_blank), counts) in heads.iter().zip(&counts) {
        let n_head = 10 + n_blank;
        assert_eq!(before[at..at + n_head], after[at..at + n_head]);
        at += n_head;
        let (mut place, mut n_out) = (0, 0);
        for (old, new) in before[at..at + n_lines].iter().zip(&after[at..at + n_lines]) {
            let is_valid = !is_ptx_no_return(old.trim_ascii_end());
            let is_out = is_valid && ByRule::fate(place).is_out;
            place += u64::from(is_valid);
            n_out += u64::from(is_out);
            if !is_out {
                assert_eq!(old, new);
                continue;
            }
            assert!(is_ptx_no_return(new.trim_ascii_end()));
            let rest = |line: &[u8]| {
                let text = String::from_utf8_lossy(line).into_owned();
                text.split_whitespace().skip(3).collect::<Vec<_>>().join(" ")
            };
            assert_eq!(rest(old), rest(new));
            assert_eq!(old.ends_with(b"\r\n"), new.ends_with(b"\r\n"));
        }
        assert_eq!(*counts, GivenBack { n_valid: place, n_out });
        at += n_lines;
    }
    assert_eq!(at, before.len());
    counts
}

#[test]
fn lines_of_every_kind_come_back() {
    for (end, columns) in [("\n", ""), ("\r\n", " 0.5"), ("\n", " 0.25 1 2 3"), ("\n", " 1 2 3")] {
        let line = |i: usize| match i % 5 {
            0 => format!("0 0 0{columns}{end}"),
            1 => format!("  {i}.5\t-2 3{columns} {end}"),
            _ => format!("{i}.25 0 -0{columns}{end}"),
        };
        let points = |n: usize| (0..n).map(line).collect::<String>();
        let text = [
            head(300, 400, end) + &points(120_000),
            head(0, 7, end),
            format!("{end}{}", head(1, 3, end)) + &points(3),
        ];
        let heads = [(120_000, 0), (0, 0), (3, 1)];
        let counts = same_but_for_the_moving(text.concat().as_bytes(), &heads);
        assert!(counts[0].n_out > 10_000, "{counts:?}");
    }
    // The last line may lack its end.
    let text = head(1, 1, "\n") + "1 2 3";
    same_but_for_the_moving(text.as_bytes(), &[(1, 0)]);
}

#[test]
fn real_files_come_back() {
    let Some(folder) = shared("kurt3d-corridor") else { return };
    let bytes = std::fs::read(folder.join("kurt_2scans.ptx")).expect("reads");
    let counts = same_but_for_the_moving(&bytes, &[(81_360, 0), (81_360, 0)]);
    assert_eq!([counts[0].n_valid, counts[1].n_valid], [79_868, 80_047]);
}

#[test]
fn broken_files_are_refused() {
    let good = head(1, 2, "\n") + "1 2 3\n4 5 6\n";
    for (text, words) in [
        (good.replace("4 5 6\n", ""), "ends within a scan"),
        (good.replacen('1', "x", 1), "no count"),
        (good.clone() + "7\n", "ends within a scan"),
        (good.clone() + &good, "more scans"),
        (head(1, 1, "\n") + &"1".repeat(3 << 20), "longer than"),
    ] {
        let error = give_ptx(text.as_bytes(), 1).expect_err(words).to_string();
        assert!(error.contains(words), "{error}");
    }
}
