//! The input of the benches: a demo robot on a bare floor, seen by six virtual scanners 5 m away,
//! as a model, as files and as views. The same seed gives the same scene each time.

#![allow(dead_code, reason = "each bench takes what it needs")]

use contract::{Candidate, InstallationPlane, OneByOne, Region, TileAt, TilePoints, View};
use export::{E57Scans, GridPoint, GridScan, LasSettings, LasWriter, PointColumns, Quantum};
use geometry::{Aabb, Plane, Point, Pose, Vector};
use ingest::Want;
use lattice::{ViewBuilder, ViewSettings};
use robot::{Library, Model};
use simulate::demo_robots::{self, WELDER};
use simulate::{SimScan, Simulator};
use std::path::{Path, PathBuf};

/// Number of beams of each scanner over the whole sphere.
pub(crate) const N_BEAMS: u64 = 1_000_000;
/// Seed of the scene's noise.
const SEED: u64 = 60;

/// The welder with its base at the origin, its posture, and the scans of it.
pub(crate) struct Cell {
    /// The welder alone.
    pub(crate) models: Vec<Model>,
    /// Value of each free joint, radians or metres: the middle of its limits.
    pub(crate) posture: Vec<f64>,
    /// The scene, ready to be scanned.
    pub(crate) simulator: Simulator,
    folder: tempfile::TempDir,
}

impl Cell {
    /// Writes and loads the model, with its surface samples, and builds the scene of six scanners
    /// that have `n_beams` each.
    pub(crate) fn new(n_beams: u64) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let robots = folder.path().join("robots");
        let files = demo_robots::files().into_iter();
        for (path, bytes) in files.filter(|(path, _)| path.starts_with(WELDER)) {
            let path = robots.join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("is made");
            std::fs::write(path, bytes).expect("is written");
        }
        let library = Library::load(&robots, &robot::Settings::default()).expect("the model loads");
        let models = library.models;
        let model = &models[0];
        let middle = |joint| model.limits(joint).into_iter().sum::<f64>() / 2.0;
        let posture: Vec<f64> = (0..model.n_free()).map(middle).collect();
        let scene = simulate::paper_scene(SEED, model, &posture, n_beams);
        let simulator = Simulator::new(&scene, &models).expect("the scene can be built");
        Self { models, posture, simulator, folder }
    }

    /// All scans, cast once.
    pub(crate) fn scans(&self) -> Vec<SimScan> {
        (0..self.simulator.n_scans()).map(|scanner| self.simulator.scan(scanner)).collect()
    }

    /// Writes scans as one E57 file with poses, rows and columns; returns its path and its number
    /// of points.
    pub(crate) fn write_e57(&self, scans: &[SimScan]) -> (PathBuf, u64) {
        let path = self.folder.path().join("scans.e57");
        let mut file = E57Scans::create(&path).expect("is created");
        let mut n = 0;
        for scan in scans {
            let (frame, seen) = (&scan.frame, &scan.columns);
            let grid = GridScan {
                name: frame.name.clone(),
                world_from_scan: frame.world_from_scan,
                n_rows: frame.n_rows,
                n_cols: frame.n_cols,
            };
            let hits = (0..seen.len()).filter(|&i| seen.hit[i]).map(|i| {
                let (row, col) = seen.pixel(i);
                let xyz = Some(seen.xyz[i].map(|v| v as f32));
                Ok(GridPoint { xyz, row, col, intensity: strength(seen.intensity[i]) })
            });
            n += file.add(&grid, hits).expect("is written");
        }
        file.finish().expect("is written");
        (path, n)
    }

    /// Writes points as one LAS or LAZ file of format 6; returns its path.
    pub(crate) fn write_las(&self, points: &World, compress: bool) -> PathBuf {
        let path = self.folder.path().join(if compress { "scans.laz" } else { "scans.las" });
        let mut settings = points.las();
        (settings.with_labels, settings.compress) = (false, compress);
        let mut file = LasWriter::create(&path, settings).expect("is created");
        file.push(&points.columns()).expect("is written");
        file.finish().expect("is written");
        path
    }

    /// A folder that is removed with the cell.
    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Bounds of what may belong to the robot: its reach about the base, and 0.1 m below the floor.
    pub(crate) fn region(&self) -> Region {
        let reach = self.models[0].reach();
        let bounds = Aabb { min: [-reach, -reach, -0.1], max: [reach, reach, 2.0 * reach] };
        Region { origin: Point::origin(), bounds }
    }

    /// The floor that the robot stands on.
    pub(crate) fn floor(&self) -> InstallationPlane {
        InstallationPlane {
            plane: Plane { normal: Vector::z(), offset: 0.0 },
            bounds: self.region().world_bounds(),
            area: 100.0,
            is_floor: true,
        }
    }

    /// The robot at its true base, which is stated to be clear, so that no quick look precedes the
    /// search.
    pub(crate) fn candidate(&self) -> Candidate {
        Candidate {
            model: 0,
            bounds: self.region().world_bounds(),
            plane: self.floor(),
            bases: vec![(Pose::identity(), 1.0)],
        }
    }

    /// The view of each scan of the region, from an E57 file that is read as in a run.
    pub(crate) fn views(&self, scans: &[SimScan]) -> Vec<View> {
        let (path, _) = self.write_e57(scans);
        let sources = ingest::open(&[path], None, &ingest::Settings::default(), &OneByOne)
            .expect("the file opens");
        let region = self.region();
        let strips = sources.strips(sources.inputs[0].id, Want::Coordinates).expect("opens");
        let mut points = vec![Vec::new(); sources.scans.len()];
        for strip in strips {
            let strip = strip.expect("is read");
            points[strip.scan.0 as usize].extend(strip.xyz);
        }
        let scans = sources.scans.iter().zip(points);
        scans.map(|(scan, xyz)| view(scan, &xyz, &region)).collect()
    }
}

/// One scan's view of a region, from all of its points.
fn view(scan: &contract::Scan, xyz: &[[f32; 3]], region: &Region) -> View {
    let lattice = scan.lattice.as_ref().expect("the scanner is known");
    let mut extent = [u32::MAX, 0, u32::MAX, 0];
    for p in xyz {
        let at = lattice.pixel(*p).0;
        let [top, bottom, left, right] = extent;
        extent = [top.min(at.row), bottom.max(at.row), left.min(at.col), right.max(at.col)];
    }
    let settings = ViewSettings::default();
    let mut builder = ViewBuilder::new(scan, region, Some(extent), Some(0), &settings);
    let place: Vec<u32> = (0..xyz.len() as u32).collect();
    let pixel = vec![0; xyz.len()];
    builder.add(&TilePoints {
        at: TileAt { scan: scan.id, row: 0, col: 0 },
        first_place: 0,
        place: &place,
        pixel: &pixel,
        xyz,
        skip: contract::MAX_SKIP,
    });
    builder.finish()
}

/// The points of all scans in the world, with what the scanner knows about each.
pub(crate) struct World {
    /// Metres.
    pub(crate) xyz: Vec<[f64; 3]>,
    /// The object that each point belongs to.
    pub(crate) labels: Vec<contract::Label>,
    /// 0..65535.
    pub(crate) intensity: Vec<u16>,
}

impl World {
    /// All points of some scans, in their order.
    pub(crate) fn of(scans: &[SimScan]) -> Self {
        let mut all = Self { xyz: Vec::new(), labels: Vec::new(), intensity: Vec::new() };
        for SimScan { frame, columns: seen } in scans {
            let pose: &Pose = &frame.world_from_scan;
            for i in (0..seen.len()).filter(|&i| seen.hit[i]) {
                all.xyz.push((pose * Point::from(seen.xyz[i])).into());
                all.labels.push(seen.label[i]);
                all.intensity.push(strength(seen.intensity[i]));
            }
        }
        all
    }

    /// The points as columns for the writers.
    pub(crate) fn columns(&self) -> PointColumns<'_> {
        PointColumns {
            world: &self.xyz,
            labels: &self.labels,
            intensity: &self.intensity,
            ..PointColumns::default()
        }
    }

    /// Labelled records of format 6 about the middle of the points.
    pub(crate) fn las(&self) -> LasSettings {
        LasSettings::new(Quantum::around(&Aabb::of(self.xyz.iter().copied())))
    }
}

fn strength(share: f32) -> u16 {
    (share * 65_535.0) as u16
}
