//! Links neighbouring pixels of a raster that see one surface, and finds pixels that see none
//! (veil points).

use crate::Settings;
use crate::raster::{NONE, TileRaster};

/// Direction towards lower columns.
pub(crate) const LEFT: usize = 0;
/// Direction towards higher columns.
pub(crate) const RIGHT: usize = 1;
/// Direction towards lower rows.
pub(crate) const DOWN: usize = 2;
/// Direction towards higher rows.
pub(crate) const UP: usize = 3;
/// Flag of a link to a neighbour that exists, but sees another surface.
pub(crate) const BROKEN: u8 = 0x80;
/// Largest distance to a neighbour, pixels: rebuilt rasters have gaps of up to two.
const REACH: usize = 3;
/// Share of a step in range that may be missing in the next step of one surface at a grazing angle,
/// since directions are not exactly regular. At an edge in front of a flat background the whole
/// step is missing.
const UNEVEN: f32 = 0.4;
/// Number of cells of a piece of surface below which it may be a veil.
const MIN_PIECE: usize = 4;

/// Index of the pixel `by` pixels away from `at` in `direction`; it must lie inside the raster.
#[inline]
pub(crate) fn step(side: usize, at: usize, direction: usize, by: usize) -> usize {
    match direction {
        LEFT => at - by,
        RIGHT => at + by,
        DOWN => at - by * side,
        _ => at + by * side,
    }
}

/// The neighbour of `at` in `direction` that is linked as the same surface, if any.
#[inline]
pub(crate) fn linked(raster: &TileRaster, at: usize, direction: usize) -> Option<usize> {
    let link = raster.links[at][direction];
    (link != 0 && link & BROKEN == 0).then(|| step(raster.side, at, direction, usize::from(link)))
}

/// Limits for the links of one raster.
struct Rule {
    incidence: f32,
    grazing: f32,
}

/// Links each pixel with its next neighbours along row and column. A link is 0 where there is none,
/// else the distance to the neighbour in pixels, with [`BROKEN`] where it sees another surface.
pub(crate) fn link(raster: &mut TileRaster, settings: &Settings) {
    let (side, n_pixels) = (raster.side, raster.n_pixels());
    raster.links.clear();
    raster.links.resize(n_pixels, [0; 4]);
    raster.bridged.clear();
    raster.bridged.resize(n_pixels, false);
    let rule = Rule {
        incidence: settings.max_incidence.tan() as f32,
        grazing: settings.max_grazing.tan() as f32,
    };
    for row in 0..side {
        for col in 0..side {
            let at = row * side + col;
            if raster.xyzr[at][3] == 0.0 {
                continue;
            }
            let angle = raster.col_step[row];
            let row_way = Way { forth: RIGHT, back: LEFT, behind: col, before: side - 1 - col };
            link_one(raster, &rule, at, row_way, angle);
            let angle = raster.row_step;
            let column_way = Way { forth: UP, back: DOWN, behind: row, before: side - 1 - row };
            link_one(raster, &rule, at, column_way, angle);
        }
    }
}

/// The way along which a pixel is linked.
#[derive(Clone, Copy)]
struct Way {
    /// Direction forwards, and the one back.
    forth: usize,
    back: usize,
    /// Number of pixels inside the tile behind the pixel, and before it.
    behind: usize,
    before: usize,
}

/// Links `at` forwards; `room` is the number of pixels behind and in front of it inside the tile.
#[inline]
fn link_one(raster: &mut TileRaster, rule: &Rule, at: usize, way: Way, angle: f32) {
    let Way { forth, back, .. } = way;
    let (side, range) = (raster.side, raster.xyzr[at][3]);
    for by in 1..=REACH.min(way.before) {
        let other = step(side, at, forth, by);
        let there = raster.xyzr[other][3];
        if there == 0.0 {
            continue;
        }
        let mean = 0.5 * (range + there);
        let difference = (range - there).abs();
        let sigma = raster.noise.sigma(mean);
        let across = mean * angle * by as f32;
        // A surface seen at most at this incidence cannot step more than that (METHOD.md §2).
        let mut joined = difference <= across * rule.incidence + 4.243 * sigma;
        if !joined
            && difference <= across * rule.grazing
            && way.behind >= by
            && way.before >= 2 * by
        {
            let before = raster.xyzr[step(side, at, back, by)][3];
            let after = raster.xyzr[step(side, other, forth, by)][3];
            joined = continues([before, range, there, after], difference, sigma);
        }
        let value = if joined { by as u8 } else { by as u8 | BROKEN };
        raster.links[at][forth] = value;
        raster.links[other][back] = value;
        if joined {
            for between in 1..by {
                raster.bridged[step(side, at, forth, between)] = true;
            }
        }
        return;
    }
}

/// Whether four neighbouring ranges lie on one plane seen at a grazing angle: along a line of the
/// raster the inverse range of a plane is linear.
#[inline]
fn continues(ranges: [f32; 4], difference: f32, sigma: f32) -> bool {
    let [a, b, c, d] = ranges;
    if a == 0.0 || d == 0.0 {
        return false;
    }
    let limit = 7.35 * sigma + UNEVEN * difference;
    let [va, vb, vc, vd] = [1.0 / a, 1.0 / b, 1.0 / c, 1.0 / d];
    (va + vc - 2.0 * vb).abs() * b * b <= limit && (vb + vd - 2.0 * vc).abs() * c * c <= limit
}

/// Finds the veil points of `raster`: pixels whose opposite neighbours along a row or column both
/// see another surface, one nearer and one farther, and small separate pieces between a near and a
/// far surface.
///
/// A pixel nearer than both neighbours is a wire, and one farther than both is a slit; these are
/// real surfaces and never veils.
pub(crate) fn veils(raster: &mut TileRaster) {
    let mut out = std::mem::take(&mut raster.veils);
    out.clear();
    for at in 0..raster.n_pixels() {
        if raster.point[at] == NONE {
            continue;
        }
        let links = raster.links[at];
        if links.iter().all(|l| l & BROKEN == 0) {
            continue;
        }
        let torn = between(raster, at, LEFT, RIGHT) || between(raster, at, DOWN, UP);
        if torn || (is_small(raster, at) && near_and_far(raster, at)) {
            out.push(at as u16);
        }
    }
    raster.veils = out;
}

/// Whether the neighbours on both sides see other surfaces, one nearer and one farther.
#[inline]
fn between(raster: &TileRaster, at: usize, back: usize, forth: usize) -> bool {
    let (b, f) = (raster.links[at][back], raster.links[at][forth]);
    if b & BROKEN == 0 || f & BROKEN == 0 {
        return false;
    }
    let (side, range) = (raster.side, raster.xyzr[at][3]);
    let one = raster.xyzr[step(side, at, back, usize::from(b & !BROKEN))][3];
    let other = raster.xyzr[step(side, at, forth, usize::from(f & !BROKEN))][3];
    (one < range) != (other < range)
}

/// Whether the linked piece around `at` has fewer than [`MIN_PIECE`] pixels.
fn is_small(raster: &TileRaster, at: usize) -> bool {
    let mut piece = [at; MIN_PIECE];
    let (mut n, mut next) = (1, 0);
    while next < n {
        for direction in 0..4 {
            let Some(other) = linked(raster, piece[next], direction) else {
                continue;
            };
            if !piece[..n].contains(&other) {
                piece[n] = other;
                n += 1;
                if n == MIN_PIECE {
                    return false;
                }
            }
        }
        next += 1;
    }
    true
}

/// Whether broken links of `at` lead to something nearer and to something farther.
fn near_and_far(raster: &TileRaster, at: usize) -> bool {
    let (side, range) = (raster.side, raster.xyzr[at][3]);
    let (mut near, mut far) = (false, false);
    for direction in 0..4 {
        let link = raster.links[at][direction];
        if link & BROKEN != 0 {
            let other = raster.xyzr[step(side, at, direction, usize::from(link & !BROKEN))][3];
            near |= other < range;
            far |= other > range;
        }
    }
    near && far
}
