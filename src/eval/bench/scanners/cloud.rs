//! Draws the points of a hall with the errors of real scanners, and puts them in the orders in
//! which clouds reach people.

use super::row::DrawnScanners;
use crate::engine::Engine;
use contract::{Error, Label, Result};
use export::{LasSettings, LasWriter, PointColumns, Quantum};
use geometry::{Pose, Vector};
use nalgebra::Point3;
use simulate::random::Random;
use simulate::scene::{BeamRaster, RegistrationError, Scanner};
use simulate::{Plant, Scene, Simulator, plant};
use std::path::{Path, PathBuf};

/// The order of a cloud's points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// As measured, with a source id for each scan.
    Ids,
    /// As measured, without ids.
    Merged,
    /// The same, compressed.
    Compressed,
    /// By tiles of 5 m, as measured within each, with ids.
    TilesWithIds,
    /// The same without ids.
    Tiles,
    /// As measured, three of ten points, without ids.
    Thinned,
    /// None.
    Shuffled,
    /// None, so many percent of the points.
    Random(u8),
    /// One point of each voxel of so many millimetres, by voxels.
    Voxels(u8),
    /// The centroid of each voxel of so many millimetres, by voxels.
    Centroids(u8),
    /// None, with so many arc seconds of jitter and no ripple.
    Jitter(u8),
    /// None, with so many arc seconds of ripple.
    Ripple(u8),
    /// Of a scanner that is carried along.
    Carried,
}

impl Order {
    pub(super) const ALL: [Self; 20] = [
        Self::Ids,
        Self::Merged,
        Self::Compressed,
        Self::TilesWithIds,
        Self::Tiles,
        Self::Thinned,
        Self::Shuffled,
        Self::Random(10),
        Self::Random(30),
        Self::Voxels(5),
        Self::Voxels(10),
        Self::Voxels(20),
        Self::Centroids(5),
        Self::Centroids(10),
        Self::Centroids(20),
        Self::Jitter(5),
        Self::Jitter(10),
        Self::Jitter(20),
        Self::Ripple(8),
        Self::Carried,
    ];

    pub(super) fn word(self) -> String {
        let word = match self {
            Self::Ids => "with ids",
            Self::Merged => "without ids",
            Self::Compressed => "without ids, LAZ",
            Self::TilesWithIds => "5 m tiles with ids",
            Self::Tiles => "5 m tiles without ids",
            Self::Thinned => "30 % kept without ids",
            Self::Shuffled => "shuffled",
            Self::Carried => "carried scanner",
            Self::Random(share) => return format!("shuffled, {share} % kept"),
            Self::Voxels(edge) => return format!("one point a voxel of {edge} mm"),
            Self::Centroids(edge) => return format!("centroids of voxels of {edge} mm"),
            Self::Jitter(size) => return format!("shuffled, {size}″ jitter"),
            Self::Ripple(size) => return format!("shuffled, {size}″ ripple"),
        };
        word.to_owned()
    }
}

/// Points with the scans that they are of.
#[derive(Debug, Clone, Default)]
pub(super) struct DrawnCloud {
    pub(super) points: Vec<[f64; 3]>,
    /// Number of the true scan of each point.
    pub(super) scan: Vec<u16>,
    /// Source id of each point in the file.
    pub(super) ids: Vec<u16>,
    /// Where the scanners stood, in the frame of the points.
    pub(super) scanners: Vec<[f64; 3]>,
    pub(super) drawn: DrawnScanners,
}

/// Profiles of a carried scanner.
const N_PROFILES: usize = 500;
/// Edge of a tile, metres.
const TILE: f64 = 5.0;

impl DrawnCloud {
    /// A hall of a seed, with a number of setups within bounds and at most so many beams.
    pub(super) fn drawn(
        seed: u64,
        [least, most]: [usize; 2],
        n_beams: f64,
        order: Option<Order>,
        engine: &Engine,
    ) -> Result<Self> {
        let mut random = Random::keyed(&[seed, 0x5CA]);
        let n_setups = least + random.below(most - least + 1);
        // A scanner sends beams over 360° by 130°.
        let finest = (360.0 * 130.0 * n_setups as f64 / n_beams).sqrt();
        let mut drawn = DrawnScanners {
            n_setups,
            step_deg: random.between(0.08, 0.25).max(finest),
            noise_mm: random.between(1.0, 3.0),
            jitter_arcsec: [5.0, 10.0, 20.0][random.below(3)],
            ripple_arcsec: random.between(0.0, 8.0),
            dropouts: random.between(0.0, 0.1),
            quantum: [1e-4, 1e-4, 1e-3][random.below(3)],
        };
        match order {
            Some(Order::Jitter(size)) => {
                (drawn.jitter_arcsec, drawn.ripple_arcsec) = (f64::from(size), 0.0);
            }
            Some(Order::Ripple(size)) => drawn.ripple_arcsec = f64::from(size),
            _ => {}
        }
        let mut scene = plant(&of_hall(seed, n_setups, drawn.step_deg), &[])?;
        for scanner in &mut scene.scanners {
            scanner.noise = drawn.noise_mm * 1e-3;
            scanner.dropouts = drawn.dropouts;
            let tilt = random.normals().map(|v| 1.2 * v);
            (scanner.rpy_deg[0], scanner.rpy_deg[1]) = (tilt[0], tilt[1]);
            scanner.registration = RegistrationError::drawn([0.003, 0.05], &mut random);
        }
        let mut cloud = Self { drawn, ..Self::default() };
        cloud.scan(&scene, seed, engine)?;
        Ok(cloud)
    }

    /// The hall of a seed, measured by a scanner that is carried along.
    pub(super) fn carried(seed: u64, engine: &Engine) -> Result<Self> {
        let mut random = Random::keyed(&[seed, 0xCA4]);
        let step_deg = random.between(0.15, 0.3);
        let mut scene = plant(&of_hall(seed, 1, step_deg), &[])?;
        let first = scene.scanners.first().cloned().unwrap_or_default();
        let (speed, bend) = (random.between(0.002, 0.03), random.between(-1.5, 1.5));
        let mut yaw = random.between(0.0, 360.0);
        let mut at = first.position;
        scene.scanners.clear();
        for k in 0..N_PROFILES {
            // Beams are sent across the way.
            at[0] -= speed * yaw.to_radians().cos();
            at[1] -= speed * yaw.to_radians().sin();
            yaw += bend;
            let azimuth_deg = [90.0, 90.0 + step_deg];
            scene.scanners.push(Scanner {
                name: format!("profile {k}"),
                position: [at[0], at[1], at[2] + 0.02 * (0.05 * k as f64).sin()],
                rpy_deg: [
                    0.5 * random.normals()[0],
                    0.5 * random.normals()[0],
                    yaw.rem_euclid(360.0) - 180.0,
                ],
                raster: BeamRaster { azimuth_deg, step_deg, ..first.raster.clone() },
                ..first.clone()
            });
        }
        let mut cloud = Self::default();
        cloud.drawn.quantum = 1e-4;
        cloud.drawn.jitter_arcsec = 10.0;
        cloud.scan(&scene, seed, engine)?;
        cloud.scanners.clear();
        Ok(cloud)
    }

    /// Adds the points of all scans, with errors of the stored angles.
    fn scan(&mut self, scene: &Scene, seed: u64, engine: &Engine) -> Result<()> {
        const COLUMNS: u32 = 64;
        let simulator = Simulator::new(scene, &[])?;
        for i in 0..simulator.n_scans() {
            let frame = simulator.frame(i);
            let firsts: Vec<u32> = (0..frame.n_cols).step_by(COLUMNS as usize).collect();
            let pose = frame.world_from_scan;
            let errors = AngleErrors::drawn(&self.drawn, seed, i);
            let parts = engine.each(firsts, |first| {
                let seen = simulator.columns(i, first..(first + COLUMNS).min(frame.n_cols));
                let mut random = Random::keyed(&[seed, i as u64, u64::from(first), 0xE44]);
                let hits = (0..seen.len()).filter(|&k| seen.hit[k]);
                Ok(hits.map(|k| errors.world(&pose, seen.xyz[k], &mut random)).collect::<Vec<_>>())
            })?;
            for part in parts {
                self.scan.extend(vec![i as u16; part.len()]);
                self.points.extend(part);
            }
            self.scanners.push(pose.translation.vector.into());
        }
        self.ids = vec![0; self.points.len()];
        Ok(())
    }

    /// The points in an order.
    pub(super) fn in_order(&self, order: Order, seed: u64) -> Self {
        let mut random = Random::keyed(&[seed, 0x0D4]);
        let mut chosen: Vec<usize> = (0..self.points.len()).collect();
        match order {
            Order::Ids | Order::Merged | Order::Compressed | Order::Carried => {}
            Order::Tiles | Order::TilesWithIds => {
                let tile = |i: &usize| [0, 1].map(|a| (self.points[*i][a] / TILE).floor() as i64);
                chosen.sort_by_key(tile);
            }
            Order::Thinned => chosen.retain(|_| random.unit() < 0.3),
            Order::Centroids(edge) => return self.centroids(f64::from(edge) * 1e-3),
            Order::Shuffled
            | Order::Random(_)
            | Order::Voxels(_)
            | Order::Jitter(_)
            | Order::Ripple(_) => shuffle(&mut chosen, &mut random),
        }
        match order {
            Order::Random(share) => chosen.truncate(chosen.len() * usize::from(share) / 100),
            Order::Voxels(edge) => {
                let voxel = |i: &usize| self.voxel(*i, f64::from(edge) * 1e-3);
                chosen.sort_by_key(voxel);
                chosen.dedup_by_key(|i| voxel(i));
            }
            _ => {}
        }
        let has_ids = matches!(order, Order::Ids | Order::TilesWithIds);
        let id = |i: &usize| if has_ids { self.scan[*i] + 1 } else { 0 };
        Self {
            points: chosen.iter().map(|i| self.points[*i]).collect(),
            scan: chosen.iter().map(|i| self.scan[*i]).collect(),
            ids: chosen.iter().map(id).collect(),
            scanners: self.scanners.clone(),
            drawn: self.drawn.clone(),
        }
    }

    /// The voxel of a point.
    fn voxel(&self, i: usize, edge: f64) -> [i64; 3] {
        self.points[i].map(|v| (v / edge).floor() as i64)
    }

    /// One mean for all points of a voxel, whosever they are.
    fn centroids(&self, edge: f64) -> Self {
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        order.sort_by_key(|i| (self.voxel(*i, edge), *i));
        let mut out =
            Self { scanners: self.scanners.clone(), drawn: self.drawn.clone(), ..Self::default() };
        for same in order.chunk_by(|a, b| self.voxel(*a, edge) == self.voxel(*b, edge)) {
            let mean =
                |a: usize| same.iter().map(|i| self.points[*i][a]).sum::<f64>() / same.len() as f64;
            out.points.push([0, 1, 2].map(mean));
            out.scan.push(self.scan[same[0]]);
            out.ids.push(0);
        }
        out
    }

    /// Writes the cloud as LAS or LAZ.
    pub(super) fn write(&self, dir: &Path, order: Order) -> Result<PathBuf> {
        const AT_ONCE: usize = 1 << 16;
        let quantum = Quantum { scale: [self.drawn.quantum; 3], offset: [0.0; 3] };
        let mut settings = LasSettings::new(quantum);
        settings.with_labels = false;
        settings.compress = order == Order::Compressed;
        let path = dir.join(if settings.compress { "cloud.laz" } else { "cloud.las" });
        let mut las = LasWriter::create(path.clone(), settings)?;
        let points = self.points.chunks(AT_ONCE).zip(self.ids.chunks(AT_ONCE));
        for (world, ids) in points {
            let mut from = 0;
            for same in ids.chunk_by(|a, b| a == b) {
                let world = &world[from..from + same.len()];
                from += same.len();
                let labels = vec![Label::FIXED; world.len()];
                let intensity = vec![0; world.len()];
                las.push(&PointColumns {
                    world,
                    labels: &labels,
                    intensity: &intensity,
                    scan: same[0],
                    ..PointColumns::default()
                })?;
            }
        }
        las.finish().map_err(|e: Error| e.at(path.display()))?;
        Ok(path)
    }
}

fn shuffle(chosen: &mut [usize], random: &mut Random) {
    for i in (1..chosen.len()).rev() {
        chosen.swap(i, random.below(i + 1));
    }
}

fn of_hall(seed: u64, n_scanners: usize, step_deg: f64) -> Plant {
    let (is_tight, moves) = (false, false);
    Plant { seed, n_robots: 0, n_rows: 1, n_scanners, step_deg, is_tight, moves }
}

/// Errors of the angles that a scanner stores for a beam.
struct AngleErrors {
    jitter: f64,
    /// Amplitude of the graduation errors, and their phases and periods in a turn.
    ripple: f64,
    phases: [f64; 2],
    periods: [f64; 2],
}

impl AngleErrors {
    fn drawn(drawn: &DrawnScanners, seed: u64, scan: usize) -> Self {
        let arcsec = |v: f64| (v / 3600.0).to_radians();
        let mut random = Random::keyed(&[seed, scan as u64, 0x41B]);
        Self {
            jitter: arcsec(drawn.jitter_arcsec),
            ripple: arcsec(drawn.ripple_arcsec),
            phases: [(); 2].map(|()| random.between(0.0, std::f64::consts::TAU)),
            periods: [(); 2].map(|()| 1.0 + random.below(12) as f64),
        }
    }

    /// A measured point of the scan frame in the world, with errors of its direction.
    fn world(&self, pose: &Pose, xyz: [f64; 3], random: &mut Random) -> [f64; 3] {
        let p = Vector::from(xyz);
        let (flat, range) = (p.x.hypot(p.y), p.norm());
        let ripple = |kind: usize, angle: f64| {
            self.ripple * (self.periods[kind] * angle + self.phases[kind]).sin()
        };
        let [a, b] = random.normals();
        let (azimuth, elevation) = (p.y.atan2(p.x), p.z.atan2(flat));
        // The error of an azimuth moves a beam near the zenith less.
        let azimuth = azimuth + ripple(0, azimuth) + self.jitter * a;
        let elevation = elevation + ripple(1, elevation) + self.jitter * b;
        let (rise, flat) = elevation.sin_cos();
        let along = Vector::new(flat * azimuth.cos(), flat * azimuth.sin(), rise);
        (pose * Point3::from(along * range)).into()
    }
}
