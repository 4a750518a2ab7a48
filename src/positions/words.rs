//! What was found and what was not, in words.

use setups::{FoundRasters, FoundSetups, RasterSetup, Setup};

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

/// The evidence of a setup that was found from points in no order.
pub(super) fn raster_evidence(setup: &RasterSetup) -> String {
    let e = &setup.evidence;
    let [azimuth, elevation] = setup.steps.map(f64::to_degrees);
    let sigmas = e.angle_sigmas.map(|s| s.to_degrees() * 3600.0);
    format!(
        "found without order: {:.0} % of the points lie on a raster of {azimuth:.4}° by {elevation:.4}° \
         (coherence on the floor {:.2} and {:.2}; clearness {:.0} and {:.0} in {} directions, where \
         chance stays below {:.0}), to {:.1}″ and {:.1}″",
        100.0 * e.share,
        e.coherence[0],
        e.coherence[1],
        e.clearness[0],
        e.clearness[1],
        e.n_cells,
        setups::CLEAR_RASTER,
        sigmas[0],
        sigmas[1],
    )
}

/// Why points without order have no setup, or none that a run can use.
pub(super) fn unknown_unordered(in_order: &str, found: &FoundRasters) -> String {
    const UNUSED: &str = "positions were found, but the points are in no order, so that a scanners \
         file cannot name those of each scanner";
    match (found.setups.is_empty(), found.cause) {
        (true, Some(cause)) => format!("{in_order}; {}", cause.words()),
        (true, None) => in_order.to_owned(),
        (false, Some(cause)) => format!("{UNUSED}; {}", cause.words()),
        (false, None) => UNUSED.to_owned(),
    }
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
