//! Hoses whose ends at the robot are hidden, and what only hoses join to the building.

use super::tests::{attached, attached_to_one_of, shell, voxel};
use super::*;
use contract::PointKind;

/// A face of a moving link, 22 cm wide, at z = 0.
fn face() -> Vec<ResidualVoxel> {
    let filled = |at| ResidualVoxel { n_residual: 0, n_link: 5, ..voxel(at, 1, 0) };
    shell([-5, -5, 0], [5, 5, 0], filled)
}

/// A line above the face, or below it, up to where it leaves what is looked at.
fn line(at: impl Fn(i32) -> Voxel, of: std::ops::Range<i32>) -> Vec<ResidualVoxel> {
    let last = if of.start < -10 { of.start } else { of.end - 1 };
    of.map(|k| ResidualVoxel { at_border: k == last, ..voxel(at(k), 1, k.abs()) }).collect()
}

/// How many hundredths of the first of some parts move; a robot of four links, so that the arm is
/// no hand.
fn percent_of_first(parts: &[Vec<ResidualVoxel>]) -> usize {
    let out = attached_to_one_of(4, parts);
    let moves = |v: &&ResidualVoxel| out.label(v.voxel).kind == PointKind::Attachment;
    100 * parts[0].iter().filter(moves).count() / parts[0].len()
}

#[test]
fn a_hose_that_ends_in_the_shadow_beside_a_link_moves_and_a_pipe_that_passes_does_not() {
    let curve = |k: i32| [k * k / 200, 0, k];
    let hose = line(curve, 3..90);
    assert!(percent_of_first(&[hose.clone(), face()]) >= 95);
    // A part of it beside the link is seen, farther on.
    let bit = shell([-1, 0, 1], [0, 1, 3], |at| voxel(at, 1, at[2] - 1));
    let far = line(curve, 15..90);
    assert!(percent_of_first(&[far.clone(), face(), bit]) >= 95);
    // Nothing shows that it leads there, or nothing that the robot is there.
    assert_eq!(percent_of_first(&[far, face()]), 0);
    assert_eq!(percent_of_first(&[hose]), 0);
    // A pipe that passes close by, hidden behind the link over 16 cm, and one that ends beside it.
    let pipe = |k: i32| [7, 0, k];
    let (above, below) = (line(pipe, 4..90), line(pipe, -60..-3));
    assert_eq!(percent_of_first(&[above.clone(), face(), below.clone()]), 0);
    assert_eq!(percent_of_first(&[below, face(), above]), 0);
    let mut beside = line(|k| [k, 7, 3], -60..60);
    beside.iter_mut().for_each(|v| v.distance = v.distance.max(0.045));
    assert_eq!(percent_of_first(&[beside, face()]), 0);
    assert_eq!(percent_of_first(&[line(|k| [9, 0, k], 4..90), face()]), 0);
}

#[test]
fn a_plate_on_a_hand_from_which_a_hose_hangs_down_moves_and_one_on_a_post_does_not() {
    let below = |at: Voxel| voxel(at, 1, -at[2]);
    let tool = shell([-2, -2, -5], [2, 2, 0], below);
    let plate = shell([-15, -15, -8], [15, 15, -6], below);
    let hose = (3..80).map(|k| match k {
        3..20 => voxel([k, 0, 0], 1, k - 3),
        _ => ResidualVoxel { at_border: k == 79, ..voxel([20, 0, 20 - k], 1, k) },
    });
    let hose: Vec<_> = hose.collect();
    let post = shell([-3, -3, -60], [3, 3, -9], |at| ResidualVoxel {
        grounded: at[2] == -60,
        ..below(at)
    });
    let n_moving = |parts: &[Vec<ResidualVoxel>], of: &[ResidualVoxel]| {
        let out = attached(parts);
        of.iter().filter(|v| out.label(v.voxel).kind == PointKind::Attachment).count()
    };
    let n = n_moving(&[tool.clone(), plate.clone(), hose.clone()], &plate);
    assert!(100 * n >= 95 * plate.len(), "{n} of {}", plate.len());
    assert_eq!(n_moving(&[tool, plate.clone(), hose, post], &plate), 0);
}
