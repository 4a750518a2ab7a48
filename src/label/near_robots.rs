//! Fits and the tiles near them in; the labels of the points there, by place, and what hangs on
//! each robot out.

use crate::detect::robots::FittedRobots;
use crate::engine::{AllThreads, Amount, Engine, Task};
use crate::store::Store;
use attach::{Attach, AttachedPieces};
use contract::{Floor, Fold, Label, MaskId, PlaceRun, Result, Scan, TileLabels};
use segment::Segment;
use std::ops::Range;

/// The scans in which points near robots are looked for.
pub(crate) struct ScansNearRobots<'a> {
    pub(crate) store: &'a Store,
    pub(crate) floor: &'a Floor,
    pub(crate) scans: &'a [Scan],
    /// Masks of all inputs, also of those without scans here.
    pub(crate) n_masks: usize,
}

/// What is known of points near robots.
pub(crate) struct NearRobots {
    /// Their labels: for each mask, by place.
    pub(crate) labels: Vec<Vec<PlaceRun<Label>>>,
    /// What hangs on each robot.
    pub(crate) hanging: Vec<AttachedPieces>,
}

impl NearRobots {
    /// Segments the tiles near robots, and decides over all scans what hangs on them.
    pub(crate) fn find(
        robots: FittedRobots<'_>,
        scans: &ScansNearRobots<'_>,
        segment: segment::Settings,
        attach: attach::Settings,
        engine: &Engine,
    ) -> Result<Self> {
        let FittedRobots { fits, models } = robots;
        let &ScansNearRobots { store, floor, scans, n_masks } = scans;
        let attach = Attach::new(fits, models, attach);
        let segment = || Segment::new(fits, models, floor, scans, segment, &AllThreads);
        let segment = engine.pool()?.install(segment);
        let regions = segment.regions();
        let mut tiles: Vec<usize> = regions.iter().flat_map(|r| store.touching(r)).collect();
        tiles.sort_unstable();
        tiles.dedup();
        let task = Task::new("segment").of(Amount::items(tiles.len() as u64));
        let mut sum = attach.empty();
        let mut labelled: Vec<TileLabels> = Vec::new();
        let reads = store.reads();
        engine.pass(task, store.picks_again(tiles), |f| {
            f.map(&reads).map(&segment).for_each(|mut tile| {
                attach.add(&mut sum, std::mem::take(&mut tile.voxels))?;
                labelled.push(tile);
                Ok(())
            })
        })?;
        let attached = attach.finish(sum)?;
        let mut labels = vec![Vec::new(); n_masks];
        for tile in labelled {
            labels[tile.mask.0 as usize].extend(tile.settle(|voxel| attached.label(voxel)));
        }
        for own in &mut labels {
            PlaceRun::join(own);
        }
        Ok(Self { labels, hanging: attach::attached_pieces(&attached, fits, models) })
    }

    /// The labels of one mask, for places of which many are neighbours.
    pub(crate) fn of(&self, mask: MaskId) -> NearOf<'_> {
        NearOf { runs: &self.labels[mask.0 as usize], last: 0..0, label: None }
    }
}

/// Labels of points near robots, of one mask.
pub(crate) struct NearOf<'a> {
    runs: &'a [PlaceRun<Label>],
    /// Places that are labelled as the last one that was asked for.
    last: Range<u64>,
    label: Option<Label>,
}

impl NearOf<'_> {
    /// The label of a point near a robot.
    #[inline]
    pub(crate) fn label(&mut self, place: u64) -> Option<Label> {
        if !self.last.contains(&place) {
            self.find(place);
        }
        self.label
    }

    fn find(&mut self, place: u64) {
        let next = self.runs.partition_point(|run| run.end() <= place);
        let before = next.checked_sub(1).map_or(0, |before| self.runs[before].end());
        (self.last, self.label) = match self.runs.get(next) {
            Some(run) if run.first <= place => (run.first..run.end(), Some(run.what)),
            Some(run) => (before..run.first, None),
            None => (before..u64::MAX, None),
        };
    }
}
