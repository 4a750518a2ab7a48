//! Tests of thinning: how many points stay, which, and that order does not matter.

use super::*;
use contract::Label;
use proptest::prelude::*;

fn point(world: [f64; 3], kind: PointKind, robot: i16, link: i16) -> PagePoint {
    PagePoint { world, label: Label { kind, robot, link } }
}

/// A level floor of `n` by `n` points, this far apart.
fn floor(n: u32, apart: f64) -> Vec<PagePoint> {
    let places = (0..n).flat_map(|i| (0..n).map(move |j| [f64::from(i), f64::from(j)]));
    places
        .map(|[x, y]| point([x * apart + 0.001, y * apart + 0.001, 0.01], PointKind::Floor, -1, -1))
        .collect()
}

fn all(points: &PagePoints, most: usize) -> Vec<(BlockKey, LeveledBlock)> {
    points.finish(most)
}

#[test]
fn one_point_a_voxel_stays_and_near_robots_more() {
    let robot = Aabb { min: [1.0, 1.0, 0.0], max: [2.0, 2.0, 2.0] };
    let mut far = PagePoints::new(&[], [0.0; 3], 1_000_000);
    let mut near = PagePoints::new(&[robot], [0.0; 3], 1_000_000);
    let floor = floor(640, 0.01);
    far.add(&floor);
    near.add(&floor);
    far.settle();
    near.settle();
    // 6.4 m in voxels of 25 mm.
    assert_eq!(far.n_points(), 256 * 256);
    assert!(near.n_points() > 256 * 256 + 20_000, "{}", near.n_points());
    assert_eq!(far.n_of_kind, [0, 0, 0, 640 * 640, 0]);
}

#[test]
fn no_more_points_stay_than_there_is_room_for() {
    let mut points = PagePoints::new(&[], [0.0; 3], 20_000);
    for piece in floor(900, 0.01).chunks(50_000) {
        points.add(piece);
        points.settle();
        assert!(points.n_points() <= 40_000, "{} in memory", points.n_points());
    }
    let count = |most: usize| all(&points, most).iter().map(|(_, b)| b.points.len()).sum::<usize>();
    let [whole, part] = [20_000, 9_000].map(count);
    assert!(whole <= 20_500 && whole > 4_500, "{whole}");
    assert!((7_500..9_500).contains(&part), "{part}");
}

#[test]
fn levels_are_thinnings_of_the_whole() {
    let mut points = PagePoints::new(&[], [0.0; 3], 1_000_000);
    points.add(&floor(640, 0.01));
    let blocks = all(&points, 1_000_000);
    assert_eq!(blocks.len(), 1);
    let block = &blocks[0].1;
    assert_eq!(block.shift, 2);
    // Voxels of 0.8 m, 0.4 m, …, each with one point of its level or of those before it.
    let mut n = 0;
    for (k, count) in block.counts.iter().enumerate() {
        n += count;
        let side = 8 << k.min(5);
        assert_eq!(n, side * side, "level {k}");
        let shift = COARSEST as usize - k.min(5);
        let voxels: std::collections::BTreeSet<u32> =
            block.points[..n as usize].iter().map(|(place, _)| place >> (3 * shift)).collect();
        assert_eq!(voxels.len(), n as usize);
    }
}

#[test]
fn points_of_robots_keep_link_and_whether_they_hang_on_it() {
    let mut points = PagePoints::new(&[], [0.0; 3], 1_000);
    points.add(&[
        point([0.1, 0.1, 0.1], PointKind::Link, 4, 7),
        point([0.2, 0.1, 0.1], PointKind::Attachment, 4, 9),
        point([0.1, 0.1, 0.1], PointKind::Uncertain, -1, -1),
        point([f64::NAN, 0.0, 0.0], PointKind::Fixed, -1, -1),
        point([1e9, 0.0, 0.0], PointKind::Fixed, -1, -1),
    ]);
    let blocks = all(&points, 1_000);
    let tags = |owner| {
        let own = blocks.iter().filter(|(key, _)| key.0 == owner);
        let mut tags: Vec<u16> = own.flat_map(|(_, b)| b.points.iter().map(|p| p.1)).collect();
        tags.sort_unstable();
        tags
    };
    assert_eq!(tags(Owner::Robot(4)), [7 << 1, 9 << 1 | 1]);
    assert_eq!(tags(Owner::Still), [UNCERTAIN]);
}

#[test]
fn only_the_faces_of_unseen_space_are_shown() {
    let grid = contract::SpaceGrid { edge: 0.1, first: [0; 3], size: [20, 20, 20] };
    let mut space = Space::unknown(grid);
    for at in 0..20 * 20 * 20 {
        if space.grid().cell(at)[2] >= 10 {
            space.voxels_mut()[at] = SpaceKind::Free;
        }
    }
    let mut points = PagePoints::new(&[], [0.0; 3], 10_000);
    points.add_space(&space);
    assert_eq!(points.n_points(), 400, "one layer below what is free");
}

proptest! {
    #[test]
    fn what_stays_does_not_depend_on_order(seed in 0_u64..1_000, cut in 1_usize..3_000) {
        let mut some: Vec<PagePoint> = (0..3_000_u64)
            .map(|k| {
                let at = |i: u64| (scatter(seed * 9_973 + 3 * k + i) % 900) as f64 * 0.01;
                point([at(0), at(1), at(2) * 0.2], PointKind::Fixed, -1, -1)
            })
            .collect();
        let of = |pieces: &[&[PagePoint]]| {
            let mut points = PagePoints::new(&[], [0.0; 3], 700);
            for piece in pieces {
                points.add(piece);
                points.settle();
            }
            all(&points, 700)
        };
        let once = of(&[&some]);
        let (a, b) = some.split_at(cut);
        let twice = of(&[b, a]);
        some.reverse();
        let back = of(&[&some]);
        prop_assert_eq!(&once, &twice);
        prop_assert_eq!(&once, &back);
    }
}
