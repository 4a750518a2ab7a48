//! Writes scenes of all robots of a library in drawn places and postures, with the truth: what
//! `scripts/cross/scene.py` opens with other software.
//!
//! ```text
//! cargo run --release -p scene --example library_scene -- LIBRARY OUT SEED
//! OUT/FORMAT/…       the scenes
//! OUT/truth.json     robots, values of joints, poses of links
//! ```

use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use robot::{Library, Model, ModelDetails, Settings, hull};
use scene::{FixedBox, FloorPatch, PlantRobot, PlantScene, SceneFiles};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

type Answer<T> = Result<T, Box<dyn Error>>;

/// Numbers of the sequence SplitMix64, from 0 to 1.
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// A drawn posture whose loops close.
fn posture(model: &Model, draw: &mut Draw) -> Vec<f64> {
    for _ in 0..200 {
        let drawn: Vec<f64> = (0..model.n_free())
            .map(|free| {
                let [low, high] = model.limits(free);
                draw.within(low, high)
            })
            .collect();
        if model.loop_gap(&drawn) <= 1e-4 {
            return drawn;
        }
    }
    model.home()
}

/// A robot of the scene, and the name of the tool that it has.
struct Placed {
    robot: PlantRobot,
    tool: Option<String>,
}

/// Each model in a drawn place, and the first one twice more: on a ceiling, and on a wall with the
/// tool of the library, if there is one.
fn robots(library: &Path, draw: &mut Draw) -> Answer<Vec<Placed>> {
    let settings = Settings::without_clouds();
    let models = Library::load(library, &settings)?.models;
    let first = models.iter().find(|model| !model.is_tool()).ok_or("the library has no robot")?;
    let tool = models.iter().find(|model| model.is_tool());
    let all = models.iter().map(|model| (model, None, None));
    let ceiling = (first, None, Some([PI, 0.0, 1.1]));
    let wall = (first, tool, Some([0.7, FRAC_PI_2, -0.4]));
    let corners = [[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.3]];
    let piece = hull(&corners).ok_or("a tetrahedron has a hull")?;
    let load = |model: &Model| ModelDetails::load(&library.join(&model.name), model, &settings);
    let mut out = Vec::new();
    for (at, (bare, tool, turn)) in all.chain([ceiling, wall]).enumerate() {
        let (mut model, mut details) = (bare.clone(), load(bare)?);
        if let (Some(tool), Some(&flange)) = (tool, bare.flanges().first()) {
            model = bare.with_tool(tool, flange, 0.3);
            details = details.with_tool(&load(tool)?);
        }
        let place = Translation3::new(4.0 * at as f64, draw.within(-3.0, 3.0), draw.within(0., 2.));
        let tilted = [draw.within(-0.5, 0.5), draw.within(-0.5, 0.5), draw.within(-3.1, 3.1)];
        let [roll, pitch, yaw] = turn.unwrap_or(tilted);
        let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let robot = PlantRobot {
            id: format!("R{}", at + 1),
            details,
            world_from_base: Pose::from_parts(place, turn),
            posture: posture(&model, draw),
            hanging: BTreeMap::from([(model.links.len() - 1, vec![piece.clone()])]),
            model,
        };
        out.push(Placed { robot, tool: tool.map(|tool| tool.name.clone()) });
    }
    Ok(out)
}

fn truth(Placed { robot, tool }: &Placed) -> Value {
    let pose = |pose: &Pose| {
        let (p, q) = (pose.translation, pose.rotation);
        json!({ "xyz": [p.x, p.y, p.z], "quat_wxyz": [q.w, q.i, q.j, q.k] })
    };
    let links = robot.model.links.iter().map(|link| &link.name);
    let poses = robot.world_from_links();
    let values = robot.model.joints.iter().map(|joint| &joint.name).zip(robot.values());
    json!({
        "id": robot.id, "model": robot.model.name, "tool": tool,
        "link_poses": links.zip(&poses).map(|(l, p)| (l.clone(), pose(p))).collect::<BTreeMap<_, _>>(),
        "values": values.map(|(name, value)| (name.clone(), value)).collect::<BTreeMap<_, _>>(),
    })
}

fn main() -> Answer<()> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [library, out, seed] = &given[..] else {
        return Err("call it with LIBRARY OUT SEED".into());
    };
    let mut draw = Draw(seed.parse()?);
    let placed = robots(Path::new(library), &mut draw)?;
    let plant = PlantScene {
        name: "plant".into(),
        robots: placed.iter().map(|placed| placed.robot.clone()).collect(),
        fixed: vec![
            FixedBox { center: [0.0, 5.0, 0.5], size: [2.0, 0.1, 1.0] },
            FixedBox { center: [3.0, 5.0, 0.25], size: [0.5, 0.5, 0.5] },
        ],
        touching: Vec::new(),
        floor: Some(FloorPatch {
            world_from_floor: Pose::from(Vector::new(20.0, 0.0, -3.0)),
            size: [80.0, 40.0],
        }),
    };
    let formats: [(&str, SceneFiles); 8] = [
        ("urdf", scene::urdf(&plant, None)?),
        ("srdf", scene::srdf(&plant, Some("plant_scene"))?),
        ("moveit", scene::moveit(&plant, None)?),
        ("usd", scene::usd(&plant)?),
        ("mjcf", scene::mjcf(&plant)?),
        ("sdf", scene::sdf(&plant)?),
        ("gltf", scene::gltf(&plant)?),
        ("robodk", scene::robodk(&plant)?),
    ];
    for (format, written) in formats {
        for file in written.files {
            let path = Path::new(out).join(format).join(file.path);
            std::fs::create_dir_all(path.parent().ok_or("a path has a folder")?)?;
            std::fs::write(path, file.bytes)?;
        }
        std::fs::write(Path::new(out).join(format).join("notes.txt"), written.notes.join("\n"))?;
    }
    let robots: Vec<Value> = placed.iter().map(truth).collect();
    std::fs::write(Path::new(out).join("truth.json"), json!({ "robots": robots }).to_string())?;
    Ok(())
}
