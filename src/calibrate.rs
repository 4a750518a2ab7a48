//! Fits in; the same with the places of their joints estimated, and the models so corrected, out: for robots that their
//! models fit poorly, where it is asked for.

use crate::engine::{AllThreads, Engine};
use crate::search::Search;
use contract::{Fit, Region, Result, Verdict};
use fit::Prepared;
use robot::Model;

/// The fits, each of its own model, which are added to `models`.
pub(crate) fn calibrate(
    fits: Vec<Fit>,
    models: &mut Vec<Model>,
    (search, regions): (&Search<'_>, &[Region]),
    engine: &Engine,
) -> Result<Vec<Fit>> {
    let known: &[Model] = models;
    let done = engine.fan_out("calibrate", fits, |fit| {
        if fit.verdict == Verdict::Refused {
            return Ok((fit, None));
        }
        let found = search.with_scene(&fit, regions, |scene, settings| {
            let prepared = Prepared::new(fit.model, &known[fit.model]);
            fit::calibrate(&fit, &prepared, scene, settings, &AllThreads)
        })?;
        Ok(found.map_or((fit, None), |(model, fit)| (fit, Some(model))))
    })?;
    let mut out = Vec::with_capacity(done.len());
    for (mut fit, model) in done {
        if let Some(model) = model {
            fit.model = models.len();
            models.push(model);
        }
        out.push(fit);
    }
    Ok(out)
}
