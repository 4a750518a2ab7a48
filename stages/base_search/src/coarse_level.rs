//! The coarse level of the search: every place on a plane that has points around it, at every yaw.
//!
//! Places lie in rows, upright ones on walls, and at each yaw a whole row is looked up at once.

use contract::{Fan, InstallationPlane};
use geometry::{Plane, Pose, Vector};
use nalgebra::UnitQuaternion;

use crate::problem::BaseSearch;
use crate::score_grid::{MAX_STRIDE, PlaceRow, RowAxis, Stencil};
use crate::trial::{BaseTrial, SampleScore, Samples, coarse_yaw};

/// Heights above a plane of the points that may belong to a base, metres: above the plane itself,
/// and not above a robot's shoulder.
const FOOT_HEIGHTS: std::ops::Range<f64> = 0.03..1.2;
/// Share of the base's radius within which a place needs points around it.
const SURROUND_SHARE: f64 = 0.8;
/// Fewest filled cells of the plane within that radius.
const MIN_CELLS: usize = 3;
/// Fewest points of a filled cell.
const MIN_IN_CELL: u32 = 3;

/// Share of its length that an upright unit normal has along z at most, for rows along z.
const UPRIGHT: f64 = 0.3;

/// A place on the plane: x, y in its own coordinates, metres.
type Place = (f64, f64);

/// The base of a model at each yaw of the coarse level, at one place from which it is shifted.
struct TurnedBases<'s> {
    search: &'s BaseSearch<'s>,
    tolerance: f32,
    start: Place,
    /// Along which rows of places lie.
    axis: RowAxis,
    /// The pose of the plane's axes, and of the base at each yaw; region frame.
    frame: UnitQuaternion<f64>,
    poses: Vec<Pose>,
    /// The samples at each yaw as cells of the grid; `None` where there is no grid.
    stencils: Option<Vec<Stencil<'s>>>,
}

impl<'s> TurnedBases<'s> {
    fn new(search: &'s BaseSearch<'s>, local: &Plane, start: Place) -> Self {
        let axis = row_axis(local);
        let tolerance = search.coarse_tolerance();
        let n = (std::f64::consts::TAU / coarse_yaw()).round() as usize;
        let turned = |k: usize| search.pose(local, start.0, start.1, k as f64 * coarse_yaw());
        let poses: Vec<Pose> = (0..n).map(|k| turned(k) * search.root_from_base).collect();
        let samples = Samples::first(search.model, search.base, search.settings.n_coarse);
        let stencil = |pose: &Pose| search.region.stencil(axis, samples.points, pose, tolerance);
        let stencils = poses.iter().map(stencil).collect();
        Self { search, tolerance, start, axis, frame: local.frame(), poses, stencils }
    }

    /// The shift to a place; region frame, metres.
    fn shift(&self, (x, y): Place) -> Vector {
        self.frame * Vector::new(x - self.start.0, y - self.start.1, 0.0)
    }

    /// Score of the first `n_samples` samples at one place, at yaw `k`.
    fn look_up(&self, k: usize, place: Place, n_samples: usize) -> SampleScore {
        let shift = self.shift(place);
        let known = self.stencils.as_ref().map(|s| &s[k]);
        let known = known.and_then(|s| s.look_up(shift.cast::<f32>().into(), n_samples));
        known.unwrap_or_else(|| {
            let mut pose = self.poses[k];
            pose.translation.vector += shift;
            let samples = Samples::first(self.search.model, self.search.base, n_samples);
            self.search.quick_score(samples, &pose, self.tolerance)
        })
    }

    /// The same at each of some places, which lie in a row of cells if `row` is known.
    fn look_up_all(
        &self,
        k: usize,
        places: &[Place],
        row: Option<&PlaceRow>,
        n_samples: usize,
    ) -> Vec<SampleScore> {
        let known = self.stencils.as_ref().zip(row);
        let known = known.and_then(|(s, row)| s[k].look_up_row(row, n_samples));
        known.unwrap_or_else(|| places.iter().map(|p| self.look_up(k, *p, n_samples)).collect())
    }

    /// The row of cells in which the first of these places lie, as many as do.
    fn row(&self, places: &[Place]) -> Option<PlaceRow> {
        let stencil = self.stencils.as_ref()?.first()?;
        let cells = |p: &Place| stencil.cells(self.shift(*p).cast::<f32>().into());
        let first = cells(places.first()?);
        let at = self.axis.index();
        let stride = places.get(1).map_or(0, |second| cells(second)[at] - first[at]);
        let row = PlaceRow { axis: self.axis, first, stride: stride.clamp(1, MAX_STRIDE), n: 1 };
        let fits = |(i, place): &(usize, &Place)| cells(place) == row.place(*i);
        let n = match (1..=MAX_STRIDE).contains(&stride) {
            true => places.iter().enumerate().take_while(fits).count(),
            false => 1,
        };
        Some(PlaceRow { n, ..row })
    }

    /// The trials worth a closer look at some places in a row, on plane `at`.
    fn trials(&self, at: usize, places: &[Place], row: Option<&PlaceRow>) -> Vec<BaseTrial> {
        let (search, n) = (self.search, self.poses.len());
        let (n_all, thrift) = (search.settings.n_coarse, search.thrift);
        // Few samples at every other yaw exclude most places, and most yaws of the others.
        let few: Vec<Vec<SampleScore>> =
            (0..n).step_by(2).map(|k| self.look_up_all(k, places, row, n_all / 4)).collect();
        let top = |i: usize| few.iter().map(|s| s[i].score).fold(f64::NEG_INFINITY, f64::max);
        let tops: Vec<f64> = (0..places.len()).map(top).collect();
        let is_near_top = |k: usize, i: usize| {
            let [before, after] = [k / 2, k.div_ceil(2)].map(|k| few[k % few.len()][i].score);
            tops[i] >= thrift.min_quick_score && before.max(after) >= tops[i] - thrift.yaw_lag
        };
        let mut out: Vec<Vec<BaseTrial>> = vec![Vec::new(); places.len()];
        for k in 0..n {
            let wanted: Vec<usize> = (0..places.len()).filter(|i| is_near_top(k, *i)).collect();
            let (Some(first), Some(last)) = (wanted.first(), wanted.last()) else { continue };
            let part = row.map(|row| row.part(*first, last - first + 1));
            let ratings = self.look_up_all(k, &places[*first..=*last], part.as_ref(), n_all);
            for i in &wanted {
                let rating = ratings[i - first];
                if search.is_open(&rating) {
                    let (x, y) = places[*i];
                    let yaw = k as f64 * coarse_yaw();
                    let first = SampleScore::default();
                    out[*i].push(BaseTrial { x, y, yaw, plane: at, rating, first });
                }
            }
        }
        out.concat()
    }
}

impl BaseSearch<'_> {
    /// Scores every place on the plane that has points around it, at every yaw.
    pub(crate) fn coarse(
        &self,
        at: usize,
        plane: &InstallationPlane,
        local: &Plane,
        fan: &dyn Fan,
    ) -> Vec<BaseTrial> {
        let places = self.occupied(plane, local, self.coarse_step());
        let Some(start) = places.first() else { return Vec::new() };
        let turned = TurnedBases::new(self, local, *start);
        let mut rows: Vec<(&[Place], Option<PlaceRow>)> = Vec::new();
        let mut rest = &places[..];
        while !rest.is_empty() {
            let row = turned.row(rest);
            let (own, others) = rest.split_at(row.map_or(1, |row| row.n));
            rows.push((own, row));
            rest = others;
        }
        let trials =
            |(places, row): (&[Place], Option<PlaceRow>)| turned.trials(at, places, row.as_ref());
        fan.fan(rows, trials).into_iter().flatten().collect()
    }

    /// Places on the plane (x, y in its own coordinates, metres) that have points above it within
    /// the base's radius, row by row.
    fn occupied(&self, plane: &InstallationPlane, local: &Plane, step: f64) -> Vec<(f64, f64)> {
        // The rows' own axes, turned about the normal.
        let (frame, turn) = (local.frame(), row_turn(local));
        let to_plane = turn.inverse() * frame.inverse();
        let span = |corners: [[f64; 3]; 8], i: usize| {
            let along = corners.map(|c| (to_plane * Vector::from(c))[i]);
            along
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)))
        };
        let shifted = plane.bounds.corners().map(|c| {
            let at = Vector::from(c) - self.region.region.origin.coords;
            [at.x, at.y, at.z]
        });
        let reach = self.region.region.bounds.corners();
        let grow = self.radius.max(0.1);
        let low: [f64; 2] =
            std::array::from_fn(|i| span(reach, i).0.max(span(shifted, i).0 - grow));
        let high: [f64; 2] =
            std::array::from_fn(|i| span(reach, i).1.min(span(shifted, i).1 + grow));
        if low[0] >= high[0] || low[1] >= high[1] {
            return Vec::new();
        }
        let n: [usize; 2] =
            std::array::from_fn(|i| ((high[i] - low[i]) / step).ceil() as usize + 1);
        let mut count = vec![0_u32; n[0] * n[1]];
        for cube in self.region.point_cubes() {
            let q = to_plane * Vector::from(cube.at.map(f64::from));
            let height = q.z - local.offset;
            if !FOOT_HEIGHTS.contains(&height) {
                continue;
            }
            let i = ((q.x - low[0]) / step).round();
            let j = ((q.y - low[1]) / step).round();
            if i >= 0.0 && j >= 0.0 && (i as usize) < n[0] && (j as usize) < n[1] {
                count[j as usize * n[0] + i as usize] += cube.n_points;
            }
        }
        let near = filled_around(&count, n, self.radius * SURROUND_SHARE / step);
        let place = |at: usize| {
            let [u, v] = [at % n[0], at / n[0]].map(|i| i as f64 * step);
            let at = turn * Vector::new(low[0] + u, low[1] + v, 0.0);
            (at.x, at.y)
        };
        near.iter().enumerate().filter(|(_, n)| **n >= MIN_CELLS).map(|(at, _)| place(at)).collect()
    }
}

/// For each cell of a plane the number of filled cells within a radius, in cells. The scans show no
/// points in the middle of a base, so that points around it are counted.
fn filled_around(count: &[u32], n: [usize; 2], radius: f64) -> Vec<usize> {
    let r = radius.ceil() as isize;
    let disc: Vec<(isize, isize)> = (-r..=r)
        .flat_map(|dj| (-r..=r).map(move |di| (di, dj)))
        .filter(|(di, dj)| di * di + dj * dj <= r * r)
        .collect();
    let mut near = vec![0_usize; count.len()];
    for (at, _) in count.iter().enumerate().filter(|(_, n)| **n >= MIN_IN_CELL) {
        let (i, j) = ((at % n[0]) as isize, (at / n[0]) as isize);
        for (di, dj) in &disc {
            let (a, b) = (i + di, j + dj);
            if a >= 0 && b >= 0 && (a as usize) < n[0] && (b as usize) < n[1] {
                near[b as usize * n[0] + a as usize] += 1;
            }
        }
    }
    near
}

/// The axis along which rows of places on a plane lie.
fn row_axis(plane: &Plane) -> RowAxis {
    if plane.normal.z.abs() <= UPRIGHT { RowAxis::Z } else { RowAxis::X }
}

/// The turn about a plane's normal from its own axes to those of its rows: of an upright plane, the
/// first one points upwards.
fn row_turn(plane: &Plane) -> UnitQuaternion<f64> {
    if row_axis(plane) == RowAxis::X {
        return UnitQuaternion::identity();
    }
    let up = plane.frame().inverse() * Vector::z();
    UnitQuaternion::from_axis_angle(&Vector::z_axis(), up.y.atan2(up.x))
}
