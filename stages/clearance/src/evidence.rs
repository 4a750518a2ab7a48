//! Selects the points around a robot that are evidence of an object, and drops stray points.
//!
//! Scans have stray points: a beam that hits an edge partly gives a point between the edge and the
//! surface behind it, where nothing is, and masks leave some points of a robot to the fixed world.
//! A point counts if other points lie on the same surface, or on the same line, as the points of a
//! wire do. A point without either is dropped if it lies in space that beams passed through. Points
//! of beams that grazed an edge in front of them count only as part of a surface, or of a line or a
//! plane with little beside it: points of an edge are scattered over the depth behind it, those of
//! a wire or a wall that happens to stand behind the edge are not.

use crate::obstacle::{HALF_CELL, Obstacle, ObstacleKind, distance};
use contract::{Space, SpaceKind};
use geometry::{Point, Pose};
use rustc_hash::FxHashMap;

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
/// Thickness of a line, metres: the wire, the scanner's noise, and the edge of a cell.
const LINE_THICKNESS: f32 = 0.010;
/// Number of other points that make a line.
const ON_LINE: usize = 3;
/// Number of other points that make a line of points of grazing beams, and their least share of all
/// points about: a curtain behind an edge has points all over.
const ON_CLEAR_LINE: usize = 8;
const CLEAR_SHARE: f64 = 0.7;
/// Number of points, the farthest ones, through which such a line is tried.
const N_LINES: usize = 4;
/// Largest distance of neighbours on a plane of points of grazing beams, metres: a wall at 6 m has
/// ten points about each, of beams 0.15° apart that meet it at 60°.
const PLANE_REACH: f32 = 0.10;
/// Least standard deviation of such a plane's points along both of its directions, metres; along a
/// line it is less in one.
const PLANE_WIDTH: f32 = 0.015;
/// Least sine of the angle between such a line or plane and a beam to it: an edge or a tip in front
/// leaves points along the beam. 15°.
const ACROSS_BEAM: f64 = 0.26;
/// Largest number of unknown voxels among the six beside that of a point for its surroundings to
/// count as seen.
const UNKNOWN: usize = 2;

/// From one obstacle to another, metres.
type Offset = nalgebra::Vector3<f32>;

/// Obstacles by the cube of edge [`NEAR`] that holds them.
struct Cubes<'a> {
    all: &'a [Obstacle],
    cubes: FxHashMap<[i32; 3], Vec<u32>>,
}

/// For each obstacle, whether it is evidence of an object. Without `space` nothing is known to be
/// seen, and all obstacles are. `behind` tells, for those that are no thick surface, which lie
/// behind something that neighbouring beams hit; these are treated as measured by grazing beams.
/// `eyes` gives the places of the scanners that measured an obstacle, base frame.
pub(crate) fn evident(
    all: &mut [Obstacle],
    behind: impl Fn(&[Obstacle], &[bool]) -> Vec<bool>,
    eyes: impl Fn(usize) -> Vec<Point>,
    space: Option<&Space>,
    world_from_base: &Pose,
) -> Vec<bool> {
    let mut out = vec![true; all.len()];
    let Some(space) = space else { return out };
    let cubes = Cubes::of(all);
    let thin: Vec<bool> = (all.iter())
        .map(|o| o.is_point() && !o.is_grazed && cubes.n_near(o, NEAR, SOLID) < SOLID)
        .collect();
    let surface_threshold = cubes.surface_threshold();
    let is_behind = behind(all, &thin);
    all.iter_mut().zip(is_behind).for_each(|(o, is_behind)| o.is_grazed |= is_behind);
    let (cubes, points) = (Cubes::of(all), Cubes::of_points(all));
    for (at, o) in all.iter().enumerate().filter(|(_, o)| o.is_point()) {
        out[at] = cubes.n_near(o, NEAR, surface_threshold) >= surface_threshold
            || if o.is_grazed {
                let eyes = eyes(at);
                points.is_on_clear_line(at, &eyes) || points.is_on_clear_plane(at, &eyes)
            } else {
                cubes.is_small_object(at) || !is_seen(space, &(world_from_base * place(o)))
            };
    }
    out
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
    let is_evident = supported_by_others(&all, surface_threshold(&all), |_| true);
    all.iter().zip(is_evident).filter(|(_, is)| *is).map(|(o, _)| o.at).collect()
}

/// Number of neighbours that makes a surface at the density of these points.
pub(crate) fn surface_threshold(all: &[Obstacle]) -> usize {
    Cubes::of(all).surface_threshold()
}

/// For each obstacle, whether the others are evidence that it belongs to an object: it lies on a
/// surface (`surface_threshold` neighbours make one), on a line or among a few neighbours. It is
/// only computed where `is_needed` holds, and `false` elsewhere.
pub(crate) fn supported_by_others(
    all: &[Obstacle],
    surface_threshold: usize,
    is_needed: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let cubes = Cubes::of(all);
    let is_evident = |(at, o): (usize, &Obstacle)| {
        is_needed(at)
            && (cubes.n_near(o, NEAR, surface_threshold) >= surface_threshold
                || !o.is_grazed && cubes.is_small_object(at))
    };
    all.iter().enumerate().map(is_evident).collect()
}

impl<'a> Cubes<'a> {
    /// Of those that not only grazing beams measured.
    fn of(all: &'a [Obstacle]) -> Self {
        Self::those(all, |o| !o.is_grazed)
    }

    /// Of all single points.
    fn of_points(all: &'a [Obstacle]) -> Self {
        Self::those(all, Obstacle::is_point)
    }

    fn those(all: &'a [Obstacle], counts: impl Fn(&Obstacle) -> bool) -> Self {
        let mut cubes: FxHashMap<[i32; 3], Vec<u32>> = FxHashMap::default();
        for (at, o) in all.iter().enumerate().filter(|(_, o)| counts(o)) {
            cubes.entry(cube(o.at)).or_default().push(at as u32);
        }
        Self { all, cubes }
    }

    /// Obstacles in the cubes about a place, up to `n` cubes away along each axis.
    fn around(&self, at: [f32; 3], n: i32) -> impl Iterator<Item = u32> + '_ {
        let [x, y, z] = cube(at);
        let side = 2 * n + 1;
        let n_cubes = side * side * side;
        // The cube of the place first, since it mostly holds enough neighbours.
        (0..n_cubes).flat_map(move |i| {
            let i = (i + n_cubes / 2) % n_cubes;
            let by = [i % side - n, i / side % side - n, i / (side * side) - n];
            self.cubes.get(&[x + by[0], y + by[1], z + by[2]]).into_iter().flatten().copied()
        })
    }

    /// Number of other obstacles within `within` metres of an obstacle, which is at most [`NEAR`];
    /// counting stops at `most`.
    fn n_near(&self, o: &Obstacle, within: f32, most: usize) -> usize {
        let is_near = |i: &u32| distance(self.all[*i as usize].at, o.at) < within;
        let itself = usize::from(!o.is_grazed);
        self.around(o.at, 1).filter(is_near).take(most + itself).count().saturating_sub(itself)
    }

    /// Whether an obstacle belongs to a small object or to a line.
    fn is_small_object(&self, at: usize) -> bool {
        self.n_near(&self.all[at], CLOSE, MIN_CLOSE) >= MIN_CLOSE || self.is_on_line(at)
    }

    /// Number of neighbours that makes a surface at the density of these scans.
    fn surface_threshold(&self) -> usize {
        /// Number of points from which the median is taken.
        const N_SAMPLED: usize = 2000;
        let step = self.all.len() / N_SAMPLED + 1;
        let most = (MIN_NEIGHBOURS as f64 / SHARE) as usize;
        let mut n: Vec<usize> =
            self.all.iter().step_by(step).map(|o| self.n_near(o, NEAR, most)).collect();
        n.sort_unstable();
        let median = n.get(n.len() / 2).copied().unwrap_or(0);
        ((median as f64 * SHARE) as usize).clamp(1, MIN_NEIGHBOURS)
    }

    /// Whether enough other obstacles lie on a line through an obstacle.
    fn is_on_line(&self, at: usize) -> bool {
        let near = self.offsets(at);
        // Points that are too near define no direction.
        near.iter()
            .filter(|v| v.norm() > 2.0 * LINE_THICKNESS)
            .any(|v| n_along(&near, &v.normalize()) >= ON_LINE)
    }

    /// Whether most of the obstacles about an obstacle lie on one line through it that does not
    /// follow a beam.
    fn is_on_clear_line(&self, at: usize, eyes: &[Point]) -> bool {
        let mut near = self.offsets(at);
        let most = (near.len() as f64 * CLEAR_SHARE).ceil() as usize;
        if near.len() < ON_CLEAR_LINE {
            return false;
        }
        near.sort_by(|a, b| b.norm_squared().total_cmp(&a.norm_squared()));
        let here = place(&self.all[at]);
        let is_across = |unit: &Offset| {
            let unit = unit.map(f64::from);
            eyes.iter().all(|eye| unit.cross(&(here - eye).normalize()).norm() > ACROSS_BEAM)
        };
        near[..N_LINES]
            .iter()
            .map(|v| v.normalize())
            .any(|unit| n_along(&near, &unit) >= most.max(ON_CLEAR_LINE) && is_across(&unit))
    }

    /// Whether most of the obstacles about an obstacle lie on one plane through it that does not
    /// follow a beam.
    fn is_on_clear_plane(&self, at: usize, eyes: &[Point]) -> bool {
        let mut near = self.offsets(at);
        near.retain(|v| v.norm() < PLANE_REACH);
        let most = (near.len() as f64 * CLEAR_SHARE).ceil() as usize;
        if near.len() < ON_CLEAR_LINE {
            return false;
        }
        let spread: nalgebra::Matrix3<f32> = near.iter().map(|v| v * v.transpose()).sum();
        let eigen = (spread / near.len() as f32).symmetric_eigen();
        let across = eigen.eigenvalues.imin();
        let is_wide = (0..3).filter(|k| *k != across);
        let normal: Offset = eigen.eigenvectors.column(across).into_owned();
        let here = place(&self.all[at]);
        let is_faced = |eye: &Point| {
            let beam = (here - eye).normalize();
            beam.dot(&normal.map(f64::from)).abs() > ACROSS_BEAM
        };
        is_wide.into_iter().all(|k| eigen.eigenvalues[k] > PLANE_WIDTH * PLANE_WIDTH)
            && near.iter().filter(|v| v.dot(&normal).abs() < LINE_THICKNESS).count() >= most
            && eyes.iter().all(is_faced)
    }

    /// From an obstacle to all others within [`LINE_REACH`], metres.
    fn offsets(&self, at: usize) -> Vec<Offset> {
        let here = self.all[at].at;
        let reach = (LINE_REACH / NEAR).ceil() as i32;
        self.around(here, reach)
            .filter(|i| *i as usize != at)
            .map(|i| Offset::from(std::array::from_fn(|k| self.all[i as usize].at[k] - here[k])))
            .filter(|v| v.norm() < LINE_REACH)
            .collect()
    }
}

/// Number of places near the line through the origin with this direction.
fn n_along(near: &[Offset], unit: &Offset) -> usize {
    near.iter().filter(|w| (*w - unit * w.dot(unit)).norm() < LINE_THICKNESS).count()
}

fn place(o: &Obstacle) -> Point {
    Point::from(o.at.map(f64::from))
}

fn cube(at: [f32; 3]) -> [i32; 3] {
    at.map(|v| (v / NEAR).floor() as i32)
}

/// Whether beams passed through the space beside a place in the world.
fn is_seen(space: &Space, p: &Point) -> bool {
    let grid = space.grid();
    let is_unknown = |k: &usize| {
        let mut beside: [f64; 3] = p.coords.into();
        beside[k / 2] += if k.is_multiple_of(2) { grid.edge } else { -grid.edge };
        grid.index(beside).is_none_or(|at| space.voxels()[at] == SpaceKind::Unknown)
    };
    (0..6).filter(is_unknown).count() <= UNKNOWN
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::SpaceGrid;
    use geometry::Aabb;

    fn evident_among(points: &[[f32; 3]], kind: SpaceKind) -> Vec<bool> {
        evident_by(points, kind, false)
    }

    const EYE: [f64; 3] = [-2.0, 0.0, 0.0];

    fn evident_by(points: &[[f32; 3]], kind: SpaceKind, grazed: bool) -> Vec<bool> {
        // A distant wall with 1 cm between points sets the density of the scan.
        let wall = (0..2500).map(|i| [1.0, 0.01 * (i % 50) as f32, 0.01 * (i / 50) as f32]);
        let obstacle =
            |(at, is_grazed)| Obstacle { at, radius: 0.0035, what: ObstacleKind::Fixed, is_grazed };
        let mut all: Vec<Obstacle> = (points.iter().map(|p| (*p, grazed)))
            .chain(wall.map(|p| (p, false)))
            .map(obstacle)
            .collect();
        let bounds = Aabb { min: [-1.5; 3], max: [1.5; 3] };
        let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.05));
        space.voxels_mut().fill(kind);
        let nothing = |all: &[Obstacle], _: &[bool]| vec![false; all.len()];
        let eyes = |_: usize| vec![Point::from(EYE)];
        let out = evident(&mut all, nothing, eyes, Some(&space), &Pose::identity());
        assert!(out[points.len()..].iter().all(|is| *is), "the wall stands");
        out[..points.len()].to_vec()
    }

    #[test]
    fn strays_in_seen_space_are_evidence_of_nothing() {
        let strays = [[0.0, 0.0, 0.0], [0.03, 0.02, -0.02], [-0.02, 0.05, 0.05], [0.3, 0.3, 0.1]];
        assert_eq!(evident_among(&strays, SpaceKind::Free), [false; 4]);
        // Where no beam passed, each of them may be an object.
        assert_eq!(evident_among(&strays, SpaceKind::Unknown), [true; 4]);
    }

    #[test]
    fn a_small_thing_of_four_points_stays() {
        let hook = [[0.0, 0.0, 0.0], [0.012, 0.0, 0.0], [0.0, 0.0, 0.012], [0.012, 0.0, 0.012]];
        assert_eq!(evident_among(&hook, SpaceKind::Free), [true; 4]);
    }

    #[test]
    fn a_wire_that_few_beams_met_stays() {
        // Points 4 cm apart with a noise of 3 mm.
        let noise = |i: usize| [0.003, -0.002, 0.001, -0.003][i % 4];
        let wire: Vec<[f32; 3]> =
            (0..9).map(|i| [noise(i), noise(i + 1), 0.04 * i as f32 - 0.16]).collect();
        assert_eq!(evident_among(&wire, SpaceKind::Free), [true; 9]);
    }

    #[test]
    fn a_wire_that_stands_behind_an_edge_by_chance_stays() {
        let noise = |i: usize| [0.002, -0.002, 0.001, -0.003][i % 4];
        let mut all: Vec<[f32; 3]> =
            (0..60).map(|i| [noise(i), noise(i + 1), 0.01 * i as f32]).collect();
        // Some points of the edge itself are among them.
        all.extend((0..5).map(|i| [-0.05 * i as f32, 0.02, 0.1 * i as f32]));
        assert_eq!(evident_by(&all, SpaceKind::Free, true)[..60], [true; 60]);
    }

    #[test]
    fn a_wall_of_few_beams_behind_an_edge_stays() {
        let noise = |i: usize| [0.002, -0.002, 0.001, -0.003][i % 4];
        // Beams 3 cm apart on a wall that stands askew, at 45° to them.
        let of = |i: usize| [(i % 8) as f32 * 0.03, (i / 8) as f32 * 0.03];
        let all: Vec<[f32; 3]> =
            (0..64).map(|i| [0.2 + of(i)[0] + noise(i), of(i)[0], of(i)[1]]).collect();
        assert_eq!(evident_by(&all, SpaceKind::Free, true), [true; 64]);
    }

    #[test]
    fn stray_points_are_not_attached() {
        let hose = (0..40).map(|i| ([0.01 * i as f32, 0.0, 0.0], i % 5 == 0));
        let curtain = (0..20).map(|i| ([0.0, 0.3, 0.01 * i as f32], true));
        let all: Vec<_> = hose.chain(curtain).chain([([0.0, -0.4, 0.0], false)]).collect();
        let left = attached_points(&all);
        assert_eq!(left, all[..40].iter().map(|(p, _)| *p).collect::<Vec<_>>());
    }

    #[test]
    fn points_of_grazing_beams_count_only_on_surfaces_of_others() {
        // Behind an upright edge, at any depth.
        let depth = |i: usize| (i * 37 % 50) as f32 * 0.01;
        let curtain: Vec<[f32; 3]> = (0..30).map(|i| [depth(i), 0.0, 0.01 * i as f32]).collect();
        assert_eq!(evident_by(&curtain, SpaceKind::Free, true), [false; 30]);
        assert_eq!(evident_by(&curtain, SpaceKind::Unknown, true), [false; 30]);
        // Behind a tip, along the beam.
        let tail: Vec<[f32; 3]> = (0..30).map(|i| [0.01 * i as f32, 0.0, 0.0]).collect();
        assert_eq!(evident_by(&tail, SpaceKind::Free, true), [false; 30]);
        // Points at the wall belong to the wall.
        let at_wall = [[0.99, 0.2, 0.2], [1.01, 0.305, 0.1]];
        assert_eq!(evident_by(&at_wall, SpaceKind::Free, true), [true; 2]);
    }
}
