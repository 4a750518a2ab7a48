//! One obstacle: a ball around a cell of points or around a voxel of unseen space. All coordinates
//! are in the frame of the robot's base, metres.

/// Edge of the cells in which all points make one obstacle, metres: finer than the margins of
/// motion planners, and coarse enough that a robot cell's floor fits into memory.
pub const CELL: f64 = 0.004;
/// Half the diagonal of a cube of edge 1.
pub(crate) const HALF_DIAGONAL: f64 = 0.8661;
/// Radius of a ball that holds a cell, metres.
pub(crate) const HALF_CELL: f32 = (HALF_DIAGONAL * CELL) as f32;

/// The kind of an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ObstacleKind {
    /// Points that do not move.
    Fixed,
    /// Points of the floor.
    Floor,
    /// Points with the label uncertain.
    Uncertain,
    /// Uncertain points beside the robot as it was scanned. Most of them belong to it.
    Beside,
    /// The robot with this index in the result: its points and the surface of its model.
    Robot(i16),
    /// Space that no beam passed through.
    Unseen,
}

/// An obstacle: a ball.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Obstacle {
    pub(crate) at: [f32; 3],
    pub(crate) radius: f32,
    pub(crate) what: ObstacleKind,
    /// Whether all beams that measured it grazed the edge of a robot (see [`crate::Shadow`]).
    pub(crate) is_grazed: bool,
}

impl Obstacle {
    /// Whether it is a cell of single points. Floors and robots are known from more than these.
    pub(crate) fn is_point(&self) -> bool {
        matches!(self.what, ObstacleKind::Fixed | ObstacleKind::Uncertain)
    }
}

#[inline]
pub(crate) fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt()
}
