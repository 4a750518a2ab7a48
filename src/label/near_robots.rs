//! Labels of points near the fitted robots, sorted by place, and the bodies that are attached to
//! each robot.

use crate::cache::Cache;
use crate::detect::robots::FittedRobots;
use crate::engine::{AllThreads, Amount, Engine, Task};
use crate::store::Store;
use attach::{Attach, AttachedPieces};
use contract::{
    Cluster, Error, Floor, Fold, InputId, Kind, Label, Mask, MaskId, PlaceRun, Result, Scan,
    TileLabels,
};
use segment::Segment;
use std::ops::Range;

/// Scans, robots and settings with which points near robots are labelled.
pub(crate) struct ScansNearRobots<'a> {
    pub(crate) store: &'a Store,
    pub(crate) floor: &'a Floor,
    /// Clusters of the whole plant, along which hoses are followed.
    pub(crate) clusters: &'a [Cluster],
    pub(crate) scans: &'a [Scan],
    /// Number of masks of all inputs, including inputs without scans here.
    pub(crate) n_masks: usize,
}

/// Name of the piece with the bodies that are attached to robots.
const HANGING: &str = "hanging";

/// Name of the piece with the labels of an input.
fn piece(input: InputId) -> String {
    format!("near {}", input.0)
}

/// Labels of points near robots, and attached bodies.
pub(crate) struct NearRobots {
    /// Labels for each mask, sorted by place.
    pub(crate) labels: Vec<Vec<PlaceRun<Label>>>,
    /// Bodies that are attached to each robot.
    pub(crate) hanging: Vec<AttachedPieces>,
}

impl NearRobots {
    /// Segments the tiles near robots, and decides over all scans which bodies are attached to
    /// them.
    pub(crate) fn find(
        robots: FittedRobots<'_>,
        scans: &ScansNearRobots<'_>,
        segment: segment::Settings,
        attach: attach::Settings,
        engine: &Engine,
    ) -> Result<Self> {
        let FittedRobots { fits, models } = robots;
        let &ScansNearRobots { store, floor, clusters, scans, n_masks } = scans;
        let attach = Attach::new(fits, models, attach);
        let segment =
            || Segment::new(fits, models, floor, scans, segment, &AllThreads).following(clusters);
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

    /// Stores the labels as pieces, one for each input, and the bodies as the last one.
    pub(crate) fn keep(&self, kept: &Cache, masks: &[Mask]) -> Result<()> {
        let mut rest = masks.iter().zip(&self.labels).peekable();
        while let Some((first, _)) = rest.peek().copied() {
            let mut own = Vec::new();
            while let Some((_, runs)) = rest.next_if(|(mask, _)| mask.input == first.input) {
                own.push(runs);
            }
            kept.keep(&piece(first.input), &own)?;
        }
        kept.keep(HANGING, &self.hanging)
    }

    /// Whether all pieces are stored.
    pub(crate) fn is_kept(kept: &Cache) -> bool {
        kept.has(HANGING)
    }

    /// The stored labels of the masks of one input, or of all, and the bodies.
    ///
    /// # Errors
    /// A piece that is missing or damaged.
    pub(crate) fn kept(kept: &Cache, masks: &[Mask], of: Option<InputId>) -> Result<Self> {
        let lost = || {
            Error::new(Kind::Io, "a piece with labels near robots is missing or damaged")
                .hint("start the job again")
        };
        let mut labels: Vec<Vec<PlaceRun<Label>>> = vec![Vec::new(); masks.len()];
        let is_wanted = |mask: &&Mask| of.is_none_or(|input| mask.input == input);
        let mut at = 0;
        while let Some(first) = masks[at..].iter().find(is_wanted) {
            at = masks.partition_point(|mask| mask.input < first.input);
            let own: Vec<_> = kept.get(&piece(first.input)).ok_or_else(lost)?;
            for runs in own {
                *labels.get_mut(at).ok_or_else(lost)? = runs;
                at += 1;
            }
            at = at.max(masks.partition_point(|mask| mask.input <= first.input));
        }
        Ok(Self { labels, hanging: kept.get(HANGING).ok_or_else(lost)? })
    }

    /// Look-up of the labels of one mask, fast for neighbouring places.
    pub(crate) fn of(&self, mask: MaskId) -> NearOf<'_> {
        NearOf { runs: &self.labels[mask.0 as usize], last: 0..0, label: None }
    }
}

/// Look-up of labels of points near robots in one mask.
pub(crate) struct NearOf<'a> {
    runs: &'a [PlaceRun<Label>],
    /// Places with the same label as the last one that was looked up.
    last: Range<u64>,
    label: Option<Label>,
}

impl NearOf<'_> {
    /// The label of a place; `None` where its point is near no robot.
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
