//! States in words where else a joint may stand that the points do not determine.

use contract::words::Unit;
use contract::{Certainty, Fit};
use geometry::angle;

use super::thresholds::KNOWN_SIGMA;

/// Standard deviation from which on the values that are named are but some of those that a joint
/// may have, radians (30°).
const ANYWHERE: f64 = 0.52;
/// Most values of a joint that are named.
const MAX_VALUES: usize = 3;

/// What follows the standard deviation of joint `j` in a sentence: other values that it may have,
/// degrees or millimetres. Empty where there are none.
pub(super) fn elsewhere(fit: &Fit, j: usize, slides: bool) -> String {
    let (joint, unit) = (&fit.joints[j], Unit::of(slides));
    let apart = |a: f64, b: f64| angle::apart(a, b) > KNOWN_SIGMA;
    let mut values: Vec<f64> = Vec::new();
    let equals = fit.equals.iter().filter_map(|equal| equal.posture.get(j).copied());
    for value in equals.filter(|v| apart(*v, joint.value)) {
        if values.len() < MAX_VALUES && values.iter().all(|v| apart(*v, value)) {
            values.push(value);
        }
    }
    let others: Vec<String> = values.iter().map(|v| unit.say(*v, 1)).collect();
    let others = others.join(", ");
    match joint.certainty {
        _ if !values.is_empty() && !slides && joint.sigma > ANYWHERE => {
            format!(": it may as well stand at {others} or elsewhere")
        }
        _ if !values.is_empty() => format!(": it may as well stand at {others}"),
        // Its standard deviation is that of one of several answers.
        Certainty::Undetermined if joint.sigma < KNOWN_SIGMA => {
            ": another posture explains the points nearly as well".into()
        }
        _ => String::new(),
    }
}
