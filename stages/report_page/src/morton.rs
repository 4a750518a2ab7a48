//! Places within a block as one number, so that sorting brings neighbours together and a shift
//! gives the voxel that a place lies in.

/// Bits of a place along one axis.
pub(crate) const AXIS_BITS: u32 = 10;
/// Steps of a block along one axis.
pub(crate) const STEPS: u32 = 1 << AXIS_BITS;

/// The place of three steps, each below [`STEPS`]: their bits in turn, x lowest.
pub(crate) fn join(steps: [u32; 3]) -> u32 {
    spread(steps[0]) | spread(steps[1]) << 1 | spread(steps[2]) << 2
}

/// Moves bit i to bit 3·i.
fn spread(step: u32) -> u32 {
    let mut v = step & (STEPS - 1);
    v = (v | v << 16) & 0x0300_00ff;
    v = (v | v << 8) & 0x0300_f00f;
    v = (v | v << 4) & 0x030c_30c3;
    (v | v << 2) & 0x0924_9249
}

/// A number without pattern for each entry, by which one of several is chosen whatever their order.
pub(crate) fn scatter(entry: u64) -> u64 {
    let mut v = entry.wrapping_add(0x9e37_79b9_7f4a_7c15);
    v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    v ^ (v >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_holds_its_steps_and_its_voxels() {
        for steps in [[0, 0, 0], [1, 2, 3], [1023, 0, 512], [341, 682, 1023]] {
            let place = join(steps);
            for (axis, step) in steps.into_iter().enumerate() {
                let back: u32 =
                    (0..AXIS_BITS).map(|b| (place >> (3 * b + axis as u32) & 1) << b).sum();
                assert_eq!(step, back);
            }
            assert_eq!(place >> 6, join(steps.map(|s| s >> 2)), "a voxel of four steps");
        }
    }
}
