//! What a file declares of its coordinates' units, what its format prescribes and what a person
//! says in; how many metres they are out.

mod choice;
mod declared;
mod geokeys;
mod known;
mod las;
mod projjson;
mod wkt;

#[cfg(test)]
mod tests;

pub(crate) use choice::{Choice, DECLARED};
pub(crate) use declared::Declaration;
pub(crate) use las::read as of_las;
pub(crate) use wkt::read as of_wkt;

use contract::{Error, Kind, Result, quote};
use declared::{Sense, StatedUnit, System, is_same};
use serde::Serialize;
use std::fmt;

/// A unit of length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LengthUnit {
    /// Name for people.
    pub name: String,
    /// Metres of one.
    pub metres: f64,
}

/// Where the units of an input come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// A person gave them.
    Given,
    /// The file declares them.
    Declared,
    /// The format prescribes them.
    Format,
    /// Nothing says anything: metres are assumed.
    Assumed,
}

/// Units that an input's coordinates are read in; what is read of it is in metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Units {
    /// Of x and y.
    pub horizontal: LengthUnit,
    /// Of z.
    pub vertical: LengthUnit,
    /// Where they come from.
    pub origin: Origin,
    /// Which record declares them, where one does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by: Option<&'static str>,
    /// What is odd about what the file says, in words.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// How coordinates whose units are not known can be read all the same.
const WAY_OUT: &str = "give the unit with --units, for example --units m";

impl LengthUnit {
    pub(crate) fn new(name: impl Into<String>, metres: f64) -> Self {
        Self { name: name.into(), metres }
    }

    /// Whether it has about so many metres.
    pub(crate) fn is_about(&self, metres: f64) -> bool {
        is_same(self.metres, metres)
    }
}

impl Units {
    /// Of a file whose records declare this, what counts first; `choice` is what a person gives for
    /// it.
    ///
    /// # Errors
    /// Coordinates that are no lengths, or of which nobody can tell what they are.
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
                remarks.push(format!("its {} names a unit that nobody knows: '{name}'", first.by));
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

    /// Of a file of scans with poses whose format prescribes metres.
    ///
    /// # Errors
    /// As [`Units::of_nothing`].
    pub(crate) fn of_format(choice: Option<&[LengthUnit; 2]>) -> Result<Self> {
        Self::of_scans(choice, Origin::Format)
    }

    /// Of a file of scans with poses that says nothing, and whose format does not either.
    ///
    /// # Errors
    /// Heights in a unit of their own: scans are turned, so that none of their axes is the height.
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

    /// Metres of one unit of x, y and z.
    #[must_use]
    pub fn factors(&self) -> [f64; 3] {
        [self.horizontal.metres, self.horizontal.metres, self.vertical.metres]
    }

    /// Whether coordinates are in metres as they stand in the file.
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

/// The unit of heights. Where its name and its number contradict each other, the one that x and y
/// have as well.
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
            remarks.push(format!("its {by} names a unit of heights that nobody knows: '{name}'"));
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

/// Said where a record that does not count declares another unit.
fn disagreement(declared: &[Declaration], horizontal: Option<&LengthUnit>) -> Option<String> {
    let own = horizontal?;
    let other = declared.iter().skip(1).find_map(|d| match d.horizontal.as_ref()?.sense() {
        Sense::Unit(unit) if !is_same(unit.metres, own.metres) => Some((unit, d.by)),
        _ => None,
    });
    let (unit, by) = other?;
    Some(format!("its {by} declares another unit, which does not count: {unit}"))
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name.as_str() {
            "metre" if is_same(self.metres, 1.0) => write!(f, "metre"),
            name => write!(f, "{} ({} m)", quote::shown(name), (self.metres * 1e9).round() / 1e9),
        }
    }
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
