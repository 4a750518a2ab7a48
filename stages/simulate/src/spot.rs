//! Begins a random scene with a bare hall, and places a robot in it, with a stand and a random
//! posture.

use crate::posture::Postures;
use crate::random::Random;
use crate::scene::{
    BeamRaster, Building, Mixed, RobotPlace, Scanner, Scene, SceneFloor, SceneStand, StandShape,
};
use crate::solid::cuboid;
use contract::Result;
use geometry::Point;
use robot::Model;

/// Depth below the floor that is allowed for a link, metres.
const FLOOR_SLACK: f64 = 0.005;

/// A hall with walls and a floor that is nearly level, and nothing in it; `size` holds its sides
/// and its height, metres.
pub(crate) fn bare_hall(
    seed: u64,
    size: [f64; 3],
    has_ceiling: bool,
    random: &mut Random,
) -> Scene {
    Scene {
        seed,
        hall: Some(Building { size, walls: true, ceiling: has_ceiling }),
        floor: Some(SceneFloor {
            size: None,
            tilt_deg: [random.between(-0.1, 0.1), random.between(-0.1, 0.1)],
            wave_amplitude: 0.003,
            wave_length: 5.0,
            levels: vec![],
        }),
        ..Scene::default()
    }
}

/// A scanner with the errors of a good real one.
pub(crate) fn scanner(name: String, position: [f64; 3], raster: BeamRaster) -> Scanner {
    Scanner {
        name,
        position,
        raster,
        noise: 0.002,
        jitter: 1e-5,
        dropouts: 0.002,
        dark_dropouts: 0.3,
        mixed: Some(Mixed::default()),
        ..Scanner::default()
    }
}

/// The place of a robot and the space that it has.
pub(crate) struct RobotSpot<'a> {
    pub(crate) name: String,
    pub(crate) model: &'a str,
    pub(crate) xy: [f64; 2],
    /// Height of its stand, metres; 0 for a robot on the floor.
    pub(crate) stand: f64,
    pub(crate) side: f64,
    pub(crate) shape: StandShape,
    /// Range of its yaw, degrees.
    pub(crate) yaw_deg: [f64; 2],
    /// Centre and size of a box that its `tool0` carries, metres.
    pub(crate) load: Option<([f64; 3], [f64; 3])>,
    /// Lowest and highest corner of its space, metres.
    pub(crate) min: [f64; 2],
    pub(crate) max: [f64; 2],
}

impl RobotSpot<'_> {
    /// Adds the stand, turns the robot and draws its posture.
    pub(crate) fn place(
        &self,
        scene: &mut Scene,
        model: &Model,
        random: &mut Random,
    ) -> Result<RobotPlace> {
        let mut place = self.stand_only(scene, random);
        let walls: Vec<([f64; 3], [f64; 3])> = keep_out(scene, &self.name);
        let allowed = |p: &Point| {
            let inside = (0..2).all(|i| p[i] > self.min[i] && p[i] < self.max[i]);
            let taken = walls.iter().any(|(a, b)| (0..3).all(|i| p[i] > a[i] && p[i] < b[i]));
            inside && !taken && p.z > scene.ground(p.x, p.y) - FLOOR_SLACK
        };
        let mut postures = Postures::new(model);
        if let Some((xyz, size)) = self.load {
            let link = model.links.iter().position(|l| l.name == "tool0");
            // The body reaches from the flange to the bottom of the box, which includes the tool
            // between.
            let (top, bottom) = (-0.04, xyz[2] - 0.5 * size[2]);
            let body = cuboid([size[0], size[1], top - bottom], 0.0).at([
                xyz[0],
                xyz[1],
                0.5 * (top + bottom),
            ]);
            postures = postures.carrying(link.unwrap_or(0), &body.mesh());
        }
        let posture = postures.draw(random, &place.world_from_base(), allowed)?;
        let joints = model.free.iter().zip(posture);
        place.posture = joints.map(|(&j, v)| (model.joints[j].name.clone(), v)).collect();
        Ok(place)
    }

    /// Adds the stand (once) and turns the robot; its posture is the model's home.
    pub(crate) fn stand_only(&self, scene: &mut Scene, random: &mut Random) -> RobotPlace {
        let [x, y] = self.xy;
        let ground = scene.ground(x, y);
        if self.stand > 0.0 && !scene.stands.iter().any(|s| s.name == self.name) {
            scene.stands.push(SceneStand {
                name: self.name.clone(),
                xy: self.xy,
                yaw_deg: 0.0,
                top: ground + self.stand,
                side: self.side,
                shape: self.shape,
            });
        }
        RobotPlace {
            name: self.name.clone(),
            model: self.model.into(),
            xyz: [x, y, ground + self.stand],
            rpy_deg: [0.0, 0.0, random.between(self.yaw_deg[0], self.yaw_deg[1])],
            ..RobotPlace::default()
        }
    }
}

/// Boxes that arms must not enter: furniture and stands, a robot's own stand up to just below its
/// top.
pub(crate) fn keep_out(scene: &Scene, own: &str) -> Vec<([f64; 3], [f64; 3])> {
    let around = |xy: [f64; 2], half: [f64; 2], low: f64, high: f64| {
        ([xy[0] - half[0], xy[1] - half[1], low], [xy[0] + half[0], xy[1] + half[1], high])
    };
    let stands = scene.stands.iter().map(|s| {
        let slack = if s.name == own { 0.01 } else { 0.0 };
        around(s.xy, [0.55 * s.side; 2], -1.0, s.top - slack)
    });
    let furniture = scene.conveyors.iter().chain(&scene.benches).map(|f| {
        let (sin, cos) = f.yaw_deg.to_radians().sin_cos();
        let half = [
            0.5 * (f.size[0] * cos.abs() + f.size[1] * sin.abs()) + 0.05,
            0.5 * (f.size[0] * sin.abs() + f.size[1] * cos.abs()) + 0.05,
        ];
        around(f.xy, half, -1.0, f.size[2] + 0.25)
    });
    let boxes = scene.boxes.iter().map(|b| {
        let half = 0.5 * b.size[0].hypot(b.size[1]);
        around([b.xyz[0], b.xyz[1]], [half; 2], -1.0, b.xyz[2] + 0.5 * b.size[2])
    });
    let columns = scene.columns.iter().map(|c| around(c.xy, [1.6 * c.radius; 2], -1.0, c.height));
    stands.chain(furniture).chain(boxes).chain(columns).collect()
}
