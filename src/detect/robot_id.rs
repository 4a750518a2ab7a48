//! The place of a robot among the fits in; what every file and message calls it, out.

/// What a robot is called, by its place among the fits.
pub(crate) fn robot_id(index: usize) -> String {
    format!("R{}", index + 1)
}
