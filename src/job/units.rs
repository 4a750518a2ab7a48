//! Units of opened inputs: as messages for people, as entries of the result, and checks whether
//! robots of the library fit into clouds of that size.

use contract::words::count;
use contract::{Input, Result};
use export::UnitsEntry;
use ingest::{Origin, Sources};
use robot::Library;
use std::path::Path;

/// Messages that name the units of all inputs: one line for all inputs with the same units.
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

/// The units of an opened input, as an entry of the result.
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

/// Extent above which a cloud is large enough for any robot library, metres: a fifth of the reach
/// of the largest robot.
const LARGE_ENOUGH: f64 = 1.0;

/// Like [`check_sizes`], for a library that is not loaded yet. It is loaded only where a cloud is
/// so small that the size of its robots matters.
pub(crate) fn check_plan(robots: &Path, sources: &Sources) -> Result<()> {
    sources.check_sizes()?;
    let spread = sources.spread();
    let is_small = spread.size().iter().all(|side| *side < LARGE_ENOUGH);
    if spread.is_empty() || !is_small {
        return Ok(());
    }
    check_sizes(&Library::load(robots, &robot::Settings::without_clouds())?, sources)
}

/// Refuses inputs that, in the units that they are read in, are too small or too large for a plant
/// with robots of this library.
pub(crate) fn check_sizes(library: &Library, sources: &Sources) -> Result<()> {
    sources.check_sizes()?;
    let arms = library.models.iter().filter(|model| !model.is_tool());
    let smallest = arms.min_by(|a, b| a.reach().total_cmp(&b.reach()));
    smallest.map_or(Ok(()), |arm| sources.check_reach(&arm.name, arm.reach()))
}
