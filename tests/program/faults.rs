//! Writes, syncs and renames that fail, one after the other, and inputs that change under a run,
//! from outside: the state is the old one or the new one, and the next run ends right. Linux only:
//! faults are put between the program and its system.
#![cfg(target_os = "linux")]
#![allow(clippy::print_stderr, reason = "a test that is skipped says so")]

use crate::common::palletiser;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Beams of each scanner: few, since only what is written matters here.
const N_BEAMS: u64 = 60_000;
/// Faults that are tried, spread over the run, and the last ones, when results take their places;
/// all of them, from the number that it gives on, where the environment asks for it.
const N_FAULTS: usize = 14;
const LAST_FAULTS: usize = 3;
const ALL: &str = "STILLPOINT_ALL_FAULTS";
/// Counts calls that write below a folder, and lets one of them fail.
const SHIM: &str = include_str!("faults.c");

/// The library that is put between; `None` where the machine has no C compiler.
fn shim(dir: &Path) -> Option<PathBuf> {
    let (source, library) = (dir.join("faults.c"), dir.join("faults.so"));
    std::fs::write(&source, SHIM).expect("writes");
    let mut cc = Command::new("cc");
    cc.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(&source).arg("-ldl");
    match cc.status() {
        Ok(status) => {
            assert!(status.success(), "the faults do not compile");
            Some(library)
        }
        Err(_) => None,
    }
}

fn command(dir: &Path, out: &str, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    command.current_dir(dir).args(["run", "scans/scans.e57", "--robots", "robots", "--out", out]);
    command.args(["--progress", "none", "--set", "export.copc=true"]).args(more);
    command
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn whole(dir: &Path, out: &str) -> bool {
    let mut verify = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    verify.current_dir(dir).args(["verify", out, "--progress", "none"]);
    verify.output().expect("the program starts").status.success()
}

fn list(dir: &Path, out: &str) -> String {
    std::fs::read_to_string(dir.join(out).join("manifest.json")).expect("a list")
}

#[test]
fn whatever_fails_to_be_written_the_state_is_old_or_new() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    palletiser(dir, 12, N_BEAMS);
    let Some(shim) = shim(dir) else {
        eprintln!("there is no C compiler here: faults are not tried");
        return;
    };
    // An old result, made with other settings, and what the new one ought to be.
    let old = ["--set", "segment.max_gate=0.02"];
    let with = |out: &str, more: &[&str], at: usize| {
        let mut run = command(dir, out, more);
        run.env("LD_PRELOAD", &shim)
            .env("FAULT_DIR", dir.join(out))
            .env("FAULT_AT", at.to_string());
        run.env("FAULT_COUNT", dir.join("count")).output().expect("the program starts")
    };
    assert!(command(dir, "old", &old).status().expect("starts").success());
    crate::common::copy_folder(&dir.join("old"), &dir.join("new"));
    assert!(with("new", &[], 0).status.success());
    let n: usize =
        std::fs::read_to_string(dir.join("count")).expect("a count").parse().expect("it");
    assert!(n > 50, "only {n} calls were seen");
    let first = std::env::var(ALL).ok().map(|from| from.parse().expect("a number"));
    let step = if first.is_some() { 1 } else { n.div_ceil(N_FAULTS) };
    let mut faults: Vec<usize> = (first.unwrap_or(1)..=n).step_by(step).collect();
    faults.extend(n + 1 - LAST_FAULTS..=n);
    for at in faults {
        let _ = std::fs::remove_dir_all(dir.join("out"));
        crate::common::copy_folder(&dir.join("old"), &dir.join("out"));
        let failed = with("out", &[], at);
        // A sync of a folder or a hint to the system may be passed over; a signal or a panic may
        // not.
        let code = failed.status.code().unwrap_or_else(|| panic!("call {at}: {}", failed.status));
        assert!([0, 1, 5].contains(&code), "call {at}: {code} {}", said(&failed));
        assert!(code == 0 || said(&failed).contains("error: "), "call {at}: {}", said(&failed));
        if dir.join("out/result.json").exists() {
            assert!(whole(dir, "out"), "call {at}: a result that is neither old nor new");
        }
        let next = command(dir, "out", &[]).output().expect("starts");
        assert!(next.status.success(), "after call {at}: {}", said(&next));
        assert!(list(dir, "out") == list(dir, "new"), "after call {at}: other bytes");
        assert!(whole(dir, "out"), "after call {at}");
    }
}

#[test]
fn inputs_that_change_under_a_run_are_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    palletiser(dir, 12, N_BEAMS);
    let (whole, input) = (dir.join("scans/scans.las"), dir.join("scan.las"));
    let bytes = std::fs::read(&whole).expect("reads");
    // Later and later in a run: while it is opened, read, labelled.
    for (k, wait) in [5, 30, 80, 150, 400, 900].into_iter().enumerate() {
        std::fs::write(&input, &bytes).expect("writes");
        let mut run = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
        run.current_dir(dir).args(["run", "scan.las", "--robots", "robots", "--progress", "none"]);
        run.args(["--scanners", "scans/scanners.toml", "--out", &format!("out{k}")]);
        run.stderr(std::process::Stdio::piped()).stdout(std::process::Stdio::null());
        let run = run.spawn().expect("the program starts");
        std::thread::sleep(std::time::Duration::from_millis(wait));
        if k % 3 == 2 {
            std::fs::remove_file(&input).expect("takes it away");
        } else if k % 3 == 0 {
            let file = std::fs::File::options().write(true).open(&input).expect("opens");
            file.set_len(bytes.len() as u64 / 3).expect("cuts it short");
        } else {
            // Another file takes its place.
            std::fs::write(dir.join("other.las"), &bytes[..bytes.len() / 2]).expect("writes");
            std::fs::rename(dir.join("other.las"), &input).expect("replaces it");
        }
        let output = run.wait_with_output().expect("ends");
        let code = output.status.code();
        let code = code.unwrap_or_else(|| panic!("after {wait} ms: {}", output.status));
        // Where it had ended before, all was well.
        assert!([0, 4].contains(&code), "after {wait} ms: {}", said(&output));
        assert!(code == 0 || said(&output).contains("scan.las"), "{}", said(&output));
        assert!(code == 0 || !dir.join(format!("out{k}/result.json")).exists());
    }
}
