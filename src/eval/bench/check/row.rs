//! What the scene and the check say of a path, and of all paths of a cell.

use super::draw::PathKind;
use crate::eval::bench::cases::CaseRow;
use serde::Serialize;

/// What the scene says of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum True {
    /// It keeps the margin, and scanners saw all of its space and the margin about it.
    Free,
    /// It keeps the margin.
    Unseen,
    /// It comes nearer than the margin, and touches nothing.
    Grazes,
    /// It touches something.
    Collides,
}

/// A path that was checked.
#[derive(Debug, Clone, Serialize)]
pub(super) struct PathRow {
    pub(super) robot: String,
    pub(super) model: String,
    pub(super) drawn: PathKind,
    pub(super) truth: True,
    /// Metres, to what, and where on the way.
    pub(super) gap: f64,
    pub(super) nearest: String,
    pub(super) at: f64,
    /// What the check said.
    pub(super) outcome: String,
    pub(super) doubts: Vec<String>,
    /// What comes near, the worst first.
    pub(super) contacts: Vec<String>,
    /// Waypoints, to look at it again.
    pub(super) from: Vec<f64>,
    pub(super) to: Vec<f64>,
}

/// A cell.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct CheckRow {
    pub(super) seed: u64,
    pub(super) failed: Option<String>,
    pub(super) n_robots: usize,
    /// Robots that were found as what they are.
    pub(super) n_checked: usize,
    pub(super) paths: Vec<PathRow>,
    /// Scanning, the main job, and checking with its truth, seconds.
    pub(super) seconds: [f64; 3],
}

impl PathRow {
    /// It keeps the margin, and something is said to be in its way.
    pub(super) fn is_wolf(&self) -> bool {
        matches!(self.truth, True::Free | True::Unseen)
            && matches!(&*self.outcome, "near" | "blocked")
    }

    /// The reason that counts: the worst contact's kind, or the doubts.
    pub(super) fn why(&self) -> String {
        if matches!(&*self.outcome, "near" | "blocked") {
            let worst = self.contacts.first().map_or("a joint cannot get there", |c| c);
            let hangs = if worst.contains("(hangs)") { ", what hangs on it" } else { "" };
            let kind: Vec<&str> = worst.split(' ').take(2).collect();
            return kind.join(" ") + hangs;
        }
        self.doubts.join(", ")
    }

    pub(super) fn line(&self) -> String {
        format!(
            "{} ({}) {:?} {:?} {:.4} m {} at {:.2}: {} [{}] {}",
            self.robot,
            self.model,
            self.drawn,
            self.truth,
            self.gap,
            self.nearest,
            self.at,
            self.outcome,
            self.doubts.join(" "),
            self.contacts.first().map_or("", |c| c),
        )
    }
}

impl CaseRow for CheckRow {
    fn fail(&mut self, why: String) {
        self.failed = Some(why);
    }

    fn line(&self) -> String {
        if let Some(why) = &self.failed {
            return format!("{}: failed: {why}", self.seed);
        }
        let count = |is: &dyn Fn(&PathRow) -> bool| self.paths.iter().filter(|p| is(p)).count();
        format!(
            "{}: {} of {} robots, {} paths; free in seen space {}, of them called free {}; colliding {}, missed {}; free, called near or blocked {}; scan {:.1} s, run {:.1} s, check {:.1} s",
            self.seed,
            self.n_checked,
            self.n_robots,
            self.paths.len(),
            count(&|p| p.truth == True::Free),
            count(&|p| p.truth == True::Free && p.outcome == "free"),
            count(&|p| p.truth == True::Collides),
            count(&|p| p.truth == True::Collides && p.outcome == "free"),
            count(&PathRow::is_wolf),
            self.seconds[0],
            self.seconds[1],
            self.seconds[2],
        )
    }
}
