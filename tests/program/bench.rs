//! Cells drawn from seeds, scanned and searched by `bench accuracy`: mounts, closed loops, scans
//! without noise and the source's method are right in them, and what is written can be read.
#![allow(clippy::print_stderr, reason = "a test that is skipped says so")]

use std::path::Path;
use std::process::Command;

/// Runs suites of one demo robot; returns the rows.
fn rows(out: &Path, args: &[&str]) -> Vec<serde_json::Value> {
    let done = Command::new(env!("CARGO_BIN_EXE_stillpoint"))
        .args(["bench", "accuracy", "--against", "same", "--progress", "none", "--out"])
        .arg(out)
        .args(args)
        .output()
        .expect("the program starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    for picture in ["errors.svg", "reliability.svg"] {
        let text = std::fs::read_to_string(out.join(picture)).expect("is written");
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"), "{picture}");
    }
    let text = std::fs::read_to_string(out.join("accuracy.json")).expect("is written");
    let whole: serde_json::Value = serde_json::from_str(&text).expect("parses");
    whole["rows"].as_array().expect("rows").clone()
}

/// Largest error of the joints said to be determined, degrees.
fn worst(row: &serde_json::Value) -> f64 {
    let joints = row["joints"].as_array().expect("joints");
    let known = joints.iter().filter(|j| j["determined"] == true);
    known.map(|j| j["error"].as_f64().expect("a number").abs().to_degrees()).fold(0.0, f64::max)
}

#[test]
fn robots_hang_from_ceilings_and_walls_and_follow_their_loops() {
    let out = tempfile::tempdir().expect("a folder");
    let args = ["--suite", "mounts,loops", "--model", "palletiser", "--cases", "2", "--seed", "4"];
    let rows = rows(out.path(), &args);
    assert_eq!(rows.len(), 4);
    for row in &rows {
        assert_eq!(row["right"], true, "{row:#}");
        assert_eq!(row["n_invented"], 0, "{row:#}");
        assert!(worst(row) < 0.1, "{row:#}");
        assert!(row["loop_gap"].as_f64().expect("a number") < 1e-9, "{row:#}");
        let [turn, shift] = [0, 1].map(|i| row["sub"][i].as_f64().expect("a number"));
        assert!(turn.to_degrees() < 0.1 && shift < 1e-3, "{row:#}");
    }
}

#[test]
fn small_arms_are_exact_where_scans_are() {
    let out = tempfile::tempdir().expect("a folder");
    let rows = rows(
        out.path(),
        &["--suite", "paper", "--model", "arm", "--cases", "1", "--seed", "81010"],
    );
    let row = &rows[0];
    assert_eq!(row["verdict"], "trusted", "{row:#}");
    // Points beside edges that were matched with another face made it 0.02°.
    assert!(worst(row) < 0.01, "{row:#}");
}

#[test]
fn the_method_of_the_source_stays_within_its_printed_errors_and_trusts_nothing() {
    let out = tempfile::tempdir().expect("a folder");
    let args = ["--suite", "models", "--model", "palletiser", "--cases", "1", "--seed", "3"];
    let rows = rows(out.path(), &[&args[..], &["--method", "paper"]].concat());
    let row = &rows[0];
    assert_eq!(row["verdict"], "doubtful", "{row:#}");
    // Its Table 1: 0.8° after the sweep, 0.54° after the registration.
    assert!(worst(row) < 0.54, "{row:#}");
    for joint in row["joints"].as_array().expect("joints") {
        assert!(joint["rough"].as_f64().expect("swept").abs() < 0.8_f64.to_radians(), "{joint}");
    }
}

#[test]
fn robots_whose_feet_hide_all_of_their_stands_are_found() {
    let out = tempfile::tempdir().expect("a folder");
    let models = "palletiser,welder";
    let args = ["--suite", "pillars", "--model", models, "--cases", "2", "--seed", "7"];
    for row in rows(out.path(), &args) {
        assert_eq!(row["right"], true, "{row:#}");
        assert_eq!(row["verdict"], "trusted", "{row:#}");
    }
}

#[test]
fn robots_behind_plates_and_beside_others_are_found() {
    let out = tempfile::tempdir().expect("a folder");
    let args = ["--suite", "hidden,crossed", "--model", "arm", "--cases", "3", "--seed", "8"];
    let rows = rows(out.path(), &args);
    // Of a foot that is a quarter there another yaw may be as good.
    let n_trusted = rows.iter().filter(|row| row["verdict"] == "trusted").count();
    assert!(n_trusted >= 5, "{n_trusted} of {} are trusted", rows.len());
    for row in rows {
        assert_eq!(row["right"], true, "{row:#}");
        assert_eq!(row["n_invented"], 0, "{row:#}");
        // Plates that hide three quarters of a foot were taken for it, the wrong way round: 753 mm.
        assert!(row["tip"][0].as_f64().expect("a number") < 0.002, "{row:#}");
    }
}

#[test]
fn robots_whose_arms_cross_are_both_kept() {
    let out = tempfile::tempdir().expect("a folder");
    let args = ["--suite", "crossed", "--model", "welder", "--seed", "86900"];
    let rows = rows(out.path(), &[&args[..], &["--first", "1", "--cases", "1"]].concat());
    // Their boxes share a quarter: one of them was taken for the other's twin, and dropped.
    assert_eq!(rows[0]["right"], true, "{:#}", rows[0]);
    assert_eq!(rows[0]["verdict"], "trusted", "{:#}", rows[0]);
}

#[test]
fn electrodes_are_found_beside_what_hangs_on_them() {
    let out = tempfile::tempdir().expect("a folder");
    let args = ["--suite", "clutter", "--model", "welder", "--seed", "86400", "--cases", "1"];
    let rows = rows(out.path(), &args);
    assert_eq!(rows.len(), 1);
    // A gripper drew the electrode to the end of its slide, 0.14 m away.
    assert_eq!(rows[0]["right"], true, "{:#}", rows[0]);
    let tip = rows[0]["tip"][0].as_f64().expect("a number");
    assert!(tip < 1e-3, "{:#}", rows[0]);
    // What hangs along the arm goes with it; what stands beside it does not.
    let [moving, all] = [0, 1].map(|i| rows[0]["labels"]["hoses"][i].as_f64().expect("a count"));
    assert!(all > 500.0 && moving > 0.9 * all, "{:#}", rows[0]);
    let [all, lost] = [0, 1].map(|i| rows[0]["labels"]["fixed"][i].as_f64().expect("a count"));
    assert!(all > 1000.0 && lost < 1e-4 * all, "{:#}", rows[0]);
}

#[test]
fn adjusting_from_the_truth_is_no_better_and_going_link_after_link_is_worse() {
    let out = tempfile::tempdir().expect("a folder");
    let suites = "registration,sequential,scans-held,from-truth";
    let args = ["--suite", suites, "--model", "palletiser", "--cases", "1", "--seed", "3"];
    let rows = rows(out.path(), &args);
    assert_eq!(rows.len(), 4);
    let error = |row: &serde_json::Value| {
        let joints = row["joints"].as_array().expect("joints").iter();
        let errors = joints.map(|j| j["error"].as_f64().expect("a number").abs().to_degrees());
        // The last one turns a bare flange.
        errors.take(3).fold(0.0, f64::max)
    };
    let [ours, sequential, held, from_truth] = [0, 1, 2, 3].map(|i| error(&rows[i]));
    assert!((ours - from_truth).abs() < 0.01, "{ours} {from_truth}");
    assert!(sequential > 3.0 * ours && sequential < 0.5, "{sequential} {ours}");
    assert!(held > 3.0 * ours && held < 0.2, "{held} {ours}");
    assert_eq!(rows[1]["is_baseline"], true);
    let text = std::fs::read_to_string(out.path().join("accuracy.md")).expect("is written");
    assert!(
        text.contains("| the product | 1 of 1 |") && text.contains("| from-truth | 1 of 1 |"),
        "{text}"
    );
}

#[test]
fn robots_whose_joints_are_elsewhere_are_doubted_until_they_are_calibrated() {
    let out = tempfile::tempdir().expect("a folder");
    let args = ["--suite", "frames,calibration", "--model", "arm", "--cases", "1", "--seed", "5"];
    let rows = rows(out.path(), &args);
    assert_eq!(rows[0]["verdict"], "doubtful", "{:#}", rows[0]);
    for row in &rows {
        assert_eq!(row["right"], true, "{row:#}");
    }
    // The nominal fit's doubt was of joints that it did not know, and these are known.
    assert_eq!(rows[1]["verdict"], "trusted", "{:#}", rows[1]);
    assert!(worst(&rows[1]) < 0.1, "{:#}", rows[1]);
}

/// Copies real models, where they are there, to a folder; whether they are.
fn copy_real(names: &[&str], robots: &Path) -> bool {
    let real = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/robots");
    for name in names {
        if !real.join(name).is_dir() {
            eprintln!("skipped: no {name} in {}", real.display());
            return false;
        }
        crate::common::copy_folder(&real.join(name), &robots.join(name));
    }
    true
}

/// All that hang on flanges are found.
fn check_tools(robots: &Path, more: &[&str]) {
    let out = tempfile::tempdir().expect("a folder");
    let folder = robots.display().to_string();
    let args = [&["--suite", "tools", "--cases", "2", "--robots", &folder], more].concat();
    let rows = rows(out.path(), &args);
    assert_eq!(rows.len(), 2);
    for row in rows {
        assert_eq!(row["right"], true, "{row:#}");
        assert_eq!(row["verdict"], "trusted", "{row:#}");
    }
}

#[test]
fn grippers_are_found_on_real_flanges_and_turned_as_they_hang() {
    let robots = tempfile::tempdir().expect("a folder");
    if copy_real(&["abb_irb7600_150_350", "robotiq_2f_85"], robots.path()) {
        check_tools(robots.path(), &["--seed", "131"]);
    }
}

#[test]
fn grippers_are_found_on_round_flanges() {
    let robots = tempfile::tempdir().expect("a folder");
    stillpoint::eval::demo::write_robots(robots.path()).expect("the library is written");
    if copy_real(&["robotiq_2f_85"], robots.path()) {
        check_tools(robots.path(), &["--seed", "87300", "--model", "palletiser,robotiq"]);
    }
}
