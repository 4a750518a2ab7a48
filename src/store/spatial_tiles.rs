//! Counts the spatial tiles of the result that the points of a store fill, and refuses a run that
//! would write too many of them before anything is written.

use super::{Store, TileEntry};
use crate::engine::{Engine, Task};
use contract::{Error, Kind, Result, Scan};
use geometry::{Aabb, Point};
use std::collections::BTreeSet;

/// Number of spatial tiles up to which the bounds of one store tile count as filled without a look
/// at its points.
const FEW: u64 = 64;

/// Row and column of a spatial tile.
type At = [i32; 2];

/// Estimated number of spatial tiles for points that mostly lie within these bounds, and the most
/// that may be written.
pub(crate) fn expected(spread: &Aabb, n_points: u64, settings: &export::Settings) -> [u64; 2] {
    let most = (settings.max_tiles as u64).min(n_points);
    if !settings.tiles {
        return [0, most];
    }
    [if spread.is_empty() { most.min(1) } else { n_touched(spread, settings).min(n_points) }, most]
}

/// Refuses a number of spatial tiles above the limit.
///
/// # Errors
/// `OverBudget` where the number `n` is greater than the limit `most`.
pub(crate) fn within([n, most]: [u64; 2]) -> Result<()> {
    if n <= most {
        return Ok(());
    }
    let what =
        format!("the points are spread over {n} spatial tiles, at most \"{most}\" are written");
    Err(Error::new(Kind::OverBudget, what).hint(
        "is their unit right? It is given with --units. Else take larger tiles (--set export.tile_edge=50), none \
         (--set export.tiles=false), or more (--set export.max_tiles=100000)",
    ))
}

/// Returns the store after a check that its points do not fill more spatial tiles than may be
/// written.
///
/// # Errors
/// Too many spatial tiles, or tiles of the store that cannot be read.
pub(crate) fn checked(
    store: Store,
    scans: &[Scan],
    settings: &export::Settings,
    engine: &Engine,
) -> Result<Store> {
    if settings.tiles {
        check(&store, scans, settings, engine)?;
    }
    Ok(store)
}

/// Counts the spatial tiles that the points of a store fill, and checks the number.
fn check(
    store: &Store,
    scans: &[Scan],
    settings: &export::Settings,
    engine: &Engine,
) -> Result<()> {
    let most = settings.max_tiles as u64;
    // Bounds are sufficient for nearly every plant: points are read only for tiles with wide
    // bounds.
    let (few, many): (Vec<usize>, Vec<usize>) = (0..store.entries().len())
        .partition(|&i| n_touched(&store.entries()[i].bounds, settings) <= FEW);
    let mut filled: BTreeSet<At> = BTreeSet::new();
    for &i in &few {
        filled.extend(touched(&store.entries()[i], settings));
    }
    let sparse: u64 = many.iter().map(|&i| store.entries()[i].n_points).sum();
    if filled.len() as u64 + sparse <= most {
        return Ok(());
    }
    let count = |which: Vec<usize>| -> Result<BTreeSet<At>> {
        let read = engine
            .fan_out(Task::new("spatial tiles"), which, |i| filled_by(store, i, scans, settings))?;
        Ok(read.into_iter().flatten().collect())
    };
    let exact = count(many)?;
    if (filled.len() + exact.len()) as u64 <= most {
        return Ok(());
    }
    let all: BTreeSet<At> = count(few)?.into_iter().chain(exact).collect();
    within([all.len() as u64, most])
}

/// The spatial tiles that hold points of one tile of the store.
fn filled_by(
    store: &Store,
    i: usize,
    scans: &[Scan],
    settings: &export::Settings,
) -> Result<BTreeSet<At>> {
    let tile = store.tile(i, 0)?;
    let pose = &scans[tile.at.scan.0 as usize].world_from_scan;
    let at = |p: &[f32; 3]| {
        let world = pose * Point::from(p.map(f64::from));
        [1, 0].map(|axis| (world[axis] / settings.tile_edge).floor() as i32)
    };
    Ok(tile.xyz.iter().map(at).collect())
}

/// Least and greatest row and column of the spatial tiles that a box touches.
fn corners(bounds: &Aabb, settings: &export::Settings) -> [[i64; 2]; 2] {
    let place = |at: &[f64; 3]| [1, 0].map(|axis| (at[axis] / settings.tile_edge).floor() as i64);
    [place(&bounds.min), place(&bounds.max)]
}

fn n_touched(bounds: &Aabb, settings: &export::Settings) -> u64 {
    let [least, most] = corners(bounds, settings);
    let n = |axis: usize| most[axis].saturating_sub(least[axis]).saturating_add(1).max(0) as u64;
    n(0).saturating_mul(n(1))
}

fn touched(entry: &TileEntry, settings: &export::Settings) -> impl Iterator<Item = At> {
    let [least, most] = corners(&entry.bounds, settings);
    (least[0]..=most[0])
        .flat_map(move |row| (least[1]..=most[1]).map(move |col| [row as i32, col as i32]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_expects_the_tiles_that_a_box_touches() {
        let settings = export::Settings::default();
        let hall = Aabb { min: [-12.0, 0.0, 0.0], max: [12.0, 9.9, 5.0] };
        assert_eq!(expected(&hall, 1_000_000, &settings), [12, 40_000]);
        assert_eq!(expected(&hall, 7, &settings), [7, 7], "no more tiles than points");
        assert_eq!(expected(&Aabb::EMPTY, 1_000, &settings), [1, 1_000]);
        let none = export::Settings { tiles: false, ..settings };
        assert_eq!(expected(&hall, 1_000_000, &none)[0], 0);
        let wide = Aabb { min: [0.0; 3], max: [8_000.0, 7_000.0, 8_000.0] };
        let error = within(expected(&wide, 1 << 30, &settings)).expect_err("too many");
        assert_eq!(error.kind(), Kind::OverBudget);
        assert!(error.to_string().contains("--units"), "{error}");
        // Bounds beyond those of any plant.
        let absurd = Aabb { min: [-1e300; 3], max: [1e300; 3] };
        assert!(n_touched(&absurd, &settings) > 1 << 60);
    }
}
