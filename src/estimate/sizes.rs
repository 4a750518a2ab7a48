//! Sizes by which memory and disk are estimated.

use contract::Input;
use ingest::Sources;

/// Size of a point in the store, with its share of catalogue and checksums, bytes.
pub(super) const STORE_BYTES: u64 = 18;
/// Size of a point's labels (kind, robot, link), bytes.
pub(super) const LABEL_BYTES: u64 = 5;
/// Memory of the program with an open library, bytes.
pub(super) const PROGRAM_BYTES: u64 = 160 << 20;
/// Memory of each loaded model, bytes.
pub(super) const MODEL_BYTES: u64 = 24 << 20;
/// Memory of each point until the budget is full, bytes.
pub(super) const POINT_BYTES: u64 = 40;
/// Memory of each scan while a robot is searched, independent of the budget, bytes: a billion
/// points of 20 scans took 0.8 GiB with 512 MiB allowed.
pub(super) const SCAN_BYTES: u64 = 28 << 20;
/// Most scans that see one place.
pub(super) const SCANS: u64 = 24;
/// Estimated size of a point in a text file, bytes.
const TEXT_BYTES: u64 = 45;

/// Number of points of an input: as it states, else from its length.
pub(super) fn points(sources: &Sources, input: &Input) -> u64 {
    let scans = sources.scans.iter().filter(|s| s.input == input.id);
    let in_scans: Option<u64> = scans.map(|s| s.stated_points).sum();
    sources.n_stated(input.id).or(in_scans).unwrap_or(input.n_bytes / TEXT_BYTES)
}

/// Number of points of all inputs, as [`points`].
pub(crate) fn all_points(sources: &Sources) -> u64 {
    sources.inputs.iter().fold(0, |sum, input| sum.saturating_add(points(sources, input)))
}
