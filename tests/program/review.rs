//! What a person says of a robot, from outside: a posture near which it stands, one at which it
//! does not, that nothing stands there, and what cannot be.

use crate::common::palletiser;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// Beams of each scanner.
const N_BEAMS: u64 = 250_000;
/// How far the posture in the review is from the true one, and how far from it the fit may end,
/// radians.
const OFF: f64 = 0.05;
const NEAR: f64 = 2e-4;

fn run(dir: &Path, review: &str) -> Output {
    run_with(dir, review, &[])
}

fn run_with(dir: &Path, review: &str, more: &[&str]) -> Output {
    std::fs::write(dir.join("review.toml"), review).expect("writes");
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    command.current_dir(dir).args(["run", "scans/scans.e57", "--robots", "robots", "--out", "out"]);
    command.args(["--review", "review.toml", "--progress", "none"]);
    command.args(more);
    command.output().expect("the program starts")
}

fn result(dir: &Path, review: &str) -> Value {
    let output = run(dir, review);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(dir.join("out/result.json")).expect("a result");
    serde_json::from_str(&text).expect("JSON")
}

fn joints(robot: &Value) -> Vec<(String, f64)> {
    let joints = robot["joints"].as_object().expect("joints");
    joints.iter().map(|(name, v)| (name.clone(), v.as_f64().expect("a value"))).collect()
}

#[test]
fn a_posture_that_is_given_is_where_the_fit_begins_and_no_more() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    palletiser(dir, 11, N_BEAMS);
    let found = &result(dir, "")["robots"][0];
    let at = &found["base_pose"]["xyz"];
    let given = |off: f64| {
        let words =
            joints(found).into_iter().map(|(name, value)| format!("{name} = {}", value + off));
        let words: Vec<String> = words.collect();
        format!(
            "[[robot]]\nat = {at}\nmodel = {}\njoints = {{ {} }}\n",
            found["model"],
            words.join(", ")
        )
    };
    let near = &result(dir, &given(OFF))["robots"][0];
    assert_eq!(near["verdict"], "trusted");
    for ((name, a), (_, b)) in joints(found).iter().zip(joints(near)) {
        let sigma = found["sigma"][name].as_f64().expect("a deviation");
        assert!((a - b).abs() < NEAR.max(3.0 * sigma), "{name}: {a} and {b} ± {sigma}");
    }
    let far = result(dir, &given(0.6));
    assert!(far["warnings"].to_string().contains("contradicts the scans"), "{}", far["warnings"]);
    assert_eq!(joints(&far["robots"][0]), joints(found));
    let none = result(dir, &format!("[[robot]]\nat = {at}\nverdict = \"reject\"\n"));
    assert_eq!(none["robots"].as_array().expect("robots").len(), 0);
    // It was a true robot: that is said, not passed over.
    let did = none["review"][0]["did"].as_str().expect("a sentence");
    assert!(
        did.contains("(trusted, score ") && did.contains("check whether this is intended"),
        "{did}"
    );
    assert!(none["warnings"].to_string().contains("review, entry 1: reject near "), "{none:#}");
    let odd = run(
        dir,
        &format!("[[robot]]\nat = {at}\nmodel = {}\njoints = {{ elbow = 1.0 }}", found["model"]),
    );
    let said = String::from_utf8_lossy(&odd.stderr).into_owned();
    assert_eq!(odd.status.code(), Some(4), "{said}");
    assert!(
        said.contains("review.toml") && said.contains("no joint \"elbow\": there are "),
        "{said}"
    );
}

#[test]
fn a_place_and_a_model_are_enough_where_the_run_finds_nothing_to_search() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    // So many beams that the flange's turn is clear: it is coarse with a quarter of them, and a few
    // samples decide on the verdict then.
    palletiser(dir, 12, 4 * N_BEAMS);
    let found = result(dir, "")["robots"][0].clone();
    let base: Vec<f64> =
        (0..3).map(|i| found["base_pose"]["xyz"][i].as_f64().expect("a number")).collect();
    // No body of this many points is there, so that no region is searched.
    let nothing = ["--set", "region.min_points=1000000000"];
    let robots = |review: &str| {
        let output = run_with(dir, review, &nothing);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read_to_string(dir.join("out/result.json")).expect("a result");
        let result: Value = serde_json::from_str(&text).expect("JSON");
        result["robots"].as_array().expect("robots").clone()
    };
    assert_eq!(robots("").len(), 0);
    let at = format!("[{}, {}, {}]", base[0] + 0.15, base[1] - 0.2, base[2] + 0.1);
    let place = format!("[[robot]]\nat = {at}\nmodel = {}\n", found["model"]);
    let same = |hinted: &[Value]| {
        assert_eq!(hinted.len(), 1, "{hinted:?}");
        assert_eq!(hinted[0]["verdict"], "trusted", "{:#}", hinted[0]);
        for ((name, a), (_, b)) in joints(&found).iter().zip(joints(&hinted[0])) {
            let sigma = found["sigma"][name].as_f64().expect("a deviation");
            assert!((a - b).abs() < NEAR.max(4.0 * sigma), "{name}: {a} and {b} ± {sigma}");
        }
    };
    same(&robots(&place));
    // The posture without the turn of the base.
    let near: Vec<String> = joints(&found)
        .into_iter()
        .map(|(name, value)| format!("{name} = {}", value + OFF))
        .collect();
    same(&robots(&format!("{place}joints = {{ {} }}\n", near.join(", "))));
}
