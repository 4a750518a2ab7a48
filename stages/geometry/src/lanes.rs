//! Places in; their coordinates axis by axis out, as vector registers take them.

/// Places that are asked about together.
pub const LANES: usize = 16;

/// Coordinates of [`LANES`] places, axis by axis: what is reckoned of all of them is so in vector
/// registers.
pub type Lanes = [[f32; LANES]; 3];

/// Places as lanes, the last one in those that are left over; at least one, at most [`LANES`].
#[inline]
#[must_use]
pub fn lanes(places: &[[f32; 3]]) -> Lanes {
    // A loop is inlined where arrays made of closures are not.
    let mut out = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let place = places[i.min(places.len() - 1)];
        (out[0][i], out[1][i], out[2][i]) = (place[0], place[1], place[2]);
    }
    out
}
