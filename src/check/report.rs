//! What a check is asked for, and what a path came to.

use clearance::Contact;
use geometry::{Point, Pose};
use std::path::PathBuf;

/// What is to be checked.
#[derive(Debug, Clone)]
pub struct CheckRequest {
    /// Output folder of a run.
    pub out: PathBuf,
    /// File of the path.
    pub trajectory: PathBuf,
    /// Id of the robot; the only one that has all joints of the path where left out.
    pub robot: Option<String>,
    /// Library, where it is not where it was.
    pub robots: Option<PathBuf>,
    /// What is nearer is near, metres.
    pub margin: f64,
    /// Turning joints of the path are given in degrees.
    pub degrees: bool,
}

/// What a path came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PathOutcome {
    /// Nothing is near, and all is known.
    Free,
    /// Nothing is near that was not as near where the robot was found; but not all is known.
    Unknown,
    /// Something is nearer than the margin.
    Near,
    /// Something is hit, or a joint cannot get there.
    Blocked,
}

/// Why a path is not known to be free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum PathDoubt {
    /// It leads through space that no beam went through
    Unseen,
    /// It comes nearer to uncertain points within 10 cm of where the robot was found: most are its
    /// own and move with it, some may stand in its way
    Beside,
    /// Parts are as near to something as they were where the robot was found
    AsFound,
    /// The robot's posture is doubtful, not known well enough for the margin, or a joint is not
    /// determined that the path leaves as found
    Posture,
}

/// What was found.
pub struct PathReport {
    /// Id of the robot.
    pub robot: String,
    /// Names of its links.
    pub links: Vec<String>,
    /// World from its base.
    pub world_from_base: Pose,
    /// How near it comes to what.
    pub contacts: Vec<Contact>,
    /// What joints cannot do, in words, with the waypoint.
    pub impossible: Vec<(f64, String)>,
    /// Why it is not known to be free.
    pub doubts: Vec<PathDoubt>,
    /// What a person should know, in words.
    pub warnings: Vec<String>,
    /// The worst of all.
    pub outcome: PathOutcome,
    /// Waypoints, and postures that were looked at.
    pub n_waypoints: usize,
    /// See `n_waypoints`.
    pub n_postures: usize,
    /// When waypoints are reached, seconds, where the path says.
    pub times: Vec<f64>,
    /// What was asked for, metres.
    pub margin: f64,
    /// Ids of all robots, by their numbers.
    pub ids: Vec<String>,
}

impl PathReport {
    /// A point of the base's frame in the world.
    pub(super) fn world(&self, p: &Point) -> [f64; 3] {
        (self.world_from_base * p).coords.into()
    }

    /// Whether the path may be gone where these doubts are allowed.
    #[must_use]
    pub fn passes(&self, allowed: &[PathDoubt]) -> bool {
        self.outcome <= PathOutcome::Unknown
            && self.doubts.iter().all(|doubt| allowed.contains(doubt))
    }
}
