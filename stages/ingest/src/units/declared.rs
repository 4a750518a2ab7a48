//! What a file declares about the units of its coordinates, before it is interpreted.

use super::known;
use super::length_unit::{LengthUnit, is_same};

/// The kind of a coordinate system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum System {
    /// Not declared.
    #[default]
    Unknown,
    /// Lengths along axes of which the third points upwards.
    Lengths,
    /// Longitude and latitude, degrees.
    Degrees,
    /// Lengths from the centre of the earth, so that no axis points upwards.
    EarthCentred,
}

/// A unit as a file states it: by name, by its length in metres, or both.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct StatedUnit {
    pub(crate) name: Option<String>,
    pub(crate) metres: Option<f64>,
}

/// The declaration of one record of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Declaration {
    pub(crate) system: System,
    /// Unit of x and y.
    pub(crate) horizontal: Option<StatedUnit>,
    /// Unit of z.
    pub(crate) vertical: Option<StatedUnit>,
    /// Name of the record.
    pub(crate) by: &'static str,
    /// Messages about oddities.
    pub(crate) remarks: Vec<String>,
}

/// The interpretation of a stated unit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Sense {
    /// A known unit.
    Unit(LengthUnit),
    /// Name and length contradict each other: the unit of the name, and that of the length.
    Either(LengthUnit, LengthUnit),
    /// An unknown unit, by its name.
    Nothing(String),
}

/// Largest number of characters of a unit's name that are kept.
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
    /// Interprets the statement.
    pub(crate) fn sense(&self) -> Sense {
        let name = self.name.as_deref().unwrap_or_default().trim();
        let cut: String = name.chars().take(LONGEST_NAME).collect();
        let metres = self.metres.filter(|v| v.is_finite() && *v > 0.0);
        match (known::by_name(name), metres) {
            (Some(named), Some(metres)) if is_same(named.metres, metres) => {
                // Where the name leaves it open, the length tells the two kinds of foot apart.
                // Files round the survey foot, and map coordinates are so large that the exact
                // value must be used.
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
