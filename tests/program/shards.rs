//! A job in shards, from outside: many processes with one store make the same bytes as one run,
//! whatever the order, also where two make the same shard and where some are killed.

use crate::common::{cell_of_files, files};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Beams of each of six scanners: few, since only whether results agree matters here.
const N_BEAMS: u64 = 120_000;
/// Most kills of one job.
const N_KILLS: usize = 8;
/// Most rounds of a job that ends.
const N_ROUNDS: usize = 300;

/// The job of all tests here: two E57 files and a LAS file.
fn command(dir: &Path, what: &[&str], out: &str, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    command.current_dir(dir).args(what);
    command.args(["scans0/scans.e57", "scans1/scans.e57", "scans2/scans.las"]);
    command.args(["--scanners", "scans2/scanners.toml", "--robots", "robots", "--out", out]);
    command.args(["--progress", "none"]).args(more);
    command
}

fn done(mut command: Command) -> Output {
    command.output().expect("the program starts")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn same(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    assert!(a.len() > 10 && a.keys().eq(b.keys()), "{:?} and {:?}", a.keys(), b.keys());
    for (name, bytes) in &a {
        assert!(b[name] == *bytes, "{} differs", name.display());
    }
}

/// A sequence that is the same on every machine (SplitMix64).
struct Draw(u64);

impl Draw {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

/// The list of the shards of a job.
fn listed(dir: &Path, out: &str, more: &[&str]) -> Value {
    let output = done(command(dir, &["shards"], out, &[&["--json"], more].concat()));
    assert!(output.status.success(), "{}", said(&output));
    serde_json::from_slice(&output.stdout).expect("a list")
}

/// Ids and kinds of the shards with a state.
fn in_state(list: &Value, state: &str) -> Vec<(String, String)> {
    let word = |shard: &Value, name: &str| shard[name].as_str().expect("a word").to_owned();
    let all = list["shards"].as_array().expect("shards").iter();
    let own = all.filter(|shard| shard["state"] == state);
    own.map(|shard| (word(shard, "id"), word(shard, "kind"))).collect()
}

/// Makes all shards of a job with `make`, which gets the drawn one. Returns the ids of all, and the
/// exit code of the last one.
fn all(
    dir: &Path,
    out: &str,
    more: &[&str],
    draw: &mut Draw,
    mut make: impl FnMut(&str, &mut Draw) -> Option<Output>,
) -> (Vec<(String, String)>, Option<i32>) {
    let (mut ids, mut code) = (Vec::new(), None);
    for _ in 0..N_ROUNDS {
        let list = listed(dir, out, more);
        if list["finished"] == true {
            return (ids, code);
        }
        let ready = in_state(&list, "ready");
        assert!(!ready.is_empty(), "nothing can be made: {list}");
        let shard = ready[draw.below(ready.len())].clone();
        if let Some(output) = make(&shard.0, draw) {
            code = output.status.code();
            ids.push(shard);
        }
    }
    panic!("the job does not end");
}

#[test]
fn shards_in_any_order_and_by_two_at_once_make_the_bytes_of_a_run() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    cell_of_files(dir, 3, 11, N_BEAMS);
    let whole = done(command(dir, &["run"], "one", &[]));
    assert!(whole.status.success(), "{}", said(&whole));
    for (seed, more) in [(1, &[][..]), (2, &["--set", "export.compress=true"][..])] {
        let (one, many) = (format!("one{seed}"), format!("many{seed}"));
        assert!(done(command(dir, &["run"], &one, more)).status.success());
        let mut draw = Draw(seed);
        let (ids, code) = all(dir, &many, more, &mut draw, |id, draw| {
            let threads = (1 + draw.below(3)).to_string();
            let make =
                || command(dir, &["shard", id], &many, &[more, &["--threads", &threads]].concat());
            // Two processes make every third shard, one of them a little later.
            let twice = draw.below(3) == 0 && !id.starts_with("gather");
            let other = twice.then(|| {
                make().stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("starts")
            });
            if twice {
                std::thread::sleep(Duration::from_millis(draw.below(200) as u64));
            }
            let output = done(make());
            assert!(output.status.success(), "{id}: {}", said(&output));
            if let Some(other) = other {
                let other = other.wait_with_output().expect("ends");
                assert!(other.status.success(), "{id}: {}", said(&other));
            }
            Some(output)
        });
        assert_eq!(code, Some(0));
        same(&dir.join(&one), &dir.join(&many));
        // Every kind, each shard once: two processes at one shard are one shard.
        let kinds: Vec<&str> = ids.iter().map(|(_, kind)| kind.as_str()).collect();
        for (kind, n) in [
            ("tiles", 3),
            ("planes", 3),
            ("ground", 1),
            ("robots", 1),
            ("space", 1),
            ("labels", 3),
            ("gather", 1),
        ] {
            assert_eq!(kinds.iter().filter(|k| **k == kind).count(), n, "{kind}: {kinds:?}");
        }
        assert!(kinds.contains(&"region"));
        // A shard that comes late finds the result, and leaves it as it is; nothing stays behind.
        let late = done(command(dir, &["shard", &ids[0].0], &many, more));
        assert!(late.status.success(), "{}", said(&late));
        same(&dir.join(&one), &dir.join(&many));
        let labels = dir.join(&many).join("store/labels");
        assert!(std::fs::read_dir(labels).expect("a folder").next().is_none());
    }
    same(&dir.join("one"), &dir.join("many1"));
}

#[test]
fn what_is_not_ready_or_not_known_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    cell_of_files(dir, 3, 12, 40_000);
    let list = listed(dir, "out", &[]);
    let waiting = in_state(&list, "waiting");
    assert!(waiting.iter().any(|(_, kind)| kind == "ground"), "{list}");
    for (id, _) in waiting {
        let output = done(command(dir, &["shard", &id], "out", &[]));
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).contains("needs others"), "{}", said(&output));
    }
    for id in ["tiles-0123456789abcdef", "gather", ""] {
        let output = done(command(dir, &["shard", id], "out", &[]));
        assert_eq!(output.status.code(), Some(2), "{id}: {}", said(&output));
    }
    let early = done(command(dir, &["gather"], "out", &[]));
    assert_eq!(early.status.code(), Some(2), "{}", said(&early));
    assert!(said(&early).contains("not made yet"), "{}", said(&early));
    // Another job has other shards.
    let other = listed(dir, "out", &["--set", "fit.beam=151"]);
    assert!(in_state(&list, "ready").iter().all(|s| !in_state(&other, "ready").contains(s)));
    // Estimates are there and differ: a join of nothing but planes is the least.
    let seconds = |shard: &Value| shard["seconds"].as_f64().expect("a number");
    let shards = list["shards"].as_array().expect("shards");
    assert!(shards.iter().all(|s| seconds(s) > 0.0 && s["memory_bytes"].as_u64() > Some(1 << 20)));
}

#[cfg(unix)]
#[test]
fn shards_that_are_killed_are_made_again_and_leave_no_damage() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    cell_of_files(dir, 3, 13, N_BEAMS);
    assert!(done(command(dir, &["run"], "one", &[])).status.success());
    let (mut n_kills, mut took) = (0, Duration::from_millis(500));
    let mut draw = Draw(7);
    let (_, code) = all(dir, "many", &[], &mut draw, |id, draw| {
        let mut make = command(dir, &["shard", id], "many", &[]);
        if n_kills < N_KILLS && draw.below(2) == 0 {
            let mut child =
                make.stderr(Stdio::null()).stdout(Stdio::null()).spawn().expect("starts");
            std::thread::sleep(took.mul_f64(draw.below(1000) as f64 / 1000.0));
            child.kill().expect("is killed");
            // One that has ended before was made.
            if !child.wait().expect("ends").success() {
                n_kills += 1;
                return None;
            }
        }
        let started = Instant::now();
        let output = done(make);
        assert!(output.status.success(), "{id}: {}", said(&output));
        took = started.elapsed();
        Some(output)
    });
    assert!(code == Some(0) && n_kills >= N_KILLS / 2, "{code:?}, {n_kills} kills");
    same(&dir.join("one"), &dir.join("many"));
    // Pieces of processes that were killed are gone with the job.
    let new = std::fs::read_dir(dir.join("many/store/tiles")).expect("a folder");
    let names: Vec<String> =
        new.flatten().map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    assert!(names.len() == 3 && names.iter().all(|n| !n.starts_with("new")), "{names:?}");
}

#[test]
fn a_job_that_keeps_going_names_what_it_leaves_out() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    cell_of_files(dir, 3, 14, N_BEAMS);
    // A file that is damaged in the middle.
    let broken = dir.join("scans1/scans.e57");
    let mut bytes = std::fs::read(&broken).expect("a file");
    let middle = bytes.len() / 2;
    bytes[middle..middle + 64].iter_mut().for_each(|b| *b ^= 0x5a);
    std::fs::write(&broken, bytes).expect("writes");
    let more = ["--keep-going"];
    let one = done(command(dir, &["run"], "one", &more));
    assert_eq!(one.status.code(), Some(3), "{}", said(&one));
    let (_, code) = all(dir, "many", &more, &mut Draw(3), |id, _| {
        let output = done(command(dir, &["shard", id], "many", &more));
        let may_be_in_part = id.starts_with("tiles") || id.starts_with("gather");
        let is_in_part = output.status.code() == Some(3) && may_be_in_part;
        assert!(output.status.success() || is_in_part, "{id}: {}", said(&output));
        Some(output)
    });
    assert_eq!(code, Some(3), "the result is one in part");
    same(&dir.join("one"), &dir.join("many"));

    // A region that no process can finish is left out by the engine that has tried, and named.
    let why = "killed four times";
    let mut regions = 0;
    let (_, code) = all(dir, "less", &more, &mut Draw(4), |id, _| {
        let is_region = id.starts_with("region");
        let more: &[&str] = if is_region { &["--keep-going", "--leave-out", why] } else { &more };
        regions += usize::from(is_region);
        Some(done(command(dir, &["shard", id], "less", more)))
    });
    assert!(code == Some(3) && regions > 0);
    let text = std::fs::read_to_string(dir.join("less/result.json")).expect("a result");
    let result: Value = serde_json::from_str(&text).expect("JSON");
    let warnings = result["warnings"].to_string();
    assert!(warnings.contains(why) && warnings.contains("scans1/scans.e57"), "{warnings}");
    assert_eq!(result["robots"].as_array().map(Vec::len), Some(0));
    // Without leave to keep going nothing is left out.
    let id = "region-0123456789abcdef";
    let strict = done(command(dir, &["shard", id], "strict", &["--leave-out", why]));
    assert_eq!(strict.status.code(), Some(2), "{}", said(&strict));
}
