//! The joints of a robot's entry for people: value, standard deviation and certainty.

use crate::result::RobotEntry;
use contract::words::Unit;
use contract::{Certainty, DETERMINED_SIGMA};

/// A joint of a robot's entry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointWords<'a> {
    /// Name in the URDF.
    pub name: &'a str,
    /// Value, radians or metres.
    pub value: f64,
    /// Standard deviation in the same unit.
    pub sigma: f64,
    /// How well the points determine it.
    pub certainty: Certainty,
    /// Unit in which it is shown.
    pub unit: Unit,
}

impl JointWords<'_> {
    /// Value, standard deviation, and a word unless it is determined: `57.483° ± 0.060° coarse`.
    #[must_use]
    pub fn say(&self) -> String {
        self.unit.say_both(self.value, self.sigma) + self.certainty.note()
    }
}

impl RobotEntry {
    /// The joints in the order of the model.
    pub fn posture(&self) -> impl Iterator<Item = JointWords<'_>> {
        self.joints.0.iter().map(|(name, value)| {
            let sigma = of(&self.sigma.0, name).unwrap_or(f64::NAN);
            // Results of earlier versions say only whether a joint is determined.
            let has_others =
                || of(&self.determined.0, name) == Some(false) && sigma < DETERMINED_SIGMA;
            let guess = || Certainty::of(sigma, has_others(), DETERMINED_SIGMA);
            let certainty = of(&self.certainty.0, name).unwrap_or_else(guess);
            let unit = Unit::of(self.slides.contains(name));
            JointWords { name, value: *value, sigma, certainty, unit }
        })
    }
}

/// The value with that name.
fn of<T: Copy>(places: &[(String, T)], name: &str) -> Option<T> {
    places.iter().find(|(n, _)| n == name).map(|(_, value)| *value)
}
