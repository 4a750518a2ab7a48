//! What a closed loop is: the joints that it sets, the pins that hold it together, and the form in
//! which it is solved.

use geometry::Point;
use serde::{Deserialize, Serialize};

/// A loop that the tree leaves open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClosedLoop {
    /// As `robot.toml` calls it.
    pub name: String,
    /// Indices of the joints that it sets, in tree order.
    pub passive: Vec<usize>,
    /// Pins that hold it together.
    pub closures: Vec<Closure>,
    /// How it is solved.
    pub form: Form,
}

/// A pin: two points of two links that coincide, seen along the axes of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Closure {
    /// Index of the link on the side of the first passive joint.
    pub link_a: usize,
    /// The pin in its frame, metres.
    pub point_a: Point,
    /// Index of the other link.
    pub link_b: usize,
    /// The pin in its frame, metres.
    pub point_b: Point,
}

/// How a loop is solved. `mode` is +1 or −1: which of two solutions, that of the zero posture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Form {
    /// Two revolute joints one after the other, then the pin.
    RrrSerial {
        /// Which of two solutions.
        mode: f64,
    },
    /// A revolute joint on each side of the pin.
    RrrBranched {
        /// Which of two solutions.
        mode: f64,
    },
    /// A revolute joint that carries a prismatic one, then the pin.
    Rpr {
        /// Which of two solutions.
        mode: f64,
    },
    /// A bar that points at the pin.
    Rr,
    /// By Newton's method.
    General,
}
