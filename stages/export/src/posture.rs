//! The entry of a robot in; its joints as people read them, each with its standard deviation and
//! how well it is known, out.

use crate::result::RobotEntry;
use contract::words::Unit;
use contract::{Certainty, DETERMINED_SIGMA};

/// A joint of an entry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointWords<'a> {
    /// As in the URDF.
    pub name: &'a str,
    /// Radians or metres.
    pub value: f64,
    /// Standard deviation, same unit.
    pub sigma: f64,
    /// How well it is known.
    pub certainty: Certainty,
    /// What people read it in.
    pub unit: Unit,
}

impl JointWords<'_> {
    /// Value, standard deviation, and a word where it is not determined: `57.483° ± 0.060° coarse`.
    #[must_use]
    pub fn say(&self) -> String {
        self.unit.say_both(self.value, self.sigma) + self.certainty.note()
    }
}

impl RobotEntry {
    /// Its joints, in the order of the model.
    pub fn posture(&self) -> impl Iterator<Item = JointWords<'_>> {
        self.joints.0.iter().map(|(name, value)| {
            let sigma = of(&self.sigma.0, name).unwrap_or(f64::NAN);
            // Results of earlier versions say whether the points determine a joint, and no more.
            let has_others =
                || of(&self.determined.0, name) == Some(false) && sigma < DETERMINED_SIGMA;
            let guess = || Certainty::of(sigma, has_others(), DETERMINED_SIGMA);
            let certainty = of(&self.certainty.0, name).unwrap_or_else(guess);
            let unit = Unit::of(self.slides.contains(name));
            JointWords { name, value: *value, sigma, certainty, unit }
        })
    }
}

/// What is known of the thing with that name.
fn of<T: Copy>(places: &[(String, T)], name: &str) -> Option<T> {
    places.iter().find(|(n, _)| n == name).map(|(_, value)| *value)
}
