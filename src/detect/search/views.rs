//! Builds the views of a region: for each scan, depth image and points of the region, from those
//! tiles and levels that a fit needs.

use super::Search;
use crate::engine::AllThreads;
use contract::{Region, Result, Scan, View};
use lattice::{ViewBuilder, ViewSettings};
use rayon::prelude::*;

/// Number of points of a region beyond which more do not improve a fit: the adjustment of a robot
/// uses a hundredth of it. Up to four times as many are kept.
const ENOUGH_POINTS: u64 = 3_000_000;
/// Distance of neighbouring beams at a region beyond which a scan tells too little about a posture,
/// metres.
const MAX_SPACING: f64 = 0.05;

impl Search<'_, '_> {
    /// Views of all scans that see part of the region.
    pub(super) fn views(&self, region: &Region) -> Result<Vec<View>> {
        let thin = self.thin(region);
        let mut views = self.seen(region, Some(thin), &self.settings.view)?;
        lattice::agree(&mut views, &AllThreads);
        Ok(views)
    }

    /// Depth images of all scans that see part of the region, at the resolution of `settings`,
    /// without points and without doubted beams.
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

    /// The `skip` of tiles that leaves about [`ENOUGH_POINTS`] points of a region (see
    /// [`skip`](contract::Tile::skip)).
    fn thin(&self, region: &Region) -> u32 {
        let touching = self.store.touching(&region.world_bounds());
        let n_points: u64 = touching.iter().map(|&i| self.store.entries()[i].n_points).sum();
        (0..).find(|thin| n_points >> (2 * (thin + 1)) < ENOUGH_POINTS).unwrap_or(0)
    }

    /// The view of one scan; `None` where it sees nothing of the region.
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

/// Distance from the scanner to the nearest point of a region, metres.
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
