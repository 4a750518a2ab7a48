//! Levels of contact between a part of a robot and an obstacle.

/// How close a part of a robot is to an obstacle; a greater level is worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ContactLevel {
    /// The part reaches into space that no beam passed through.
    Unseen,
    /// The obstacle is nearer than the margin.
    Near,
    /// The obstacle touches the surface of the part.
    Hit,
    /// The obstacle lies inside the part.
    Inside,
}
