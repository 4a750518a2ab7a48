//! A path of a robot against what was scanned, from outside: into the floor, through what nobody
//! has seen, and what is no path.

use crate::common::palletiser;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// Beams of each scanner.
const N_BEAMS: u64 = 250_000;

fn program(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    command.current_dir(dir).args(args).args(["--progress", "none"]);
    command.output().expect("the program starts")
}

/// Checks a path; the exit code and the answer.
fn check(dir: &Path, path: &str, more: &[&str]) -> (i32, Value) {
    std::fs::write(dir.join("path.csv"), path).expect("writes");
    let args = ["check", "out", "--trajectory", "path.csv", "--json"];
    let output = program(dir, &[&args, more].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    let answer = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {said}"));
    (output.status.code().expect("it ends"), answer)
}

/// Contacts of a level, with what.
fn contacts<'a>(answer: &'a Value, what: &str) -> Vec<&'a Value> {
    let all = answer["contacts"].as_array().expect("contacts");
    all.iter().filter(|c| c["what"] == what && c["level"] != "unseen").collect()
}

#[test]
fn a_path_is_free_only_where_all_is_known_and_nothing_near() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    palletiser(dir, 12, N_BEAMS);
    let args = ["run", "scans/scans.e57", "--robots", "robots", "--out", "out"];
    let run = program(dir, &args);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let text = std::fs::read_to_string(dir.join("out/result.json")).expect("a result");
    let result: Value = serde_json::from_str(&text).expect("JSON");
    let joints = result["robots"][0]["joints"].as_object().expect("joints");
    let names: Vec<&str> = joints.keys().map(String::as_str).collect();
    let found: Vec<f64> = joints.values().map(|v| v.as_f64().expect("a value")).collect();
    let line =
        |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
    let moved = |joint: usize, by: f64| {
        let mut out = found.clone();
        out[joint] += by;
        out
    };
    let head = names.join(",") + "\n";

    // Where it stands nothing is in its way, in whatever units.
    let (code, stands) = check(dir, &(head.clone() + &line(&found)), &[]);
    assert!([0, 3].contains(&code) && stands["outcome"] != "blocked", "{stands}");
    assert_eq!(stands["n_postures"], 1);
    let degrees: Vec<f64> = found.iter().map(|v| v.to_degrees()).collect();
    let (_, same) = check(dir, &(head.clone() + &line(&degrees)), &["--degrees"]);
    assert_eq!(same["contacts"], stands["contacts"]);

    // Its arm bent to its stops goes through the floor, once it is low enough.
    let mut stops = found.clone();
    (stops[1], stops[2]) = (1.2, 1.2);
    let down_path = head.clone() + &line(&found) + &line(&stops);
    let (code, down) = check(dir, &down_path, &["--allow", "unseen,beside,as-found"]);
    assert_eq!((code, &down["outcome"]), (1, &Value::from("blocked")), "{down}");
    let floor = contacts(&down, "floor");
    assert!(!floor.is_empty(), "{down}");
    let hit = floor.iter().find(|c| c["level"] == "hit" || c["level"] == "inside");
    let hit = hit.expect("it goes in");
    assert!(hit["from"].as_f64().expect("a place") > 0.1, "{hit}");
    assert!(hit["at"][2].as_f64().expect("a height").abs() < 0.02, "{hit}");
    assert_eq!(hit["as_found"], false);

    // Why it is so, in one sentence.
    let why = down["why"].as_str().expect("a sentence");
    let is_reached = down["impossible"].as_array().expect("a list").is_empty();
    let said = if is_reached { " hits something (" } else { "The robot cannot go there: " };
    assert!(why.contains(said) && why.ends_with('.'), "{why}");
    assert_eq!(down["schema"], "stillpoint.check/2");
    let apart = down["beam_spacing"].as_f64().expect("scanners have positions");
    assert!((0.001..0.05).contains(&apart), "{apart}");

    // A turn keeps clear of the floor: what is left is not known, and may be allowed.
    let turn = head.clone() + &line(&found) + &line(&moved(0, 0.5));
    let (code, turned) = check(dir, &turn, &[]);
    assert_eq!((code, &turned["outcome"]), (3, &Value::from("unknown")), "{turned}");
    assert!(turned["doubts"].as_array().expect("doubts").contains(&"unseen".into()), "{turned}");
    let why = turned["why"].as_str().expect("a sentence");
    assert!(why.starts_with("It is not known whether the path is free: "), "{why}");
    let (code, _) = check(dir, &turn, &["--allow", "unseen,beside,as-found"]);
    assert_eq!(code, 0);
    // The same on any number of threads.
    let (_, one) = check(dir, &turn, &["--threads", "1"]);
    assert_eq!(one, turned);

    several(dir, &[&turn, &down_path, &(head.clone() + &line(&found))], &[&turned, &down, &stands]);

    // Beyond its stops it cannot get.
    let (code, beyond) = check(dir, &(head.clone() + &line(&moved(0, 9.0))), &[]);
    assert_eq!(code, 1);
    assert!(beyond["impossible"][0]["what"].to_string().contains("beyond its limits"), "{beyond}");

    for (path, code, said) in [
        ("elbow\n0.1\n".to_owned(), 2, "no robot of the result has the joints elbow"),
        (head + "0.1\n", 4, "line 2 has 1 values"),
    ] {
        std::fs::write(dir.join("path.csv"), path).expect("writes");
        let output = program(dir, &["check", "out", "--trajectory", "path.csv"]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{text}");
        assert!(text.contains(said), "{text}");
    }
}

/// Several paths in one call have the reports of each by itself, and the worst exit code.
fn several(dir: &Path, paths: &[&str; 3], alone: &[&Value; 3]) {
    let files = ["turn.csv", "down.csv", "stands.csv"];
    files
        .iter()
        .zip(paths)
        .for_each(|(f, path)| std::fs::write(dir.join(f), path).expect("writes"));
    let call = |files: &[&str], more: &[&str]| {
        let output = program(dir, &[&["check", "out", "--trajectory"], files, more].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), String::from_utf8(output.stdout).expect("text"), said)
    };
    let (code, text, said) = call(&files, &["--json"]);
    let answer: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {said}"));
    assert_eq!((code, &answer["schema"]), (Some(1), &Value::from("stillpoint.checks/1")), "{said}");
    let reports = answer["paths"].as_array().expect("reports");
    assert_eq!(reports.len(), 3);
    for ((report, alone), file) in reports.iter().zip(alone).zip(files) {
        let mut report = report.clone();
        let own = report.as_object_mut().expect("an object");
        assert_eq!(own.remove("trajectory"), Some(file.into()));
        let passes = own.remove("passes").expect("is told");
        assert_eq!(passes, own["outcome"] == "free", "{file}");
        assert_eq!(&report, *alone, "{file}");
    }
    // Without the one that is blocked it is not known, and doubts that are allowed pass.
    let unknown = ["stands.csv", "--trajectory", "turn.csv"];
    let (code, text, _) = call(&unknown, &[]);
    assert_eq!(code, Some(3));
    assert!(text.starts_with("stands.csv\n") && text.contains("\nturn.csv\n"), "{text}");
    let doubts = ["--allow", "unseen,beside,as-found,posture"];
    let (code, text, _) = call(&unknown, &doubts);
    assert!(code == Some(0) && text.ends_with("2 pass\n"), "{text}");
    let (code, text, _) = call(&files, &doubts);
    assert!(code == Some(1) && text.contains("1 blocked") && text.ends_with("2 pass\n"), "{text}");
    // A file that is no path is named before anything is looked at.
    std::fs::write(dir.join("odd.csv"), "elbow\n0.1\n").expect("writes");
    let (code, text, said) = call(&["turn.csv", "odd.csv"], &[]);
    assert!(code == Some(2) && text.is_empty() && said.contains("odd.csv"), "{said}");
}

/// A cell that the bench draws, with wires in the robot's way: curtains of points behind outlines,
/// strays, and gaps beside its own links are in nobody's way.
#[test]
fn small_moves_among_all_that_a_scan_gets_wrong_are_free_and_no_collision_is() {
    let dir = tempfile::tempdir().expect("a folder");
    let args =
        ["bench", "check", "--cases", "1", "--first", "3", "--seed", "591", "--step", "0.25"];
    let bench = program(dir.path(), &[&args[..], &["--out", "bench"]].concat());
    assert!(bench.status.success(), "{}", String::from_utf8_lossy(&bench.stderr));
    let text = std::fs::read_to_string(dir.path().join("bench/check.jsonl")).expect("rows");
    let row: Value = serde_json::from_str(&text).expect("one row");
    let paths = row["paths"].as_array().expect("paths");
    let of = |truth: &str| paths.iter().filter(|p| p["truth"] == truth).collect::<Vec<_>>();
    let (free, hits) = (of("free"), of("collides"));
    assert!(free.len() >= 5 && hits.len() >= 3, "{row}");
    assert!(hits.iter().all(|p| p["outcome"] != "free"), "{hits:?}");
    assert!(free.iter().all(|p| p["outcome"] == "free"), "{free:?}");

    // Of points of still things hardly any are dropped, of strays behind edges many: what may be a
    // wire or a pipe is kept with the strays beside it.
    let points = row["points"].as_object().expect("counts");
    let sum = |strays: bool, what: &str| -> u64 {
        let own = points.iter().filter(|(name, _)| (*name == "strays") == strays);
        own.map(|(_, count)| count[what].as_u64().expect("a number")).sum()
    };
    assert!(sum(false, "n") > 20_000 && sum(true, "n") > 50, "{points:?}");
    assert!(1000 * sum(false, "n_dropped") < sum(false, "n"), "{points:?}");
    assert!(5 * sum(true, "n_dropped") > 2 * sum(true, "n"), "{points:?}");
}
