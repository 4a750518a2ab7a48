//! Rows of the path bench: truth and outcome of each path, and counts of each cell.

use super::draw::PathKind;
use super::evidence::PointCounts;
use super::truth::True;
use crate::eval::bench::cases::CaseRow;
use serde::Serialize;

/// A path that was checked.
#[derive(Debug, Clone, Serialize)]
pub(super) struct PathRow {
    pub(super) robot: String,
    pub(super) model: String,
    pub(super) drawn: PathKind,
    pub(super) truth: True,
    /// Least distance (metres), obstacle, and position on the path.
    pub(super) gap: f64,
    pub(super) nearest: String,
    pub(super) at: f64,
    /// Outcome of the check.
    pub(super) outcome: String,
    pub(super) doubts: Vec<String>,
    /// Contacts, worst first.
    pub(super) contacts: Vec<String>,
    /// Waypoints, to repeat the check.
    pub(super) from: Vec<f64>,
    pub(super) to: Vec<f64>,
}

/// A cell.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct CheckRow {
    pub(super) seed: u64,
    pub(super) failed: Option<String>,
    pub(super) n_robots: usize,
    /// Number of robots found with the right model.
    pub(super) n_checked: usize,
    pub(super) paths: Vec<PathRow>,
    /// Cells of points around its robots by what they lie on.
    pub(super) points: PointCounts,
    /// Scanning, the main job, and checking with its truth, seconds.
    pub(super) seconds: [f64; 3],
}

impl PathRow {
    /// Whether the check reports an obstacle though the path keeps the margin.
    pub(super) fn is_wolf(&self) -> bool {
        matches!(self.truth, True::Free | True::Unseen)
            && matches!(&*self.outcome, "near" | "blocked")
    }

    /// The decisive reason: the kind of the worst contact, or the doubts.
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
