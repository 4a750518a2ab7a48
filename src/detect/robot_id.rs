//! Ids of robots, which all files and messages use.

/// The id of a robot (`R1`, `R2`, …) by its index among the fits.
pub(crate) fn robot_id(index: usize) -> String {
    format!("R{}", index + 1)
}
