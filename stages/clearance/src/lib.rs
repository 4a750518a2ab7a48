//! A robot, what stands around it and a path of postures in; where on the way it comes near to
//! what, out.
//!
//! In doubt it is near: points count as balls that hold all of their cell, and between two postures
//! of the path each part may be half a step farther.
#![forbid(unsafe_code)]

mod body;
mod evidence;
mod obstacle;
mod obstacles;
mod path;
mod shadow;
mod shape;

pub use body::{Hung, RobotBody, STEP, reach};
pub use evidence::hanging;
pub use obstacle::{CELL, What};
pub use obstacles::{Cells, FARTHEST, KnownBounds, Obstacles};
pub use path::{Contact, Contacts, Leg, PathWalk, PieceContacts, leg};
pub use shadow::{ScannerAt, Shadow};

/// How a part of a robot stands to an obstacle; what is worse is greater.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ContactLevel {
    /// In space that no beam went through.
    Unseen,
    /// Nearer than the margin.
    Near,
    /// It touches the surface of the part.
    Hit,
    /// It lies inside of the part.
    Inside,
}
