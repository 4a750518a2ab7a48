//! What models of a library have to do with one another: at a place where one model's base and
//! first link score far higher than another's, the other one is not looked at more closely.

use geometry::Vector;
use std::collections::HashMap;

use crate::trial::BaseTrial;

/// Radius of the neighbourhood in which bases of different models compete, metres: a base may be
/// found beside its middle.
const NEIGHBOURHOOD: f64 = 0.35;

/// Base poses of one model at a level of a search.
#[derive(Debug, Default)]
pub struct RatedBases {
    pub(crate) trials: Vec<BaseTrial>,
    /// Where each of them stands; region frame, metres.
    pub(crate) places: Vec<Vector>,
}

/// Drops the bases of each model that score less than a share of the best one of any model in the
/// neighbourhood.
#[must_use]
pub fn drop_outscored(models: Vec<RatedBases>, least_share: f64) -> Vec<RatedBases> {
    let mut cells: HashMap<[i32; 3], Vec<(Vector, f64)>> = HashMap::new();
    for own in &models {
        for (at, trial) in own.places.iter().zip(&own.trials) {
            cells.entry(cell(at)).or_default().push((*at, trial.rating.score));
        }
    }
    // Of the bases of one cell only a few are the best of anywhere, and these come first.
    cells.values_mut().for_each(|all| all.sort_by(|a, b| b.1.total_cmp(&a.1)));
    let best = |here: &Vector| {
        let mut best = 0.0_f64;
        let [i, j, k] = cell(here);
        for n in 0..27 {
            let at = [i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1];
            let near = cells.get(&at).into_iter().flatten();
            let near = near.take_while(|(_, score)| *score > best);
            let found = near.into_iter().find(|(at, _)| (at - here).norm() < NEIGHBOURHOOD);
            best = found.map_or(best, |(_, score)| *score);
        }
        best
    };
    let kept = |own: &RatedBases| {
        let kept = own.places.iter().zip(&own.trials);
        let kept = kept.filter(|(at, trial)| trial.rating.score >= least_share * best(at));
        let (places, trials) = kept.map(|(at, trial)| (*at, *trial)).unzip();
        RatedBases { trials, places }
    };
    models.iter().map(kept).collect()
}

fn cell(at: &Vector) -> [i32; 3] {
    [0, 1, 2].map(|i| (at[i] / NEIGHBOURHOOD).floor() as i32)
}
