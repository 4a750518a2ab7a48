//! The search for the base poses of one model in one region, from coarse to fine: candidates
//! grouped by place, best first.
//!
//! The search space is (x, y, yaw) on each plane that has points above it; each level keeps the
//! best poses. From the second level on the first moving link is scored as well, swept over its
//! joint: many boxes have the shape of a base, but few that of a base with a carousel on it.

use contract::{Candidate, Fan, InstallationPlane};
use geometry::{Plane, Pose};
use nalgebra::{Translation3, UnitQuaternion};

use crate::first_link_score::PlausibleBases;
use crate::first_link_stencils::FirstLinkStencils;
use crate::hill_climb::SearchLevel;
use crate::outscored::RatedBases;
use crate::problem::BaseSearch;
use crate::regions::{GUESS_STEP, are_stacked};
use crate::trial::{BaseTrial, SampleScore, Thinning, best, coarse_yaw};

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
        let middle = self.middle_bases(planes, &self.coarse_bases(planes, fan), fan);
        self.refine(planes, &middle, fan)
    }

    /// The coarse level of the search: base poses with their scores.
    #[must_use]
    pub fn coarse_bases(&self, planes: &[InstallationPlane], fan: &dyn Fan) -> RatedBases {
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
        self.placed(&local, trials)
    }

    /// The middle level of the search: the base poses around those of the coarse level on the same
    /// planes.
    #[must_use]
    pub fn middle_bases(
        &self,
        planes: &[InstallationPlane],
        coarse: &RatedBases,
        fan: &dyn Fan,
    ) -> RatedBases {
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
        self.placed(&local, trials)
    }

    /// Refines base poses of the middle level on the same planes, and returns the candidates, one
    /// for each place, best first.
    #[must_use]
    pub fn refine(
        &self,
        planes: &[InstallationPlane],
        middle: &RatedBases,
        fan: &dyn Fan,
    ) -> Vec<Candidate> {
        let local = self.all_local(planes);
        let thrift = self.thrift;
        let (step, yaw_step) = (self.coarse_step(), coarse_yaw());
        let cells = self.breadth * self.n_cells();
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
            true => self.refine_best_first(&local, &middle.trials, &fine, fan),
            false => self.refine_level(&local, &middle.trials, &fine, fan),
        };
        self.group(planes, &local, &trials)
    }

    /// Trials with their places.
    fn placed(&self, local: &[Plane], trials: Vec<BaseTrial>) -> RatedBases {
        let at = |t: &BaseTrial| self.pose(&local[t.plane], t.x, t.y, 0.0).translation.vector;
        let places = trials.iter().map(at).collect();
        RatedBases { trials, places }
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
    pub(crate) fn is_open(&self, rating: &SampleScore) -> bool {
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
    pub(crate) fn coarse_step(&self) -> f64 {
        self.region.whole_cells((self.radius * 0.35).clamp(0.04, 0.10))
    }

    /// Tolerance of the coarse level, metres.
    pub(crate) fn coarse_tolerance(&self) -> f32 {
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
