//! The simulator: scans with truth from a scene and robot models.

use crate::beams::Beams;
use crate::columns::{ScanFrame, SimColumns, SimScan};
use crate::scan::Station;
use crate::scene::{RobotPlace, Scene};
use crate::truth::{LaterPosture, SCHEMA, TrueRobot, TrueScan, Truth};
use crate::world::{BodySurface, SceneTriangles, posture_of};
use contract::Result;
use geometry::{Pose, Vector};
use robot::Model;
use std::ops::Range;

/// A scene ready to be scanned.
pub struct Simulator {
    /// The scene in each set of postures that any scanner saw.
    states: Vec<StillScene>,
    stations: Vec<Station>,
    /// Index of the state of each station.
    state_of: Vec<usize>,
    robots: Vec<TrueRobot>,
    objects: Vec<String>,
}

/// The scene in one set of postures.
struct StillScene {
    beams: Beams,
    surfaces: Vec<BodySurface>,
    n_triangles: usize,
}

impl Simulator {
    /// Builds all bodies of a scene; `models` must include the models of its robots.
    ///
    /// # Errors
    /// `BadInput` if the scene names a model, link or joint that does not exist, or has a number
    /// out of range.
    pub fn new(scene: &Scene, models: &[Model]) -> Result<Self> {
        crate::check::check(scene)?;
        let (mut seen, mut states, mut state_of) = (Vec::new(), Vec::new(), Vec::new());
        for scanner in &scene.scanners {
            let then = scene.as_seen_by(&scanner.name);
            let known = seen.iter().position(|s| *s == then.robots);
            state_of.push(known.unwrap_or(seen.len()));
            if known.is_none() {
                states.push(StillScene::new(SceneTriangles::new(&then, models)?));
                seen.push(then.robots);
            }
        }
        let world = SceneTriangles::new(scene, models)?;
        let robots = true_robots(scene, models, &world)?;
        let stations = scene
            .scanners
            .iter()
            .enumerate()
            .map(|(i, s)| Station::new(s, [scene.seed, i as u64], scene.origin))
            .collect::<Result<Vec<_>>>()?;
        Ok(Self { states, stations, state_of, robots, objects: world.objects })
    }

    /// Number of scanners.
    #[must_use]
    pub fn n_scans(&self) -> usize {
        self.stations.len()
    }

    /// Number of triangles in the scene.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.states.first().map_or(0, |s| s.n_triangles)
    }

    /// The properties of a scan that files state.
    ///
    /// # Panics
    /// If the scene has no scanner with this index.
    #[must_use]
    pub fn frame(&self, scanner: usize) -> &ScanFrame {
        &self.stations[scanner].frame
    }

    /// Beams of some columns of one scan.
    ///
    /// # Law
    /// The beams depend only on scene, scanner and column: they are the same however the columns
    /// are split and in whatever order they are requested. Each call casts one more column on
    /// either side, so that 16 or more should be requested at a time.
    ///
    /// # Panics
    /// If the scene has no scanner with this index.
    #[must_use]
    pub fn columns(&self, scanner: usize, cols: Range<u32>) -> SimColumns {
        let state = &self.states[self.state_of[scanner]];
        self.stations[scanner].columns(&state.beams, &state.surfaces, cols)
    }

    /// A whole scan.
    ///
    /// # Panics
    /// If the scene has no scanner with this index.
    #[must_use]
    pub fn scan(&self, scanner: usize) -> SimScan {
        let frame = self.frame(scanner).clone();
        let columns = self.columns(scanner, 0..frame.n_cols);
        SimScan { frame, columns }
    }

    /// The truth of the scene; the numbers of points of its scans are 0 until the caller counts
    /// them.
    #[must_use]
    pub fn truth(&self) -> Truth {
        let scans = self.stations.iter().map(|s| TrueScan {
            name: s.frame.name.clone(),
            pose: (&s.frame.true_world_from_scan).into(),
            stated_pose: (&s.frame.world_from_scan).into(),
            n_beams: u64::from(s.frame.n_rows) * u64::from(s.frame.n_cols),
            n_points: 0,
        });
        Truth {
            schema: SCHEMA.into(),
            robots: self.robots.clone(),
            scans: scans.collect(),
            objects: self.objects.clone(),
        }
    }
}

impl StillScene {
    fn new(world: SceneTriangles) -> Self {
        Self {
            beams: Beams::new(&world.triangles, &world.surface_of),
            surfaces: world.surfaces,
            n_triangles: world.triangles.len(),
        }
    }
}

fn true_robots(scene: &Scene, models: &[Model], world: &SceneTriangles) -> Result<Vec<TrueRobot>> {
    scene
        .robots
        .iter()
        .zip(&world.robots)
        .map(|(place, placed)| {
            let model = &models[placed.model];
            let mut base: Pose = placed.world_from_link[0];
            base.translation.vector += Vector::from(scene.origin);
            let named = |posture: &[f64]| {
                let joints = model.free.iter().zip(posture);
                joints.map(|(&j, v)| (model.joints[j].name.clone(), *v)).collect()
            };
            let later = place.later.iter().map(|then| {
                let place = RobotPlace { posture: then.posture.clone(), ..place.clone() };
                let joints = named(&posture_of(&place, model)?);
                Ok(LaterPosture { scans: then.scanners.clone(), joints })
            });
            Ok(TrueRobot {
                name: place.name.clone(),
                model: model.name.clone(),
                base_link: model.links[0].name.clone(),
                base_pose: (&base).into(),
                joints: named(&placed.posture),
                links: model.links.iter().map(|l| l.name.clone()).collect(),
                later: later.collect::<Result<_>>()?,
            })
        })
        .collect()
}
