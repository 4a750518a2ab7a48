//! Opened inputs in; the units that they are read in, in words and for the result, out; and whether
//! robots of a library can stand in them.

use contract::words::count;
use contract::{Input, Result};
use export::UnitsEntry;
use ingest::{Origin, Sources};
use robot::Library;
use std::path::Path;

/// The units of inputs, in words: one line for all inputs of the same.
pub(crate) fn in_words(sources: &Sources) -> Vec<String> {
    let all = sources.opened().iter().filter_map(|input| sources.units(input.id));
    let all: Vec<String> = all.map(ToString::to_string).collect();
    let mut out: Vec<(&String, usize)> = Vec::new();
    for text in &all {
        match out.iter_mut().find(|(known, _)| *known == text) {
            Some((_, n)) => *n += 1,
            None => out.push((text, 1)),
        }
    }
    out.into_iter().map(|(text, n)| format!("{text}: {}", count(n as u64, "input"))).collect()
}

/// The units of an opened input, for the result.
pub(crate) fn entry(sources: &Sources, input: &Input) -> Option<UnitsEntry> {
    let units = sources.units(input.id)?;
    let origin = match units.origin {
        Origin::Given => "given",
        Origin::Declared => "declared",
        Origin::Format => "format",
        Origin::Assumed => "assumed",
    };
    Some(UnitsEntry { text: units.to_string(), origin: origin.into(), metres: units.factors() })
}

/// Clouds that are larger hold a robot of any library, metres: a fifth of the largest one's reach.
const LARGE_ENOUGH: f64 = 1.0;

/// As [`check_sizes`], of a library that is not loaded yet: it is only where clouds are so small
/// that its robots decide.
pub(crate) fn check_plan(robots: &Path, sources: &Sources) -> Result<()> {
    sources.check_sizes()?;
    let spread = sources.spread();
    let is_small = spread.size().iter().all(|side| *side < LARGE_ENOUGH);
    if spread.is_empty() || !is_small {
        return Ok(());
    }
    check_sizes(&Library::load(robots, &robot::Settings::without_clouds())?, sources)
}

/// Refuses inputs that cannot be of a plant with robots of this library, in the units that they are
/// read in.
pub(crate) fn check_sizes(library: &Library, sources: &Sources) -> Result<()> {
    sources.check_sizes()?;
    let arms = library.models.iter().filter(|model| !model.is_tool());
    let smallest = arms.min_by(|a, b| a.reach().total_cmp(&b.reach()));
    smallest.map_or(Ok(()), |arm| sources.check_reach(&arm.name, arm.reach()))
}
