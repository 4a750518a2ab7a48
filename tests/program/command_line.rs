//! The program from outside: exit codes, what goes to standard output and what to standard error.

use std::path::Path;
use std::process::{Command, Output};

fn stillpoint(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_stillpoint")).args(args).output().expect("the program starts")
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("a code, no signal")
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn help_and_version_are_no_failures() {
    let help = stillpoint(&["--help"]);
    assert_eq!(code(&help), 0);
    let text = String::from_utf8_lossy(&help.stdout).into_owned();
    for command in
        ["demo", "inspect", "scanners", "run", "plan", "verify", "report", "simulate", "robots"]
    {
        assert!(text.contains(command), "{command}");
    }
    assert_eq!(code(&stillpoint(&["--version"])), 0);
}

/// Completions and pages name all commands, those of `bench` and `robots` as well.
#[test]
fn completions_and_manual_pages_name_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = stillpoint(&["completions", shell]);
        assert_eq!(code(&script), 0, "{}", err(&script));
        let text = String::from_utf8_lossy(&script.stdout).into_owned();
        for word in ["rescan", "calibrate", "throughput", "keep-going"] {
            assert!(text.contains(word), "{shell}: {word}");
        }
    }
    let dir = tempfile::tempdir().expect("a folder");
    let out = dir.path().join("man");
    let output = stillpoint(&["manual", &out.to_string_lossy()]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    for page in ["stillpoint", "stillpoint-run", "stillpoint-robots-calibrate"] {
        let text = std::fs::read_to_string(out.join(format!("{page}.1"))).expect("a page");
        assert!(text.starts_with(".ie") && text.contains(".SH NAME"), "{page}");
    }
    // A folder that cannot be made.
    let file = dir.path().join("file");
    std::fs::write(&file, "").expect("writes");
    assert_eq!(code(&stillpoint(&["manual", &file.to_string_lossy()])), 1);
}

#[test]
fn usage_is_two() {
    for args in [
        &["frobnicate"][..],
        &["run", "a.e57"],
        &["inspect", "a.e57", "--set", "fit.bean=3"],
        &["inspect", "a.e57", "--threads", "0"],
        &["inspect", "a.e57", "--memory", "much"],
        &["check", "a", "--trajectory", "b", "--margin", "7"],
        &["rescan", "a.e57", "--base", "b", "--out", "o", "--cell", "1,2", "--robot", "R1"],
        &["export", "a", "--to", "ply", "--robots", "b"],
        &["export", "a", "--to", "ply", "--bound", "0.01"],
        &["export", "a", "--to", "mesh", "--bound", "5"],
        &["export", "a", "--to", "mjcf", "--package", "cell"],
        &["export", "a", "--to", "urdf", "--package", "../cell"],
    ] {
        let output = stillpoint(args);
        assert_eq!(code(&output), 2, "{args:?}: {}", err(&output));
        assert!(output.stdout.is_empty(), "{args:?}");
    }
    assert_eq!(code(&stillpoint(&["inspect", "a.e57", "--memory", "1MiB"])), 5);
}

/// One rule for all commands: a path that a person names and that is not there, or is not what it
/// should be, is bad input.
#[test]
fn a_path_that_leads_nowhere_is_four_for_every_command() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| dir.path().join(name).to_string_lossy().into_owned();
    let (nosuch, out, file) = (at("nosuch"), at("out"), at("file"));
    std::fs::write(&file, "plain text").expect("writes");
    std::fs::create_dir(at("empty")).expect("is made");
    let (empty, path) = (at("empty"), at("path.csv"));
    std::fs::write(&path, "joint\n0.5\n").expect("writes");
    // What is wrong stands behind the arguments.
    let cases: &[(&[&str], &str)] = &[
        (&["inspect", &nosuch], &nosuch),
        (&["inspect", &empty], &empty),
        (&["run", &nosuch, "--robots", &empty, "--out", &out], &nosuch),
        (&["run", &file, "--robots", &nosuch, "--out", &out], &nosuch),
        (&["run", &file, "--robots", &empty, "--out", &out, "--review", &nosuch], &nosuch),
        (&["run", &file, "--robots", &empty, "--out", &out, "--scanners", &nosuch], &nosuch),
        (&["plan", &nosuch, "--robots", &empty, "--out", &out], &nosuch),
        (&["plan", &file, "--robots", &nosuch, "--out", &out], &nosuch),
        (&["rescan", &nosuch, "--base", &empty, "--out", &out], &nosuch),
        (&["rescan", &file, "--base", &nosuch, "--out", &out], &nosuch),
        (&["rescan", &file, "--base", &empty, "--out", &out], &empty),
        (&["verify", &nosuch], &nosuch),
        (&["verify", &empty], &empty),
        (&["report", &nosuch], &nosuch),
        (&["report", &empty], &empty),
        (&["export", &nosuch, "--to", "ply"], &nosuch),
        (&["export", &empty, "--to", "copc"], &empty),
        (&["export", &nosuch, "--to", "mjcf"], &nosuch),
        (&["export", &empty, "--to", "urdf"], &empty),
        (&["export", &empty, "--to", "distance"], &empty),
        (&["export", &empty, "--to", "mesh"], &empty),
        (&["check", &nosuch, "--trajectory", &path], &nosuch),
        (&["check", &empty, "--trajectory", &path], &empty),
        (&["check", &empty, "--trajectory", &nosuch], &nosuch),
        (&["diff", &nosuch, &nosuch], &nosuch),
        (&["diff", &empty, &file], &empty),
        (&["history", &nosuch], &nosuch),
        (&["history", &empty], &empty),
        (&["history", &file], &file),
        (&["simulate", &nosuch, "--out", &out], &nosuch),
        (&["simulate", &file, "--out", &out], &file),
        (&["robots", "lint", &nosuch], ""),
        (&["robots", "calibrate", &nosuch, "--robots", &empty, "--out", &out], &nosuch),
        (&["robots", "calibrate", &empty, "--robots", &empty, "--out", &out], &empty),
        (&["bench", "accuracy", "--robots", &nosuch], &nosuch),
        (&["bench", "plant", "--robots", &nosuch], &nosuch),
        (&["bench", "rescan", "--robots", &nosuch], &nosuch),
        (&["bench", "throughput", "--robots", &nosuch, "--out", &out], &nosuch),
        (&["inspect", &file, "--config", &nosuch], &nosuch),
        (&["inspect", &file, "--config", &file], &file),
        (&["inspect", &file, "--scanners", &nosuch], &nosuch),
        (&["inspect", &file], &file),
    ];
    for (args, wrong) in cases {
        let output = stillpoint(&[*args, &["--progress", "none"][..]].concat());
        let text = err(&output);
        assert_eq!(code(&output), 4, "{args:?}: {text}");
        assert!(text.contains(wrong), "{args:?}: {text}");
    }
    assert!(!dir.path().join("out/result.json").exists());
}

/// Pipes wait for ever, and devices have no end: neither is read, whatever it is named for.
#[cfg(target_os = "linux")]
#[test]
fn pipes_and_devices_are_refused_at_once() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| dir.path().join(name).to_string_lossy().into_owned();
    let (pipe, file, out, empty) = (at("pipe"), at("file"), at("out"), at("empty"));
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("makes pipes").success());
    std::fs::write(&file, "plain text").expect("writes");
    std::fs::create_dir(&empty).expect("is made");
    for odd in [pipe.as_str(), "/dev/zero"] {
        let cases: &[&[&str]] = &[
            &["inspect", odd],
            &["inspect", &file, "--config", odd],
            &["inspect", &file, "--scanners", odd],
            &["run", odd, "--robots", &empty, "--out", &out],
            &["run", &file, "--robots", &empty, "--out", &out, "--review", odd],
            &["simulate", odd, "--out", &out],
        ];
        for args in cases {
            let output = stillpoint(args);
            assert_eq!(code(&output), 4, "{args:?}: {}", err(&output));
            let text = err(&output);
            assert!(text.contains(odd) && text.contains("only regular files"), "{args:?}: {text}");
        }
    }
    // A limit names the file, itself and what lifts it; and it is lifted by that.
    let config = at("config.toml");
    std::fs::write(&config, "threads = 2\n").expect("writes");
    let bounded = |most: &str| stillpoint(&["inspect", &file, "--config", &config, "--set", most]);
    let long = bounded("ingest.max_text_bytes=5");
    let text = err(&long);
    assert!(code(&long) == 5 && text.contains("config.toml") && text.contains("5 bytes"), "{text}");
    assert!(text.contains("--set ingest.max_text_bytes"), "{text}");
    assert_eq!(code(&bounded("ingest.max_text_bytes=500")), 4, "the input is no scan");
}

#[test]
fn bad_input_is_four_and_names_the_file() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("noise.e57");
    std::fs::write(&path, [7; 5000]).expect("writes");
    let path = path.to_string_lossy().into_owned();
    let output = stillpoint(&["inspect", &path]);
    assert_eq!(code(&output), 4, "{}", err(&output));
    assert!(err(&output).starts_with(&format!("error: {path}: ")), "{}", err(&output));
    let output = stillpoint(&["inspect", &path, "--log-format", "json"]);
    let error: serde_json::Value = serde_json::from_str(err(&output).trim()).expect("JSON");
    assert_eq!((error["level"].as_str(), code(&output)), (Some("error"), 4));
}

#[test]
fn an_empty_library_is_explained() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().to_string_lossy().into_owned();
    let output = stillpoint(&["robots", "lint", &path, "--json"]);
    assert_eq!(code(&output), 4);
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(all["schema"], "stillpoint.lint/1");
    assert!(all["errors"].as_u64() > Some(0), "{all}");
}

#[test]
fn what_is_counted_and_what_the_system_says_read_as_sentences() {
    let dir = tempfile::tempdir().expect("a folder");
    let model = dir.path().join("arm");
    std::fs::create_dir(&model).expect("is made");
    std::fs::write(model.join("robot.urdf"), "<robot name='arm'>").expect("is written");
    let output = stillpoint(&["robots", "lint", &dir.path().to_string_lossy()]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.ends_with("1 error, 0 warnings, 0 notes\n"), "{text}");
    let nowhere = dir.path().join("nowhere").to_string_lossy().into_owned();
    for args in [
        &["verify", &nowhere][..],
        &["report", &nowhere],
        &["history", &nowhere],
        &["diff", &nowhere, &nowhere],
        &["robots", "lint", &nowhere],
        &["simulate", &nowhere, "--out", &nowhere],
    ] {
        let output = stillpoint(args);
        let said = err(&output) + &String::from_utf8_lossy(&output.stdout);
        assert_ne!(code(&output), 0, "{args:?}");
        assert!(!said.is_empty() && !said.contains("os error"), "{args:?}: {said}");
    }
}

/// A bare room with one scanner: scans, poses and truth come out whole, the same for any number of
/// threads.
#[test]
fn a_scene_becomes_scans_with_truth() {
    const SCENE: &str = r#"
        seed = 5
        [floor]
        [[box]]
        name = "crate"
        xyz = [2.0, 0.0, 0.5]
        size = [1.0, 1.0, 1.0]
        [[scanner]]
        name = "alone"
        position = [0.0, 0.0, 1.6]
        raster = { elevation_deg = [-60.0, 90.0], azimuth_deg = [-180.0, 180.0], step_deg = 1.0 }
        min_range = 0.3
        max_range = 80.0
        noise = 0.002
    "#;
    let dir = tempfile::tempdir().expect("a folder");
    let scene = dir.path().join("scene.toml");
    std::fs::write(&scene, SCENE).expect("writes");
    let scan = |name: &str, threads: &str| {
        let out = dir.path().join(name);
        let (scene, text) = (scene.to_string_lossy(), out.to_string_lossy().into_owned());
        let output = stillpoint(&["simulate", &scene, "--out", &text, "--threads", threads]);
        assert_eq!(code(&output), 0, "{}", err(&output));
        out
    };
    let (one, three) = (scan("one", "1"), scan("three", "3"));
    let same = |file: &str| {
        let read = |out: &Path| std::fs::read(out.join(file)).expect(file);
        assert!(read(&one) == read(&three), "{file}");
        read(&one)
    };
    for file in ["scans.e57", "scans.las", "scanners.toml", "truth/labels/0.kind.npy"] {
        assert!(!same(file).is_empty());
    }
    let truth: serde_json::Value = serde_json::from_slice(&same("truth/truth.json")).expect("JSON");
    let n = truth["scans"][0]["n_points"].as_u64().expect("a count");
    assert!(n > 10_000, "{n}");

    let path = |file: &str| one.join(file).to_string_lossy().into_owned();
    let (e57, las, scanners) = (path("scans.e57"), path("scans.las"), path("scanners.toml"));
    let output = stillpoint(&["inspect", &e57, &las, "--scanners", &scanners, "--json"]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    for i in 0..2 {
        assert_eq!(all["inputs"][i]["scans"][0]["scanner_known"], true, "{all}");
    }
    // An E57 file states its beams; how many came back is known once it is read.
    assert_eq!(all["inputs"][1]["n_points"].as_u64(), Some(n), "{all}");
}

/// Each line of standard error is one JSON object.
fn json_lines(output: &Output) -> Vec<serde_json::Value> {
    let parse = |line: &str| {
        serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}\n{}", err(output)))
    };
    err(output).lines().map(parse).collect()
}

#[test]
fn a_log_of_json_holds_nothing_else() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("noise.e57");
    std::fs::write(&path, "noise").expect("writes");
    let path = path.to_string_lossy().into_owned();
    for (args, kind) in [
        (&["frobnicate", "--log-format", "json"][..], "usage"),
        (&["run", "--log-format=json"], "usage"),
        (&["inspect", "no/such.e57", "--log-format=json"], "bad_input"),
        (&["inspect", &path, "--log-format", "json"], "bad_input"),
    ] {
        let output = stillpoint(args);
        let lines = json_lines(&output);
        assert_eq!(lines.last().map(|l| &l["kind"]), Some(&kind.into()), "{args:?}: {lines:?}");
    }
    // Progress, too, even where lines are asked for, or none.
    for progress in ["plain", "none", "json"] {
        let out = dir.path().join(progress);
        let scene = dir.path().join("scene.toml");
        std::fs::write(&scene, SCENE).expect("writes");
        let [scene, out] = [scene, out].map(|p| p.to_string_lossy().into_owned());
        let robots = dir.path().to_string_lossy().into_owned();
        let output = stillpoint(&[
            "simulate",
            &scene,
            "--robots",
            &robots,
            "--out",
            &out,
            "--log-format=json",
            "--progress",
            progress,
        ]);
        json_lines(&output);
    }
}

/// A scene that names a robot that no library has: refused after the library was read.
const SCENE: &str = "seed = 1\n[[robots]]\nmodel = 'none'\nxyz = [0, 0, 0]\n";

#[test]
fn names_of_files_do_not_steer_the_terminal() {
    let dir = tempfile::tempdir().expect("a folder");
    let name = "a\u{1b}[2Jb\u{202e}c\rd\nerror: all is well";
    let path = dir.path().join(name).with_extension("e57");
    std::fs::write(&path, "noise").expect("writes");
    let path = path.to_string_lossy().into_owned();
    let is_odd = |c: char| contract::quote::is_odd(c) && c != '\n';
    for args in [
        &["inspect", &path][..],
        &["inspect", &path, "--log-format=json"],
        &["verify", &path],
        &["robots", "lint", &path],
        &["robots", "lint", &path, "--json"],
        &["history", &path],
    ] {
        let output = stillpoint(args);
        for text in [err(&output), String::from_utf8_lossy(&output.stdout).into_owned()] {
            assert!(!text.contains(is_odd), "{args:?}: {text:?}");
            assert!(!text.lines().any(|l| l.starts_with("error: all is well")), "{text:?}");
        }
    }
    // JSON says the same name.
    let output = stillpoint(&["inspect", &path, "--log-format=json"]);
    let said = json_lines(&output);
    assert!(said[0]["message"].as_str().is_some_and(|m| m.contains("a\\u{1b}[2J")), "{said:?}");
}
