//! What a file says of its coordinates' units, before anybody judges it.

use super::{LengthUnit, known};

/// What kind of numbers coordinates are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum System {
    /// Nothing says it.
    #[default]
    Unknown,
    /// Lengths along axes of which the third points up.
    Lengths,
    /// Longitude and latitude.
    Degrees,
    /// Lengths from the middle of the earth: no axis points up.
    EarthCentred,
}

/// A unit as a file states it: by name, by its metres, or both.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct StatedUnit {
    pub(crate) name: Option<String>,
    pub(crate) metres: Option<f64>,
}

/// What one record of a file declares.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Declaration {
    pub(crate) system: System,
    /// Of x and y.
    pub(crate) horizontal: Option<StatedUnit>,
    /// Of z.
    pub(crate) vertical: Option<StatedUnit>,
    /// Which record says it.
    pub(crate) by: &'static str,
    /// What is odd about it, in words.
    pub(crate) remarks: Vec<String>,
}

/// What a stated unit comes to.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Sense {
    /// A unit.
    Unit(LengthUnit),
    /// Its name and its number of metres are of different units: that of the name, and that of the
    /// number.
    Either(LengthUnit, LengthUnit),
    /// Nobody knows what it is.
    Nothing(String),
}

/// Units whose lengths differ by less are the same but for rounding, or the two kinds of foot
/// (2e-6).
const SAME: f64 = 1e-3;

/// Characters of a unit's name that are kept: nobody's unit has more.
const LONGEST_NAME: usize = 60;

impl Declaration {
    pub(crate) fn new(by: &'static str) -> Self {
        Self { by, ..Self::default() }
    }
}

impl From<LengthUnit> for StatedUnit {
    fn from(unit: LengthUnit) -> Self {
        Self { name: Some(unit.name), metres: Some(unit.metres) }
    }
}

impl StatedUnit {
    /// What unit it is.
    pub(crate) fn sense(&self) -> Sense {
        let name = self.name.as_deref().unwrap_or_default().trim();
        let cut: String = name.chars().take(LONGEST_NAME).collect();
        let metres = self.metres.filter(|v| v.is_finite() && *v > 0.0);
        match (known::by_name(name), metres) {
            (Some(named), Some(metres)) if is_same(named.metres, metres) => {
                // The number tells the two kinds of foot apart where the name does not. Files round
                // that of the survey foot, which a map's coordinates are too large
                // for.
                let is_survey = (metres / known::US_FOOT - 1.0).abs() < 1e-9;
                Sense::Unit(if is_survey {
                    LengthUnit::new("US survey foot", known::US_FOOT)
                } else {
                    LengthUnit::new(named.name, metres)
                })
            }
            (Some(named), Some(metres)) => Sense::Either(named, LengthUnit::new("unit", metres)),
            (Some(named), None) => Sense::Unit(named),
            (None, Some(metres)) => Sense::Unit(LengthUnit::new(
                if cut.is_empty() { "unit".into() } else { cut },
                metres,
            )),
            (None, None) => Sense::Nothing(cut),
        }
    }
}

/// Whether two units are one, in metres.
pub(crate) fn is_same(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < SAME
}
