//! Selects the points around a robot that are evidence of an object, and drops stray points.
//!
//! Scans have stray points: a beam that hits an edge partly gives a point between the edge and the
//! surface behind it, where nothing is, and masks leave some points of a robot to the fixed world.
//! A point that is labelled as fixed is dropped only with proof that nothing is there: beams of
//! another scanner passed its place, its own beam passed an edge in front of it, and neither a
//! surface, nor a line, a bar or a plane, nor a point of another scanner goes with it. Beams also
//! pass beside a thing that is thinner than their distance, so that the first alone would drop
//! wires and pipes. An uncertain point is dropped without such proof, too, if it lies alone in
//! space that beams passed through, or if its beam grazed an edge in front of it and it belongs to
//! nothing either. What lies right beside an undoubted point, or amid such points in their plane,
//! stays.

use crate::grid::Grid;
use crate::lines::{self, Offset};
use crate::obstacle::{HALF_CELL, Obstacle, ObstacleKind};
use contract::{Fan, Space, SpaceKind};
use geometry::{Point, Pose};
use std::ops::Range;

/// Largest distance between neighbours on a surface, metres: the edge of the voxels of known space.
const NEAR: f32 = 0.05;
/// Number of neighbours from which on a point belongs to a surface.
const MIN_NEIGHBOURS: usize = 8;
/// Number of neighbours from which on a surface needs no other proof.
const SOLID: usize = 24;
/// In sparse scans, number of neighbours that suffices, as share of the median over all points.
const SHARE: f64 = 0.125;
/// Distance within which [`MIN_CLOSE`] neighbours make a small object, metres; stray points lie
/// farther apart, over the depth that an edge hides.
const CLOSE: f32 = 0.025;
/// Number of neighbours within [`CLOSE`] that make a small object.
const MIN_CLOSE: usize = 3;
/// Largest distance between neighbours on a line, metres: beams 15 mm apart hit a wire of 4 mm
/// about four times on twice this length.
const LINE_REACH: f32 = 0.15;
/// Distance within which points of two scanners lie on one surface, metres: two edges leave stray
/// points at one place by chance only.
const AGREED: f32 = 0.04;
/// Distance from an undoubted point within which others belong to the same thing, metres: it would
/// be in the way of a path within the usual margin just the same.
const BESIDE: f32 = 0.02;
/// Largest number of unknown voxels among the six beside that of a point for its surroundings to
/// count as seen.
const UNKNOWN: usize = 2;
/// Number of obstacles that are looked at as one piece of work.
const PIECE: usize = 1 << 14;

/// What scanners tell about the obstacles with these indices.
pub(crate) trait Sight: Sync {
    /// Places of the scanners that measured an obstacle, base frame.
    fn eyes(&self, at: usize) -> Vec<Point>;
    /// Whether several scanners measured two obstacles, or one of them.
    fn are_of_several(&self, at: usize, other: usize) -> bool;
    /// Whether beams of a scanner that did not measure an obstacle passed its place.
    fn is_passed(&self, at: usize, o: &Obstacle) -> bool;
    /// Of the obstacles for which it is asked, which lie behind something that neighbouring beams
    /// hit.
    fn behind(&self, all: &[Obstacle], asked: &[bool]) -> Vec<bool>;
}

/// The part of space that is known, and where the robot stands in it.
#[derive(Clone, Copy)]
pub(crate) struct SeenSpace<'a> {
    pub(crate) space: &'a Space,
    pub(crate) world_from_base: &'a Pose,
}

/// For each obstacle, whether it is evidence of an object. Without `seen` nothing is known to be
/// free, and all obstacles are. Points that may be strays are marked as grazed.
pub(crate) fn evident(
    all: &mut [Obstacle],
    sight: &dyn Sight,
    seen: Option<SeenSpace<'_>>,
    fan: &dyn Fan,
) -> Vec<bool> {
    let Some(seen) = seen else { return vec![true; all.len()] };
    let surfaces = Grid::of(NEAR, all, |o| !o.is_grazed);
    let surface_threshold = surface_threshold(&surfaces);
    let thin = each(fan, all, |at, o| {
        o.is_point() && (o.is_grazed || surfaces.n_near(at, o.at, NEAR, SOLID) < SOLID)
    });
    let passed = each(fan, all, |at, o| o.is_point() && sight.is_passed(at, o));
    let asked = each(fan, all, |at, o| match o.what {
        ObstacleKind::Uncertain => thin[at] && !o.is_grazed,
        _ => passed[at],
    });
    let behind = sight.behind(all, &asked);
    let doubtful = each(fan, all, |at, o| match o.what {
        ObstacleKind::Uncertain => passed[at] || thin[at],
        _ => passed[at] && behind[at],
    });
    for (at, o) in all.iter_mut().enumerate() {
        o.is_grazed |= behind[at] || passed[at] && doubtful[at];
    }
    let surfaces = Grid::of(NEAR, all, |o| !o.is_grazed);
    let points = Grid::of(NEAR, all, Obstacle::is_point);
    let is_undoubted =
        |at: usize| !doubtful[at] && (all[at].is_point() || all[at].what == ObstacleKind::Floor);
    let look = PointEvidence { sight, seen, surface_threshold, surfaces, points };
    each(fan, all, |at, o| {
        let undoubted = |reach: f32| {
            let near = look.surfaces.offsets(at, o.at, reach);
            near.filter(|(other, _)| is_undoubted(*other)).map(|(_, by)| by)
        };
        !doubtful[at]
            || undoubted(BESIDE).next().is_some()
            || look.is_evident(at, o)
            || lines::is_in_plane_of(&undoubted(LINE_REACH).collect::<Vec<_>>())
    })
}

/// All that tells whether a point is evidence of an object.
struct PointEvidence<'a> {
    sight: &'a dyn Sight,
    seen: SeenSpace<'a>,
    surface_threshold: usize,
    /// What no grazing beam measured.
    surfaces: Grid,
    /// All single points.
    points: Grid,
}

impl PointEvidence<'_> {
    fn is_evident(&self, at: usize, o: &Obstacle) -> bool {
        let n = self.surface_threshold;
        self.surfaces.n_near(at, o.at, NEAR, n) >= n
            || if o.is_grazed {
                self.is_of_a_thing(at, o)
            } else {
                is_small_object(&self.surfaces, at, o) || !self.seen.is_seen(o)
            }
    }

    /// Whether a point of a beam that may have grazed an edge belongs to a thing behind it.
    fn is_of_a_thing(&self, at: usize, o: &Obstacle) -> bool {
        let mut near: Vec<Offset> = Vec::new();
        for (other, by) in self.points.offsets(at, o.at, LINE_REACH) {
            if by.norm() < AGREED && self.sight.are_of_several(at, other) {
                return true;
            }
            near.push(by);
        }
        let (here, eyes) = (place(o), self.sight.eyes(at));
        let far = || -> Vec<Offset> {
            self.points.offsets(at, o.at, lines::LONG_REACH).map(|(_, by)| by).collect()
        };
        lines::is_on_clear_plane(&near, &here, &eyes)
            || lines::is_on_clear_bar(&near, &here, &eyes)
            || lines::is_on_clear_line(&near, &here, &eyes)
            || lines::is_on_long_line(&far(), &here, &eyes)
    }
}

/// Calls `of` for each obstacle with its index, and returns the results in their order.
fn each(
    fan: &dyn Fan,
    all: &[Obstacle],
    of: impl Fn(usize, &Obstacle) -> bool + Sync,
) -> Vec<bool> {
    let pieces: Vec<Range<usize>> =
        (0..all.len()).step_by(PIECE).map(|from| from..(from + PIECE).min(all.len())).collect();
    let own = |piece: Range<usize>| piece.map(|at| of(at, &all[at])).collect::<Vec<bool>>();
    fan.fan(pieces, own).concat()
}

/// Selects, from points attached to a link (each with whether its beam grazed an edge), those that
/// are evidence of an attached object.
#[must_use]
pub fn attached_points(points: &[([f32; 3], bool)]) -> Vec<[f32; 3]> {
    let obstacle = |&(at, is_grazed): &([f32; 3], bool)| Obstacle {
        at,
        radius: HALF_CELL,
        what: ObstacleKind::Uncertain,
        is_grazed,
    };
    let all: Vec<Obstacle> = points.iter().map(obstacle).collect();
    let is_evident = supported_by_others(&all, surface_threshold_of(&all), |_| true);
    all.iter().zip(is_evident).filter(|(_, is)| *is).map(|(o, _)| o.at).collect()
}

/// Number of neighbours that makes a surface at the density of these points.
pub(crate) fn surface_threshold_of(all: &[Obstacle]) -> usize {
    surface_threshold(&Grid::of(NEAR, all, |o| !o.is_grazed))
}

/// For each obstacle, whether the others are evidence that it belongs to an object: it lies on a
/// surface (`surface_threshold` neighbours make one), on a line or among a few neighbours. It is
/// only computed where `is_needed` holds, and `false` elsewhere.
pub(crate) fn supported_by_others(
    all: &[Obstacle],
    surface_threshold: usize,
    is_needed: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let surfaces = Grid::of(NEAR, all, |o| !o.is_grazed);
    let is_evident = |(at, o): (usize, &Obstacle)| {
        is_needed(at)
            && (surfaces.n_near(at, o.at, NEAR, surface_threshold) >= surface_threshold
                || !o.is_grazed && is_small_object(&surfaces, at, o))
    };
    all.iter().enumerate().map(is_evident).collect()
}

/// Whether an obstacle belongs to a small object or to a line.
fn is_small_object(surfaces: &Grid, at: usize, o: &Obstacle) -> bool {
    surfaces.n_near(at, o.at, CLOSE, MIN_CLOSE) >= MIN_CLOSE || {
        let near: Vec<Offset> = surfaces.offsets(at, o.at, LINE_REACH).map(|(_, by)| by).collect();
        lines::is_on_line(&near)
    }
}

/// Number of neighbours that makes a surface at the density of these scans.
fn surface_threshold(surfaces: &Grid) -> usize {
    /// Number of points from which the median is taken.
    const N_SAMPLED: usize = 2000;
    let step = surfaces.len() / N_SAMPLED + 1;
    let most = (MIN_NEIGHBOURS as f64 / SHARE) as usize;
    let n_near = |(at, p): (u32, [f32; 3])| surfaces.n_near(at as usize, p, NEAR, most);
    let mut n: Vec<usize> = surfaces.sampled(step).map(n_near).collect();
    n.sort_unstable();
    let median = n.get(n.len() / 2).copied().unwrap_or(0);
    ((median as f64 * SHARE) as usize).clamp(1, MIN_NEIGHBOURS)
}

fn place(o: &Obstacle) -> Point {
    Point::from(o.at.map(f64::from))
}

impl SeenSpace<'_> {
    /// Whether beams passed through the space beside an obstacle.
    fn is_seen(&self, o: &Obstacle) -> bool {
        let grid = self.space.grid();
        let p = self.world_from_base * place(o);
        let is_unknown = |k: &usize| {
            let mut beside: [f64; 3] = p.coords.into();
            beside[k / 2] += if k.is_multiple_of(2) { grid.edge } else { -grid.edge };
            let at = grid.index(beside);
            at.is_none_or(|at| self.space.voxels()[at] == SpaceKind::Unknown)
        };
        (0..6).filter(is_unknown).count() <= UNKNOWN
    }
}

#[cfg(test)]
mod tests;
