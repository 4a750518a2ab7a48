//! What is said of each point of a file that is given back, and what happens to moving ones.

use contract::{Label, Result};

/// Class of a point that a later scan replaced or showed to be gone.
pub const SUPERSEDED: u8 = 254;

/// What is known of one point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PointFate {
    /// Number of its kind, or [`SUPERSEDED`].
    pub class: u8,
    /// Index of its robot, −1 for none.
    pub robot: i16,
    /// Index of its link among those of the robot, −1 for none.
    pub link: i16,
    /// Whether the point is taken out.
    pub is_out: bool,
}

impl PointFate {
    /// What is said of a record that the file itself flags as invalid: nothing was measured there.
    pub(crate) const UNKNOWN: Self =
        Self { class: Label::UNCERTAIN.kind as u8, robot: -1, link: -1, is_out: false };

    /// The fate of a point with this label: points that move are taken out, and so are points that
    /// are no longer there.
    #[must_use]
    pub fn of(label: Label, is_superseded: bool) -> Self {
        Self {
            class: if is_superseded { SUPERSEDED } else { label.kind as u8 },
            robot: label.robot,
            link: label.link,
            is_out: is_superseded || label.moves(),
        }
    }
}

/// The labels of all points of one scan.
pub trait ScanFates: Sync {
    /// What is known of `n` points from place `first` on; places count the points that the file
    /// does not flag as invalid.
    ///
    /// # Errors
    /// If there are no such places, or their labels cannot be read.
    fn range(&self, first: u64, n: usize) -> Result<Vec<PointFate>>;
}

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GiveBack {
    /// Whether points that are taken out are left out; else they stay and are flagged as invalid.
    pub drops: bool,
    /// Whether classes, robots and links are written beside the points.
    pub says_labels: bool,
}

/// Numbers of points of one scan.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GivenBack {
    /// Points that the file does not flag as invalid.
    pub n_valid: u64,
    /// Those of them that are taken out.
    pub n_out: u64,
}

/// Names of a robot and of its links, in the order of their indices.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RobotNames {
    /// Identifier, such as `R1`.
    pub id: String,
    /// Name of its model.
    pub model: String,
    /// Names of its links.
    pub links: Vec<String>,
}
