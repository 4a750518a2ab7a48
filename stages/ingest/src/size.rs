//! Estimates from samples how far the points of each scan spread, and checks whether that can be a
//! plant in the units that are assumed.

use crate::file::OpenFile;
use crate::sources::Sources;
use crate::units::{LengthUnit, Origin, Units};
use contract::{Error, Input, Result, quote};
use geometry::Aabb;
/// Largest plausible spread of a scan of a plant, metres: halls measure hundreds of metres, as far
/// as scanners reach.
const LARGEST: [f64; 3] = [2_000.0, 2_000.0, 200.0];
/// Smallest plausible spread of a scan, metres: the smallest arms are ten times as large.
const SMALLEST: f64 = 0.02;
/// Largest distance between scans of one plant, metres.
const FARTHEST: f64 = 1.0e5;
/// A cloud smaller than this share of the smallest robot's reach cannot hold the robot.
const SHARE_OF_REACH: f64 = 0.2;
/// Plausible sizes of a robot cell, metres: least and most of its larger side, and of its height.
const CELL: [[f64; 2]; 2] = [[1.5, 500.0], [0.8, 100.0]];
/// Units that are tried on a cloud of implausible size, the most common ones first.
const TRIED: [(&str, f64); 4] = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("km", 1e3)];

impl Sources {
    /// Refuses inputs that cannot show a plant in the units that are assumed: without a given or
    /// declared unit clouds of kilometres, and also clouds of millimetres where a unit was given or
    /// declared.
    ///
    /// # Errors
    /// For the first such input, with the size of its points and how to give the right unit.
    pub fn check_sizes(&self) -> Result<()> {
        self.check_frames()?;
        self.opened().iter().zip(&self.files).try_for_each(|(input, file)| {
            let units = file.reader.units();
            let is_bare = matches!(units.origin, Origin::Format | Origin::Assumed);
            let of = |is_wrong: fn(&[f64; 3]) -> bool| file.sizes().find(is_wrong);
            match (of(is_vast), file.largest()) {
                (Some(size), _) if is_bare => {
                    Err(wrong(input, units, &size, "no plant is this large"))
                }
                (_, Some(size)) if diagonal(&size) < SMALLEST => {
                    Err(wrong(input, units, &size, "no robot cell is this small"))
                }
                _ => Ok(()),
            }
        })
    }

    /// World bounds of most points of the opened inputs, metres, as far as samples tell; empty
    /// where they do not.
    #[must_use]
    pub fn spread(&self) -> Aabb {
        let all = self.files.iter().flat_map(|file| file.spreads.iter().flatten());
        all.fold(Aabb::EMPTY, |all, own| all.union(own))
    }

    /// Refuses scans so far apart that they must be in different frames.
    fn check_frames(&self) -> Result<()> {
        let place = |file: &OpenFile, i: usize| {
            let scan = &self.scans[file.first_scan as usize + i];
            (scan.world_from_scan.translation.vector, &self.inputs[scan.input.0 as usize].path)
        };
        let has_points = |file: &OpenFile, i: &usize| file.spreads[*i].is_some();
        let all = self.files.iter().flat_map(|file| {
            let scans = (0..file.spreads.len()).filter(move |i| has_points(file, i));
            scans.map(move |i| place(file, i))
        });
        let Some((first, of)) = all.clone().next() else { return Ok(()) };
        let far = all.map(|(at, path)| ((at - first).norm(), path));
        let Some((distance, path)) = far.clone().find(|(distance, _)| *distance > FARTHEST) else {
            return Ok(());
        };
        let what = format!(
            "a scan lies {:.0} km from the first one of \"{}\": they are not in one frame",
            distance / 1000.0,
            of.display()
        );
        Err(Error::bad_input(what)
            .at(path.display())
            .hint("bring the scans into one frame, or run them one by one"))
    }

    /// Refuses inputs that are all too small to hold the smallest robot of a library.
    ///
    /// # Errors
    /// For the largest of them, with the size of its points.
    pub fn check_reach(&self, smallest: &str, reach: f64) -> Result<()> {
        let all = self.opened().iter().zip(&self.files);
        let sizes = all.filter_map(|(input, file)| Some((input, file, file.largest()?)));
        let largest = sizes.max_by(|a, b| diagonal(&a.2).total_cmp(&diagonal(&b.2)));
        match largest {
            Some((input, file, size)) if diagonal(&size) < SHARE_OF_REACH * reach => {
                let what =
                    format!("the smallest robot of the library, {smallest}, reaches {reach:.2} m");
                Err(wrong(input, file.reader.units(), &size, &what))
            }
            _ => Ok(()),
        }
    }

    /// Adds warnings about implausible sizes of files that declare their units.
    pub(crate) fn warn_of_sizes(&mut self) {
        let inputs = self.opened().iter().zip(&self.files);
        let said = inputs.flat_map(|(input, file)| {
            let units = file.reader.units();
            let path = input.path.display().to_string();
            let path = quote::shown(&path);
            let vast = file.sizes().find(is_vast);
            let vast = vast.filter(|_| units.origin == Origin::Declared).map(|size| {
                format!(
                    "{path}: points spread over {}, in {units}: no plant is this large",
                    words(&size)
                )
            });
            let remarks = units.remarks.iter().map(|remark| format!("{path}: {remark}"));
            remarks.chain(vast).collect::<Vec<_>>()
        });
        let said: Vec<String> = said.collect();
        self.warnings.extend(said);
    }
}

impl OpenFile {
    /// Spread of the points of each scan along x, y and z, metres.
    fn sizes(&self) -> impl Iterator<Item = [f64; 3]> {
        self.spreads.iter().flatten().map(Aabb::size)
    }

    /// The largest spread of its scans, metres.
    fn largest(&self) -> Option<[f64; 3]> {
        self.sizes().max_by(|a, b| diagonal(a).total_cmp(&diagonal(b)))
    }
}

fn is_vast(size: &[f64; 3]) -> bool {
    size.iter().zip(LARGEST).any(|(side, most)| *side > most)
}

fn diagonal(size: &[f64; 3]) -> f64 {
    size.iter().map(|side| side * side).sum::<f64>().sqrt()
}

fn wrong(input: &Input, units: &Units, size: &[f64; 3], why: &str) -> Error {
    let hint = match likely(units, size) {
        Some(("m", size)) => {
            format!("in metres they spread over {}: give --units m", words(&size))
        }
        Some((unit, size)) => format!(
            "in {unit} they spread over {}: give --units {unit}, or --units m where they are metres all the same",
            words(&size)
        ),
        None => "give the unit with --units (mm, cm, in, ft, us-ft), or --units m where they are metres \
                 all the same"
            .into(),
    };
    let what = format!("the points spread over {}, and {why}; unit: \"{units}\"", words(size));
    Error::bad_input(what).at(input.path.display()).hint(hint)
}

/// The unit in which a cloud has the size of a robot cell, and its size then, metres.
fn likely(units: &Units, size: &[f64; 3]) -> Option<(&'static str, [f64; 3])> {
    let factors = units.factors();
    let of_file: [f64; 3] = std::array::from_fn(|axis| size[axis] / factors[axis]);
    let is_other = |metres: f64| !LengthUnit::new("", metres).is_about(units.horizontal.metres);
    TRIED.into_iter().filter(|(_, metres)| is_other(*metres)).find_map(|(unit, metres)| {
        let size = of_file.map(|side| side * metres);
        let within = |v: f64, [least, most]: [f64; 2]| v >= least && v <= most;
        let is_cell = within(size[0].max(size[1]), CELL[0]) && within(size[2], CELL[1]);
        is_cell.then_some((unit, size))
    })
}

/// Three lengths for people.
fn words(size: &[f64; 3]) -> String {
    let most = size.iter().fold(0.0_f64, |a, b| a.max(*b));
    let (factor, unit) = match most {
        v if v >= 2_000.0 => (1e-3, "km"),
        v if v >= 0.1 => (1.0, "m"),
        _ => (1e3, "mm"),
    };
    let [x, y, z] = size.map(|v| v * factor);
    format!("{x:.1} × {y:.1} × {z:.1} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_that_makes_a_cell_is_named() {
        let in_metres = Units::of_nothing(None).expect("metres");
        for (size, unit) in [
            ([7_200.0, 6_300.0, 3_100.0], Some("mm")),
            ([800.0, 700.0, 400.0], Some("cm")),
            ([40_000.0, 20_000.0, 8_000.0], Some("mm")),
            ([0.008, 0.007, 0.003], Some("km")),
            ([1e9, 1e9, 1e9], None),
            // An aerial survey, which has the size of a cell in no unit.
            ([3_000.0, 4_000.0, 70.0], None),
        ] {
            assert_eq!(likely(&in_metres, &size).map(|(unit, _)| unit), unit, "{size:?}");
        }
        let mm = LengthUnit::new("millimetre", 1e-3);
        let given = Units::of_nothing(Some(&[mm.clone(), mm])).expect("given");
        assert_eq!(likely(&given, &[0.008, 0.007, 0.003]).map(|(unit, _)| unit), Some("m"));
    }
}
