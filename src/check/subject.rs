//! The checked robot: a path as whole postures, limits of its joints, uncertainty of its posture,
//! and the outcome of a path.

use super::report::{CheckRequest, PathDoubt, PathOutcome, PathReport};
use super::trajectory::Trajectory;
use crate::cache::Manifest;
use clearance::{Contact, ContactLevel, Contacts, Leg, ObstacleKind};
use contract::{Error, Fit, JointFit, Result, Verdict};
use export::{RobotEntry, mesh_files};
use robot::{JointKind, Model};
use std::path::PathBuf;

/// Greatest gap of a closed loop that counts as closed, metres: less than a scanner resolves.
const LOOP_GAP: f64 = 1e-4;
/// Distance beyond a limit that counts as rounding, radians or metres.
const ROUNDING: f64 = 1e-6;

/// The robot of a result that is checked.
pub(super) struct CheckedRobot<'a> {
    pub(super) entry: &'a RobotEntry,
    pub(super) number: usize,
    pub(super) fit: &'a Fit,
    pub(super) model: &'a Model,
}

impl CheckedRobot<'_> {
    /// Refuses a model that differs from that of the run in links, joints or triangles.
    pub(super) fn is_of_the_library(&self, manifest: &Manifest) -> Result<()> {
        let model = self.model;
        let bad = |what: &str| {
            let what =
                format!("the library's {} has {what} than {} has", model.name, self.entry.id);
            Err(Error::bad_input(what).hint("give the library of the run with --robots"))
        };
        let joints = model.free.iter().map(|&j| &model.joints[j].name);
        if !model.links.iter().map(|l| &l.name).eq(&self.entry.links)
            || !joints.eq(self.entry.joints.0.iter().map(|(name, _)| name))
        {
            return bad("other links or joints");
        }
        let id = &self.entry.id;
        let files = mesh_files(id, model);
        let own: Vec<&(String, u64)> = files.iter().flatten().collect();
        let is_there = |(path, n_bytes): &(String, u64)| {
            manifest.files.iter().any(|f| f.path == *path && f.n_bytes == *n_bytes)
        };
        let folder = format!("robots/{id}/meshes/");
        let of_links = |path: &str| path.starts_with(&folder) && !path.contains("_hanging_");
        let n = manifest.files.iter().filter(|f| of_links(&f.path)).count();
        let attached_points = own.iter().filter(|(path, _)| path.contains("_hanging_")).count();
        if n + attached_points != own.len() || !own.iter().all(|file| is_there(file)) {
            return bad("other meshes");
        }
        Ok(())
    }

    /// The posture in which it was found.
    pub(super) fn found(&self) -> Vec<f64> {
        self.fit.joints.iter().map(|j| j.value).collect()
    }

    /// The waypoints as whole postures: joints that the path does not name keep their found values.
    pub(super) fn postures(&self, path: &Trajectory, degrees: bool) -> Result<Vec<Vec<f64>>> {
        let columns: Vec<Option<usize>> = (self.fit.joints.iter())
            .map(|joint| path.joints.iter().position(|name| *name == joint.name))
            .collect();
        let has = |name: &&String| self.fit.joints.iter().any(|j| j.name == **name);
        if let Some(odd) = path.joints.iter().find(|name| !has(name)) {
            let known: Vec<&str> = self.fit.joints.iter().map(|j| &*j.name).collect();
            let what = format!("{} has no joint \"{odd}\"", self.entry.id);
            return Err(Error::bad_input(what).hint(format!("there are {}", known.join(", "))));
        }
        let slides =
            |joint: usize| self.model.joints[self.model.free[joint]].kind == JointKind::Prismatic;
        let value = |point: &[f64], joint: usize| match columns[joint] {
            Some(column) if degrees && !slides(joint) => point[column].to_radians(),
            Some(column) => point[column],
            None => self.fit.joints[joint].value,
        };
        let posture = |point: &Vec<f64>| (0..columns.len()).map(|j| value(point, j)).collect();
        Ok(path.points.iter().map(posture).collect())
    }

    /// Waypoints that its joints cannot reach, with messages; `contacts` states which closed loops
    /// stay open.
    pub(super) fn impossible(
        &self,
        path: &[Vec<f64>],
        legs: &[Leg],
        contacts: &Contacts,
        degrees: bool,
    ) -> Vec<(f64, String)> {
        let (open_at, open) = contacts.open();
        let mut out = Vec::new();
        for (free, &joint) in self.model.free.iter().enumerate() {
            let joint = &self.model.joints[joint];
            let Some([low, high]) = joint.limits else { continue };
            let beyond = |v: f64| (low - v).max(v - high);
            let all = path.iter().enumerate().map(|(at, posture)| (at, posture[free]));
            let worst = all.max_by(|a, b| beyond(a.1).total_cmp(&beyond(b.1)));
            let Some((at, value)) = worst.filter(|w| beyond(w.1) > ROUNDING) else { continue };
            let hint = if degrees { "" } else { " (a path in degrees needs --degrees)" };
            let name = &joint.name;
            let what =
                format!("{name} is {value:.4}, beyond its limits {low:.4} to {high:.4}{hint}");
            out.push((at as f64, what));
        }
        if open > LOOP_GAP {
            out.push((open_at, format!("a closed loop stays open by {:.1} mm", open * 1e3)));
        }
        let jump = legs.iter().position(|leg| leg.jumps);
        out.extend(jump.map(|at| (at as f64, "a part jumps on the way from here".to_owned())));
        out
    }

    /// Reasons why its posture is not certain enough for the margin.
    fn uncertain(&self, path: &Trajectory, margin: f64) -> Vec<String> {
        let (fit, id) = (self.fit, &self.entry.id);
        let mut out = Vec::new();
        if fit.verdict != Verdict::Trusted {
            let reasons = fit.reasons.join("; ");
            out.push(format!("the posture of {id} is {}: {reasons}", fit.verdict.word()));
        }
        if !fit.stays.is_empty() {
            let what =
                "moved between scans: what hangs on it is not known to hang there in all of them";
            out.push(format!("{id} {what}"));
        }
        let is_open = |j: &&JointFit| !j.is_determined() && !path.joints.contains(&j.name);
        out.extend(fit.joints.iter().filter(is_open).map(|joint| {
            let (name, word) = (&joint.name, joint.certainty.word());
            format!("joint '{name}' is {word}, and the path does not give it")
        }));
        // The uncertainty of the base's rotation moves the farthest point of the robot by this.
        let [shift, turn] =
            [0, 3].map(|i| fit.base_sigma[i..i + 3].iter().map(|s| s * s).sum::<f64>());
        let lever = clearance::reach(self.model);
        let sigma = (shift + turn * lever.powi(2) + fit.tip_sigma.powi(2)).sqrt();
        // An undefined deviation counts as uncertain, too.
        if sigma.is_nan() || 3.0 * sigma > margin {
            out.push(format!(
                "what {id} reaches is known to ± {:.1} mm: a margin of {:.1} mm is less than three times that",
                sigma * 1e3,
                margin * 1e3
            ));
        }
        out
    }

    /// The report of the path.
    pub(super) fn report(
        &self,
        request: &CheckRequest,
        path: &Trajectory,
        contacts: &[Contact],
        impossible: Vec<(f64, String)>,
    ) -> PathReport {
        let warnings = self.uncertain(path, request.margin);
        let mut doubts = if warnings.is_empty() { Vec::new() } else { vec![PathDoubt::Posture] };
        let is_beside = |c: &Contact| c.what == ObstacleKind::Beside || c.is_doubtful;
        let stands = |c: &&Contact| !c.as_found && !is_beside(c);
        let is = |level: ContactLevel| contacts.iter().filter(stands).any(|c| c.level >= level);
        let has = |is: &dyn Fn(&Contact) -> bool| contacts.iter().any(is);
        // An obstacle that was as near in the found posture does not make the path worse.
        if has(&Contact::is_unseen) {
            doubts.push(PathDoubt::Unseen);
        }
        if has(&|c| is_beside(c) && c.level > ContactLevel::Unseen && !c.as_found) {
            doubts.push(PathDoubt::Beside);
        }
        if has(&|c| c.as_found && c.level > ContactLevel::Unseen && !is_beside(c)) {
            doubts.push(PathDoubt::AsFound);
        }
        let outcome = if is(ContactLevel::Hit) || !impossible.is_empty() {
            PathOutcome::Blocked
        } else if is(ContactLevel::Near) {
            PathOutcome::Near
        } else if doubts.is_empty() {
            PathOutcome::Free
        } else {
            PathOutcome::Unknown
        };
        PathReport {
            trajectory: PathBuf::new(),
            robot: self.entry.id.clone(),
            links: self.entry.links.clone(),
            world_from_base: self.fit.world_from_base,
            contacts: contacts.to_vec(),
            impossible,
            doubts,
            warnings,
            outcome,
            n_waypoints: path.points.len(),
            n_postures: 0,
            beam_spacing: None,
            times: path.times.clone(),
            margin: request.margin,
            ids: Vec::new(),
        }
    }
}
