//! The search for the base poses of one model in one region, from coarse to fine: candidates
//! grouped by place, best first.
//!
//! The search space is (x, y, yaw) on each plane that has points above it; each level keeps the
//! best poses. From the second level on the first moving link is scored as well, swept over its
//! joint: many boxes have the shape of a base, but few that of a base with a carousel on it.

use contract::{Candidate, Fan, InstallationPlane};
use geometry::{Plane, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};

use crate::first_link_score::PlausibleBases;
use crate::first_link_stencils::FirstLinkStencils;
use crate::hill_climb::SearchLevel;
use crate::outscored::CoarseBases;
use crate::problem::BaseSearch;
use crate::regions::{GUESS_STEP, are_stacked};
use crate::score_grid::Stencil;
use crate::trial::{BaseTrial, SampleScore, Samples, Thinning, best, coarse_yaw};

/// Heights above a plane of the points that may belong to a base, metres: above the plane itself,
/// and not above a robot's shoulder.
const FOOT_HEIGHTS: std::ops::Range<f64> = 0.03..1.2;
/// Share of the base's radius within which a place needs points around it.
const SURROUND_SHARE: f64 = 0.8;
/// Fewest filled cells of the plane within that radius.
const MIN_CELLS: usize = 3;
/// Fewest points of a filled cell.
const MIN_IN_CELL: u32 = 3;
/// Largest stride between guessed planes at the coarse level: the next levels try two planes up and
/// down, and then one.
const MAX_STRIDE: usize = 6;
/// Tolerance of the coarse level as a multiple of its grid's step.
const COARSE_REACH: f64 = 1.3;
/// Share of the least score that a base must reach at the coarse level. On coarse grids the score
/// of the right pose differs somewhat from the final one.
const MIN_SHARE_COARSE: f64 = 0.4;
/// Share of the least score that a base must reach at the middle level.
const MIN_SHARE_MIDDLE: f64 = 0.6;
/// Limit of base poses of one place before the first link is scored.
const FEET_OF_A_PLACE: usize = 16;
/// Number of trials that are refined to the finest level at once.
const FINE_BATCH: usize = 16;
/// Number of poses of a place that are rated to compare places.
const FEW_OF_A_PLACE: usize = 3;
/// Area on the ground of one robot with its equipment, m².
const CELL_AREA: f64 = 25.0;
/// Largest number of robots that is expected in a region: a square of 12 m holds this many.
const MAX_CELLS: usize = 6;

impl BaseSearch<'_> {
    /// Runs the search on installation planes (world frame) and returns the candidates, one for
    /// each place, best first.
    #[must_use]
    pub fn run(&self, planes: &[InstallationPlane], fan: &dyn Fan) -> Vec<Candidate> {
        self.refine(planes, &self.coarse_bases(planes, fan), fan)
    }

    /// The coarse level of the search: base poses with their scores.
    #[must_use]
    pub fn coarse_bases(&self, planes: &[InstallationPlane], fan: &dyn Fan) -> CoarseBases {
        let local = self.all_local(planes);
        let (thrift, mut trials) = (self.thrift, Vec::new());
        for at in self.coarse_planes(&local) {
            trials.extend(self.coarse(at, &planes[at], &local[at], fan));
        }
        let cells = self.breadth * self.n_cells();
        let thinning = Thinning {
            keep: self.settings.keep_feet * cells,
            quota: FEET_OF_A_PLACE,
            step: self.coarse_step() * 0.9,
            yaw_step: coarse_yaw() * 0.9,
        };
        best(&mut trials, thinning);
        // Large parts of a cell have the height of a base. The first link excludes them sooner than
        // a finer grid does.
        let tolerance = self.coarse_tolerance();
        let stencils = FirstLinkStencils::new(self, &local, &trials, tolerance);
        let mut trials = fan.fan(trials, |t| {
            self.quick_with_first_link(&local[t.plane], t, tolerance, Some(&stencils))
        });
        best(
            &mut trials,
            Thinning {
                keep: thrift.keep * self.settings.keep_coarse * cells,
                quota: thrift.quota,
                ..thinning
            },
        );
        self.drop_low_scores(&mut trials, MIN_SHARE_COARSE);
        let at = |t: &BaseTrial| self.pose(&local[t.plane], t.x, t.y, 0.0).translation.vector;
        let places = trials.iter().map(at).collect();
        CoarseBases { trials, places }
    }

    /// Refines base poses of the coarse level on the same planes, and returns the candidates, one
    /// for each place, best first.
    #[must_use]
    pub fn refine(
        &self,
        planes: &[InstallationPlane],
        coarse: &CoarseBases,
        fan: &dyn Fan,
    ) -> Vec<Candidate> {
        let local = self.all_local(planes);
        let thrift = self.thrift;
        let (step, yaw_step) = (self.coarse_step(), coarse_yaw());
        let cells = self.breadth * self.n_cells();
        let middle = SearchLevel {
            step: step / 2.0,
            yaw: yaw_step / 2.0,
            rise: 2,
            keep: thrift.keep * self.settings.keep_middle * cells,
            quota: thrift.quota,
            is_quick: thrift.is_best_first,
        };
        let mut trials = self.refine_level(&local, &coarse.trials, &middle, fan);
        self.drop_low_scores(&mut trials, MIN_SHARE_MIDDLE);
        let per_place = self.settings.bases_per_place;
        let fine = SearchLevel {
            step: step / 4.0,
            yaw: yaw_step / 5.0,
            rise: 1,
            keep: self.settings.max_places * cells * per_place,
            quota: per_place,
            is_quick: false,
        };
        let trials = match thrift.is_best_first {
            true => self.refine_best_first(&local, &trials, &fine, fan),
            false => self.refine_level(&local, &trials, &fine, fan),
        };
        self.group(planes, &local, &trials)
    }

    fn all_local(&self, planes: &[InstallationPlane]) -> Vec<Plane> {
        planes.iter().map(|p| self.to_local(&p.plane)).collect()
    }

    /// Drops trials that score less than a share of the least score, and those that no finer level
    /// could find plausible.
    fn drop_low_scores(&self, trials: &mut Vec<BaseTrial>, share: f64) {
        trials.retain(|t| {
            t.rating.score >= share * self.min_score && self.may_be_plausible(&t.rating)
        });
    }

    /// Whether a pose of the coarsest grid is looked at more closely.
    fn is_open(&self, rating: &SampleScore) -> bool {
        rating.score > 0.0 && self.may_be_plausible(rating)
    }

    /// Whether a score on a coarse grid leaves room for a plausible base (`accept`).
    fn may_be_plausible(&self, rating: &SampleScore) -> bool {
        !self.region.evidence.has_beams() || rating.judged() >= self.thrift.min_judged
    }

    /// Number of robots that the region may hold, at least one. It scales the number of places that
    /// are kept.
    fn n_cells(&self) -> usize {
        let size = self.region.region.bounds.size();
        ((size[0] * size[1] / CELL_AREA).round() as usize).clamp(1, MAX_CELLS)
    }

    fn to_local(&self, plane: &Plane) -> Plane {
        Plane {
            normal: plane.normal,
            offset: plane.offset - plane.normal.dot(&self.region.region.origin.coords),
        }
    }

    /// Step of the coarse grid, metres: small enough that the true place lies within the tolerance.
    fn coarse_step(&self) -> f64 {
        self.region.whole_cells((self.radius * 0.35).clamp(0.04, 0.10))
    }

    /// Tolerance of the coarse level, metres.
    fn coarse_tolerance(&self) -> f32 {
        self.region.grid_tolerance((COARSE_REACH * self.coarse_step()) as f32)
    }

    /// The planes that are searched at the coarse level: of a stack of guessed planes the lowest
    /// and every few above it, otherwise all.
    fn coarse_planes(&self, planes: &[Plane]) -> Vec<usize> {
        let reach = COARSE_REACH * self.coarse_step();
        let stride = ((1.5 * reach / GUESS_STEP) as usize).clamp(1, MAX_STRIDE);
        let mut first = 0;
        let is_searched = |at: &usize| {
            let is_above = *at > first && are_stacked(&planes[*at - 1], &planes[*at], 1);
            if !is_above {
                first = *at;
            }
            !self.is_guess || (*at - first).is_multiple_of(stride)
        };
        (0..planes.len()).filter(is_searched).collect()
    }

    /// Scores every place on the plane that has points around it, at every yaw.
    fn coarse(
        &self,
        at: usize,
        plane: &InstallationPlane,
        local: &Plane,
        fan: &dyn Fan,
    ) -> Vec<BaseTrial> {
        let (step, tolerance) = (self.coarse_step(), self.coarse_tolerance());
        let n = (std::f64::consts::TAU / coarse_yaw()).round() as usize;
        let places = self.occupied(plane, local, step);
        let Some(start) = places.first().copied() else { return Vec::new() };
        let samples = Samples::first(self.model, self.base, self.settings.n_coarse);
        let turned = |k: usize| {
            self.pose(local, start.0, start.1, k as f64 * coarse_yaw()) * self.root_from_base
        };
        let stencils: Option<Vec<Stencil<'_>>> =
            (0..n).map(|k| self.region.stencil(samples.points, &turned(k), tolerance)).collect();
        let frame = local.frame();
        let place = |(x, y): (f64, f64)| -> Vec<BaseTrial> {
            let shift = frame * Vector::new(x - start.0, y - start.1, 0.0);
            let look_up = |k: usize, n_samples: usize| {
                let known = stencils.as_ref().map(|s| &s[k]);
                let known = known.and_then(|s| s.look_up(shift.cast::<f32>().into(), n_samples));
                known.unwrap_or_else(|| {
                    let mut pose = turned(k);
                    pose.translation.vector += shift;
                    let samples = Samples::first(self.model, self.base, n_samples);
                    self.quick_score(samples, &pose, tolerance)
                })
            };
            // Few samples at every other yaw exclude most places, and most yaws of the others.
            let few: Vec<f64> =
                (0..n).step_by(2).map(|k| look_up(k, self.settings.n_coarse / 4).score).collect();
            let top = few.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
            if top < self.thrift.min_quick_score {
                return Vec::new();
            }
            let is_near_top = |k: usize| {
                few[k / 2 % few.len()].max(few[k.div_ceil(2) % few.len()])
                    >= top - self.thrift.yaw_lag
            };
            let all = (0..n).filter(|k| is_near_top(*k)).filter_map(|k| {
                let rating = look_up(k, self.settings.n_coarse);
                let yaw = k as f64 * coarse_yaw();
                let first = SampleScore::default();
                self.is_open(&rating).then_some(BaseTrial { x, y, yaw, plane: at, rating, first })
            });
            all.collect()
        };
        fan.fan(places, place).into_iter().flatten().collect()
    }

    /// Places on the plane (x, y in its own coordinates, metres) that have points above it within
    /// the base's radius, row by row.
    fn occupied(&self, plane: &InstallationPlane, local: &Plane, step: f64) -> Vec<(f64, f64)> {
        let to_plane = local.frame().inverse();
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
        // The scans show no points in the middle of a base, so that points around it are counted.
        let r = ((self.radius * SURROUND_SHARE) / step).ceil() as isize;
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
        let place =
            |at: usize| (low[0] + (at % n[0]) as f64 * step, low[1] + (at / n[0]) as f64 * step);
        near.iter().enumerate().filter(|(_, n)| **n >= MIN_CELLS).map(|(at, _)| place(at)).collect()
    }

    /// Refines trials to the finest level in batches, best first. Ends where no other trial can
    /// reach the score of the places that are wanted: a score falls from level to level, as the
    /// tolerance does.
    fn refine_best_first(
        &self,
        local: &[Plane],
        trials: &[BaseTrial],
        level: &SearchLevel,
        fan: &dyn Fan,
    ) -> Vec<BaseTrial> {
        let mut sorted = trials.to_vec();
        sorted.sort_by(|a, b| b.rating.score.total_cmp(&a.rating.score));
        let few = SearchLevel { keep: 2 * FINE_BATCH, quota: FEW_OF_A_PLACE, ..*level };
        let mut known = PlausibleBases::default();
        let (mut climbed, mut rated): (Vec<BaseTrial>, Vec<BaseTrial>) = (Vec::new(), Vec::new());
        for batch in sorted.chunks(FINE_BATCH) {
            let found = self.wanted_places(local, &rated, &mut known);
            let least = found.get(self.n_places().max(1) - 1).map(|p| p[0].rating.score);
            if least.is_some_and(|least| batch[0].rating.score < least) {
                break;
            }
            let of_batch = self.climb_all(local, batch, level, fan);
            rated.extend(self.rate(local, of_batch.clone(), &few, fan));
            climbed.extend(of_batch);
        }
        // All poses of the places that are wanted.
        let found = self.wanted_places(local, &rated, &mut known);
        let at = |t: &BaseTrial| self.pose(&local[t.plane], t.x, t.y, 0.0).translation.vector;
        let radius = self.settings.place_radius;
        let is_wanted = |t: &BaseTrial| found.iter().any(|p| (at(&p[0]) - at(t)).norm() < radius);
        climbed.retain(is_wanted);
        let all = SearchLevel { keep: self.n_places() * self.settings.bases_per_place, ..*level };
        self.rate(local, climbed, &all, fan)
    }

    /// Number of places that are wanted.
    fn n_places(&self) -> usize {
        self.places.unwrap_or(self.settings.max_places * self.n_cells())
    }

    /// The places that are wanted among rated trials in any order.
    fn wanted_places(
        &self,
        local: &[Plane],
        rated: &[BaseTrial],
        known: &mut PlausibleBases,
    ) -> Vec<Vec<BaseTrial>> {
        let mut sorted = rated.to_vec();
        sorted.sort_by(|a, b| b.rating.score.total_cmp(&a.rating.score));
        let mut found = self.places(local, &sorted, known);
        found.truncate(self.n_places());
        found
    }

    fn group(
        &self,
        planes: &[InstallationPlane],
        local: &[Plane],
        trials: &[BaseTrial],
    ) -> Vec<Candidate> {
        let places = self.places(local, trials, &mut PlausibleBases::default());
        let world_from_local = Pose::from_parts(
            Translation3::from(self.region.region.origin.coords),
            UnitQuaternion::identity(),
        );
        let world = self.region.region.world_bounds();
        places
            .iter()
            .map(|place| Candidate {
                model: self.index,
                bounds: world,
                plane: planes[place[0].plane].clone(),
                bases: place
                    .iter()
                    .map(|t| {
                        let pose = self.pose(&local[t.plane], t.x, t.y, t.yaw);
                        (world_from_local * pose, t.rating.score)
                    })
                    .collect(),
            })
            .collect()
    }

    /// Plausible trials by place, best first.
    fn places(
        &self,
        local: &[Plane],
        trials: &[BaseTrial],
        known: &mut PlausibleBases,
    ) -> Vec<Vec<BaseTrial>> {
        let mut places: Vec<Vec<BaseTrial>> = Vec::new();
        for trial in trials.iter().filter(|t| t.rating.score >= self.min_score) {
            let radius = self.settings.place_radius;
            let at = |t: &BaseTrial| self.pose(&local[t.plane], t.x, t.y, 0.0).translation.vector;
            let here = at(trial);
            let same = places.iter().position(|p| (at(&p[0]) - here).norm() < radius);
            match same {
                Some(at) if places[at].len() < self.settings.bases_per_place => {
                    places[at].push(*trial);
                }
                Some(_) => {}
                None if places.len() < self.settings.max_places * self.n_cells() => {
                    places.push(vec![*trial])
                }
                None => {}
            }
        }
        places.iter_mut().for_each(|p| p.sort_by(|a, b| b.rating.score.total_cmp(&a.rating.score)));
        places.retain_mut(|place| self.accept(local, place, known));
        places.sort_by(|a, b| b[0].rating.score.total_cmp(&a[0].rating.score));
        places
    }
}
