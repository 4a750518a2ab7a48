//! Scans a random cell in memory and sends the scans through the stages of the main job.

use crate::detect::calibrate::calibrate;
use crate::detect::ground::Ground;
use crate::detect::robots::FittedRobots;
use crate::detect::search::{PreparedLibrary, Search};
use crate::detect::tools;
use crate::engine::{AllThreads, Engine};
use crate::job::{Means, Settings};
use crate::label::near_robots::{NearRobots, ScansNearRobots};
use crate::store::{Scatter, TileSink};
use contract::{
    Fit, InputId, Label, Lattice, Map, MaskId, Region, Result, Scan, ScanId, Strip, Verdict,
};
use geometry::Pose;
use rayon::prelude::*;
use robot::Model;
use simulate::{Scene, SimColumns, Simulator};
use std::path::Path;
use std::time::Instant;

/// A scanned cell with its truth.
#[derive(Default)]
pub(super) struct ScannedCell {
    scans: Vec<Scan>,
    strips: Vec<Strip>,
    /// The true surface of each point of each scan.
    truth: Vec<Vec<Real>>,
    /// For each object of the scene, whether it is a hose.
    hoses: Vec<bool>,
    /// Number of points that truly lie on the robot.
    n_robot_points: usize,
}

/// The true surface of a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Real {
    pub(super) label: Label,
    pub(super) on_hose: bool,
}

/// Results of the search, and its time.
#[derive(Default)]
pub(super) struct FoundInCell {
    pub(super) fits: Vec<Fit>,
    pub(super) n_robot_points: usize,
    /// Seconds from the regions and the store to fits.
    pub(super) seconds: f64,
    /// End points of the refinement from each start.
    pub(super) ends: Vec<Start>,
    /// Labels of points near robots, and true surfaces for each scan.
    pub(super) labels: Option<(NearRobots, Vec<Vec<Real>>)>,
}

/// Base pose in the world frame, and a posture.
pub(super) type Start = (Pose, Vec<f64>);

/// Additional computations besides the search.
#[derive(Debug, Clone, Copy)]
pub(super) enum Then<'a> {
    /// Nothing.
    Nothing,
    /// Only the refinement of the first model, from each of these starts.
    Converge(&'a [Start]),
    /// A further adjustment of the results, from the truth where it is given.
    Adjust(Option<&'a Start>),
}

/// Number of columns that are cast at a time.
const COLUMNS: u32 = 32;

impl ScannedCell {
    /// Scans a scene; `models` are the true models.
    pub(super) fn scan(scene: &Scene, models: &[Model], engine: &Engine) -> Result<Self> {
        let simulator = Simulator::new(scene, models)?;
        let is_hose = |thing: &String| thing.starts_with("hose ");
        let hoses = simulator.truth().objects.iter().map(is_hose).collect();
        let mut cell = Self { hoses, ..Self::default() };
        for k in 0..simulator.n_scans() {
            let frame = simulator.frame(k);
            let step = frame.raster.step().to_radians();
            let (row, col) = (frame.raster.elevation(0), frame.raster.azimuth(0));
            cell.scans.push(Scan {
                id: ScanId(k as u32),
                input: InputId(0),
                mask: MaskId(k as u32),
                name: frame.name.clone(),
                source_id: None,
                places: Vec::new(),
                raster: None,
                scanner: contract::ScannerPosition::Stated,
                world_from_scan: frame.world_from_scan,
                lattice: Some(Lattice::new(step, step, row, col)),
                stated_bounds: None,
                stated_points: None,
                notes: Vec::new(),
            });
            let firsts: Vec<u32> = (0..frame.n_cols).step_by(COLUMNS as usize).collect();
            let columns: Vec<SimColumns> = engine.pool()?.install(|| {
                let cast = |c: u32| simulator.columns(k, c..(c + COLUMNS).min(frame.n_cols));
                firsts.into_par_iter().map(cast).collect()
            });
            cell.truth.push(Vec::new());
            let mut place = 0;
            for c in &columns {
                cell.add(k, c, &mut place);
            }
        }
        Ok(cell)
    }

    fn add(&mut self, scan: usize, columns: &SimColumns, place: &mut u64) {
        let hits: Vec<usize> = (0..columns.len()).filter(|&i| columns.hit[i]).collect();
        let n_robot = hits.iter().filter(|&&i| columns.label[i].robot == 0).count();
        self.n_robot_points += n_robot;
        let on_hose = |i: usize| self.hoses.get(usize::from(columns.object[i])) == Some(&true);
        let real = |&i: &usize| Real { label: columns.label[i], on_hose: on_hose(i) };
        self.truth[scan].extend(hits.iter().map(real));
        self.strips.push(Strip {
            scan: ScanId(scan as u32),
            mask: MaskId(scan as u32),
            first_place: *place,
            place: (0..hits.len() as u32).collect(),
            xyz: hits.iter().map(|&i| columns.xyz[i].map(|v| v as f32)).collect(),
            attributes: None,
        });
        *place += hits.len() as u64;
    }

    /// Sends the scans through the stages of the main job, from the store on, with the models of
    /// the library.
    pub(super) fn search(
        self,
        library: &PreparedLibrary<'_>,
        then: Then<'_>,
        dir: &Path,
        settings: &Settings,
        means: &Means,
        engine: &Engine,
    ) -> Result<FoundInCell> {
        let scans = &self.scans;
        let scatter = Scatter::new(scans);
        let mut sink = TileSink::create(dir, scans, 0, means.ingest_bytes())?;
        for strip in self.strips {
            sink.add(&scatter.apply(strip, &mut ())?)?;
        }
        let store = sink.finish(engine, means.store_bytes())?;
        let names = library.models().iter().map(|m| m.name.as_str()).collect();
        engine.pool()?.install(|| library.prepare(&names, &AllThreads));
        let ground = Ground::of_tiles(scans, &store, settings, engine)?;
        let clusters =
            cluster::split(&ground.surfaces.occupancy, &ground.surfaces.floor, &settings.cluster);
        let regions = base_search::regions(&clusters, &settings.region);
        let search = Search::new(library, scans, &store, &ground, settings).over(&regions);
        if let Then::Converge(starts) = then {
            let here = starts.first().and_then(|start| nearest(&regions, &start.0));
            let ends = here.map_or(Ok(Vec::new()), |region| search.converge(region, 0, starts))?;
            let n_robot_points = self.n_robot_points;
            return Ok(FoundInCell { ends, n_robot_points, ..FoundInCell::default() });
        }
        let started = Instant::now();
        let fits = engine.fan_out("fit", regions.clone(), |region| search.region(&region))?;
        let mut models = library.models().to_vec();
        let mut fits = fit::choose(fits.into_iter().flatten().collect(), &models, |_| false);
        fits = tools::attach_tools(fits, &mut models, &search, engine)?;
        if settings.fit.calibrate {
            fits = calibrate(fits, &mut models, &search, engine)?;
        }
        if let Then::Adjust(from) = then {
            fits = adjusted(&fits, from, &search, &regions, &models)?;
        }
        let seconds = started.elapsed().as_secs_f64();
        let (floor, n_masks) = (&ground.surfaces.floor, scans.len());
        let seen = ScansNearRobots { store: &store, floor, clusters: &clusters, scans, n_masks };
        let robots = FittedRobots { fits: &fits, models: &models };
        let near = NearRobots::find(robots, &seen, settings.segment, settings.attach, engine)?;
        let n_robot_points = self.n_robot_points;
        let labels = Some((near, self.truth));
        Ok(FoundInCell { fits, n_robot_points, seconds, labels, ..FoundInCell::default() })
    }
}

/// The region whose middle is nearest to a base.
fn nearest<'r>(regions: &'r [Region], world_from_base: &Pose) -> Option<&'r Region> {
    let apart = |r: &Region| (r.origin.coords - world_from_base.translation.vector).norm();
    regions.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))
}

/// Fits after a further adjustment, from their own ends or from a start of the first robot, as far
/// as it converges.
fn adjusted(
    fits: &[Fit],
    from: Option<&Start>,
    search: &Search<'_, '_>,
    regions: &[Region],
    models: &[Model],
) -> Result<Vec<Fit>> {
    let mut out = Vec::new();
    for fit in fits.iter().filter(|fit| fit.verdict != Verdict::Refused) {
        let mut before = fit.clone();
        if let Some((world_from_base, posture)) = from {
            before.world_from_base = *world_from_base;
            before.joints.iter_mut().zip(posture).for_each(|(joint, q)| joint.value = *q);
        }
        if let Some(region) = nearest(regions, &before.world_from_base) {
            out.extend(search.again(region, &before, &models[fit.model])?);
        }
        // The truth is one robot's.
        if from.is_some() {
            break;
        }
    }
    Ok(out)
}
