//! Determines the units of a file's coordinates from what the user gives, what the file declares
//! and what its format prescribes, in this order.

mod choice;
mod declared;
mod geokeys;
mod known;
mod las;
mod length_unit;
mod projjson;
mod system;
mod wkt;

#[cfg(test)]
mod tests;

pub(crate) use choice::{Choice, DECLARED};
pub(crate) use declared::Declaration;
pub(crate) use las::read as of_las;
pub use length_unit::LengthUnit;
pub use system::ReferenceSystem;
pub(crate) use system::read as system_of_las;
pub(crate) use wkt::read as of_wkt;

use contract::{Error, Kind, Result, quote};
use declared::{Sense, StatedUnit, System};
use length_unit::is_same;
use serde::Serialize;
use std::fmt;

/// Source of the units of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// The user gave them.
    Given,
    /// The file declares them.
    Declared,
    /// The format prescribes them.
    Format,
    /// Nothing declares a unit; metres are assumed.
    Assumed,
}

/// The units of an input's coordinates in the file; points are returned in metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Units {
    /// Unit of x and y.
    pub horizontal: LengthUnit,
    /// Unit of z.
    pub vertical: LengthUnit,
    /// Source of the units.
    pub origin: Origin,
    /// Name of the record that declares them, if one does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by: Option<&'static str>,
    /// Messages about oddities in the declaration.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// Advice for files whose units cannot be determined.
const WAY_OUT: &str = "give the unit with --units, for example --units m";

impl Units {
    /// The units of a file with these declarations, the decisive one first; `choice` is what the
    /// user gave for the file.
    ///
    /// # Errors
    /// If the coordinates are no lengths, or if their unit cannot be determined.
    pub(crate) fn of(declared: &[Declaration], choice: Option<&[LengthUnit; 2]>) -> Result<Self> {
        if let Some([horizontal, vertical]) = choice {
            return Ok(Self::plain(horizontal.clone(), vertical.clone(), Origin::Given));
        }
        let Some(first) = declared.first() else { return Ok(Self::assumed()) };
        let place = |e: Error| e.at(first.by).hint(WAY_OUT);
        refuse_angles(first.system).map_err(place)?;
        let mut remarks = first.remarks.clone();
        let horizontal = match first.horizontal.as_ref().map(StatedUnit::sense) {
            Some(Sense::Unit(unit)) => Some(unit),
            Some(Sense::Either(name, number)) => {
                return Err(place(contradiction(&name, &number)));
            }
            Some(Sense::Nothing(name)) => {
                let name = quote::shown(&name);
                remarks.push(format!("its {} names a unit that is not known: '{name}'", first.by));
                None
            }
            None => None,
        };
        let vertical = declared.iter().find_map(|d| d.vertical.as_ref().map(|v| (v.sense(), d.by)));
        let vertical = heights(vertical, horizontal.as_ref(), &mut remarks).map_err(place)?;
        remarks.extend(disagreement(declared, horizontal.as_ref()));
        Ok(match (horizontal, vertical) {
            (Some(horizontal), vertical) => Self {
                vertical: vertical.unwrap_or_else(|| horizontal.clone()),
                horizontal,
                origin: Origin::Declared,
                by: Some(first.by),
                remarks,
            },
            (None, Some(vertical)) if !is_same(vertical.metres, 1.0) => {
                let what = "the unit of heights is declared, that of x and y is not";
                return Err(place(Error::new(Kind::BadInput, format!("{what}: \"{vertical}\""))));
            }
            (None, _) => Self { remarks, ..Self::assumed() },
        })
    }

    /// The units of a file of scans with poses, whose format prescribes metres.
    ///
    /// # Errors
    /// As [`Units::of_nothing`].
    pub(crate) fn of_format(choice: Option<&[LengthUnit; 2]>) -> Result<Self> {
        Self::of_scans(choice, Origin::Format)
    }

    /// The units of a file of scans with poses, where neither file nor format states a unit.
    ///
    /// # Errors
    /// If heights are given a unit of their own: scans are rotated, so that no axis is the height.
    pub(crate) fn of_nothing(choice: Option<&[LengthUnit; 2]>) -> Result<Self> {
        Self::of_scans(choice, Origin::Assumed)
    }

    fn of_scans(choice: Option<&[LengthUnit; 2]>, origin: Origin) -> Result<Self> {
        match choice {
            None => Ok(Self { origin, ..Self::assumed() }),
            Some([all, heights]) if all == heights => {
                Ok(Self::plain(all.clone(), all.clone(), Origin::Given))
            }
            Some([all, heights]) => {
                let what = "scans with poses have one unit for all axes, not two";
                Err(Error::new(
                    Kind::Usage,
                    format!("{what}: \"{} and {}\"", all.name, heights.name),
                )
                .hint("a unit for heights alone is for LAS and LAZ"))
            }
        }
    }

    fn assumed() -> Self {
        let metre = || LengthUnit::new("metre", 1.0);
        Self::plain(metre(), metre(), Origin::Assumed)
    }

    fn plain(horizontal: LengthUnit, vertical: LengthUnit, origin: Origin) -> Self {
        Self { horizontal, vertical, origin, by: None, remarks: Vec::new() }
    }

    /// Metres per unit of x, y and z.
    #[must_use]
    pub fn factors(&self) -> [f64; 3] {
        [self.horizontal.metres, self.horizontal.metres, self.vertical.metres]
    }

    /// Whether the coordinates in the file are in metres already.
    #[must_use]
    pub fn is_metres(&self) -> bool {
        self.factors() == [1.0; 3]
    }
}

fn refuse_angles(system: System) -> Result<()> {
    let what = match system {
        System::Lengths | System::Unknown => return Ok(()),
        System::Degrees => {
            "coordinates are declared as longitude and latitude: robots are measured in lengths"
        }
        System::EarthCentred => {
            "coordinates are declared as counted from the earth's middle: no axis of them points up"
        }
    };
    Err(Error::new(Kind::Unsupported, what))
}

/// The unit of heights. Where its name and its length contradict each other, the one that x and y
/// also have counts.
fn heights(
    stated: Option<(Sense, &'static str)>,
    horizontal: Option<&LengthUnit>,
    remarks: &mut Vec<String>,
) -> Result<Option<LengthUnit>> {
    Ok(match stated {
        None => {
            if let Some(unit) = horizontal.filter(|unit| !is_same(unit.metres, 1.0)) {
                remarks.push(format!(
                    "the unit of heights is not declared: {} as x and y",
                    quote::shown(&unit.name)
                ));
            }
            None
        }
        Some((Sense::Unit(unit), _)) => Some(unit),
        Some((Sense::Nothing(name), by)) => {
            let name = quote::shown(&name);
            remarks.push(format!("its {by} names a unit of heights that is not known: '{name}'"));
            None
        }
        Some((Sense::Either(name, number), by)) => {
            let is_it =
                |unit: &&LengthUnit| horizontal.is_some_and(|h| is_same(h.metres, unit.metres));
            let unit = [&name, &number].into_iter().find(is_it);
            let unit = unit.ok_or_else(|| contradiction(&name, &number))?;
            remarks.push(format!(
                "the unit of heights contradicts itself in its {by} ({}, but {} m of one): {} as x and y",
                name.name, number.metres, unit.metres
            ));
            horizontal.cloned()
        }
    })
}

fn contradiction(name: &LengthUnit, number: &LengthUnit) -> Error {
    let what = "the unit contradicts itself: its name and its number of metres differ";
    Error::bad_input(format!("{what}, \"{}, {}\"", name.name, number.metres))
}

/// The message where a record that does not count declares another unit.
fn disagreement(declared: &[Declaration], horizontal: Option<&LengthUnit>) -> Option<String> {
    let own = horizontal?;
    let other = declared.iter().skip(1).find_map(|d| match d.horizontal.as_ref()?.sense() {
        Sense::Unit(unit) if !is_same(unit.metres, own.metres) => Some((unit, d.by)),
        _ => None,
    });
    let (unit, by) = other?;
    Some(format!("its {by} declares another unit, which does not count: {unit}"))
}

impl fmt::Display for Units {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.horizontal)?;
        if self.vertical != self.horizontal {
            write!(f, ", heights {}", self.vertical)?;
        }
        match (self.origin, self.by) {
            (Origin::Given, _) => write!(f, ", given with --units"),
            (Origin::Declared, by) => write!(f, ", declared by its {}", by.unwrap_or("records")),
            (Origin::Format, _) => write!(f, ", as the format prescribes"),
            (Origin::Assumed, _) => write!(f, ", assumed: nothing declares a unit"),
        }
    }
}
