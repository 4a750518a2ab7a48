//! Open inputs in; the bounds of the points of each scan out, where that takes a second or two. An
//! E57 file states bounds in the frame of the scan: turned into the world they hold all points, but
//! may be much wider.

use crate::reader::Want;
use crate::sources::Sources;
use contract::{Fan, Format, Input, Result};
use geometry::{Aabb, Point};
use std::collections::BTreeMap;

/// Most points of an input that are read for its bounds: one thread decodes 20 million a second.
const MOST_READ: u64 = 20_000_000;

/// Bounds of scans in the world, metres, by their number: those of inputs that were read. An input
/// that cannot be read has none; a run says why.
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
