//! Property tests of the store on random strips: the tiles hold exactly the points that were added,
//! whatever strips, memory and threads were used.

use super::tests::{build, scans, tiles};
use super::*;
use contract::{MaskId, ScanId, Strip};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// Number of random stores; each is written to disk twice.
const N_CASES: u32 = 48;

/// Points of one scan by place. Places ascend with gaps; coordinates fill a room, a distant room,
/// or a single spot.
fn points() -> impl Strategy<Value = Vec<(u64, [f32; 3])>> {
    let gap = prop_oneof![8 => Just(1_u64), 2 => 2_u64..50, 1 => Just(1_u64 << 20)];
    let axis = || prop_oneof![4 => -9.0_f32..9.0, 1 => -900.0_f32..900.0, 1 => Just(1.5_f32)];
    let point = (gap, [axis(), axis(), axis()]);
    prop::collection::vec(point, 0..400).prop_map(|points| {
        let mut place = 0;
        let next = |(gap, xyz): (u64, [f32; 3])| {
            place += gap;
            (place, xyz)
        };
        points.into_iter().map(next).collect()
    })
}

/// Divides the points of a scan into strips of these lengths, in turn.
fn strips(scan: u32, points: &[(u64, [f32; 3])], lengths: &[usize]) -> Vec<Strip> {
    let mut left = points;
    let mut out = Vec::new();
    for length in lengths.iter().cycle() {
        let (now, next) = left.split_at((*length).min(left.len()));
        let Some((first, _)) = now.first() else { return out };
        out.push(Strip {
            scan: ScanId(scan),
            mask: MaskId(scan),
            first_place: *first,
            place: now.iter().map(|(place, _)| (place - first) as u32).collect(),
            xyz: now.iter().map(|(_, xyz)| *xyz).collect(),
            attributes: None,
        });
        left = next;
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(N_CASES))]

    #[test]
    fn what_goes_in_comes_out_whatever_way_it_came(
        all in [points(), points(), points()],
        cuts in [prop::collection::vec(1_usize..90, 1..4), prop::collection::vec(1_usize..90, 1..4)],
        budgets in [1_usize..200_000, 1_usize..200_000],
        n_workers in 1_usize..4,
        reversed in any::<bool>(),
    ) {
        let dirs = [0, 1].map(|_| tempfile::tempdir().expect("a folder"));
        let of = |i: usize| -> Vec<Strip> {
            (0..3).flat_map(|s| strips(s as u32, &all[s], &cuts[i])).collect()
        };
        let (first, _) = build(dirs[0].path(), of(0), budgets[0], 1);
        let mut other = of(1);
        if reversed {
            other.reverse();
        }
        let (second, _) = build(dirs[1].path(), other, budgets[1], n_workers);
        let found = tiles(&first);
        prop_assert!(found == tiles(&second), "strips, budgets or workers change the tiles");
        // The store that is read back from disk must be the same.
        let again = Store::open(dirs[0].path(), 0, 1 << 16).expect("opens");
        prop_assert!(found == tiles(&again), "a store is what was written");
        let mut out: [BTreeMap<u64, [u32; 3]>; 3] = Default::default();
        let scans = scans();
        for tile in &found {
            let s = tile.at.scan.0 as usize;
            for k in 0..tile.len() {
                let place = tile.first_place + u64::from(tile.place[k]);
                let twice = out[s].insert(place, tile.xyz[k].map(f32::to_bits));
                prop_assert!(twice.is_none(), "place {} is in two tiles", place);
                let p = nalgebra::Point3::from(tile.xyz[k].map(f64::from));
                let world = scans[s].world_from_scan * p;
                prop_assert!(tile.bounds.grown(1e-9).contains(world.into()), "bounds");
            }
        }
        for (s, points) in all.iter().enumerate() {
            let wanted: BTreeMap<u64, [u32; 3]> =
                points.iter().map(|(place, xyz)| (*place, xyz.map(f32::to_bits))).collect();
            prop_assert!(out[s] == wanted, "points of scan {}", s);
        }
    }
}
