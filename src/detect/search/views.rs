//! A region in, what each scan saw of it out: reads the tiles that the region's views need, no more
//! points of them than a fit can use.

use super::Search;
use crate::engine::AllThreads;
use contract::{Region, Result, Scan, View};
use lattice::{ViewBuilder, ViewSettings};
use rayon::prelude::*;

/// Points of a region beyond which more of them tell a fit nothing new: a robot has a hundredth of
/// that in its adjustment. Up to four times as many are kept.
const ENOUGH_POINTS: u64 = 3_000_000;
/// Beams farther apart than this at a region, metres, say nothing of use about a robot's posture.
const MAX_SPACING: f64 = 0.05;

impl Search<'_, '_> {
    /// What each scan sees of the region, those that see something.
    pub(super) fn views(&self, region: &Region) -> Result<Vec<View>> {
        let thin = self.thin(region);
        let mut views = self.seen(region, Some(thin), &self.settings.view)?;
        lattice::agree(&mut views, &AllThreads);
        Ok(views)
    }

    /// The same as the beams say it, none of them doubted, as fine as asked for; without points.
    pub(crate) fn images(&self, region: &Region, settings: &ViewSettings) -> Result<Vec<View>> {
        self.seen(region, None, settings)
    }

    fn seen(
        &self,
        region: &Region,
        thin: Option<u32>,
        settings: &ViewSettings,
    ) -> Result<Vec<View>> {
        let scans = self.scans.par_iter();
        scans.filter_map(|scan| self.view(scan, region, thin, settings).transpose()).collect()
    }

    /// How much of the points of a region may be skipped: as much as leaves [`ENOUGH_POINTS`].
    fn thin(&self, region: &Region) -> u32 {
        let touching = self.store.touching(&region.world_bounds());
        let n_points: u64 = touching.iter().map(|&i| self.store.entries()[i].n_points).sum();
        (0..).find(|thin| n_points >> (2 * (thin + 1)) < ENOUGH_POINTS).unwrap_or(0)
    }

    /// One scan's view of the region; `None` where it sees nothing of it.
    fn view(
        &self,
        scan: &Scan,
        region: &Region,
        thin: Option<u32>,
        settings: &ViewSettings,
    ) -> Result<Option<View>> {
        let extent = self.ground.extents[scan.id.0 as usize];
        if extent.is_none() {
            return Ok(None);
        }
        if let Some(lattice) = &scan.lattice {
            let near = distance(scan, region);
            if near * lattice.row_step.max(lattice.col_step) > MAX_SPACING {
                return Ok(None);
            }
        }
        let mut builder = ViewBuilder::new(scan, region, extent, thin, settings);
        let entries = self.store.entries().iter().enumerate();
        let wanted: Vec<usize> =
            entries.filter(|(_, entry)| builder.wants(entry.at)).map(|(i, _)| i).collect();
        self.store.look_at(&wanted, builder.skip(), |tile| builder.add(tile))?;
        let view = builder.finish();
        Ok((!view.points.is_empty() || !view.images.is_empty()).then_some(view))
    }
}

/// Distance from a scan's scanner to the nearest point of a region, metres.
fn distance(scan: &Scan, region: &Region) -> f64 {
    let scanner = scan.world_from_scan.translation.vector - region.origin.coords;
    (0..3)
        .map(|i| {
            (region.bounds.min[i] - scanner[i])
                .max(scanner[i] - region.bounds.max[i])
                .max(0.0)
                .powi(2)
        })
        .sum::<f64>()
        .sqrt()
}
