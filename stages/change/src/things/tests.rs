//! Finds synthetic things that moved, went or appeared.

use super::*;
use crate::occupancy::{OccupancyBuilder, SessionEvidence};
use contract::OneByOne;

fn found(then: OccupancyBuilder, now: OccupancyBuilder) -> Vec<Thing> {
    things(&then.finish(), &now.finish(), &ThingSettings::default(), &OneByOne)
}

/// From the middle of a thing's earlier bounds to that of the later ones.
fn apart(thing: &Thing) -> [f64; 3] {
    let [then, now] = [thing.then, thing.now].map(|b| b.expect("bounds").center());
    (now - then).into()
}

/// The surface of a box, with five points in each voxel.
fn solid(tally: &mut OccupancyBuilder, min: [f64; 3], size: [f64; 3], is_empty: bool) {
    let n = size.map(|s| (s / 0.02) as i32);
    for i in 0..=n[0] {
        for j in 0..=n[1] {
            for k in 0..=n[2] {
                let rim = [(i, n[0]), (j, n[1]), (k, n[2])].iter().any(|(v, n)| *v == 0 || v == n);
                if rim {
                    let at = [i, j, k].map(|v| 0.02 * f64::from(v));
                    let p = [min[0] + at[0], min[1] + at[1], min[2] + at[2]];
                    let nothing = SessionEvidence::Empty { is_pierced: false };
                    tally.add(p, 4e-4, if is_empty { nothing } else { SessionEvidence::Occupied });
                }
            }
        }
    }
}

#[test]
fn a_pallet_moves_a_barrel_goes_and_a_crate_comes() {
    let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    // A cabinet that stays: the other session saw its surfaces.
    solid(&mut then, [5.0, 5.0, 0.02], [0.8, 0.6, 1.8], false);
    solid(&mut now, [5.0, 5.0, 0.02], [0.8, 0.6, 1.8], false);
    solid(&mut then, [1.0, 1.0, 0.02], [1.2, 0.8, 0.6], true);
    solid(&mut now, [3.0, 1.0, 0.02], [0.8, 1.2, 0.6], true);
    solid(&mut then, [1.0, 6.0, 0.02], [0.6, 0.6, 0.9], true);
    solid(&mut now, [8.0, 1.0, 0.02], [0.3, 0.3, 0.4], true);
    let (then, now) = (then.finish(), now.finish());
    let found = things(&then, &now, &ThingSettings::default(), &OneByOne);
    let kinds: Vec<_> = found.iter().map(|t| t.change).collect();
    assert_eq!(kinds, [ThingChange::Moved, ThingChange::Gone, ThingChange::Appeared]);
    let shift = apart(&found[0]);
    assert!((shift[0] - 1.8).abs() < 0.06 && (shift[1] - 0.2).abs() < 0.06, "{shift:?}");
    assert!(things(&then, &then, &ThingSettings::default(), &OneByOne).is_empty());
}

#[test]
fn a_thing_pushed_by_less_than_its_length_moved_as_a_whole() {
    let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    // The places where the pallet stands in both sessions were never seen empty.
    let parts = [(&mut then, 1.0, 0.4, 1.4, 0.8), (&mut now, 2.2, 0.4, 1.4, 0.8)];
    for (tally, own, own_length, shared, shared_length) in parts {
        solid(tally, [own, 1.0, 0.02], [own_length, 0.8, 0.6], true);
        solid(tally, [shared, 1.0, 0.02], [shared_length, 0.8, 0.6], false);
    }
    let found = found(then, now);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].change, ThingChange::Moved);
    let shift = apart(&found[0]);
    assert!((shift[0] - 0.4).abs() < 0.06, "{shift:?}");
}

#[test]
fn a_thing_with_a_grazed_top_is_not_split() {
    let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    solid(&mut then, [1.0, 1.0, 0.02], [1.2, 1.0, 0.7], true);
    // Two sides are seen in part, and the top as rows of points 14 cm apart.
    solid(&mut now, [5.0, 1.0, 0.02], [0.1, 0.4, 0.7], true);
    solid(&mut now, [5.0, 1.9, 0.02], [0.3, 0.1, 0.7], true);
    for row in 1..=8 {
        for i in 0..10 {
            let (x, y) = (5.01 + 0.14 * f64::from(row), 1.05 + 0.1 * f64::from(i));
            now.add([x, y, 0.71], 4e-4, SessionEvidence::Empty { is_pierced: false });
        }
    }
    let found = found(then, now);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].change, ThingChange::Moved);
}

#[test]
fn a_pallet_is_recognised_by_one_side_and_a_barrel_is_not() {
    let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    solid(&mut then, [1.0, 1.0, 0.02], [1.4, 1.0, 0.66], true);
    solid(&mut then, [1.0, 6.0, 0.02], [0.9, 0.9, 0.86], true);
    // The long side of the pallet, and a strip of its top.
    solid(&mut now, [5.0, 1.0, 0.02], [1.2, 0.36, 0.66], true);
    let found = found(then, now);
    let kinds: Vec<_> = found.iter().map(|t| t.change).collect();
    assert_eq!(kinds, [ThingChange::Moved, ThingChange::Gone]);
    assert!(found[1].then.expect("bounds").contains([1.4, 6.4, 0.5]));
}

#[test]
fn wires_that_a_nearer_scanner_sees_are_no_change() {
    let (then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    for (scan, wire) in (0..4).flat_map(|scan| (0..12).map(move |wire| (scan, wire))) {
        for i in 0..400 {
            let at = [0.0025 * f64::from(i), 1.0, 0.05 * f64::from(wire) + 0.02];
            now.add(at, 3.7e-5, SessionEvidence::Empty { is_pierced: scan > 0 });
        }
    }
    assert!(found(then, now).is_empty());
}

#[test]
fn what_is_near_a_robot_is_the_robots() {
    let (mut then, now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    solid(&mut then, [1.0, 1.0, 0.5], [0.2, 0.2, 0.2], true);
    for i in 0..60 {
        then.add_robot([1.25, 1.0 + 0.005 * f64::from(i), 0.6]);
    }
    let (then, now) = (then.finish(), now.finish());
    let n_found = |robot_margin: f64| {
        things(&then, &now, &ThingSettings { robot_margin, ..Default::default() }, &OneByOne).len()
    };
    assert_eq!(n_found(0.3), 0);
    assert_eq!(n_found(0.0), 1);
}

#[test]
fn a_thing_is_recognised_by_its_top_above_a_fence() {
    let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    solid(&mut then, [1.0, 1.0, 0.02], [1.2, 0.8, 0.7], true);
    solid(&mut then, [1.0, 6.0, 0.02], [0.6, 0.6, 0.5], true);
    solid(&mut now, [5.0, 1.0, 0.62], [1.2, 0.8, 0.1], true);
    let found = found(then, now);
    let kinds: Vec<_> = found.iter().map(|t| t.change).collect();
    assert_eq!(kinds, [ThingChange::Moved, ThingChange::Gone]);
    let shift = apart(&found[0]);
    assert!((shift[0] - 4.0).abs() < 0.06 && shift[2].abs() < 0.06, "{shift:?}");
    assert!(found[1].then.expect("bounds").contains([1.3, 6.3, 0.3]));
}

#[test]
fn two_visible_ends_of_a_thing_are_joined() {
    let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    solid(&mut then, [1.0, 1.0, 0.02], [1.3, 0.9, 0.73], true);
    // Rows of beams graze the top: one end is seen completely, the other end as an edge. Another
    // object appeared beside it.
    solid(&mut now, [5.0, 1.0, 0.02], [0.7, 0.85, 0.73], true);
    solid(&mut now, [6.1, 1.1, 0.27], [0.2, 0.7, 0.48], true);
    solid(&mut now, [5.0, 2.4, 0.02], [0.3, 0.3, 0.4], true);
    let found = found(then, now);
    let kinds: Vec<_> = found.iter().map(|t| t.change).collect();
    assert_eq!(kinds, [ThingChange::Moved, ThingChange::Appeared]);
    let shift = apart(&found[0]);
    assert!((shift[0] - 4.0).abs() < 0.06 && shift[1].abs() < 0.06, "{shift:?}");
    assert!(found[1].now.expect("bounds").contains([5.1, 2.5, 0.2]));
}

#[test]
fn a_low_thing_beside_a_turned_one_is_separate() {
    let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
    solid(&mut then, [1.0, 1.0, 0.02], [1.4, 1.4, 0.73], true);
    // The turned thing has narrower bounds, and a post hides a strip of it. The lower thing beside
    // it is another one.
    solid(&mut now, [5.0, 1.0, 0.02], [1.1, 1.0, 0.73], true);
    solid(&mut now, [6.2, 1.2, 0.02], [0.25, 0.4, 0.73], true);
    solid(&mut now, [4.5, 1.2, 0.02], [0.25, 0.3, 0.4], true);
    let found = found(then, now);
    let kinds: Vec<_> = found.iter().map(|t| t.change).collect();
    assert_eq!(kinds, [ThingChange::Moved, ThingChange::Appeared]);
    assert!((found[0].now.expect("bounds").max[0] - 6.45).abs() < 0.06);
    assert!(found[1].now.expect("bounds").contains([4.6, 1.3, 0.2]));
}

/// An upright sheet of which this number of points in ten are pierced.
fn sheet(tally: &mut OccupancyBuilder, n_pierced: i32) {
    for (i, j) in (0..40).flat_map(|i| (0..20).map(move |j| (i, j))) {
        let is_pierced = (i + j) % 10 < n_pierced;
        let at = [1.01, 1.0 + 0.02 * f64::from(i), 1.0 + 0.02 * f64::from(j)];
        tally.add(at, 4e-4, SessionEvidence::Empty { is_pierced });
    }
}

#[test]
fn a_sheet_that_beams_go_through_is_of_a_fence() {
    for (n_pierced, n_things) in [(0, 1), (1, 0)] {
        let mut then = OccupancyBuilder::default();
        sheet(&mut then, n_pierced);
        assert_eq!(found(then, OccupancyBuilder::default()).len(), n_things, "{n_pierced} of 10");
    }
}
