//! `bench rescan`: draws plants of which one cell is scanned again, and reports which changes a
//! rescan has found, which it has invented, and its time beside a run of the whole plant.

use super::cases::{CaseRow, CaseToRun, Cases};
use super::process_watch::{command, watch};
use super::request::RescanBench;
use crate::cache::Manifest;
use crate::detect::library;
use crate::engine::Engine;
use crate::eval::compare::{Agreement, FoundRobot, RobotAgreement};
use crate::eval::virtual_scan::{Formats, scan_scene};
use crate::job::Means;
use contract::{Error, Result};
use export::ResultFile;
use geometry::Vector;
use serde::Serialize;
use serde_json::Value;
use simulate::{Scene, sessions};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Distance below which a found body is a true one, metres.
const SAME_THING: f64 = 0.35;

/// One case.
#[derive(Debug, Clone, Default, Serialize)]
struct RescanRow {
    seed: u64,
    failed: Option<String>,
    n_points: u64,
    n_new: u64,
    /// Whether each change was found.
    robot: bool,
    pallet: bool,
    barrel: bool,
    /// Whether its earlier place was reported as not compared.
    unseen: bool,
    /// Messages about wrong changes.
    invented: Vec<String>,
    /// Robots that were found, and all of the plant.
    n_robots: [usize; 2],
    /// Largest error of a determined joint of the robot that moved, degrees: rescan, and a run of
    /// the new scans alone.
    joint: [f64; 2],
    /// F1 score of moving points in the cell, likewise.
    f1: [f64; 2],
    /// Remaining registration error, metres: least and greatest of the scans.
    left: [f64; 2],
    /// Number of tiles with unchanged bytes, and of all tiles of the earlier result.
    n_same: [usize; 2],
    seconds: [f64; 2],
}

/// Draws plants in one frame, scans one cell again and rescans it; returns the table.
pub fn rescans(bench: &RescanBench, means: &Means, engine: &Engine) -> Result<String> {
    let temporary = tempfile::tempdir()?;
    let robots = bench.drawn.library(temporary.path())?;
    let quiet = engine.quiet();
    let place = Cases { name: "rescan", drawn: &bench.drawn, temporary: temporary.path() };
    let cases = CaseToRun::numbered(&bench.drawn, bench.n_cases, |seed| RescanRow {
        seed,
        ..RescanRow::default()
    });
    let case =
        |row: &mut RescanRow, _: &usize, dir: &Path| case(row, bench, &robots, dir, means, &quiet);
    place.run(cases, case, table, engine)
}

fn case(
    row: &mut RescanRow,
    bench: &RescanBench,
    robots: &Path,
    dir: &Path,
    means: &Means,
    engine: &Engine,
) -> Result<()> {
    let models = library::load(robots, &means.settings.robot, None, engine)?.models;
    let [then, now] = sessions(&bench.size.plant(row.seed), &models)?;
    let formats = Formats { las: false, ..Formats::ALL };
    let scanned = |scene: &Scene, name: &str| {
        let scans = dir.join(name);
        std::fs::create_dir_all(&scans).map_err(|e| Error::from(e).at(scans.display()))?;
        let truth = scan_scene(scene, &models, &scans, formats, engine)?;
        on_disk(&scans.join("scans.e57"))?;
        Ok::<_, Error>((scans, truth.scans.iter().map(|s| s.n_points).sum::<u64>()))
    };
    let ((old, n_points), (new, n_new)) = (scanned(&then, "then")?, scanned(&now, "now")?);
    (row.n_points, row.n_new) = (n_points, n_new);
    // Each as a process of its own, as a user starts them.
    let run = |name: &str, scans: &Path, out: &str, more: &[String]| {
        let out = dir.join(out);
        let mut all = command(name, &scans.join("scans.e57"), robots, &out, means)?;
        all.extend_from_slice(more);
        Ok::<_, Error>((watch(&all)?.seconds, out))
    };
    let (seconds, base) = run("run", &old, "base", &[])?;
    row.seconds[0] = seconds;
    let (seconds, again) =
        run("rescan", &new, "again", &["--base".into(), base.display().to_string()])?;
    row.seconds[1] = seconds;
    let mut found = vec![Agreement::of_session(&again, &new.join("truth"), then.scanners.len())?];
    if bench.alone {
        let (_, alone) = run("run", &new, "alone", &[])?;
        found.push(Agreement::of(&alone, &new.join("truth"))?);
    }
    let robots = &found[0].robots;
    let is_found = |r: &&RobotAgreement| r.found.as_ref().is_some_and(|f| f.is_right);
    row.n_robots = [robots.iter().filter(is_found).count(), robots.len()];
    (row.joint, row.f1) = ([f64::NAN; 2], [f64::NAN; 2]);
    for (i, agreement) in found.iter().enumerate() {
        row.joint[i] = joint(agreement);
        row.f1[i] = agreement.points.f1();
    }
    judge(row, &then, &now, &again)?;
    row.n_same = same(&base, &again)?;
    Ok(())
}

/// Waits until a file is on its disk: what is measured next must not wait for it.
fn on_disk(path: &Path) -> Result<()> {
    let synced = std::fs::File::open(path).and_then(|file| file.sync_all());
    synced.map_err(|e| Error::from(e).at(path.display()))
}

/// Largest error of a determined joint of the robot that moved, degrees; no number where it was not
/// found.
fn joint(agreement: &Agreement) -> f64 {
    let found = agreement.robots.first().and_then(|robot| robot.found.as_ref());
    found.map_or(f64::NAN, FoundRobot::worst_joint_deg)
}

/// Compares the list of changes with what was changed.
fn judge(row: &mut RescanRow, then: &Scene, now: &Scene, out: &Path) -> Result<()> {
    let path = out.join("changes.json");
    let text = std::fs::read_to_string(&path).map_err(|e| Error::from(e).at(path.display()))?;
    let changes: Value = serde_json::from_str(&text)
        .map_err(|e| Error::bad_input("the changes cannot be read").because(e))?;
    let list = |name: &str| changes[name].as_array().cloned().unwrap_or_default();
    let result = ResultFile::read(out)?;
    let barrel = then.columns.iter().find(|c| c.name == "barrel").map(|c| c.xy).unwrap_or_default();
    judge_robots(row, &list("robots"), now, &result);
    judge_things(row, &list("things"), then, now, barrel);
    row.unseen = list("fixed_not_compared").iter().any(|region| {
        let inside = |i: usize| {
            let corner = |k: usize| region["bounds"][k][i].as_f64().unwrap_or(f64::NAN);
            barrel[i] > corner(0) - SAME_THING && barrel[i] < corner(1) + SAME_THING
        };
        inside(0) && inside(1)
    });
    row.left = left(&list("scans"), now);
    Ok(())
}

/// Compares the reported robots: the first one moved, no other did.
fn judge_robots(row: &mut RescanRow, robots: &[Value], now: &Scene, result: &ResultFile) {
    let base = Vector::from(now.robots[0].xyz);
    for robot in robots.iter().filter(|r| r["change"]["kind"] != "same") {
        let id = robot["now"].as_str().or(robot["then"].as_str()).unwrap_or_default();
        let entry = result.robots.iter().find(|r| r.id == id);
        let is_it = entry.is_some_and(|e| (Vector::from(e.base_pose.xyz) - base).norm() < 0.5);
        if is_it && robot["change"]["kind"] == "moved" {
            row.robot = true;
        } else {
            row.invented.push(format!("{id} {}", robot["change"]["kind"]));
        }
    }
}

/// Compares the reported bodies: the pallet was moved, and the barrel at this place is gone.
fn judge_things(
    row: &mut RescanRow,
    things: &[Value],
    then: &Scene,
    now: &Scene,
    barrel: [f64; 2],
) {
    let middle = |thing: &Value, when: &str| {
        let corner = |k: usize, i: usize| thing[when][k][i].as_f64();
        let at = |i: usize| Some(0.5 * (corner(0, i)? + corner(1, i)?));
        Some([at(0)?, at(1)?])
    };
    let pallet = |scene: &Scene| {
        let found = scene.boxes.iter().find(|b| b.name == "pallet");
        found.map(|b| [b.xyz[0], b.xyz[1]]).unwrap_or_default()
    };
    let is_at = |found: Option<[f64; 2]>, at: [f64; 2]| {
        found.is_some_and(|f| (f[0] - at[0]).hypot(f[1] - at[1]) < SAME_THING)
    };
    for thing in things {
        let (was, is) = (middle(thing, "then"), middle(thing, "now"));
        match thing["change"].as_str() {
            Some("moved") if is_at(was, pallet(then)) && is_at(is, pallet(now)) => {
                row.pallet = true
            }
            Some("gone") if is_at(was, barrel) => row.barrel = true,
            change => {
                row.invented.push(format!("{} at {:?}", change.unwrap_or_default(), is.or(was)))
            }
        }
    }
}

/// Remaining registration error of the scans, metres: least and greatest.
fn left(scans: &[Value], now: &Scene) -> [f64; 2] {
    let off = scans.iter().zip(&now.scanners).map(|(found, scanner)| {
        let shift = Vector::from([0, 1, 2].map(|i| found["shift"][i].as_f64().unwrap_or(f64::NAN)));
        let real = scanner
            .world_from_scan()
            .and_then(|real| Ok((real, scanner.stated_world_from_scan()?)));
        real.map_or(f64::NAN, |(real, stated)| {
            // At the scanner; the turn is a hundredth of a degree.
            (real.translation.vector - stated.translation.vector - shift).norm()
        })
    });
    let off: Vec<f64> = off.collect();
    [off.iter().copied().fold(f64::INFINITY, f64::min), off.iter().copied().fold(0.0, f64::max)]
}

/// Tiles of a base that a later result has with the same bytes, and all of them.
fn same(base: &Path, out: &Path) -> Result<[usize; 2]> {
    let tiles = |dir: &Path| -> Result<BTreeMap<String, String>> {
        let files = Manifest::read(dir)?.files.into_iter().filter(|f| f.path.starts_with("tiles/"));
        Ok(files.map(|f| (f.path, f.digest)).collect())
    };
    let (old, new) = (tiles(base)?, tiles(out)?);
    Ok([old.iter().filter(|(path, digest)| new.get(*path) == Some(digest)).count(), old.len()])
}

impl CaseRow for RescanRow {
    fn fail(&mut self, why: String) {
        self.failed = Some(why);
    }

    fn line(&self) -> String {
        if let Some(why) = &self.failed {
            return format!("{}: failed: {why}", self.seed);
        }
        let yes = |b: bool| if b { "found" } else { "MISSED" };
        format!(
            "{}: {:.1} M points and {:.1} M new: {:.1} s, again {:.1} s ({:.1} %); robot {}, pallet {}, barrel {}, {} invented {:?}; joint {}°, F1 {}, registration left {:.1} to {:.1} mm, {} of {} tiles the same, {} of {} robots",
            self.seed,
            self.n_points as f64 * 1e-6,
            self.n_new as f64 * 1e-6,
            self.seconds[0],
            self.seconds[1],
            100.0 * self.seconds[1] / self.seconds[0],
            yes(self.robot),
            yes(self.pallet),
            if self.unseen && !self.barrel { "not seen" } else { yes(self.barrel) },
            self.invented.len(),
            self.invented,
            alone(self.joint, 3),
            alone(self.f1, 4),
            1e3 * self.left[0],
            1e3 * self.left[1],
            self.n_same[0],
            self.n_same[1],
            self.n_robots[0],
            self.n_robots[1],
        )
    }
}

/// A figure, and that of a run of the new scans alone where there was one.
fn alone([own, alone]: [f64; 2], digits: usize) -> String {
    if alone.is_finite() {
        format!("{own:.digits$} ({alone:.digits$} alone)")
    } else {
        format!("{own:.digits$}")
    }
}

fn table(rows: &[RescanRow]) -> String {
    let mut out = String::from(
        "| seed | points, new | whole s | again s | share | robot, pallet, barrel | invented | joint ° | F1 | tiles the same | robots |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for row in rows.iter().filter(|r| r.failed.is_none()) {
        let n = [row.robot, row.pallet, row.barrel].iter().filter(|b| **b).count();
        let _ = writeln!(
            out,
            "| {} | {:.1} M, {:.1} M | {:.1} | {:.1} | {:.1} % | {n} of 3 | {} | {} | {} | {} of {} | {} of {} |",
            row.seed,
            row.n_points as f64 * 1e-6,
            row.n_new as f64 * 1e-6,
            row.seconds[0],
            row.seconds[1],
            100.0 * row.seconds[1] / row.seconds[0],
            row.invented.len(),
            alone(row.joint, 3),
            alone(row.f1, 4),
            row.n_same[0],
            row.n_same[1],
            row.n_robots[0],
            row.n_robots[1],
        );
    }
    for row in rows.iter().filter(|r| r.failed.is_some() || !r.invented.is_empty()) {
        let _ = write!(out, "\n- {}", row.line());
    }
    out
}
