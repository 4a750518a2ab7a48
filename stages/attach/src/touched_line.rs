//! Columns of beams on a level sheet that a tip touches: seen at a flat angle the sheet is lines,
//! each as thin as the tip, and the least cut may run through one of them.

use crate::body_cut::Body;
use crate::layers::{THIN_NECK, layers_behind};
use crate::thin::LocalShape;
use contract::Voxel;
use std::collections::BTreeMap;

/// By how many levels above a line the tip is looked at, voxels (6 cm).
const ABOVE: i32 = 3;
/// Number of layers inside of a cut in which such a line lies (20 cm).
const NEAR_CUT: usize = 10;
/// Largest number of voxels of a tip in a level, and of what sticks out of it: plates have more.
const MOST: usize = 60;
const TIP: usize = 16;
/// By how much a line sticks out of the tip at least, and from where on it is told from it, voxels.
const OUT: i32 = 5;
const BESIDE: i32 = 1;

/// For each voxel of a side, whether it is near the cut and sticks out of a slender tip at one
/// level.
pub(crate) fn lines_at_a_tip(body: &Body<'_>, side: &[bool]) -> Vec<bool> {
    let others: Vec<bool> = side.iter().map(|own| !own).collect();
    let inside = layers_behind(body.graph, &others);
    let mut levels: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
    for k in (0..side.len()).filter(|k| side[*k]) {
        levels.entry(body.graph.voxel(k)[2]).or_default().push(k);
    }
    let mut out = vec![false; side.len()];
    if inside[0].len() > THIN_NECK {
        return out;
    }
    let mut lines: BTreeMap<i32, Vec<(usize, i32)>> = BTreeMap::new();
    for &k in inside[..NEAR_CUT].iter().flatten().filter(|k| body.shape[**k] != LocalShape::Hose) {
        let at = body.graph.voxel(k);
        let tip = levels.get(&(at[2] + ABOVE)).filter(|tip| tip.len() <= TIP);
        let overhang = tip.map(|tip| overhang(body, tip, at));
        lines.entry(at[2]).or_default().extend(overhang.map(|overhang| (k, overhang)));
    }
    for line in lines.values().filter(|line| line.iter().any(|(_, by)| *by >= OUT)) {
        line.iter().filter(|(_, by)| *by > BESIDE).for_each(|(k, _)| out[*k] = true);
    }
    if out.iter().filter(|out| **out).count() <= MOST { out } else { vec![false; side.len()] }
}

/// How far a voxel lies beside the bounds of others, seen from above, voxels.
fn overhang(body: &Body<'_>, others: &[usize], at: Voxel) -> i32 {
    let beside = |i: usize| {
        let places = || others.iter().map(|k| body.graph.voxel(*k)[i]);
        let (least, most) = (places().min().unwrap_or(at[i]), places().max().unwrap_or(at[i]));
        (least - at[i]).max(at[i] - most)
    };
    beside(0).max(beside(1))
}
