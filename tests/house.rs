//! The rules of the house that no compiler holds: who may import whom, what stages keep away from,
//! how files begin.

#[path = "house/imports.rs"]
mod imports;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Rooms that others may import.
const SHARED: [&str; 3] = ["geometry", "contract", "robot"];
/// Rooms that may touch the disk: the reader of points, the reader of robots, the writer of
/// results.
const MAY_READ: [&str; 3] = ["ingest", "robot", "export"];
/// Files that may hold unsafe code: memory maps.
const MAY_BE_UNSAFE: [&str; 1] = ["stages/ingest/src/map.rs"];
/// The only file that assigns the verdict on a fit, or changes its reasons.
const WRITES_VERDICTS: &str = "stages/fit/src/verdict.rs";
/// Longest file, lines: 400 is the aim, 450 the end.
const MAX_LINES: usize = 450;
/// Longest file of tests, lines: cases in a row read well.
const MAX_TEST_LINES: usize = 600;
/// Longest function, lines, from its `fn` to its closing brace.
const MAX_FN_LINES: usize = 60;
/// Longest line of a comment, characters.
const MAX_COMMENT: usize = 100;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn entries(dir: &Path) -> Vec<PathBuf> {
    let Ok(list) = fs::read_dir(dir) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = list.map(|e| e.expect("an entry").path()).collect();
    paths.sort();
    paths
}

fn stages() -> Vec<String> {
    let folders = entries(&root().join("stages"));
    let stages = folders.iter().filter(|p| p.join("Cargo.toml").is_file());
    stages.map(|p| p.file_name().expect("a name").to_string_lossy().into_owned()).collect()
}

/// All Rust files below `dir`, as path from the root and text.
fn rust_files(dir: &str) -> Vec<(String, String)> {
    let mut files = Vec::new();
    let mut folders = vec![root().join(dir)];
    while let Some(folder) = folders.pop() {
        for path in entries(&folder) {
            if path.is_dir() && path.file_name().is_some_and(|n| n != "target") {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(root()).expect("below the root");
                let text = fs::read_to_string(&path).expect("text");
                files.push((name.to_string_lossy().replace('\\', "/"), text));
            }
        }
    }
    files.sort();
    files
}

fn all_files() -> Vec<(String, String)> {
    ["src", "stages", "tests", "benches"].into_iter().flat_map(rust_files).collect()
}

/// The text without comments, and without what is compiled for tests only.
fn code(name: &str, text: &str) -> String {
    let file = name.rsplit('/').next().unwrap_or(name);
    if name.starts_with("tests/")
        || name.contains("/tests/")
        || name.contains("/examples/")
        || name.contains("/benches/")
    {
        return String::new();
    }
    if file == "tests.rs" || file == "build.rs" || is_test_module(name) {
        return String::new();
    }
    // By custom the tests stand at the end of a file, whatever else their attributes say.
    let end = text.find("\nmod tests {").unwrap_or(text.len());
    let lines = text[..end].lines().map(|l| l.split("//").next().unwrap_or(l));
    lines.collect::<Vec<_>>().join("\n")
}

/// Whether a file is a module that its parent compiles for tests only.
fn is_test_module(name: &str) -> bool {
    let path = root().join(name);
    let (Some(dir), Some(stem)) = (path.parent(), path.file_stem()) else {
        return false;
    };
    let declared = format!("#[cfg(test)]\nmod {};", stem.to_string_lossy());
    let above = dir.with_extension("rs");
    [dir.join("lib.rs"), dir.join("mod.rs"), above]
        .iter()
        .any(|parent| fs::read_to_string(parent).is_ok_and(|text| text.contains(&declared)))
}

/// All functions of a text that rustfmt wrote: name, and lines from the `fn` to the closing brace.
fn functions(code: &str) -> Vec<(&str, usize)> {
    const BEFORE: [&str; 5] = ["const", "async", "unsafe", "extern", "\"C\""];
    let lines: Vec<&str> = code.lines().map(str::trim_end).collect();
    let mut out = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let head = line.trim_start();
        let indent = &line[..line.len() - head.len()];
        let Some((before, after)) = head.split_once("fn ") else { continue };
        if !before.split_whitespace().all(|w| w.starts_with("pub") || BEFORE.contains(&w)) {
            continue;
        }
        // What ends it stands as far in as it begins: a brace, or a semicolon where it has no body.
        let is_end = |line: &&str| {
            let ends = |l: &str| l == "}" || l.ends_with(';') && !l.starts_with(' ');
            line.strip_prefix(indent).is_some_and(ends)
        };
        let rest = lines[at..].iter().position(is_end);
        let n = if head.ends_with('}') { 1 } else { rest.map_or(lines.len() - at, |n| n + 1) };
        out.push((after.split(['(', '<']).next().unwrap_or(after), n));
    }
    out
}

fn room(name: &str) -> &str {
    name.split('/').nth(1).unwrap_or(name)
}

fn report(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
}

#[test]
fn stages_import_only_what_is_shared() {
    let stages = stages();
    assert!(stages.len() >= 18, "{stages:?}");
    let mut faults = Vec::new();
    for stage in &stages {
        let manifest = root().join("stages").join(stage).join("Cargo.toml");
        let manifest: toml::Table =
            fs::read_to_string(manifest).expect("text").parse().expect("TOML");
        let allowed: &[&str] = match stage.as_str() {
            "geometry" => &[],
            "contract" => &["geometry"],
            "robot" => &["geometry", "contract"],
            // The method that `fit` is measured against reads model and scene as `fit` does, and
            // is judged by the same beams: else the two could not be compared.
            "baseline" => &["geometry", "contract", "robot", "fit"],
            // The Python package stands above the program, and computes nothing itself.
            "py" => &["contract"],
            _ => &SHARED,
        };
        for table in ["dependencies", "build-dependencies"] {
            let names = manifest.get(table).and_then(|t| t.as_table());
            for name in names.into_iter().flat_map(|t| t.keys()) {
                let is_above = name == "stillpoint" && stage != "py";
                if is_above || stages.contains(name) && !allowed.contains(&name.as_str()) {
                    faults.push(format!("{stage} may not depend on {name}"));
                }
            }
        }
    }
    report(&faults);
}

/// Where the method of a fit is set and chosen, and where it is measured: nothing else may rest on
/// the baseline.
const MAY_NAME_BASELINE: [&str; 3] = ["src/job/settings.rs", "src/detect/search/", "src/eval/"];

#[test]
fn only_the_choice_of_the_method_names_the_baseline() {
    let mut faults = Vec::new();
    for (name, text) in rust_files("src") {
        let may = MAY_NAME_BASELINE.iter().any(|place| name.starts_with(place));
        if code(&name, &text).contains("baseline::") && !may {
            faults.push(format!("{name} names the stage `baseline`"));
        }
    }
    report(&faults);
}

#[test]
fn files_open_with_a_sentence_and_stay_short() {
    let mut faults = Vec::new();
    for (name, text) in all_files() {
        if !text.starts_with("//! ") {
            faults.push(format!("{name} does not open with what comes in and what goes out"));
        }
        let n = text.lines().count();
        let is_test = name.contains("tests/") || name.ends_with("/tests.rs");
        let most = if is_test { MAX_TEST_LINES } else { MAX_LINES };
        if n > most {
            faults.push(format!("{name} has {n} lines"));
        }
    }
    report(&faults);
}

/// Texts between fences and tables are as wide as they are.
#[test]
fn comments_keep_to_their_width() {
    let mut faults = Vec::new();
    for (name, text) in all_files() {
        let mut is_fenced = false;
        for (at, line) in text.lines().enumerate() {
            let words = line.trim_start();
            let Some(words) = words.strip_prefix("//") else { continue };
            let words = words.trim_start_matches(['/', '!', ' ']);
            is_fenced ^= words.starts_with("```");
            let is_free = is_fenced || words.starts_with('|');
            if !is_free && line.chars().count() > MAX_COMMENT {
                faults.push(format!("{name}:{}: longer than {MAX_COMMENT} columns", at + 1));
            }
        }
    }
    report(&faults);
}

#[test]
fn functions_stay_short() {
    let mut faults = Vec::new();
    for (name, text) in all_files() {
        for (function, n) in functions(&code(&name, &text)) {
            if n > MAX_FN_LINES {
                faults.push(format!("{name}: `{function}` has {n} lines"));
            }
        }
    }
    report(&faults);
}

#[test]
fn stages_start_no_threads_and_read_no_clocks() {
    let mut faults = Vec::new();
    for (name, text) in rust_files("stages") {
        let code = code(&name, &text);
        let mut forbidden = vec![
            "std::thread",
            "std::time::Instant",
            "Instant::now",
            "SystemTime",
            "std::env",
            "println!",
            "print!(",
            "eprint!(",
            "dbg!(",
            "tracing::",
            "std::process",
            "std::net",
        ];
        if !MAY_READ.contains(&room(&name)) {
            forbidden.push("std::fs");
        }
        for word in forbidden {
            if code.contains(word) {
                faults.push(format!("{name} uses {word}"));
            }
        }
    }
    report(&faults);
}

#[test]
fn only_src_prints_and_only_by_its_writers() {
    let mut faults = Vec::new();
    for (name, text) in rust_files("src") {
        for word in ["println!", "print!(", "eprintln!", "eprint!(", "dbg!("] {
            if code(&name, &text).contains(word) {
                faults.push(format!("{name} uses {word}"));
            }
        }
    }
    report(&faults);
}

#[test]
fn unsafe_code_stands_where_it_is_named() {
    let mut faults = Vec::new();
    for (name, text) in all_files() {
        let is_used =
            ["unsafe {", "unsafe fn", "unsafe impl"].iter().any(|w| code(&name, &text).contains(w));
        if is_used && !MAY_BE_UNSAFE.contains(&name.as_str()) {
            faults.push(format!("{name} holds unsafe code"));
        }
    }
    report(&faults);
}

/// Whether a line of code assigns the verdict on a fit or changes its reasons. What is written in
/// words, or into a row of a measurement, is no verdict on a fit any more.
fn writes_a_verdict(line: &str) -> bool {
    const CHANGES: [&str; 6] = ["push(", "extend(", "insert(", "splice(", "clear(", "retain("];
    let is_path = |c: char| c.is_alphanumeric() || "_.[]".contains(c);
    let is_changed = |field: &str| {
        let assigned = line.split(&format!("{field} =")).nth(1);
        let mut lent = line.split("&mut ").skip(1);
        assigned.is_some_and(|behind| !behind.starts_with('='))
            || lent.any(|path| path.split(|c| !is_path(c)).next().unwrap_or("").ends_with(field))
            || CHANGES.iter().any(|call| line.contains(&format!("{field}.{call}")))
    };
    let is_made = line.split("verdict: ").nth(1).is_some_and(|behind| {
        let value = behind.split([',', '}']).next().unwrap_or("");
        let is_copied = value.contains(".verdict") && !value.contains(".clone()");
        value.starts_with("Verdict::") || is_copied && !value.starts_with("Verdict")
    });
    let is_elsewhere = line.contains(".word()") || line.trim_start().starts_with("row.");
    !is_elsewhere && (is_made || is_changed(".verdict") || is_changed(".reasons"))
}

/// A verdict is written where the table of its rules is applied; others report what they found out.
#[test]
fn one_file_writes_the_verdict() {
    let mut faults = Vec::new();
    for (name, text) in all_files() {
        if name == WRITES_VERDICTS {
            continue;
        }
        for line in code(&name, &text).lines().filter(|line| writes_a_verdict(line)) {
            let line = line.trim();
            faults.push(format!("{name}: `{line}`: report it by `fit::verdict::apply` or `note`"));
        }
    }
    report(&faults);
}

#[test]
fn what_writes_a_verdict_is_told_from_what_reads_one() {
    let writes = [
        "fit.verdict = Verdict::Doubtful;",
        "out.verdict = out.verdict.min(other);",
        "Fit { verdict: Verdict::Refused, ..fit.clone() }",
        "Fit { verdict: fit.verdict.max(before.verdict), ..fit.clone() }",
        "std::mem::swap(&mut a.verdict, &mut verdict);",
        "fit.reasons.push(why);",
        "fit.reasons = vec![why];",
    ];
    let reads = [
        "if fit.verdict == Verdict::Trusted {",
        "verdict::apply(&mut sure, &VerdictEvent::SeenAgain(before.verdict));",
        "row.reasons = fit.reasons.clone();",
        "pub verdict: Verdict,",
        "let is = |verdict: Verdict| move |f: &&Fit| f.verdict == verdict;",
        "pub verdict: Option<Decision>,",
        "verdict: fit.verdict.word().into(),",
        "verdict: robot.verdict.clone(),",
        "reasons: fit.reasons.clone(),",
        "all.extend(fit.reasons.iter().cloned());",
    ];
    assert_eq!(writes.iter().find(|line| !writes_a_verdict(line)), None);
    assert_eq!(reads.iter().find(|line| writes_a_verdict(line)), None);
}

#[test]
fn every_stage_is_in_the_table_of_stages() {
    let table = fs::read_to_string(root().join("stages/README.md")).unwrap_or_default();
    let missing = stages().into_iter().filter(|s| !table.contains(&format!("| {s} |")));
    report(&missing.map(|s| format!("stages/README.md does not name `{s}`")).collect::<Vec<_>>());
}

/// Names that types of several stages have on purpose: each stage has its settings, which are
/// written with the stage's name. Generators of random numbers of two stages must not depend on
/// each other, since the one decides samples and the other scenes.
const SHARED_NAMES: [&str; 2] = ["Settings", "Random"];

/// The types that a text defines outside of functions, without those of its tests.
fn types(code: &str) -> impl Iterator<Item = &str> {
    const KINDS: [&str; 4] = ["struct ", "enum ", "trait ", "type "];
    code.lines().filter(|line| !line.starts_with(' ')).filter_map(|line| {
        let line = line.strip_prefix("pub").map_or(line, |rest| {
            rest.strip_prefix("(crate)").or(rest.strip_prefix("(super)")).unwrap_or(rest)
        });
        let line = line.trim_start();
        let name = KINDS.iter().find_map(|kind| line.strip_prefix(kind))?;
        name.split(|c: char| !c.is_alphanumeric() && c != '_').next()
    })
}

#[test]
fn a_type_name_stands_once_in_the_workspace() {
    let mut homes: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (name, text) in rust_files("stages").into_iter().chain(rust_files("src")) {
        for of in types(&code(&name, &text)).filter(|of| !SHARED_NAMES.contains(of)) {
            homes.entry(of.to_owned()).or_default().push(name.clone());
        }
    }
    homes.retain(|_, files| files.len() > 1);
    report(&homes.iter().map(|(of, files)| format!("`{of}`: {files:?}")).collect::<Vec<_>>());
}

/// Settings of a stage that nobody can set, by room and name: made by the program, not by people.
const NOT_FOR_PEOPLE: [&str; 1] = ["export::LasSettings"];

#[test]
fn every_setting_of_a_stage_can_be_set() {
    let job = fs::read_to_string(root().join("src/job/settings.rs")).expect("text");
    let words: BTreeSet<&str> =
        job.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty()).collect();
    let mut faults = Vec::new();
    for (name, text) in rust_files("stages") {
        for part in text.split("\npub struct ").skip(1) {
            let kind = part.split([' ', '<', '(', ';']).next().unwrap_or_default();
            let path = format!("{}::{kind}", room(&name));
            if !kind.ends_with("Settings") || NOT_FOR_PEOPLE.contains(&path.as_str()) {
                continue;
            }
            if !job.contains(&format!("{path} {{")) {
                faults.push(format!("src/job/settings.rs does not hold {path}"));
                continue;
            }
            let body = part.split("\n}").next().unwrap_or_default();
            for line in body.lines().filter_map(|l| l.strip_prefix("    pub ")) {
                let field = line.split(':').next().unwrap_or_default();
                if !words.contains(field) {
                    faults.push(format!("{path}: {field} cannot be set"));
                }
            }
        }
    }
    report(&faults);
}

#[test]
fn nothing_of_a_workplace_is_in_the_house() {
    // Put together so that this file does not find itself.
    let words = [concat!("/wo", "rk/"), concat!("/ho", "me/"), concat!("/ro", "ot/")];
    let mut faults = Vec::new();
    for (name, text) in all_files() {
        for word in words.iter().filter(|w| text.contains(**w)) {
            faults.push(format!("{name} names {word}"));
        }
    }
    report(&faults);
}
