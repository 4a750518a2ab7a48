//! The suite of the rescan bench with pushed things: which of them a rescan reports as moved, how
//! far their stated shifts and turns are off, and whether they keep to their standard deviations.

use super::cases::{CaseRow, CaseToRun, Cases};
use super::request::RescanBench;
use super::shift_table::{ShiftRow, ShiftsRow, table};
use crate::engine::Engine;
use crate::eval::virtual_scan::{Formats, scan_scene};
use crate::job::{Job, Means};
use crate::plan;
use crate::rescan::{Cell, Frame, RescanRequest, rescan};
use contract::{Error, Result};
use export::atomic;
use geometry::{Aabb, Point, Pose, Vector};
use nalgebra::{Matrix3, UnitQuaternion};
use serde_json::Value;
use simulate::{MovedThings, TrueThing, moved_things};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

/// Distance of a reported body's middle from a true one's within which it is that one, metres: a
/// session may see one end of it only.
const SAME_THING: f64 = 0.6;

/// Draws halls with pushed things, rescans them, and returns the table.
pub fn shifts(bench: &RescanBench, means: &Means, engine: &Engine) -> Result<String> {
    let temporary = tempfile::tempdir()?;
    let robots = bench.drawn.library(temporary.path())?;
    let quiet = engine.quiet();
    let place = Cases { name: "things", drawn: &bench.drawn, temporary: temporary.path() };
    let cases = CaseToRun::numbered(&bench.drawn, bench.n_cases, |seed| ShiftsRow {
        seed,
        ..ShiftsRow::default()
    });
    let case = |row: &mut ShiftsRow, _: &usize, dir: &Path| {
        let wanted = MovedThings { seed: row.seed, step_deg: bench.size.step_deg };
        case(row, &wanted, &robots, dir, means, &quiet)
    };
    place.run(cases, case, table, engine)
}

fn case(
    row: &mut ShiftsRow,
    wanted: &MovedThings,
    robots: &Path,
    dir: &Path,
    means: &Means,
    engine: &Engine,
) -> Result<()> {
    let (scenes, things) = moved_things(wanted)?;
    let formats = Formats { las: false, labels: false, ..Formats::ALL };
    let job = |scans: &str, out: &str| {
        let inputs = vec![dir.join(scans).join("scans.e57")];
        Job::new(inputs, robots.to_path_buf(), dir.join(out), means.clone())
    };
    let (base, again) = (dir.join("base"), dir.join("again"));
    // A kept case is only rescanned, so that two builds can be compared on the same results.
    if base.join("result.json").exists() {
        let _ = std::fs::remove_dir_all(&again);
    } else {
        for (scene, name) in scenes.iter().zip(["then", "now"]) {
            scan_scene(scene, &[], &dir.join(name), formats, engine)?;
        }
        let known = things.iter().map(truth).collect::<Vec<_>>();
        atomic::write(&dir.join("things.json"), Value::from(known).to_string().as_bytes())?;
        plan::run(&job("then", "base"), engine)?;
    }
    let job = job("now", "again");
    let request = RescanRequest { base, cell: Cell::Seen, frame: Frame::Stated, job };
    let started = std::time::Instant::now();
    rescan(&request, engine)?;
    row.seconds = started.elapsed().as_secs_f64();
    judge(row, &things, &again)
}

/// A true thing, for people who look at a kept case.
fn truth(thing: &TrueThing) -> Value {
    let pose = |p: &Pose| {
        let [x, y, z]: [f64; 3] = p.translation.vector.into();
        [x, y, z, p.rotation.euler_angles().2.to_degrees()]
    };
    serde_json::json!({
        "name": thing.name, "size": thing.size, "n_alike": thing.kind.n_alike(),
        "poses": thing.poses.each_ref().map(pose), "sides": thing.sides,
    })
}

/// Compares the list of changes with the true motions.
fn judge(row: &mut ShiftsRow, things: &[TrueThing], out: &Path) -> Result<()> {
    let path = out.join("changes.json");
    let text = std::fs::read_to_string(&path).map_err(|e| Error::from(e).at(path.display()))?;
    let changes: Value = serde_json::from_str(&text)
        .map_err(|e| Error::bad_input("the changes cannot be read").because(e))?;
    let found = changes["things"].as_array().cloned().unwrap_or_default();
    row.things = things.iter().map(|thing| one(thing, &found)).collect();
    let is_of = |entry: &Value, thing: &TrueThing| {
        (0..2).any(|k| off(entry, thing, k).is_some_and(|off| off < SAME_THING))
    };
    let is_invented = |entry: &&Value| !things.iter().any(|thing| is_of(entry, thing));
    row.n_invented = found.iter().filter(is_invented).count();
    Ok(())
}

/// The bounds of a reported body in the earlier (0) or in the later session (1).
fn bounds(entry: &Value, when: usize) -> Option<Aabb> {
    let [min, max] = serde_json::from_value(entry[["then", "now"][when]].clone()).ok()?;
    Some(Aabb { min, max })
}

/// Distance in the plan of a reported body's middle from that of a thing, metres.
fn off(entry: &Value, thing: &TrueThing, when: usize) -> Option<f64> {
    let at = bounds(entry, when)?.center() - thing.poses[when].translation.vector;
    Some(at.x.hypot(at.y))
}

/// What was reported of a thing.
fn one(thing: &TrueThing, found: &[Value]) -> ShiftRow {
    let (then, now) = (&thing.poses[0], &thing.poses[1]);
    let both = thing.sides[0].intersection(&thing.sides[1]).count();
    let mut row = ShiftRow {
        kind: thing.kind.name().into(),
        sides: [thing.sides[0].len(), thing.sides[1].len(), both],
        pushed: (now.translation.vector - then.translation.vector).norm(),
        turned: yaw(&(now * then.inverse())).to_degrees(),
        ..ShiftRow::default()
    };
    let moved = found.iter().filter(|entry| entry["change"] == "moved");
    let apart = |entry: &Value| Some(off(entry, thing, 0)?.max(off(entry, thing, 1)?));
    let near = moved.filter_map(|entry| Some((apart(entry)?, entry)));
    let near = near.filter(|(apart, _)| *apart < SAME_THING);
    let Some((_, entry)) = near.min_by(|a, b| a.0.total_cmp(&b.0)) else { return row };
    row.moved = true;
    compare(&mut row, thing, entry);
    row
}

/// Compares a stated shift with the true one of the same place.
fn compare(row: &mut ShiftRow, thing: &TrueThing, entry: &Value) {
    let read = |value: &Value| serde_json::from_value::<[f64; 3]>(value.clone()).ok();
    let Some(shift) = read(&entry["shift"]).map(Vector::from) else {
        row.unknown = Some(entry["shift_unknown"].as_str().unwrap_or("no reason").into());
        return;
    };
    let motion = &entry["motion"];
    // Where no place is stated, the shift is that of the middle.
    let at = read(&motion["at"]).map(Point::from).or(bounds(entry, 0).map(|b| b.center()));
    let at = at.unwrap_or_default();
    let turn = motion["turn_deg"].as_f64();
    let error = |real: &Pose| shift - (real * at - at);
    let turn_error = |real: &Pose| turn.map(|t| turned(t - yaw(real).to_degrees()));
    let badness = |real: &Pose| turn_error(real).map_or(error(real).norm(), f64::abs);
    let all = equals(thing, turn);
    let Some(real) = all.iter().min_by(|a, b| badness(a).total_cmp(&badness(b))) else { return };
    let off = error(real);
    row.error = Some(off.into());
    if thing.kind.n_alike().is_some() {
        row.turn_error = turn_error(real);
        let sigma = motion["turn_sigma_deg"].as_f64();
        row.turn_z = row.turn_error.zip(sigma).map(|(error, sigma)| error.abs() / sigma);
    }
    let covariance = serde_json::from_value::<[[f64; 3]; 3]>(motion["covariance"].clone()).ok();
    if let Some(covariance) = covariance {
        let eigen = Matrix3::from(covariance).symmetric_eigen();
        let sigma = eigen.eigenvalues.map(|v| v.max(1e-12).sqrt());
        row.sigma = Some(sigma.max());
        let along = eigen.eigenvectors.transpose() * off;
        row.z = Some(along.component_div(&sigma).amax());
    }
}

/// The motions after which a thing looks as it does: of a thing that is round, the one with the
/// stated turn, or without a turn.
fn equals(thing: &TrueThing, turn: Option<f64>) -> Vec<Pose> {
    let [then, now] = &thing.poses;
    let spun = |angle: f64| {
        now * UnitQuaternion::from_axis_angle(&Vector::z_axis(), angle) * then.inverse()
    };
    match thing.kind.n_alike() {
        Some(n) => (0..n).map(|k| spun(TAU * k as f64 / n as f64)).collect(),
        None => vec![spun(turn.unwrap_or_default().to_radians() - yaw(&spun(0.0)))],
    }
}

/// Rotation about the vertical axis, radians.
fn yaw(pose: &Pose) -> f64 {
    pose.rotation.euler_angles().2
}

/// An angle between -180° and 180°, degrees.
fn turned(deg: f64) -> f64 {
    deg - 360.0 * (deg / 360.0).round()
}

impl CaseRow for ShiftsRow {
    fn fail(&mut self, why: String) {
        self.failed = Some(why);
    }

    fn line(&self) -> String {
        if let Some(why) = &self.failed {
            return format!("{}: failed: {why}", self.seed);
        }
        let mut line =
            format!("{}: {:.1} s, {} invented", self.seed, self.seconds, self.n_invented);
        for thing in &self.things {
            let [a, b, both] = thing.sides;
            let _ = write!(
                line,
                "; {} by {:.2} m, {:.0}°, sides {a} {b} {both}: ",
                thing.kind, thing.pushed, thing.turned
            );
            let _ = match (thing.moved, thing.off()) {
                (false, _) => write!(line, "not reported as moved"),
                (true, None) => write!(line, "{}", thing.unknown.clone().unwrap_or_default()),
                (true, Some(off)) => write!(
                    line,
                    "off by {:.1} mm (sigma {:.1} mm, z {:.2}), turn {:.2}° (z {:.2})",
                    1e3 * off,
                    1e3 * thing.sigma.unwrap_or(f64::NAN),
                    thing.z.unwrap_or(f64::NAN),
                    thing.turn_error.unwrap_or(f64::NAN),
                    thing.turn_z.unwrap_or(f64::NAN)
                ),
            };
        }
        line
    }
}
