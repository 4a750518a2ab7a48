//! The world bounds of each scan's points, where finding them takes a second or two. An E57 file
//! states bounds in the frame of the scan; a box of these in the world holds all points, but may be
//! much wider than they are, so that the points are read instead.

use crate::reader::Want;
use crate::sources::Sources;
use contract::{Fan, Format, Input, Result};
use geometry::{Aabb, Point};
use std::collections::BTreeMap;

/// Largest number of points of an input that are read for its bounds; one thread decodes 20 million
/// a second.
const MOST_READ: u64 = 20_000_000;

/// World bounds of scans by scan number, metres, for the inputs that were read. An input that
/// cannot be read is left out here; a run reports its error.
pub(crate) fn read(sources: &Sources, fan: &dyn Fan) -> BTreeMap<u32, Aabb> {
    let is_small = |input: &&Input| sources.n_stated(input.id).is_some_and(|n| n <= MOST_READ);
    let inputs: Vec<&Input> =
        sources.opened().iter().filter(|i| i.format == Format::E57).filter(is_small).collect();
    let found = fan.fan(inputs, |input| of_input(sources, input));
    found.into_iter().filter_map(Result::ok).flatten().collect()
}

fn of_input(sources: &Sources, input: &Input) -> Result<BTreeMap<u32, Aabb>> {
    let mut out: BTreeMap<u32, Aabb> = BTreeMap::new();
    for strip in sources.strips(input.id, Want::Coordinates)? {
        let strip = strip?;
        let Some(scan) = sources.scans.iter().find(|s| s.id == strip.scan) else { continue };
        let bounds = out.entry(scan.id.0).or_insert(Aabb::EMPTY);
        for p in &strip.xyz {
            bounds.add((scan.world_from_scan * Point::from(p.map(f64::from))).coords.into());
        }
    }
    out.retain(|_, bounds| !bounds.is_empty());
    Ok(out)
}
