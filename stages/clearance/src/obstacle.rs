//! What one obstacle is: a ball about a cell of points or a voxel of unseen space, and how far
//! balls are from each other. All in the frame of the robot's base, metres.

/// Edge of the cells in which all points are one obstacle, metres: finer than planners' margins,
/// and the floor of a cell in such cells fits into memory.
pub const CELL: f64 = 0.004;
/// Half the diagonal of a cube of edge 1.
pub(crate) const HALF_DIAGONAL: f64 = 0.8661;
/// Radius of a ball that holds a cell, metres.
pub(crate) const HALF_CELL: f32 = (HALF_DIAGONAL * CELL) as f32;

/// What an obstacle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum What {
    /// Points that stand still.
    Fixed,
    /// Points of the floor.
    Floor,
    /// Points of which nobody knows.
    Uncertain,
    /// Those of them beside where the robot stood when it was scanned: most are its own.
    Beside,
    /// Points and surface of the robot with this number.
    Robot(i16),
    /// Space that no beam went through.
    Unseen,
}

/// A ball.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Obstacle {
    pub(crate) at: [f32; 3],
    pub(crate) radius: f32,
    pub(crate) what: What,
    /// All beams that tell it grazed the edge of a robot (see [`crate::Shadow`]).
    pub(crate) is_grazed: bool,
}

#[inline]
pub(crate) fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt()
}
