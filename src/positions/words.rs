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

/// Why points without order have no setup, or none for some points, or why not all that were found
/// can be used: `open` says whether the file is one of which points can be told apart by rasters.
pub(super) fn unknown_unordered(
    in_order: &str,
    found: &FoundRasters,
    open: Option<bool>,
) -> Option<String> {
    const OPEN: &str = "positions were found, but it is open which points are those of which \
         scanner, or a position is too uncertain";
    const FORMAT: &str = "positions were found, but only points of LAS and LAZ files can be told \
         apart without their order: write the file as LAS";
    let cause = found.cause.map(|cause| cause.words().to_owned());
    if found.setups.is_empty() {
        let all = [Some(in_order.to_owned()), cause].into_iter().flatten();
        return Some(all.filter(|cause| !cause.is_empty()).collect::<Vec<_>>().join("; "));
    }
    let open = open.map(|is_las| if is_las { OPEN } else { FORMAT }.to_owned());
    let all: Vec<String> = open.into_iter().chain(cause).collect();
    (!all.is_empty()).then(|| all.join("; "))
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
