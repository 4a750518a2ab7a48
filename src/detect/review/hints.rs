//! Searches for robots that a review expects: a place and a model are enough, and a posture whose
//! base is not known is looked for with the yaw and the height of the base open.

use super::{Decision, Review, ReviewPlace, by_rank};
use crate::detect::search::Search;
use crate::detect::search::hint::RobotHint;
use crate::engine::{Engine, Task};
use contract::{Fit, Result, Verdict};
use geometry::Point;

impl Review {
    /// Puts a fit in the place of all that stand where an entry says.
    pub(super) fn replace(&self, fits: &mut Vec<Fit>, entry: usize, fit: Fit) {
        fits.retain(|f| !self.places[entry].has(f));
        fits.push(fit);
    }

    /// Searches around the places of entries that name a model: of those without joints, where no
    /// robot of the model is trusted, and of those in `open`, whose posture was not found on the
    /// base that was assumed, with the yaw and the height of the base open. Returns the entries
    /// whose posture the scans contradict.
    pub(super) fn search_for(
        &self,
        fits: &mut Vec<Fit>,
        open: Vec<(usize, Fit)>,
        search: &Search<'_, '_>,
        engine: &Engine,
    ) -> Result<Vec<usize>> {
        let (open, mut wrong): (Vec<_>, Vec<_>) =
            open.into_iter().partition(|(k, _)| self.places[*k].rpy.is_none());
        let hint = |place: &ReviewPlace, model: usize, posture: Option<Vec<f64>>| RobotHint {
            model,
            at: Point::from(place.at),
            radius: place.radius,
            posture,
        };
        let models = search.library().models();
        let unknown = self.places.iter().enumerate().filter_map(|(k, place)| {
            let model = models.iter().position(|m| Some(&m.name) == place.model.as_ref())?;
            let is_there =
                |f: &Fit| f.model == model && place.has(f) && f.verdict == Verdict::Trusted;
            let is_asked = place.joints.is_empty() && place.verdict != Some(Decision::Reject);
            (is_asked && !fits.iter().any(is_there)).then(|| (k, hint(place, model, None)))
        });
        let unknown: Vec<(usize, RobotHint)> = unknown.collect();
        let posture = |fit: &Fit| Some(fit.joints.iter().map(|joint| joint.value).collect());
        let known =
            open.iter().map(|(k, fit)| (*k, hint(&self.places[*k], fit.model, posture(fit))));
        let hints: Vec<(usize, RobotHint)> = unknown.into_iter().chain(known).collect();
        let task = Task::new("hints").large();
        let found =
            engine.fan_out(task, hints.iter().collect(), |(_, hint)| search.hinted(hint))?;
        for ((k, hint), found) in hints.iter().zip(found) {
            if hint.posture.is_none() {
                fits.extend(found);
            } else if let Some(best) = found.into_iter().max_by(by_rank) {
                self.replace(fits, *k, best);
            } else {
                wrong.push((*k, Fit::default()));
            }
        }
        let mut wrong: Vec<usize> = wrong.into_iter().map(|(k, _)| k).collect();
        wrong.sort_unstable();
        Ok(wrong)
    }
}
