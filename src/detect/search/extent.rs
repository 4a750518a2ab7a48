//! How far a search for bases goes, and which of the candidates that it finds are worth a fit.

use contract::{Candidate, InstallationPlane};
use geometry::{Point, Pose};

/// Share of the best score of a base of any model at a place below which another model is not
/// fitted there. Of 30 robots that were found the right model was the best at its place each time.
const MIN_SHARE_OF_PLACE: f64 = 0.6;
/// The same for robots that are not in plain view, where many places are tried.
const MIN_SHARE_OF_GUESS: f64 = 0.75;
/// Most models of one place that are fitted: those whose base scores highest there. Of 15 robots
/// that were trusted with a library of 60 models, among them the right one at other scales, the
/// right model was the best at its place each time.
const MODELS_OF_PLACE: usize = 8;
/// Share of the best score of a base of any model in the neighbourhood below which a base is not
/// looked at more closely than at the coarse level, nor at the middle one.
pub(super) const MIN_SHARE_OF_LEVEL: f64 = 0.6;
/// Factor on the number of base poses where heights are guessed, since each place then occurs at
/// many heights.
pub(super) const GUESS_BREADTH: usize = 8;

/// Distance below which bases are at the same place, metres.
pub(super) const SAME_BASE: f64 = 0.35;

/// How far a search for bases goes.
#[derive(Debug, Clone, Copy)]
pub(super) struct SearchExtent {
    /// Least score of a base.
    pub(super) min_score: f64,
    /// Factor on the number of base poses.
    pub(super) breadth: usize,
    /// Number of places of each model that are wanted; `None`: as many as the region may hold.
    pub(super) places: Option<usize>,
    /// Whether less of the search space is left out.
    pub(super) is_thorough: bool,
    /// Whether models are dropped at places where others score far higher. Of what a depth camera
    /// sees, bases say too little for that.
    pub(super) competes: bool,
}

/// Places that are searched beyond those that are wanted, since some may lie where none is wanted.
pub(super) const SPARE_PLACES: usize = 2;

impl SearchExtent {
    /// The extent of the plain search on some planes. Where there is no floor, a camera may have
    /// taken the points.
    pub(super) fn plain(planes: &[InstallationPlane]) -> Self {
        let is_thorough = planes.iter().all(InstallationPlane::is_guess);
        let competes = !is_thorough;
        Self { min_score: 0.0, breadth: breadth(planes), places: None, is_thorough, competes }
    }
}

/// Factor on the number of base poses for the planes of a region.
pub(super) fn breadth(planes: &[InstallationPlane]) -> usize {
    if planes.iter().all(InstallationPlane::is_guess) { GUESS_BREADTH } else { 1 }
}

/// The candidates of the plain search that no other model at their place leaves far behind, in
/// their order. Where heights are guessed all stay: depth cameras see too little of a base.
pub(super) fn best_of_place(
    candidates: Vec<Candidate>,
    planes: &[InstallationPlane],
) -> Vec<Candidate> {
    if planes.iter().all(InstallationPlane::is_guess) {
        return candidates;
    }
    best_by(candidates, MIN_SHARE_OF_PLACE)
}

/// The candidates of a fallback pass that no other model at their place leaves far behind.
pub(super) fn best_of_guesses(candidates: Vec<Candidate>) -> Vec<Candidate> {
    best_by(candidates, MIN_SHARE_OF_GUESS)
}

/// The candidates that score at least a share of the best one at their place, and are among the
/// few best there, in their order.
fn best_by(candidates: Vec<Candidate>, least: f64) -> Vec<Candidate> {
    let best = |c: &Candidate| (base(&c.bases[0].0), c.bases[0].1);
    let all: Vec<(Point, f64)> = candidates.iter().map(best).collect();
    let is_among_best = |c: &Candidate| {
        let (here, score) = best(c);
        let near = all.iter().filter(|(at, _)| (at - here).norm() < SAME_BASE);
        let better = near.clone().filter(|(_, other)| *other > score);
        let best = near.fold(score, |most, (_, other)| most.max(*other));
        best * least <= score && better.count() < MODELS_OF_PLACE
    };
    candidates.into_iter().filter(is_among_best).collect()
}

/// The place of a base.
pub(super) fn base(world_from_base: &Pose) -> Point {
    world_from_base.translation.vector.into()
}
