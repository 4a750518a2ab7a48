//! The map of the second pass: labels a strip and prepares its records for the clouds, its pixels
//! for the pictures and its voxels for the spaces, so that the writers only copy.

use super::cluster_lookup::ClusterLookup;
use super::known_space::{SpaceGrids, VoxelMark};
use contract::{Label, Map, MaskId, PlaceRun, PointKind, Result, Scan, Strip, Weigh};
use export::{LabelColumns, Pack, Packed, PlanPicture, PointColumns};
use geometry::{Aabb, Point, Pose};
use segment::FloorHeights;
use std::ops::Range;

/// Number of consecutive points with common bounds: neighbours in a scan lie near each other.
const BLOCK: usize = 128;
/// One of so many fixed points near a robot is drawn: a picture has fewer pixels than there are
/// points.
const DRAWN: u64 = 4;

/// The map of the second pass, with everything that it looks up.
pub(crate) struct LabelStrip<'a> {
    /// Labels of points near robots, for each mask, sorted by place.
    pub(crate) near: &'a [Vec<PlaceRun<Label>>],
    pub(crate) ground: &'a FloorHeights,
    pub(crate) scans: &'a [Scan],
    /// Voxel grids of the robots' spaces.
    pub(crate) grids: &'a SpaceGrids,
    /// Bounds that the picture of each robot shows, world frame, metres.
    pub(crate) shown: &'a [Aabb],
    pub(crate) plan: &'a PlanPicture,
    pub(crate) pack: Pack,
    /// Bounds of the records that are written to clouds, world frame, metres; labels outside stay
    /// uncertain. `None` for no bounds.
    pub(crate) cell: Option<Aabb>,
    /// For each scan, the motion from the world frame of the file to that of the plant, where they
    /// differ.
    pub(crate) moved: &'a [Option<Pose>],
    /// Clusters, where each point is to get the number of its cluster.
    pub(crate) bodies: Option<&'a ClusterLookup>,
}

/// A labelled strip.
pub(crate) struct LabelledStrip {
    pub(crate) mask: MaskId,
    /// Place of its first point, as in [`Strip`].
    pub(crate) first_place: u64,
    pub(crate) place: Vec<u32>,
    pub(crate) labels: LabelColumns,
    pub(crate) n_moving: u64,
    pub(crate) packed: Packed,
    pub(crate) spots: Vec<VoxelMark>,
    /// Points that pictures of robots show: index of the robot, position in the world frame
    /// (metres), label.
    pub(crate) shown: Vec<(usize, [f64; 3], Label)>,
}

impl Map for LabelStrip<'_> {
    type In = Strip;
    type Out = LabelledStrip;
    type Scratch = ();

    fn apply(&self, mut strip: Strip, (): &mut ()) -> Result<LabelledStrip> {
        let scan = &self.scans[strip.scan.0 as usize];
        let moved = self.moved.get(strip.scan.0 as usize).and_then(Option::as_ref);
        let world = world(&mut strip, scan, moved);
        let mut labels = self.labels(&strip, &world);
        if let Some(cell) = &self.cell {
            let outside = labels.iter_mut().zip(&world).filter(|(_, p)| !cell.contains(**p));
            outside.for_each(|(label, _)| *label = Label::UNCERTAIN);
        }
        let blocks = blocks(&world);
        let mut points = PointColumns {
            world: &world,
            labels: &labels,
            scan: (strip.scan.0 + 1) as u16,
            ..PointColumns::default()
        };
        if let Some(a) = &strip.attributes {
            points.intensity = &a.intensity;
            points.color = &a.color;
            points.gps_time = &a.gps_time;
            points.source_id = &a.source_id;
        }
        let body = self.bodies.map(|bodies| bodies.of(&world)).unwrap_or_default();
        points.body = &body;
        self.plan.add(&world, &labels);
        Ok(LabelledStrip {
            mask: strip.mask,
            first_place: strip.first_place,
            packed: self.packed(&points).map_err(|e| e.at(format!("scan '{}'", scan.name)))?,
            n_moving: labels.iter().filter(|label| label.moves()).count() as u64,
            spots: self.grids.spots(&world, &labels, &blocks, |i| {
                self.cell.is_none_or(|cell| cell.contains(world[i]))
            }),
            shown: self.shown(&strip, &world, &labels, &blocks),
            labels: LabelColumns::of(&labels),
            place: strip.place,
        })
    }
}

impl LabelStrip<'_> {
    /// Labels of a strip's points: from the list of points near robots, else from their position
    /// alone.
    fn labels(&self, strip: &Strip, world: &[[f64; 3]]) -> Vec<Label> {
        let mut labels: Vec<Label> = world.iter().map(|p| self.ground.label(*p)).collect();
        let near = &self.near[strip.mask.0 as usize];
        let from = near.partition_point(|run| run.end() <= strip.first_place);
        let Some(last) = strip.place.last() else { return labels };
        let end = strip.first_place + u64::from(*last) + 1;
        let mut at = 0;
        for run in near[from..].iter().take_while(|run| run.first < end) {
            let begins = run.first.saturating_sub(strip.first_place) as u32;
            let ends = (run.end().min(end) - strip.first_place) as u32;
            at += strip.place[at..].iter().take_while(|p| **p < begins).count();
            while strip.place.get(at).is_some_and(|p| *p < ends) {
                labels[at] = run.what;
                at += 1;
            }
        }
        labels
    }

    /// Records of the points that lie in the cell and belong to some cloud.
    fn packed(&self, points: &PointColumns<'_>) -> Result<Packed> {
        let is_held = |i: &usize| {
            let is_inside = self.cell.is_none_or(|cell| cell.contains(points.world[*i]));
            is_inside && self.pack.takes(&points.labels[*i])
        };
        let all = 0..points.world.len();
        if all.clone().all(|i| is_held(&i)) {
            return self.pack.pack(points);
        }
        let inside: Vec<usize> = all.filter(is_held).collect();
        fn few<T: Copy>(all: &[T], inside: &[usize]) -> Vec<T> {
            inside.iter().filter_map(|&i| all.get(i).copied()).collect()
        }
        self.pack.pack(&PointColumns {
            world: &few(points.world, &inside),
            labels: &few(points.labels, &inside),
            intensity: &few(points.intensity, &inside),
            color: &few(points.color, &inside),
            gps_time: &few(points.gps_time, &inside),
            body: &few(points.body, &inside),
            source_id: &few(points.source_id, &inside),
            scan: points.scan,
        })
    }

    fn shown(
        &self,
        strip: &Strip,
        world: &[[f64; 3]],
        labels: &[Label],
        blocks: &[(Range<usize>, Aabb)],
    ) -> Vec<(usize, [f64; 3], Label)> {
        let mut out = Vec::new();
        for (robot, bounds) in self.shown.iter().enumerate() {
            for (range, _) in blocks.iter().filter(|(_, own)| own.touches(bounds)) {
                for i in range.clone().filter(|&i| bounds.contains(world[i])) {
                    let stands = matches!(labels[i].kind, PointKind::Fixed | PointKind::Floor);
                    let place = strip.first_place + u64::from(strip.place[i]);
                    if !stands || place.is_multiple_of(DRAWN) {
                        out.push((robot, world[i], labels[i]));
                    }
                }
            }
        }
        out
    }
}

/// Bounds of each [`BLOCK`] of points.
pub(crate) fn blocks(world: &[[f64; 3]]) -> Vec<(Range<usize>, Aabb)> {
    let block = |(i, points): (usize, &[[f64; 3]])| {
        (i * BLOCK..i * BLOCK + points.len(), Aabb::of(points.iter().copied()))
    };
    world.chunks(BLOCK).enumerate().map(block).collect()
}

/// World coordinates of a strip's points, metres: those of the file where it states them, moved by
/// `moved` where that is given.
fn world(strip: &mut Strip, scan: &Scan, moved: Option<&Pose>) -> Vec<[f64; 3]> {
    match &mut strip.attributes {
        Some(a) if a.world.len() == strip.xyz.len() => {
            let stated = std::mem::take(&mut a.world);
            let move_by = |pose: &Pose| {
                stated.iter().map(|p| (pose * Point::from(*p)).coords.into()).collect()
            };
            moved.map(move_by).unwrap_or(stated)
        }
        _ => strip
            .xyz
            .iter()
            .map(|p| (scan.world_from_scan * Point::from(p.map(f64::from))).coords.into())
            .collect(),
    }
}

impl Weigh for LabelledStrip {
    fn weight_bytes(&self) -> usize {
        let (spots, shown) = (size_of_val(&*self.spots), size_of_val(&*self.shown));
        let place = size_of_val(&*self.place);
        place + self.labels.weight_bytes() + self.packed.weight_bytes() + spots + shown
    }

    fn n_points(&self) -> u64 {
        self.place.len() as u64
    }
}
