//! Writes the result of the whole plant after a rescan, the changes as JSON, CSV and picture, and
//! the summary for people.

use super::found::RescanFindings;
use super::picture;
use crate::cache::Digests;
use crate::detect::robot_id::robot_id;
use crate::job::Outcome;
use crate::label::labelling::WrittenLabels;
use crate::result::changed_things::{ThingEntry, word};
use crate::result::changes::{Change, RobotChange, changes, of_missed, words};
use crate::result::report::{dropped, input_entry, robot_entry};
use change::UnobservedRegion;
use contract::words::{count, fixed, triple};
use contract::{Error, Kind, Result, quote};
use export::{
    CarriedEntry, LabelFiles, RegistrationEntry, RescanEntry, ResultFile, ScanLabels, write_table,
};
use register::Registration;
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;

/// Names of the files that this module writes.
pub(crate) const NAMES: [&str; 6] = [
    "result.json",
    "plant.bin",
    "labels/table.json",
    "changes.json",
    "changes.csv",
    "pictures/changes.png",
];

/// Everything that result, changes and summary are made of.
pub(crate) struct RescanReport<'a, 's> {
    pub(crate) found: &'a RescanFindings<'a, 's>,
    pub(crate) done: &'a WrittenLabels,
    pub(crate) registered: &'a [Option<Registration>],
    /// For each mask of the earlier result, the list of its superseded places.
    pub(crate) lists: &'a [Option<String>],
    pub(crate) n_superseded: u64,
}

impl RescanReport<'_, '_> {
    pub(crate) fn finish(&self, digests: &Digests, next: &Path) -> Result<Outcome> {
        let result = self.result(digests);
        let robots = self.changes(&result);
        write_table(next, &result.robots)?;
        let all = json!({
            "schema": "stillpoint.changes/1",
            "base": self.found.base.out.display().to_string(),
            "cell": result.rescan.as_ref().map(|r| r.cell),
            "frame": result.rescan.as_ref().and_then(|r| r.frame.as_ref()),
            "scans": result.rescan.as_ref().map(|r| &r.scans),
            "robots": robots,
            "things": self.found.labels.things.iter().map(ThingEntry::of).collect::<Vec<_>>(),
            "fixed_not_compared": self.found.labels.unseen.iter().map(region).collect::<Vec<_>>(),
            "not_compared": self.found.robots.unseen.iter().map(|&i| robot_id(i)).collect::<Vec<_>>(),
        });
        let text = serde_json::to_string_pretty(&all)
            .map_err(|e| Error::new(Kind::Bug, "changes cannot be written").because(e))?;
        export::atomic::write(&next.join("changes.json"), (text + "\n").as_bytes())?;
        export::atomic::write(&next.join("changes.csv"), self.csv(&robots).as_bytes())?;
        picture::draw(self.found, &robots).write(&next.join("pictures/changes.png"))?;
        result.write(next)?;
        let summary = self.summary(&robots);
        Ok(Outcome { summary, warnings: result.warnings, ..Outcome::default() })
    }

    /// The result of the whole plant; entries of unchanged robots are those of the earlier result.
    fn result(&self, digests: &Digests) -> ResultFile {
        let mut result = self.found.base.result.clone();
        for &i in self.found.robots.changed.iter().chain(&self.found.robots.gone) {
            let space = self.done.spaces[i].clone();
            let entry = robot_entry(i, &self.found.fits[i], self.found.models, space);
            if i < result.robots.len() {
                result.robots[i] = entry
            } else {
                result.robots.push(entry)
            }
        }
        for (robot, space) in result.robots.iter_mut().zip(&self.done.spaces) {
            robot.space = space.clone().or(robot.space.take());
        }
        for (scan, list) in result.labels.scans.iter_mut().zip(self.lists) {
            scan.superseded.clone_from(list);
        }
        let sources = self.found.session.sources;
        let masks = sources.opened_masks().iter().zip(&self.done.masks);
        result.labels.scans.extend(masks.map(|(m, count)| ScanLabels::new(m, count.n_points)));
        result.labels.table = LabelFiles::TABLE.into();
        let inputs = sources
            .opened()
            .iter()
            .map(|input| input_entry(sources, input, digests, &self.done.masks));
        result.inputs.extend(inputs);
        result.warnings.extend(sources.warnings.iter().cloned().chain(sources.oddities()));
        result.warnings.extend(dropped(sources, &self.done.masks));
        result.warnings.extend(self.warnings());
        let cell = &self.found.session.past.cell;
        result.rescan = Some(RescanEntry {
            base: self.found.base.files.digest().to_owned(),
            cell: [cell.min, cell.max],
            inputs: sources.opened().iter().map(|i| i.id.0).collect(),
            robots: self.found.robots.compared().into_iter().map(robot_id).collect(),
            frame: self.found.carried.entry.clone(),
            scans: self.registrations(),
            n_superseded: self.n_superseded,
            changes: "changes.json".into(),
        });
        result
    }

    fn warnings(&self) -> Vec<String> {
        let mut out = self.found.carried.warnings.clone();
        let first = self.found.session.past.scans.len();
        for (scan, found) in self.found.session.sources.scans[first..].iter().zip(self.registered) {
            if found.is_none() {
                out.push(format!(
                    "scan '{}' shares too few surfaces with the plant: it is taken as it is placed",
                    scan.name
                ));
            }
        }
        if ["las", "laz"].iter().any(|end| self.found.base.has(&format!("clouds/fixed.{end}"))) {
            let what = "clouds/fixed is not made by a rescan: tiles/ hold the same points by class";
            out.push(what.into());
        }
        out
    }

    fn registrations(&self) -> Vec<RegistrationEntry> {
        let first = self.found.session.past.scans.len();
        let about = self.found.session.past.cell.center();
        let scans = self.found.session.sources.scans[first..].iter().zip(self.registered);
        let entry = |(scan, found): (&contract::Scan, &Option<Registration>)| {
            let found = found.as_ref()?;
            let shift = found.plant_from_stated * about - about;
            Some(RegistrationEntry {
                scan: scan.name.clone(),
                shift: shift.into(),
                turn: found.plant_from_stated.rotation.scaled_axis().into(),
                sigma: found.sigma,
                rms: found.rms,
            })
        };
        scans.filter_map(entry).collect()
    }

    /// Changes of the robots of the cell.
    fn changes(&self, result: &ResultFile) -> Vec<RobotChange> {
        let looked: Vec<String> = self.found.robots.compared().into_iter().map(robot_id).collect();
        let mut all = changes(&self.found.base.result, result);
        all.retain(|c| c.then.iter().chain(&c.now).any(|id| looked.contains(id)));
        for (i, stood) in &self.found.robots.missed {
            let (own, id) = (&self.found.fits[*i], robot_id(*i));
            all.iter_mut()
                .filter(|c| c.now.as_ref() == Some(&id))
                .for_each(|c| *c = of_missed(&id, stood, own));
        }
        // A robot with undetermined joints is not unchanged if beams contradict its earlier
        // posture.
        let contradicted: Vec<String> =
            self.found.robots.contradicted.iter().copied().map(robot_id).collect();
        let open =
            all.iter_mut().filter(|c| c.change == Change::Same && !c.not_compared.is_empty());
        for robot in open.filter(|c| c.now.iter().any(|id| contradicted.contains(id))) {
            robot.change = Change::Moved;
        }
        let lost: Vec<String> = self.found.robots.lost.iter().copied().map(robot_id).collect();
        for robot in all.iter_mut().filter(|c| c.now.iter().any(|id| lost.contains(id))) {
            robot.change = Change::Moved;
            let joints = robot.joints.drain(..).map(|joint| joint.joint);
            robot.not_compared.splice(0..0, joints);
        }
        all
    }

    fn csv(&self, robots: &[RobotChange]) -> String {
        let mut text =
            String::from("what,id,change,x_m,y_m,z_m,dx_m,dy_m,dz_m,joint,then,now,sigma\n");
        for robot in robots.iter().filter(|r| r.change != Change::Same) {
            let id = robot.now.as_ref().or(robot.then.as_ref()).cloned().unwrap_or_default();
            let word = robot.change.word();
            let at = self.place(&id);
            let [dx, dy, dz] = robot.base_shift.unwrap_or_default();
            let _ = writeln!(text, "robot,{id},{word},{at},{dx:.4},{dy:.4},{dz:.4},,,,");
            for joint in robot.joints.iter().filter(|j| j.is_change) {
                let sigma = joint.then[1].hypot(joint.now[1]);
                let (name, then, now) = (quote::csv(&joint.joint), joint.then[0], joint.now[0]);
                let _ = writeln!(
                    text,
                    "joint,{id},{word},{at},,,,{name},{then:.6},{now:.6},{sigma:.6}"
                );
            }
        }
        for (k, thing) in self.found.labels.things.iter().enumerate() {
            let at = thing.now.or(thing.then).map(|b| b.center()).unwrap_or_default();
            let shift = thing.motion.as_ref().and_then(|m| m.as_ref().ok()).map(|m| m.shift);
            let by = shift.map_or(",,".into(), |[x, y, z]| format!("{x:.4},{y:.4},{z:.4}"));
            let _ = writeln!(
                text,
                "thing,T{},{},{:.3},{:.3},{:.3},{by},,,,",
                k + 1,
                word(thing.change),
                at.x,
                at.y,
                at.z
            );
        }
        for (k, region) in self.found.labels.unseen.iter().enumerate() {
            let at = region.bounds.center();
            let at = format!("{:.3},{:.3},{:.3}", at.x, at.y, at.z);
            let _ = writeln!(text, "fixed,U{},not compared,{at},,,,,,,", k + 1);
        }
        text
    }

    fn place(&self, robot: &str) -> String {
        let at = (0..self.found.fits.len()).find(|&i| robot_id(i) == robot);
        let p =
            at.map(|i| self.found.fits[i].world_from_base.translation.vector).unwrap_or_default();
        format!("{:.3},{:.3},{:.3}", p.x, p.y, p.z)
    }

    fn summary(&self, robots: &[RobotChange]) -> String {
        let mut text = String::new();
        let size = self.found.session.past.cell.size();
        let _ = writeln!(
            text,
            "a cell of {:.1} x {:.1} x {:.1} m, {} looked at again",
            size[0],
            size[1],
            size[2],
            count(self.found.robots.compared().len() as u64, "robot")
        );
        if let Some(frame) = &self.found.carried.entry {
            let _ = writeln!(text, "  {}", frame_in_words(frame));
        }
        for scan in self.registrations() {
            let by = triple(scan.shift.map(|v| -1e3 * v), 1);
            let turn = scan.turn.iter().map(|v| v * v).sum::<f64>().sqrt().to_degrees();
            let _ = writeln!(text, "  scan '{}' was off by {by} mm, {turn:.3}°", scan.scan);
        }
        for line in words(robots).lines() {
            let _ = writeln!(text, "  {line}");
        }
        for (k, thing) in self.found.labels.things.iter().enumerate() {
            let _ = writeln!(text, "  {}", ThingEntry::of(thing).words(k));
        }
        for &i in &self.found.robots.unseen {
            let _ = writeln!(text, "  {} not compared: the new scans hardly see it", robot_id(i));
        }
        let unseen = &self.found.labels.unseen;
        if let Some(largest) = unseen.first() {
            let ([x, y, z], n) = (largest.bounds.size(), unseen.len());
            let at = largest.bounds.center();
            let _ = writeln!(
                text,
                "  {} of what stands still not compared: no new beam got there; the largest {x:.1} x {y:.1} x {z:.1} m at {} m",
                count(n as u64, "place"),
                triple(at.into(), 1)
            );
        }
        let points = count(self.n_superseded, "point");
        let _ = writeln!(text, "{points} of earlier scans superseded");
        text
    }
}

/// The frame of the new scans, as text.
fn frame_in_words(frame: &CarriedEntry) -> String {
    let [qx, qy, qz, qw] = frame.quat_xyzw;
    let yaw = (2.0 * (qw * qz + qx * qy)).atan2(1.0 - 2.0 * (qy * qy + qz * qz)).to_degrees();
    let (n, against) = (
        frame.n_on_old + frame.n_on_new,
        frame.n_where_old_saw_through + frame.n_where_new_saw_through,
    );
    format!(
        "the new scans are in another frame, {}: the plant's is theirs turned by {}° and shifted by {} m; {:.1} % of the upright surfaces that both sessions can see agree",
        frame.by,
        fixed(yaw, 3),
        triple(frame.xyz, 3),
        100.0 * n as f64 / (n + against).max(1) as f64
    )
}

fn region(region: &UnobservedRegion) -> serde_json::Value {
    let bounds = [region.bounds.min, region.bounds.max];
    json!({ "bounds": bounds, "volume_m3": region.volume, "n_points": region.n_points })
}
