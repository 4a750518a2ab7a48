//! Runs that come again, from outside: what is there is used, what is damaged is made anew, and
//! runs that are killed go on.

use crate::common::{files, palletiser};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// Beams of each scanner: few, since only whether runs agree matters here.
const N_BEAMS: u64 = 250_000;
/// Kills of one job; `scripts` has the long version.
const N_KILLS: u64 = 6;

fn command(dir: &Path, out: &str, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    command.current_dir(dir).args(["run", "scans/scans.e57", "--robots", "robots", "--out", out]);
    command.args(["--progress", "none"]).args(more);
    command
}

fn run(dir: &Path, out: &str, more: &[&str]) -> Output {
    let output = command(dir, out, more).output().expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn same(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    assert!(a.keys().eq(b.keys()), "{:?} and {:?}", a.keys(), b.keys());
    for (name, bytes) in &a {
        assert!(b[name] == *bytes, "{} differs", name.display());
    }
}

#[test]
fn what_is_there_is_used_again_and_what_is_not_is_made() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    palletiser(dir, 11, N_BEAMS);
    run(dir, "first", &[]);
    run(dir, "again", &[]);
    let whole = files(&dir.join("again"));
    assert!(whole.len() > 10, "{:?}", whole.keys());
    let unchanged = run(dir, "again", &[]);
    assert!(said(&unchanged).contains("used again: everything"), "{}", said(&unchanged));
    same(&dir.join("first"), &dir.join("again"));

    // A changed output, a missing one and one of a run before: made anew, from what the store has.
    let (changed, missing) = ("again/result.json", "again/labels/0.kind.npy");
    std::fs::write(dir.join(changed), "{}").expect("writes");
    std::fs::remove_file(dir.join(missing)).expect("removes");
    let healed = run(dir, "again", &[]);
    let text = said(&healed);
    assert!(text.contains("tiles: 1 of 1") && text.contains("used again: fits:"), "{text}");
    same(&dir.join("first"), &dir.join("again"));

    // What is made of a result afterwards goes with it.
    let export_to = |out: &str, format: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
        command.current_dir(dir).args(["export", out, "--to", format, "--progress", "none"]);
        command.output().expect("the program starts")
    };
    let export = |out: &str| export_to(out, "ply");
    assert!(export("again").status.success());
    assert!(export_to("again", "sdf").status.success());
    assert!(dir.join("again/export/fixed.ply").is_file());
    assert_eq!(export("nothing").status.code(), Some(4));

    // A parameter of the fit touches no tiles; a damaged store is made again.
    let refit = said(&run(dir, "again", &["--set", "fit.n_judge=300"]));
    assert!(refit.contains("tiles: 1 of 1") && !refit.contains("fits:"), "{refit}");
    // The same points with the same labels: what was exported of them stays true. A scene stays,
    // too, and is named.
    assert!(dir.join("again/export/fixed.ply").is_file());
    assert!(dir.join("again/export/sdf/plant.sdf").is_file());
    assert!(refit.contains("sdf shows the earlier result"), "{refit}");
    std::fs::remove_dir_all(dir.join("again/export")).expect("removes");
    for entry in std::fs::read_dir(dir.join("again/store/tiles")).expect("a folder") {
        let path = entry.expect("an entry").path().join("catalogue.rkyv");
        let mut bytes = std::fs::read(&path).expect("a catalogue");
        let middle = bytes.len() / 2;
        bytes[middle] ^= 4;
        std::fs::write(&path, bytes).expect("writes");
    }
    let anew = said(&run(dir, "again", &[]));
    assert!(!anew.contains("tiles:"), "{anew}");
    same(&dir.join("first"), &dir.join("again"));
}

#[test]
fn two_runs_in_one_folder_refuse_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    palletiser(dir.path(), 11, N_BEAMS);
    let mut first = command(dir.path(), "out", &[]).stdout(Stdio::null()).spawn().expect("starts");
    let lock = dir.path().join("out/store/lock");
    while !lock.exists() {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(50));
    let second = command(dir.path(), "out", &[]).output().expect("starts");
    assert_eq!(second.status.code(), Some(1), "{}", said(&second));
    assert!(said(&second).contains("another run uses"), "{}", said(&second));
    assert!(first.wait().expect("ends").success());
}

#[test]
fn killed_runs_go_on_and_end_with_the_same_bytes() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    palletiser(dir, 11, N_BEAMS);
    let started = std::time::Instant::now();
    run(dir, "first", &[]);
    let whole = started.elapsed();
    // Moments spread over the run, by the golden ratio.
    for i in 1..=N_KILLS {
        let share = (i as f64 * 0.618).fract();
        let mut child = command(dir, "killed", &[])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        std::thread::sleep(whole.mul_f64(share));
        // It may have ended: then the next one finds all of it.
        let _ = child.kill();
        let _ = child.wait();
    }
    run(dir, "killed", &[]);
    same(&dir.join("first"), &dir.join("killed"));
    let next = dir.join("killed/store/next");
    assert_eq!(std::fs::read_dir(next).map_or(0, Iterator::count), 0, "nothing half-written stays");
}
