//! The request of a path check and its report.

use clearance::Contact;
use geometry::{Point, Pose};
use std::path::PathBuf;

/// Request of a check of paths.
#[derive(Debug, Clone)]
pub struct CheckRequest {
    /// Output folder of the run whose result is used.
    pub out: PathBuf,
    /// Files of the paths.
    pub trajectories: Vec<PathBuf>,
    /// Id of the robot of all paths; `None` for the only robot that has all joints of a path.
    pub robot: Option<String>,
    /// Folder of the robot library, if it has moved since the run.
    pub robots: Option<PathBuf>,
    /// Distance below which an obstacle is near, metres.
    pub margin: f64,
    /// Whether turning joints of the paths are given in degrees.
    pub degrees: bool,
}

/// Outcome of a path check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PathOutcome {
    /// Nothing is near, and the whole space is known.
    Free,
    /// Nothing is nearer than in the found posture, but not everything is known.
    Unknown,
    /// Something is nearer than the margin.
    Near,
    /// Something is hit, or a joint cannot follow the path.
    Blocked,
}

/// Why a path is not known to be free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum PathDoubt {
    /// The path leads through space that no beam passed through
    Unseen,
    /// The path comes nearer to uncertain points within 10 cm of where the robot was found: most
    /// belong to the robot and move with it, some may be obstacles
    Beside,
    /// Parts are as near to an obstacle as where the robot was found
    AsFound,
    /// The robot's posture is doubtful, not known well enough for the margin, or a joint that the
    /// path leaves as found is undetermined
    Posture,
}

/// Report of a path check.
pub struct PathReport {
    /// File of the path.
    pub trajectory: PathBuf,
    /// Id of the robot.
    pub robot: String,
    /// Names of its links.
    pub links: Vec<String>,
    /// Pose of its base in the world frame.
    pub world_from_base: Pose,
    /// Contacts with obstacles.
    pub contacts: Vec<Contact>,
    /// Waypoints that the joints cannot reach, with messages.
    pub impossible: Vec<(f64, String)>,
    /// Reasons why the path is not known to be free.
    pub doubts: Vec<PathDoubt>,
    /// Warnings for people.
    pub warnings: Vec<String>,
    /// The worst outcome along the path.
    pub outcome: PathOutcome,
    /// Number of waypoints.
    pub n_waypoints: usize,
    /// Number of postures that were checked.
    pub n_postures: usize,
    /// Largest distance on the way between neighbouring beams of the scanner that resolves a place
    /// best, metres, whether or not it sees the place; `None` without scanners of known position.
    /// Thinner things may stand there without a single point.
    pub beam_spacing: Option<f64>,
    /// Times of the waypoints, seconds; empty where the path states none.
    pub times: Vec<f64>,
    /// The requested margin, metres.
    pub margin: f64,
    /// Ids of all robots, by index.
    pub ids: Vec<String>,
}

impl PathReport {
    /// World coordinates of a point in the base frame, metres.
    pub(super) fn world(&self, p: &Point) -> [f64; 3] {
        (self.world_from_base * p).coords.into()
    }

    /// Whether the path may be executed if these doubts are allowed.
    #[must_use]
    pub fn passes(&self, allowed: &[PathDoubt]) -> bool {
        self.outcome <= PathOutcome::Unknown
            && self.doubts.iter().all(|doubt| allowed.contains(doubt))
    }
}
