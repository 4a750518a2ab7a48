//! The report of a path check as text for people and as JSON for programs.

use super::report::{PathDoubt, PathOutcome, PathReport};
use clearance::{Contact, ContactLevel, ObstacleKind, STEP};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// The reports of one path or several as text for people; `allowed` are doubts in a path that
/// passes.
#[must_use]
pub fn words(reports: &[PathReport], allowed: &[PathDoubt]) -> String {
    if let [one] = reports {
        return one.words();
    }
    let mut text = String::new();
    for report in reports {
        let _ = writeln!(text, "{}\n{}", report.trajectory.display(), report.words());
    }
    let outcomes =
        [PathOutcome::Free, PathOutcome::Unknown, PathOutcome::Near, PathOutcome::Blocked];
    let count = |outcome: &PathOutcome| {
        let n = reports.iter().filter(|report| report.outcome == *outcome).count();
        (n > 0).then(|| format!("{n} {}", outcome.word()))
    };
    let counts: Vec<String> = outcomes.iter().filter_map(count).collect();
    let n_passed = reports.iter().filter(|report| report.passes(allowed)).count();
    let _ = writeln!(text, "{} paths: {}; {n_passed} pass", reports.len(), counts.join(", "));
    text
}

/// The reports of one path or several as JSON for programs.
#[must_use]
pub fn json(reports: &[PathReport], allowed: &[PathDoubt]) -> Value {
    if let [one] = reports {
        return one.json();
    }
    let one = |report: &PathReport| {
        let mut all = report.json();
        all["trajectory"] = json!(report.trajectory.display().to_string());
        all["passes"] = json!(report.passes(allowed));
        all
    };
    let all: Vec<Value> = reports.iter().map(one).collect();
    json!({ "schema": SCHEMA_OF_SEVERAL, "paths": all })
}

/// Name and version of the JSON format.
const SCHEMA: &str = "stillpoint.check/2";
/// Name and version of the JSON format of several paths.
const SCHEMA_OF_SEVERAL: &str = "stillpoint.checks/1";
/// What a check does not cover.
const NOT_CHECKED: &str = "the robot against itself, other robots in motion, the way to the first waypoint, joints that do not go \
     straight from one waypoint to the next, limits of joints that follow others, sides that nobody saw of what hangs on it";

impl PathOutcome {
    /// The outcome as a word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Unknown => "unknown",
            Self::Near => "near",
            Self::Blocked => "blocked",
        }
    }
}

impl PathDoubt {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Unseen => "unseen",
            Self::Beside => "beside",
            Self::AsFound => "as-found",
            Self::Posture => "posture",
        }
    }

    fn why(self) -> &'static str {
        match self {
            Self::Unseen => "it leads through space that no beam went through",
            Self::Beside => {
                "it comes nearer to uncertain points beside where the robot was found: most are its own, some may stand in its way"
            }
            Self::AsFound => "parts are as near to something as where the robot was found",
            Self::Posture => "the robot's posture is not certain",
        }
    }
}

fn level(contact: &Contact) -> &'static str {
    match contact.level {
        ContactLevel::Unseen => "unseen",
        ContactLevel::Near => "near",
        ContactLevel::Hit => "hit",
        ContactLevel::Inside => "inside",
    }
}

impl PathReport {
    fn what(&self, what: ObstacleKind) -> String {
        match what {
            ObstacleKind::Fixed => "fixed".into(),
            ObstacleKind::Floor => "floor".into(),
            ObstacleKind::Uncertain => "uncertain".into(),
            ObstacleKind::Beside => "uncertain beside it".into(),
            ObstacleKind::Unseen => "unseen space".into(),
            ObstacleKind::Robot(number) => {
                let id = usize::try_from(number).ok().and_then(|at| self.ids.get(at));
                id.cloned().unwrap_or_default()
            }
        }
    }

    fn part(&self, contact: &Contact) -> String {
        let link = self.links.get(contact.link).map_or("", |l| l);
        match (contact.is_doubtful, contact.is_attached) {
            (true, _) => format!("what may hang on {link}"),
            (false, true) => format!("what hangs on {link}"),
            (false, false) => link.to_owned(),
        }
    }

    /// Time at a position of the path, seconds.
    fn time(&self, place: f64) -> Option<f64> {
        let from = self.times.get(place.floor() as usize)?;
        let to = self.times.get(place.ceil() as usize)?;
        Some(from + place.fract() * (to - from))
    }

    /// The reason for the outcome, as one sentence.
    #[must_use]
    pub fn why(&self) -> String {
        let margin = self.margin * 1e3;
        if let Some((place, what)) = self.impossible.first() {
            return format!("The robot cannot go there: at waypoint {place:.0} {what}.");
        }
        let worst = |is: &dyn Fn(&Contact) -> bool| self.contacts.iter().find(|c| is(c));
        let told = |c: &Contact| {
            let place = c.at.map_or(String::new(), |at| {
                let [x, y, z] = self.world(&at);
                format!(" near ({x:.3}, {y:.3}, {z:.3})")
            });
            (self.part(c), self.what(c.what), format!("{place} at waypoint {:.2}", c.worst))
        };
        let is_beside = |c: &Contact| c.what == ObstacleKind::Beside || c.is_doubtful;
        let anew = |c: &Contact| !c.as_found && !is_beside(c);
        if let Some(c) = worst(&|c| anew(c) && c.level >= ContactLevel::Hit) {
            let (part, what, place) = told(c);
            return format!("{part} hits something ({what}){place}.");
        }
        if let Some(c) = worst(&|c| anew(c) && c.level == ContactLevel::Near) {
            let ((part, what, place), gap) = (told(c), c.gap * 1e3);
            return format!(
                "{part} may come as near as {gap:.0} mm to something ({what}){place}, and the margin is {margin:.0} mm."
            );
        }
        let Some(doubt) = self.doubts.first() else {
            return format!(
                "Nothing comes nearer than {margin:.0} mm, and beams went through all space on the way."
            );
        };
        let contact = match doubt {
            PathDoubt::Unseen => worst(&Contact::is_unseen),
            PathDoubt::Beside => worst(&|c| is_beside(c) && !c.as_found),
            PathDoubt::AsFound => {
                worst(&|c| c.as_found && c.level > ContactLevel::Unseen && !is_beside(c))
            }
            PathDoubt::Posture => None,
        };
        match contact.map(told) {
            Some((part, _, place)) => {
                format!(
                    "It is not known whether the path is free: {} ({part}{place}).",
                    doubt.why()
                )
            }
            None => {
                let more = self.warnings.first().map_or(String::new(), |w| format!(" ({w})"));
                format!("It is not known whether the path is free: {}{more}.", doubt.why())
            }
        }
    }

    /// The report as text for people.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = format!(
            "{}: {} waypoints, {} postures at most {:.0} mm apart, margin {:.0} mm\n",
            self.robot,
            self.n_waypoints,
            self.n_postures,
            STEP * 1e3,
            self.margin * 1e3
        );
        for (place, what) in &self.impossible {
            let _ = writeln!(text, "  impossible  waypoint {place:.0}: {what}");
        }
        let (as_found, anew): (Vec<&Contact>, Vec<&Contact>) =
            self.contacts.iter().partition(|c| c.as_found);
        for contact in anew {
            let near = contact.at.map_or(String::new(), |at| {
                let [x, y, z] = self.world(&at);
                format!(", worst at {:.2} near ({x:.3}, {y:.3}, {z:.3})", contact.worst)
            });
            let gap = match contact.level {
                ContactLevel::Near => format!(", {:.0} mm or more apart", contact.gap * 1e3),
                _ => String::new(),
            };
            let _ = writeln!(
                text,
                "  {:<10}  waypoints {:.2} to {:.2}: {} and {}{gap}{near}",
                level(contact),
                contact.from,
                contact.to,
                self.part(contact),
                self.what(contact.what),
            );
        }
        if !as_found.is_empty() {
            let mut parts: Vec<String> = as_found.iter().map(|c| self.part(c)).collect();
            parts.sort();
            parts.dedup();
            let _ = writeln!(text, "  no nearer than as found: {}", parts.join(", "));
        }
        let _ = write!(text, "{}: {}", self.outcome.word(), self.why());
        for doubt in self.doubts.iter().skip(1) {
            let _ = write!(text, "\nand {}", doubt.why());
        }
        let _ = write!(text, "\nnot looked at: {NOT_CHECKED}");
        if let Some(apart) = self.beam_spacing {
            let _ = write!(
                text,
                ", and what is thinner than {:.0} mm: neighbouring beams of the nearest scanner are so far \
                 apart on the way, and those of others farther",
                (apart * 1e3).ceil()
            );
        }
        text.push('\n');
        text
    }

    /// The report as JSON for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let contact = |c: &Contact| {
            json!({
                "level": level(c),
                "link": self.links.get(c.link),
                "hangs": c.is_attached,
                "doubtful": c.is_doubtful,
                "what": self.what(c.what),
                "as_found": c.as_found,
                "from": c.from,
                "to": c.to,
                "worst": c.worst,
                "time": self.time(c.worst),
                "gap": (c.what != ObstacleKind::Unseen).then_some(c.gap),
                "at": c.at.map(|at| self.world(&at)),
                "n_postures": c.n_postures,
                "n_cells": c.n,
            })
        };
        let impossible = |(at, what): &(f64, String)| json!({ "waypoint": at, "what": what });
        json!({
            "schema": SCHEMA,
            "robot": self.robot,
            "outcome": self.outcome.word(),
            "why": self.why(),
            "doubts": self.doubts.iter().map(|d| d.word()).collect::<Vec<_>>(),
            "margin": self.margin,
            "n_waypoints": self.n_waypoints,
            "n_postures": self.n_postures,
            "beam_spacing": self.beam_spacing,
            "impossible": self.impossible.iter().map(impossible).collect::<Vec<_>>(),
            "contacts": self.contacts.iter().map(contact).collect::<Vec<_>>(),
            "warnings": self.warnings,
            "not_checked": NOT_CHECKED,
        })
    }
}
