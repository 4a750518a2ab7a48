//! Whether points about a place lie on a line or a plane through it that does not follow a beam.

use geometry::Point;

/// From one point to another, metres.
pub(crate) type Offset = nalgebra::Vector3<f32>;

/// Thickness of a line, metres: the wire, the scanner's noise, and the edge of a cell.
pub(crate) const LINE_THICKNESS: f32 = 0.010;
/// Number of other points that make a line.
const ON_LINE: usize = 3;
/// Number of other points that make a line of doubtful points, and their least share of all points
/// about: a curtain behind an edge has points all over.
const ON_CLEAR_LINE: usize = 8;
const CLEAR_SHARE: f64 = 0.7;
/// Number of points, the farthest ones, through which such a line is tried.
const N_LINES: usize = 4;
/// Largest distances of neighbours on a plane of doubtful points that are tried, metres: a wall at
/// 6 m has ten points within the first, of beams 0.15° apart that meet it at 60°; a fence of wires
/// has them within the second.
const PLANE_REACHES: [f32; 2] = [0.10, 0.15];
/// Least standard deviation of such a plane's points along both of its directions, metres; along a
/// line it is less in one.
const PLANE_WIDTH: f32 = 0.015;
/// Largest distances of neighbours on a bar that are tried, metres, and the largest distance from
/// its middle line: a pipe of 20 mm, and the edge of a cell.
const BAR_REACHES: [f32; 2] = [0.05, 0.10];
const BAR_RADIUS: f32 = 0.015;
/// Largest standard deviation of its points along a beam, metres: that of a pipe is 2 mm, and noise
/// and cells of points add as much.
const BAR_DEPTH: f32 = 0.006;
/// Least sine of the angle between such a line or plane and a beam to it: an edge or a tip in front
/// leaves points along the beam. 15°.
const ACROSS_BEAM: f64 = 0.26;
/// Distance up to which points count on a long line, metres.
pub(crate) const LONG_REACH: f32 = 0.40;
/// Length of a stretch of a long line in which all points count once, metres, and least number of
/// stretches with points.
const STRETCH: f32 = 0.02;
const N_STRETCHES: usize = 6;
/// Largest number of stretches for each one with points: a curtain of few points has lines with
/// larger gaps.
const MAX_SPACING: usize = 3;
/// Distance from a long line within which most points are to lie on it, metres: less than that of
/// the wires of a fence, which is 50 mm.
const BESIDE_LINE: f32 = 0.04;
/// Number of directions, of the nearest points, in which a long line is looked for.
const N_DIRECTIONS: usize = 24;

/// Whether enough points lie on a line through the origin.
pub(crate) fn is_on_line(near: &[Offset]) -> bool {
    // Points that are too near define no direction.
    near.iter()
        .filter(|v| v.norm() > 2.0 * LINE_THICKNESS)
        .any(|v| n_along(near, &v.normalize()) >= ON_LINE)
}

/// Whether most of the points lie on one line through the origin, which is at `here`, that does not
/// follow a beam.
pub(crate) fn is_on_clear_line(near: &[Offset], here: &Point, eyes: &[Point]) -> bool {
    let most = (near.len() as f64 * CLEAR_SHARE).ceil() as usize;
    if near.len() < ON_CLEAR_LINE {
        return false;
    }
    first_of(near.iter(), N_LINES, |v| -v.norm_squared())
        .into_iter()
        .map(|v| v.normalize())
        .any(|unit| n_along(near, &unit) >= most.max(ON_CLEAR_LINE) && is_across(&unit, here, eyes))
}

/// Whether the origin, which is at `here`, lies on a long line that does not follow a beam, with
/// little beside it: on a wire that few beams met.
pub(crate) fn is_on_long_line(near: &[Offset], here: &Point, eyes: &[Point]) -> bool {
    let apart = near.iter().filter(|v| v.norm() > 2.0 * LINE_THICKNESS);
    let nearest = first_of(apart, N_DIRECTIONS, |v| v.norm_squared());
    nearest.into_iter().map(|v| v.normalize()).any(|unit| {
        let (mut n, mut n_beside) = (0_usize, 0_usize);
        let mut stretches = Vec::new();
        for w in near {
            let along = w.dot(&unit);
            let off = (w - unit * along).norm();
            n_beside += usize::from(off < BESIDE_LINE);
            if off < LINE_THICKNESS {
                n += 1;
                stretches.push((along / STRETCH).floor() as i32);
            }
        }
        stretches.sort_unstable();
        stretches.dedup();
        let length = stretches.last().zip(stretches.first()).map_or(0, |(b, a)| b - a + 1);
        stretches.len() >= N_STRETCHES
            && stretches.len() * MAX_SPACING >= length as usize
            && n as f64 >= CLEAR_SHARE * n_beside as f64
            && is_across(&unit, here, eyes)
    })
}

/// Whether most of the points near the origin, which is at `here`, lie on one plane through it that
/// does not follow a beam.
pub(crate) fn is_on_clear_plane(near: &[Offset], here: &Point, eyes: &[Point]) -> bool {
    PLANE_REACHES.iter().any(|reach| is_on_plane_within(*reach, near, here, eyes))
}

fn is_on_plane_within(reach: f32, near: &[Offset], here: &Point, eyes: &[Point]) -> bool {
    let near: Vec<Offset> = near.iter().filter(|v| v.norm() < reach).copied().collect();
    let most = (near.len() as f64 * CLEAR_SHARE).ceil() as usize;
    if near.len() < ON_CLEAR_LINE {
        return false;
    }
    let spread: nalgebra::Matrix3<f32> = near.iter().map(|v| v * v.transpose()).sum();
    let eigen = (spread / near.len() as f32).symmetric_eigen();
    let across = eigen.eigenvalues.imin();
    let mut is_wide = (0..3).filter(|k| *k != across);
    let normal: Offset = eigen.eigenvectors.column(across).into_owned();
    let is_faced = |eye: &Point| {
        let beam = (here - eye).normalize();
        beam.dot(&normal.map(f64::from)).abs() > ACROSS_BEAM
    };
    is_wide.all(|k| eigen.eigenvalues[k] > PLANE_WIDTH * PLANE_WIDTH)
        && near.iter().filter(|v| v.dot(&normal).abs() < LINE_THICKNESS).count() >= most
        && eyes.iter().all(is_faced)
}

/// Whether the origin lies in the plane of these points, which are sure, and among them: as a wire
/// of a fence does, where other wires beside it were met better.
pub(crate) fn is_in_plane_of(sure: &[Offset]) -> bool {
    if sure.len() < ON_CLEAR_LINE {
        return false;
    }
    let n = sure.len() as f32;
    let middle: Offset = sure.iter().sum::<Offset>() / n;
    let spread: nalgebra::Matrix3<f32> =
        sure.iter().map(|v| (v - middle) * (v - middle).transpose()).sum();
    let eigen = (spread / n).symmetric_eigen();
    let across = eigen.eigenvalues.imin();
    let [normal, u, v]: [Offset; 3] = std::array::from_fn(|k| {
        let axis = (across + k) % 3;
        eigen.eigenvectors.column(axis).into_owned()
    });
    let is_flat = |w: &&Offset| (*w - middle).dot(&normal).abs() < LINE_THICKNESS;
    let mut is_wide = (0..3).filter(|k| *k != across);
    let quarter = |w: &Offset| usize::from(w.dot(&u) > 0.0) + 2 * usize::from(w.dot(&v) > 0.0);
    let quarters = sure.iter().fold([false; 4], |mut has, w| {
        has[quarter(w)] = true;
        has
    });
    middle.dot(&normal).abs() < LINE_THICKNESS
        && is_wide.all(|k| eigen.eigenvalues[k] > PLANE_WIDTH * PLANE_WIDTH)
        && quarters == [true; 4]
        && sure.iter().filter(is_flat).count() as f64 >= CLEAR_SHARE * f64::from(n)
}

/// Whether most points near the origin, which is at `here`, lie on one bar with it, such as a pipe,
/// that does not follow a beam and is no deeper along the beams than the half of a pipe that they
/// meet: a curtain behind an edge is as deep as what the edge hides.
pub(crate) fn is_on_clear_bar(near: &[Offset], here: &Point, eyes: &[Point]) -> bool {
    BAR_REACHES.iter().any(|reach| is_on_bar_within(*reach, near, here, eyes))
}

fn is_on_bar_within(reach: f32, near: &[Offset], here: &Point, eyes: &[Point]) -> bool {
    let near: Vec<Offset> = near.iter().filter(|v| v.norm() < reach).copied().collect();
    if near.len() < ON_CLEAR_LINE {
        return false;
    }
    let n = near.len() as f32 + 1.0;
    let middle: Offset = near.iter().sum::<Offset>() / n;
    let square = |v: &Offset| v * v.transpose();
    let spread: nalgebra::Matrix3<f32> =
        near.iter().map(|v| square(&(v - middle))).sum::<nalgebra::Matrix3<f32>>()
            + square(&middle);
    let spread = spread / n;
    let eigen = spread.symmetric_eigen();
    let along: Offset = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let off = |v: Offset| (v - along * v.dot(&along)).norm();
    let is_flat = |eye: &Point| {
        let beam = (here - eye).normalize().map(|v| v as f32);
        let depth = (beam - along * beam.dot(&along)).normalize();
        depth.dot(&(spread * depth)) < BAR_DEPTH * BAR_DEPTH
    };
    let most = (near.len() as f64 * CLEAR_SHARE).ceil() as usize;
    off(middle) < BAR_RADIUS
        && near.iter().filter(|v| off(**v - middle) < BAR_RADIUS).count() >= most
        && is_across(&along, here, eyes)
        && eyes.iter().all(is_flat)
}

/// The first `n` places by a key, as a stable sort has them.
fn first_of<'a>(
    all: impl Iterator<Item = &'a Offset>,
    n: usize,
    key: impl Fn(&Offset) -> f32,
) -> Vec<&'a Offset> {
    let mut first: Vec<(f32, &Offset)> = Vec::with_capacity(n + 1);
    for v in all {
        let own = key(v);
        let is_first = first.len() < n || first.last().is_some_and(|(last, _)| own < *last);
        if is_first {
            let at = first.partition_point(|(other, _)| *other <= own);
            first.insert(at, (own, v));
            first.truncate(n);
        }
    }
    first.into_iter().map(|(_, v)| v).collect()
}

/// Whether a direction leads across all beams to a place.
fn is_across(unit: &Offset, here: &Point, eyes: &[Point]) -> bool {
    let unit = unit.map(f64::from);
    eyes.iter().all(|eye| unit.cross(&(here - eye).normalize()).norm() > ACROSS_BEAM)
}

/// Number of places near the line through the origin with this direction.
fn n_along(near: &[Offset], unit: &Offset) -> usize {
    near.iter().filter(|w| (*w - unit * w.dot(unit)).norm() < LINE_THICKNESS).count()
}
