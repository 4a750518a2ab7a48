//! What was found and what was not, in words.

use setups::{FoundSetups, Setup};

/// The evidence of a setup.
pub(super) fn evidence(setup: &Setup) -> String {
    let e = &setup.evidence;
    format!(
        "{} columns share its axis; elevations of {} points lie on one comb of {:.4}° (coherence {:.2} in {} directions), to {:.1}″",
        e.n_planes,
        e.n_points,
        setup.comb[1].to_degrees(),
        e.coherence,
        e.n_cells,
        e.elevation_sigma.to_degrees() * 3600.0,
    )
}

/// Why there is no setup, or none for some points, or why those found cannot be used.
pub(super) fn unknown(found: &FoundSetups, is_alone: bool, n_usable: usize) -> Option<String> {
    const NAME: &str =
        "several inputs have its name, so that no scanners file can mean it: rename the files";
    const MIXED: &str = "it is open which points are those of which scanner, or a position is too uncertain; a \
         merged file of another format can be used if it is written as LAS in its order";
    if !found.setups.is_empty() && !is_alone {
        return Some(NAME.to_owned());
    }
    if n_usable < found.setups.len() {
        return Some(MIXED.to_owned());
    }
    found.cause.map(|cause| cause.words().to_owned())
}
