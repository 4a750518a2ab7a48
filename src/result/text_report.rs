//! The report of a result as text: what its page holds in tables, for the terminal.

use super::changed_things::ThingEntry;
use super::changes::{RobotChange, words};
use super::run_record::RunRecord;
use crate::cache::VerifiedFiles;
use crate::job::memory_words;
use contract::words::{Unit, count, fixed, triple};
use contract::{Error, Result, quote};
use export::{BasePose, RescanEntry, ResultFile, RobotEntry};
use serde::Deserialize;
use std::fmt::Write as _;
use std::path::Path;

/// The parts of `changes.json` that people read.
#[derive(Deserialize)]
struct ListedChanges {
    robots: Vec<RobotChange>,
    things: Vec<ThingEntry>,
}

/// The report of a published result, behind its summary.
///
/// # Errors
/// A file that is missing or was changed.
pub(crate) fn text_report(out: &Path, files: &VerifiedFiles) -> Result<String> {
    let result = files.result()?;
    let mut text = files.manifest().summary.trim_end().to_owned() + "\n";
    result.robots.iter().for_each(|robot| add_robot(&mut text, robot));
    if let Some(rescan) = &result.rescan {
        add_changes(&mut text, rescan, files)?;
    }
    add_inputs(&mut text, &result);
    add_run(&mut text, &result, RunRecord::of_result(out, files.digest()).as_ref());
    Ok(text)
}

fn heading(text: &mut String, words: &str) {
    let _ = writeln!(text, "\n{words}");
}

/// A line of a robot: what it is about, and the words.
fn line(text: &mut String, about: &str, words: &str) {
    let _ = writeln!(text, "  {about:<12} {words}");
}

fn add_robot(text: &mut String, robot: &RobotEntry) {
    let [id, model] = [&robot.id, &robot.model].map(|name| quote::shown(name).into_owned());
    heading(text, &format!("{id} {model}: {}", robot.verdict));
    let worst = |each: &[Option<f64>; 3]| each.iter().flatten().copied().fold(0.0, f64::max);
    let [place, turn] = [&robot.base_sigma.xyz, &robot.base_sigma.rotation].map(worst);
    let base = &robot.base_pose;
    let (at, yaw) = (triple(base.xyz, 4), Unit::DEGREES.say_both(yaw(base), turn));
    line(text, "base", &format!("{at} m ± {:.1} mm, {yaw} about z{}", place * 1e3, lean(base)));
    if let (Some(tip), Some(sigma)) = (&robot.tip, robot.tip_sigma) {
        let at = triple(tip.pose.xyz, 4);
        line(text, "tip", &format!("{at} m ± {:.1} mm from the base", sigma * 1e3));
    }
    line(text, "next best", &next_best(robot));
    if !robot.equals.is_empty() {
        let others = count(robot.equals.len() as u64, "other posture");
        line(text, "as good", &format!("{others} of the same model"));
    }
    if !robot.alike.is_empty() {
        line(text, "alike", &quote::shown(&robot.alike.join(", ")));
    }
    if let Some(space) = &robot.space {
        let [free, unknown] = [space.free_m3, space.unknown_m3].map(|v| fixed(v, 1));
        line(text, "space", &format!("{free} m³ free, {unknown} m³ unseen within its reach"));
    }
    if robot.evidence.is_empty() {
        return;
    }
    let heads = ["link", "seen", "matched", "contradicted", "points", "rms"];
    let [link, seen, matched, violated, points, rms] = heads;
    let _ =
        writeln!(text, "  {link:<24} {seen:>8} {matched:>8} {violated:>12} {points:>10} {rms:>9}");
    for entry in &robot.evidence {
        let [seen, matched, violated] = [entry.seen, entry.matched, entry.violated].map(percent);
        let (link, points) = (quote::shown(&entry.link), entry.n_points);
        let rms = entry.rms.filter(|_| points > 0);
        let rms = rms.map_or_else(|| "-".into(), |v| format!("{} mm", fixed(v * 1e3, 1)));
        let _ = writeln!(
            text,
            "  {link:<24} {seen:>8} {matched:>8} {violated:>12} {points:>10} {rms:>9}"
        );
    }
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "unknown".into(), |share| format!("{} %", fixed(100.0 * share, 0)))
}

/// Rotation about the vertical, radians.
fn yaw(pose: &BasePose) -> f64 {
    let [w, i, j, k] = pose.quat_wxyz;
    (2.0 * (w * k + i * j)).atan2(1.0 - 2.0 * (j * j + k * k))
}

/// The words for a base that leans by more than a tenth of a degree.
fn lean(pose: &BasePose) -> String {
    let [_, i, j, _] = pose.quat_wxyz;
    let lean = (1.0 - 2.0 * (i * i + j * j)).clamp(-1.0, 1.0).acos();
    if lean > 0.002 { format!(", leaning {}", Unit::DEGREES.say(lean, 2)) } else { String::new() }
}

/// The best other explanation of the points, in words.
fn next_best(robot: &RobotEntry) -> String {
    let Some(next) = &robot.runner_up else { return "nothing else came near".into() };
    let what = if next.same_model {
        "the same model in another posture".into()
    } else {
        format!("model {}", quote::shown(&next.model))
    };
    let number = |value: Option<f64>, what: &str| {
        value.map_or_else(String::new, |v| format!(", {what} {}", fixed(v, 2)))
    };
    what + &number(next.score, "score") + &number(next.margin, "margin")
}

fn add_changes(text: &mut String, rescan: &RescanEntry, files: &VerifiedFiles) -> Result<()> {
    let bytes = files.bytes(&rescan.changes)?;
    let changes: ListedChanges = serde_json::from_slice(&bytes).map_err(|e| {
        Error::bad_input("the list of changes cannot be read").because(e).at(&rescan.changes)
    })?;
    heading(text, "What changed");
    for line in words(&changes.robots).lines() {
        let _ = writeln!(text, "  {line}");
    }
    for (k, thing) in changes.things.iter().enumerate() {
        let _ = writeln!(text, "  {}", thing.words(k));
    }
    heading(text, "Registration of the new scans");
    for scan in &rescan.scans {
        let shift = triple(scan.shift.map(|v| v * 1e3), 2);
        let [before, after] = scan.rms.map(|v| fixed(v * 1e3, 1));
        let name = quote::shown(&scan.scan);
        let _ = writeln!(text, "  {name:<24} {shift} mm, rms {before} mm before, {after} mm after");
    }
    Ok(())
}

fn add_inputs(text: &mut String, result: &ResultFile) {
    heading(text, "Inputs");
    for input in &result.inputs {
        let (scans, points) = (count(input.n_scans.into(), "scan"), input.n_points);
        let dropped = match input.n_dropped {
            0 => String::new(),
            n => format!(", {n} dropped"),
        };
        let _ = writeln!(
            text,
            "  {}: {}, {}, {scans}, {points} points{dropped}",
            quote::shown(&input.path),
            input.format,
            memory_words(input.n_bytes)
        );
        for note in &input.notes {
            let _ = writeln!(text, "    {}", quote::shown(note));
        }
    }
}

fn add_run(text: &mut String, result: &ResultFile, record: Option<&RunRecord>) {
    heading(text, "How the run went");
    for stage in &result.stages {
        let [from, to] = match stage.name.as_str() {
            "ingest" => ["input", "point"],
            "cluster" => ["point", "body"],
            "fit" => ["body", "robot"],
            "label" => ["point", "moving point"],
            _ => ["item", "item"],
        };
        let [from, to] = [count(stage.n_in, from), count(stage.n_out, to)];
        line(text, &stage.name, &format!("{from} -> {to}"));
    }
    let Some(record) = record else {
        line(
            text,
            "times",
            "not kept: the folder `store` of the run is not here, or is a later one",
        );
        return;
    };
    for (about, words) in record.words() {
        let _ = writeln!(text, "  {about:<20} {words}");
    }
}
