//! Fits in; the label of every point out, in the order of its file, written as masks, clouds and pictures.
//!
//! Tiles near robots are segmented and what hangs on the robots is decided over all scans; that leaves a sorted list of
//! labels by place. Then each input is streamed once more: a point's label is that of the list, or else that of its
//! place alone (floor or fixed).

use crate::engine::{Engine, Task};
use crate::job::{Room, Settings};
use crate::store::Store;
use contract::{
    Fit, Floor, Fold, InputId, Label, Map, Result, Scan, Space, SpaceGrid, Strip, TileLabels, Weigh,
};
use export::{
    Clouds, CloudsSettings, LasPoint, LasSettings, PlanPicture, Quantum, RobotPicture, SpaceEntry,
    Written, write_space,
};
use geometry::{Aabb, Point};
use ingest::{Sources, Want};
use merge::{Attach, Hanging};
use robot::Model;
use segment::{Ground, Segment};

use crate::masks::Masks;
use crate::spaces::{Spot, poses, spots};

/// What labelling reads.
pub(crate) struct Labelling<'a> {
    fits: &'a [Fit],
    models: &'a [Model],
    sources: &'a Sources,
    segment: Segment,
    attach: Attach,
    /// World bounds of each scan's points, metres.
    bounds: Vec<Aabb>,
}

/// What is known of points near robots.
pub(crate) struct Near {
    /// Their labels: for each mask, by place.
    labels: Vec<Vec<(u64, Label)>>,
    /// What hangs on each robot.
    hanging: Vec<Hanging>,
}

/// What was written.
pub(crate) struct Done {
    pub(crate) clouds: Written,
    /// For each mask: entries, points that were dropped, and points by kind (fixed, link, attachment, floor,
    /// uncertain).
    pub(crate) masks: Vec<MaskCount>,
    /// Pictures, relative to the output folder.
    pub(crate) pictures: Vec<String>,
    /// What is known of the space around each robot.
    pub(crate) spaces: Vec<Option<SpaceEntry>>,
}

/// Counts of one mask.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MaskCount {
    pub(crate) n_points: u64,
    pub(crate) n_dropped: u64,
    pub(crate) n_moving: u64,
}

impl<'a> Labelling<'a> {
    pub(crate) fn new(
        fits: &'a [Fit],
        models: &'a [Model],
        sources: &'a Sources,
        (store, floor): (&Store, &Floor),
        settings: &Settings,
    ) -> Self {
        let segment = Segment::new(fits, models, floor, &sources.scans, settings.segment);
        let attach = Attach::new(fits, models, settings.merge);
        let mut bounds = vec![Aabb::EMPTY; sources.scans.len()];
        for entry in store.entries() {
            let scan = &mut bounds[entry.at.scan.0 as usize];
            *scan = scan.union(&entry.bounds);
        }
        Self { fits, models, sources, segment, attach, bounds }
    }

    /// Segments the tiles near robots, and decides over all scans what hangs on them.
    pub(crate) fn near_robots(&self, store: &Store, engine: &Engine) -> Result<Near> {
        let regions = self.segment.regions();
        let mut tiles: Vec<usize> = regions.iter().flat_map(|r| store.touching(r)).collect();
        tiles.sort_unstable();
        tiles.dedup();
        let task = Task::new("segment").of(crate::progress::Amount::items(tiles.len() as u64));
        let mut sum = self.attach.empty();
        let mut labelled: Vec<TileLabels> = Vec::new();
        engine.pass(task, store.tiles_of(tiles), |f| {
            f.map(&self.segment).for_each(|mut tile| {
                self.attach.add(&mut sum, std::mem::take(&mut tile.voxels))?;
                labelled.push(tile);
                Ok(())
            })
        })?;
        let attached = self.attach.finish(sum)?;
        let mut near = vec![Vec::new(); self.sources.masks.len()];
        for tile in labelled {
            near[tile.mask.0 as usize].extend(tile.settle(|voxel| attached.label(voxel)));
        }
        for labels in &mut near {
            labels.sort_unstable_by_key(|entry: &(u64, Label)| entry.0);
        }
        Ok(Near { labels: near, hanging: merge::hang(&attached, self.fits, self.models) })
    }

    /// Streams every input once more and writes its labels.
    pub(crate) fn write(
        &self,
        (near, mut spaces): (&Near, Vec<Option<Space>>),
        room: &Room,
        engine: &Engine,
    ) -> Result<Done> {
        let out = room.next();
        let mut las = LasSettings::new(self.quantum());
        las.with_color = self.sources.has_color();
        let mut clouds = Clouds::create(out, CloudsSettings::new(las))?;
        let mut masks = Masks::new(out, &self.sources.masks);
        let mut robots: Vec<RobotPicture> = self.robot_pictures();
        let mut pictures = Vec::new();
        let grids: Vec<_> =
            spaces.iter().map(|s| s.as_ref().map(|s| (*s.grid(), s.grid().bounds()))).collect();
        let label = LabelStrip {
            near,
            ground: self.segment.ground(),
            scans: &self.sources.scans,
            grids: &grids,
        };
        for input in &self.sources.inputs {
            let mut plan = PlanPicture::new(&self.bounds_of(input.id));
            let task = Task::new("write").of(crate::report::amount(self.sources, input.id));
            let strips = self.sources.strips(input.id, Want::Everything)?;
            engine.pass(task, strips, |f| {
                f.map(&label).for_each(|strip| {
                    masks.add(&strip.strip, &strip.labels)?;
                    for (space, voxel, kind) in &strip.spots {
                        spaces[*space].iter_mut().for_each(|s| s.mark(*voxel, *kind));
                    }
                    for (i, label) in strip.labels.iter().enumerate() {
                        let point = las_point(&strip.strip, i, strip.world[i]);
                        clouds.push(&point.labelled(*label), label.kind)?;
                        plan.add(strip.world[i], *label);
                        robots.iter_mut().for_each(|r| r.add(strip.world[i], *label));
                    }
                    Ok(())
                })
            })?;
            pictures.push(self.draw_plan(&plan, input.id, out)?);
        }
        let masks = masks.finish()?;
        let mut said = vec![None; self.fits.len()];
        for (i, fit) in self.fits.iter().enumerate() {
            export::write_robot(out, i, fit, &self.models[fit.model], &near.hanging[i])?;
            if let Some(space) = &spaces[i] {
                said[i] = Some(write_space(out, i, space)?);
            }
        }
        for (i, picture) in robots.iter().enumerate() {
            let fit = &self.fits[i];
            let name = format!("pictures/R{}.png", i + 1);
            let title = format!("R{} {} {}", i + 1, fit.model_name, fit.verdict.word());
            picture.draw(&title).write(&out.join(&name))?;
            let evidence = format!("pictures/R{}_evidence.png", i + 1);
            let page = export::draw_evidence(&title, picture, fit, &self.models[fit.model]);
            page.write(&out.join(&evidence))?;
            pictures.extend([name, evidence]);
        }
        Ok(Done { clouds: clouds.finish()?, masks, pictures, spaces: said })
    }

    /// Scale and offset of the clouds: those of the first LAS input, so that its coordinates stay what they are.
    fn quantum(&self) -> Quantum {
        let all = self.bounds.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
        let of_input = self.sources.las_quantum();
        of_input.map_or_else(|| Quantum::around(&all), |(scale, offset)| Quantum { scale, offset })
    }

    fn robot_pictures(&self) -> Vec<RobotPicture> {
        self.fits
            .iter()
            .enumerate()
            .map(|(i, fit)| {
                let model = &self.models[fit.model];
                RobotPicture::new(i as i16, model, &poses(fit, model))
            })
            .collect()
    }

    fn draw_plan(
        &self,
        plan: &PlanPicture,
        input: InputId,
        out: &std::path::Path,
    ) -> Result<String> {
        let robots: Vec<_> = self
            .fits
            .iter()
            .enumerate()
            .map(|(i, f)| {
                let p = f.world_from_base.translation.vector;
                (format!("R{}", i + 1), [p.x, p.y])
            })
            .collect();
        let scanners: Vec<_> = self
            .sources
            .scans
            .iter()
            .filter(|s| s.input == input && s.has_beams())
            .map(|s| {
                (s.name.clone(), [s.world_from_scan.translation.x, s.world_from_scan.translation.y])
            })
            .collect();
        let path = &self.sources.inputs[input.0 as usize].path;
        let title = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let name = format!("pictures/plan_{}.png", input.0);
        plan.draw(&title, &robots, &scanners).write(&out.join(&name))?;
        Ok(name)
    }

    fn bounds_of(&self, input: InputId) -> Aabb {
        let own = self.sources.scans.iter().zip(&self.bounds).filter(|(s, _)| s.input == input);
        own.fold(Aabb::EMPTY, |all, (_, bounds)| all.union(bounds))
    }
}

/// The map of the second pass.
struct LabelStrip<'a> {
    near: &'a Near,
    ground: &'a Ground,
    scans: &'a [Scan],
    grids: &'a [Option<(SpaceGrid, Aabb)>],
}

/// A strip with its labels and world coordinates.
struct Labelled {
    strip: Strip,
    labels: Vec<Label>,
    world: Vec<[f64; 3]>,
    spots: Vec<Spot>,
}

impl Map for LabelStrip<'_> {
    type In = Strip;
    type Out = Labelled;
    type Scratch = ();

    fn apply(&self, strip: Strip, (): &mut ()) -> Result<Labelled> {
        let world = world(&strip, &self.scans[strip.scan.0 as usize]);
        let near = &self.near.labels[strip.mask.0 as usize];
        let mut at = near.partition_point(|entry| entry.0 < strip.first_place);
        let mut labels = Vec::with_capacity(strip.len());
        for (place, p) in strip.place.iter().zip(&world) {
            let place = strip.first_place + u64::from(*place);
            while near.get(at).is_some_and(|entry| entry.0 < place) {
                at += 1;
            }
            labels.push(match near.get(at) {
                Some(entry) if entry.0 == place => entry.1,
                _ => self.ground.label(*p),
            });
        }
        let spots = spots(self.grids, &world, &labels);
        Ok(Labelled { strip, labels, world, spots })
    }
}

/// World coordinates of a strip's points: those of the file where it states them.
fn world(strip: &Strip, scan: &Scan) -> Vec<[f64; 3]> {
    match &strip.attributes {
        Some(a) if a.world.len() == strip.len() => a.world.clone(),
        _ => strip
            .xyz
            .iter()
            .map(|p| (scan.world_from_scan * Point::from(p.map(f64::from))).coords.into())
            .collect(),
    }
}

fn las_point(strip: &Strip, i: usize, xyz: [f64; 3]) -> LasPoint {
    let mut point = LasPoint { xyz, source_id: (strip.scan.0 + 1) as u16, ..LasPoint::default() };
    if let Some(a) = &strip.attributes {
        point.intensity = a.intensity.get(i).copied().unwrap_or_default();
        point.color = a.color.get(i).copied().unwrap_or_default();
        point.gps_time = a.gps_time.get(i).copied().unwrap_or_default();
        point.source_id = a.source_id.get(i).copied().unwrap_or(point.source_id);
    }
    point
}

impl Weigh for Labelled {
    fn weight_bytes(&self) -> usize {
        let (labels, spots) = (size_of_val(&*self.labels), size_of_val(&*self.spots));
        self.strip.weight_bytes() + labels + spots + self.world.len() * 24
    }

    fn n_points(&self) -> u64 {
        self.strip.len() as u64
    }
}
