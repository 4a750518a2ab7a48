//! Rearranges the coordinates of several places axis by axis, as vector registers take them.

/// Number of places that are looked up together.
pub const LANES: usize = 16;

/// Coordinates of [`LANES`] places, axis by axis, so that the compiler computes with all places in
/// vector registers.
pub type Lanes = [[f32; LANES]; 3];

/// Rearranges at least one and at most [`LANES`] places; the last one fills the remaining lanes.
#[inline]
#[must_use]
pub fn lanes(places: &[[f32; 3]]) -> Lanes {
    // A loop is inlined; an array made with a closure is not.
    let mut out = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let place = places[i.min(places.len() - 1)];
        (out[0][i], out[1][i], out[2][i]) = (place[0], place[1], place[2]);
    }
    out
}
