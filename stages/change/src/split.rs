//! Splits a change into two things that stand side by side, where the size of one of them is known
//! from the other session.

use crate::occupancy::{EDGE, OccupancyCell, REACH, connected};
use std::collections::{BTreeMap, BTreeSet};

/// Tops that differ by this many voxels belong to different things.
const STEP: i32 = 2;
/// Least share of the known thing's footprint that the change must fill.
const FILLED: f64 = 0.5;

/// The columns of a change by their place on the ground: the top voxel and the number of voxels of
/// each.
type ColumnTops = BTreeMap<[i32; 2], (i32, usize)>;

/// Splits a change into a thing of the given size (metres, standing at the lowest voxel) and the
/// rest. `None` if the size fits nowhere, or if the heights do not show that the rest is another
/// thing.
pub(crate) fn split_by_size(
    cells: &[OccupancyCell],
    size: [f64; 3],
) -> Option<[Vec<OccupancyCell>; 2]> {
    let steps = size.map(|s| ((s / EDGE).round() as i32).max(1));
    let low = cells.iter().map(|c| c[2]).min()?;
    let top = low + steps[2] - 1;
    let columns = columns(cells);
    let placed = [[steps[0], steps[1]], [steps[1], steps[0]]].into_iter();
    let best = placed.filter_map(|sides| Some((sides, place(&columns, sides, top)?)));
    let (sides, (_, at)) = best.max_by_key(|(_, (n, _))| *n)?;
    let (mut inside, rest): (Vec<OccupancyCell>, Vec<OccupancyCell>) =
        cells.iter().copied().partition(|c| is_within([c[0], c[1]], at, sides));
    let (rest, slivers) = largest(rest.into_iter().collect());
    inside.extend(slivers);
    let off = |part: &[OccupancyCell]| Some((part.iter().map(|c| c[2]).max()? - top).abs());
    (off(&inside)? < STEP && off(&rest)? >= STEP).then_some([inside, rest])
}

/// The largest connected part, and all other voxels. A thing whose sides are not parallel to the
/// axes has corners outside of its rectangle.
fn largest(mut cells: BTreeSet<OccupancyCell>) -> (Vec<OccupancyCell>, Vec<OccupancyCell>) {
    let mut parts = Vec::new();
    while let Some(first) = cells.pop_first() {
        parts.push(connected(first, REACH, |c| cells.remove(c), usize::MAX));
    }
    parts.sort_by_key(Vec::len);
    (parts.pop().unwrap_or_default(), parts.concat())
}

fn columns(cells: &[OccupancyCell]) -> ColumnTops {
    let mut columns = ColumnTops::new();
    for [x, y, z] in cells {
        let column = columns.entry([*x, *y]).or_insert((*z, 0));
        *column = (column.0.max(*z), column.1 + 1);
    }
    columns
}

fn is_within(at: [i32; 2], low: [i32; 2], sides: [i32; 2]) -> bool {
    (0..2).all(|i| (low[i]..low[i] + sides[i]).contains(&at[i]))
}

/// The place at which a thing with these sides contains most voxels, with none above its top, and
/// the number of these voxels. Units are voxels.
fn place(columns: &ColumnTops, sides: [i32; 2], top: i32) -> Option<(usize, [i32; 2])> {
    let span = |i: usize| {
        let along = columns.keys().map(|c| c[i]);
        Some((along.clone().min()?, along.max()?))
    };
    let (spans, mut best) = ([span(0)?, span(1)?], None::<(usize, [i32; 2])>);
    let starts = |i: usize| spans[i].0..=(spans[i].1 + 1 - sides[i]).max(spans[i].0);
    for at in starts(0).flat_map(|x| starts(1).map(move |y| [x, y])) {
        let rows = columns.range([at[0], i32::MIN]..[at[0] + sides[0], i32::MIN]);
        let inside = rows.filter(|(c, _)| is_within(**c, at, sides)).map(|(_, column)| column);
        let (mut n, mut filled, mut is_higher) = (0, 0, false);
        for (column_top, n_voxels) in inside {
            (n, filled) = (n + n_voxels, filled + 1);
            is_higher |= *column_top > top + 1;
        }
        let is_full = f64::from(filled) >= FILLED * f64::from(sides[0] * sides[1]);
        if is_full && !is_higher && best.is_none_or(|(most, _)| n > most) {
            best = Some((n, at));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The voxels of the sides and the top of a box; size in voxels.
    fn shell(low: OccupancyCell, size: [i32; 3]) -> Vec<OccupancyCell> {
        let mut out = Vec::new();
        for i in 0..size[0] {
            for j in 0..size[1] {
                for k in 0..size[2] {
                    let side = i == 0 || j == 0 || i == size[0] - 1 || j == size[1] - 1;
                    if side || k == size[2] - 1 {
                        out.push([low[0] + i, low[1] + j, low[2] + k]);
                    }
                }
            }
        }
        out
    }

    #[test]
    fn a_barrel_beside_a_pallet_is_split_off() {
        let (pallet, barrel) = (shell([0, 0, 0], [26, 18, 14]), shell([26, 3, 0], [14, 14, 18]));
        let both = [pallet.clone(), barrel.clone()].concat();
        // The pallet is rotated by 90° in the other session.
        let [inside, rest] = split_by_size(&both, [0.9, 1.3, 0.7]).expect("two things");
        assert!(inside.iter().filter(|c| pallet.contains(c)).count() >= pallet.len() * 9 / 10);
        assert!(rest.iter().filter(|c| barrel.contains(c)).count() >= barrel.len() * 9 / 10);
    }

    #[test]
    fn a_thing_that_is_partly_hidden_later_is_not_split() {
        let pallet = shell([0, 0, 0], [26, 18, 14]);
        assert_eq!(split_by_size(&pallet, [0.7, 0.9, 0.7]), None);
        // A barrel of the other session does not fit either.
        assert_eq!(split_by_size(&pallet, [0.7, 0.7, 0.9]), None);
    }
}
