//! Parts that tools touch or carry, with what they lie on.

use super::worker::{Work, Worker};
use crate::hand::part_in;
use crate::plant::foot_radius;
use crate::random::Random;
use crate::scene::{CarriedBox, Cuboid, Furniture, Scene, ToolShape};
use geometry::{Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};

/// Largest cosine of a torch's axis with the vertical at which it points down to a part (50°), and
/// that of a wider tool, which would pass through the part (15°).
const DOWN: f64 = -0.64;
const WIDE_DOWN: f64 = -0.966;
/// Depth by which a tip presses into a part, so that no gap shows, metres.
const PRESSED: f64 = 0.003;
/// Heights of a tool's tip above the ground at which a part fits below it, metres.
const TIP: [f64; 2] = [0.3, 1.5];
/// Distance of an arm from the things below its tool, metres.
const CLEAR: f64 = 0.03;
/// Height of a support above the ground from which it is a bench and not a block, metres.
const BENCH: f64 = 0.3;

/// What a tool does with a part below it.
#[derive(Clone, Copy, PartialEq)]
enum ToolContact {
    /// Its tip rests on the part.
    On,
    /// Its tip ends so far above the part, metres.
    Above(f64),
    /// Its fingers hold the part, which lies on a fixture.
    Closed,
    /// Its tip touches a thin sheet on posts.
    Sheet,
    /// Its tip rests on a pile on the ground.
    Pile,
}

/// Whether a tool points down to where a part can lie, and nothing of the arm is in the way.
pub(super) fn is_over_a_part(worker: &Worker<'_>, scene: &Scene) -> bool {
    let Some((tip, down)) = tip(worker) else { return true };
    let base = worker.place.xyz;
    let height = tip.z - scene.ground(tip.x, tip.y);
    let apart = (tip.x - base[0]).hypot(tip.y - base[1]);
    let is_torch = worker.tool.as_ref().is_some_and(|(_, tool)| tool.shape == ToolShape::Torch);
    down.z < if is_torch { DOWN } else { WIDE_DOWN }
        && (TIP[0]..TIP[1]).contains(&height)
        && apart > foot_radius(worker.model) + 0.35
        && worker
            .surface()
            .all(|(_, p)| p.z > tip.z + CLEAR || (p.x - tip.x).hypot(p.y - tip.y) > 0.35 + CLEAR)
}

/// End of a robot's tool, and its direction, world.
fn tip(worker: &Worker<'_>) -> Option<(Point, Vector)> {
    let world_from_tool = worker.world_from_tool()?;
    let (_, tool) = worker.tool.as_ref()?;
    Some((world_from_tool * Point::new(0.0, 0.0, tool.length), world_from_tool * Vector::z()))
}

/// Adds the part that a robot touches or carries.
pub(super) fn add(scene: &mut Scene, worker: &Worker<'_>, work: Work, random: &mut Random) {
    match work {
        Work::Touch => touch(scene, worker, random),
        Work::Carry => carry(scene, worker, random),
        Work::Hoses | Work::Joined => {
            if random.unit() < 0.3 {
                carry(scene, worker, random);
            }
        }
    }
}

/// Adds a part of a random size at the end of a tool that can hold one.
fn carry(scene: &mut Scene, worker: &Worker<'_>, random: &mut Random) {
    let Some((_, tool)) = worker.tool.as_ref().filter(|t| t.1.shape != ToolShape::Torch) else {
        return;
    };
    let long = (worker.reach * random.between(0.12, 0.45)).clamp(0.1, 0.9);
    let wide = long * random.between(0.4, 1.0);
    let is_plate = random.unit() < 0.6;
    let high = if is_plate { random.between(0.02, 0.06) } else { long * random.between(0.3, 0.8) };
    let part = part_in(tool, &worker.place.name, [long, wide, high]);
    let overlap = if tool.shape == ToolShape::Gripper { random.between(0.0, 0.02) } else { 0.0 };
    let back = crate::scene::pose([0.0; 3], tool.rpy_deg) * Vector::new(0.0, 0.0, -overlap);
    let xyz = [0, 1, 2].map(|i| part.xyz[i] + back[i]);
    let size = [long, wide, high];
    let beyond = tool.length + 0.5 * high - overlap;
    let shift = Pose::from_parts(Translation3::new(0.0, 0.0, beyond), UnitQuaternion::identity());
    if worker.world_from_tool().is_some_and(|tool| is_free(scene, &(tool * shift), size)) {
        scene.carried.push(CarriedBox { xyz, ..part });
    }
}

/// Whether a carried box of this size (metres) keeps clear of ground and furniture.
fn is_free(scene: &Scene, world_from_part: &Pose, size: [f64; 3]) -> bool {
    let corner = |k: usize| {
        let along = |i: usize| if k >> i & 1 == 1 { 0.5 * size[i] } else { -0.5 * size[i] };
        world_from_part * Point::new(along(0), along(1), along(2))
    };
    let walls = crate::spot::keep_out(scene, "");
    (0..8).map(corner).chain([world_from_part * Point::origin()]).all(|p| {
        let is_in = |(a, b): &([f64; 3], [f64; 3])| {
            (0..3).all(|i| p[i] > a[i] - 2.0 * CLEAR && p[i] < b[i] + 2.0 * CLEAR)
        };
        p.z > scene.ground(p.x, p.y) + 0.1 && !walls.iter().any(is_in)
    })
}

/// Adds a part below a tool, with what it lies on.
fn touch(scene: &mut Scene, worker: &Worker<'_>, random: &mut Random) {
    let Some((tip, _)) = tip(worker) else { return };
    let Some((_, tool)) = &worker.tool else { return };
    if !is_over_a_part(worker, scene) {
        return;
    }
    let contact = match (tool.shape, random.below(5)) {
        (_, 0) => ToolContact::Above(random.between(0.03, 0.09)),
        (ToolShape::Gripper, 1..=3) => ToolContact::Closed,
        (ToolShape::Torch, 1..=3) => ToolContact::Sheet,
        (ToolShape::Cups, 1..=3) => ToolContact::Pile,
        _ => ToolContact::On,
    };
    let ground = scene.ground(tip.x, tip.y);
    let part = part_below(worker, contact, ground, random);
    let low = part.xyz[2] - 0.5 * part.size[2];
    if contact == ToolContact::Pile {
        pile(scene, &part, low, ground, random);
    } else {
        support(scene, &part, low, contact == ToolContact::Sheet, random);
    }
    scene.boxes.push(part);
}

/// The part below a tool: a box that is turned about the vertical as the tool is.
fn part_below(
    worker: &Worker<'_>,
    contact: ToolContact,
    ground: f64,
    random: &mut Random,
) -> Cuboid {
    let world_from_tool = worker.world_from_tool().unwrap_or_default();
    let length = worker.tool.as_ref().map_or(0.0, |(_, tool)| tool.length);
    let tip = world_from_tool * Point::new(0.0, 0.0, length);
    let x = world_from_tool * Vector::x();
    let mut part = Cuboid {
        name: "part".into(),
        xyz: tip.coords.into(),
        size: [random.between(0.15, 0.35), random.between(0.15, 0.3), random.between(0.08, 0.25)],
        rpy_deg: [0.0, 0.0, x.y.atan2(x.x).to_degrees()],
        reflectance: random.between(0.3, 0.9),
    };
    let mut top = tip.z + PRESSED;
    match contact {
        ToolContact::Above(gap) => top = tip.z - gap,
        ToolContact::Closed => {
            // The fingers end at 0.205 and −0.185 lengths beside the axis of the tool.
            part.size = [
                0.42 * length - 0.028,
                random.between(0.05, 0.25),
                0.2 * length + random.between(0.03, 0.15),
            ];
            top = tip.z + 0.2 * length;
            let shift = x * (0.01 * length);
            part.xyz[0] += shift.x;
            part.xyz[1] += shift.y;
        }
        ToolContact::Sheet => {
            part.size = [random.between(0.4, 0.7), random.between(0.3, 0.6), 0.006];
        }
        ToolContact::On | ToolContact::Pile => {}
    }
    part.size[2] = part.size[2].min(top - ground - 0.05);
    part.xyz[2] = top - 0.5 * part.size[2];
    part
}

/// Boxes of the same footprint from the ground up to a part whose underside is at `low`, world.
fn pile(scene: &mut Scene, part: &Cuboid, low: f64, ground: f64, random: &mut Random) {
    let n = ((low - ground) / 0.25).ceil().max(1.0);
    let height = (low - ground) / n;
    for k in 0..n as usize {
        scene.boxes.push(Cuboid {
            name: format!("pile {k}"),
            xyz: [part.xyz[0], part.xyz[1], ground + (k as f64 + 0.5) * height],
            size: [part.size[0] + 0.02, part.size[1] + 0.02, height],
            rpy_deg: [0.0, 0.0, part.rpy_deg[2] + random.between(-4.0, 4.0)],
            reflectance: random.between(0.3, 0.9),
        });
    }
}

/// A bench or a block below a part whose underside is at `low`, world; a sheet lies on posts.
fn support(scene: &mut Scene, part: &Cuboid, low: f64, is_sheet: bool, random: &mut Random) {
    let [x, y, _] = part.xyz;
    let ground = scene.ground(x, y);
    let top = if is_sheet { (low - random.between(0.06, 0.2)).max(ground + 0.05) } else { low };
    if is_sheet {
        let (sin, cos) = part.rpy_deg[2].to_radians().sin_cos();
        for k in 0..4 {
            let side = |bit: usize| if k >> bit & 1 == 1 { 0.4 } else { -0.4 };
            let (u, v) = (side(0) * part.size[0], side(1) * part.size[1]);
            scene.boxes.push(Cuboid {
                name: format!("post {k}"),
                xyz: [x + u * cos - v * sin, y + u * sin + v * cos, 0.5 * (top + low)],
                size: [0.04, 0.04, low - top],
                rpy_deg: part.rpy_deg,
                reflectance: 0.4,
            });
        }
    }
    let size = [part.size[0] + random.between(0.1, 0.4), part.size[1] + random.between(0.1, 0.4)];
    if top - ground > BENCH && random.unit() < 0.7 {
        scene.benches.push(Furniture {
            name: "below".into(),
            xy: [x, y],
            yaw_deg: part.rpy_deg[2],
            size: [size[0], size[1], top - ground],
        });
    } else {
        scene.boxes.push(Cuboid {
            name: "fixture".into(),
            xyz: [x, y, 0.5 * (top + ground)],
            size: [size[0].min(0.5), size[1].min(0.4), top - ground],
            rpy_deg: part.rpy_deg,
            reflectance: 0.5,
        });
    }
}
