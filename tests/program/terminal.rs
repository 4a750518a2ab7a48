//! What the terminal shows, word for word: each test compares it with a file under `snapshots`
//! beside it, so that a change of words is seen in a review.
//!
//! After a change that is wanted, `INSTA_UPDATE=always cargo test --test program terminal` writes
//! the files anew. What differs from machine to machine (paths, times, sizes of memory and disk) is
//! replaced by a word in brackets first.

use std::path::Path;
use std::process::Command;

/// What a command shows: its exit code, standard output, and standard error, without what differs
/// from machine to machine.
fn shown(args: &[&str], folder: &Path) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_stillpoint"))
        .args(args)
        // Clap wraps its help to the width of the terminal, where it finds one.
        .env_remove("COLUMNS")
        .env("NO_COLOR", "1")
        .current_dir(folder)
        .output()
        .expect("the program starts");
    let text = |bytes: &[u8]| redacted(&String::from_utf8_lossy(bytes), folder);
    let parts = [
        format!("$ stillpoint {}", redacted(&args.join(" "), folder)),
        format!("exit code {}", output.status.code().expect("a code, no signal")),
        format!("--- standard output\n{}", text(&output.stdout)),
        format!("--- standard error\n{}", text(&output.stderr)),
    ];
    parts.map(|part| part.trim_end().to_string()).join("\n")
}

/// The text with `[folder]` for the test's own folder, and a word in brackets for what depends on
/// machine, system and version.
fn redacted(text: &str, folder: &Path) -> String {
    let missing = std::fs::read(folder.join("missing/file")).expect_err("there is none");
    let missing = missing.to_string();
    let missing = missing.split(" (os error").next().unwrap_or_default();
    let text = text
        .replace(&*folder.to_string_lossy(), "[folder]")
        .replace(missing, "[not found]")
        .replace(concat!("stillpoint ", env!("CARGO_PKG_VERSION")), "stillpoint [version]")
        .replace(".exe", "")
        .replace('\\', "/");
    text.split_inclusive('\n').map(without_sizes).collect()
}

/// Units whose numbers depend on the machine: time, memory and disk.
const UNITS: [&str; 10] = ["s", "min", "h", "B", "bytes", "KiB", "MiB", "GiB", "MB", "GB"];

/// One line with `[number]` for each number before one of [`UNITS`], for those of a range that ends
/// so (`3 to 5 s`), and for the length of a file (`bytes: 7`); versions of libraries are
/// `[version]`.
fn without_sizes(line: &str) -> String {
    let is_number = |word: &str| {
        let word = word.trim_start_matches(['(', '~', '<']).trim_end();
        word.starts_with(|c: char| c.is_ascii_digit())
            && word.chars().all(|c| c.is_ascii_digit() || ".,".contains(c))
    };
    let mut words: Vec<String> = line.split(' ').map(str::to_string).collect();
    for at in 1..words.len() {
        if words[at].strip_prefix('v').is_some_and(is_number) {
            words[at] = "[version]".into();
        }
        if words[at - 1] == "bytes:" && is_number(&words[at]) {
            words[at] = "[number]\n".into();
        }
        let unit = words[at].trim_end_matches(['\n', ',', '.', ';', ':', ')']);
        if !UNITS.contains(&unit) || !is_number(&words[at - 1]) {
            continue;
        }
        words[at - 1] = "[number]".into();
        if at >= 3 && words[at - 2] == "to" && is_number(&words[at - 3]) {
            words[at - 3] = "[number]".into();
        }
    }
    words.join(" ")
}

fn compare(name: &str, text: &str) {
    insta::with_settings!({
        snapshot_path => "snapshots",
        prepend_module_to_snapshot => false,
        omit_expression => true,
    }, {
        insta::assert_snapshot!(name, text);
    });
}

/// Words of the command line that lead to a command of their own.
const COMMANDS: [&str; 27] = [
    "",
    "demo",
    "inspect",
    "scanners",
    "run",
    "plan",
    "rescan",
    "verify",
    "report",
    "export",
    "check",
    "diff",
    "history",
    "simulate",
    "bench",
    "bench accuracy",
    "bench plant",
    "bench rescan",
    "bench throughput",
    "bench check",
    "bench plan",
    "bench scanners",
    "robots",
    "robots lint",
    "robots calibrate",
    "config print",
    "schema",
];

#[test]
fn help_of_each_command() {
    let folder = tempfile::tempdir().expect("a folder");
    for command in COMMANDS {
        let args: Vec<&str> = command.split_whitespace().chain(["--help"]).collect();
        let name = format!("help {command}").trim_end().replace(' ', "-");
        compare(&name, &shown(&args, folder.path()));
    }
}

#[test]
fn what_a_small_file_holds() {
    let folder = tempfile::tempdir().expect("a folder");
    crate::common::palletiser(folder.path(), 3, 40_000);
    compare("inspect", &shown(&["inspect", "scans/scans.e57"], folder.path()));
    compare("inspect-las", &shown(&["inspect", "scans/scans.las"], folder.path()));
}

#[test]
fn what_a_run_would_take() {
    let folder = tempfile::tempdir().expect("a folder");
    crate::common::palletiser(folder.path(), 3, 40_000);
    let args = ["plan", "scans/scans.e57", "--robots", "robots", "--out", "out", "--threads", "2"];
    compare("plan", &shown(&[&args[..], &["--memory", "4GiB"]].concat(), folder.path()));
}

#[test]
fn errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("plain.txt"), "plain text\n").expect("writes");
    std::fs::write(at.join("empty.e57"), "").expect("writes");
    std::fs::create_dir_all(at.join("library/unknown")).expect("is made");
    std::fs::write(at.join("library/unknown/model.txt"), "no URDF\n").expect("writes");
    crate::common::palletiser(at, 3, 40_000);
    let run = ["run", "scans/scans.e57", "--robots", "library", "--out", "out"];
    let run = [&run[..], &["--progress", "none"]].concat();
    let cases: [(&str, &[&str]); 9] = [
        ("error-no-file", &["inspect", "missing.e57"]),
        ("error-no-scan", &["inspect", "plain.txt"]),
        ("error-empty-file", &["inspect", "empty.e57"]),
        ("error-no-model", &run),
        ("error-no-library", &["robots", "lint", "missing"]),
        ("error-no-result", &["verify", "missing"]),
        ("error-unknown-command", &["frobnicate"]),
        ("error-unknown-flag", &["inspect", "plain.txt", "--frobnicate"]),
        ("error-unknown-setting", &["inspect", "plain.txt", "--set", "fit.bean=3"]),
    ];
    for (name, args) in cases {
        compare(name, &shown(args, at));
    }
}
