//! Items on the arm of a random robot: hoses between links, a gripper with a part, a dress pack, a
//! rag.

use geometry::Vector;
use nalgebra::{Rotation3, UnitQuaternion};
use robot::Model;
use simulate::random::Random;
use simulate::scene::{Anchor, CarriedBox, Hose, ToolShape};
use simulate::{Scene, part_in, tool_on};

/// Most hoses along an arm (METHOD.md §19, T8 and T9).
const N_HOSES: usize = 3;
/// Radius of hoses, metres.
const RADIUS: [f64; 2] = [0.015, 0.025];
/// Distance of clamped hoses from the surface, metres.
const CLAMP: f64 = 0.03;
/// Distance of a dress pack and of a rag from the surface, metres.
const SHELL: f64 = 0.02;
const LAID: f64 = 0.005;

/// Hoses along the arm from the second link on, each from the top of one link to the top of the
/// next, with this probability.
pub(super) fn hoses(scene: &mut Scene, model: &Model, chance: f64, random: &mut Random) {
    let links = bodies(model);
    if random.unit() >= chance || links.len() <= 3 {
        return;
    }
    let hang = |l: usize| {
        let (at, away) = top(model, l);
        Anchor {
            robot: Some("R1".into()),
            link: Some(model.links[l].name.clone()),
            xyz: (at + away * CLAMP).into(),
        }
    };
    for k in 1..links.len().saturating_sub(2).min(1 + N_HOSES) {
        scene.hoses.push(Hose {
            name: format!("hose {k}"),
            anchors: vec![hang(links[k]), hang(links[k + 1])],
            radius: random.between(RADIUS[0], RADIUS[1]),
            sag: 0.1,
        });
    }
}

/// A gripper with a part, a dress pack on the forearm and a rag on the upper arm, each with this
/// probability and scaled to the robot's reach, metres.
pub(super) fn load(scene: &mut Scene, model: &Model, chance: f64, reach: f64, random: &mut Random) {
    let mut there = || random.unit() < chance;
    let [has_part, has_pack, has_rag] = [there(), there(), there()];
    let links = bodies(model);
    if let (true, Some(flange)) = (has_part, model.flanges().first()) {
        let side = (0.25 * reach).clamp(0.1, 0.4);
        let gripper = tool_on(model, *flange, ToolShape::Gripper, 0.5 * side);
        scene.carried.push(part_in(&gripper, "R1", [side, 0.7 * side, 0.5 * side]));
        scene.robots[0].tool = Some(gripper);
    }
    if let (true, Some(&forearm)) = (has_pack, links.get(3)) {
        let thick = (0.05 * reach).clamp(0.03, 0.12);
        let length = 0.6 * model.links[forearm].bounds.size().into_iter().fold(0.0, f64::max);
        scene.carried.push(laid(model, forearm, "dress pack", SHELL, [length, thick, thick]));
    }
    if let (true, Some(&upper)) = (has_rag, links.get(2)) {
        let side = (0.12 * reach).clamp(0.08, 0.3);
        scene.carried.push(laid(model, upper, "rag", LAID, [side, 0.7 * side, 0.01]));
    }
}

/// A box on top of a link, along its longest side, at a distance from its surface, metres.
fn laid(model: &Model, link: usize, name: &str, gap: f64, size: [f64; 3]) -> CarriedBox {
    let (at, away) = top(model, link);
    let extent = model.links[link].bounds.size();
    let longest = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let along = Vector::ith(longest, 1.0);
    // Along the surface; across it where the longest side stands up from it.
    let [along, other] =
        [along, Vector::ith((longest + 1) % 3, 1.0)].map(|v| v - away * v.dot(&away));
    let x = if along.norm() > 0.3 { along.normalize() } else { other.normalize() };
    let turn = Rotation3::from_basis_unchecked(&[x, away.cross(&x), away]);
    let (roll, pitch, yaw) = UnitQuaternion::from_rotation_matrix(&turn).euler_angles();
    CarriedBox {
        name: format!("{name} of R1"),
        robot: "R1".into(),
        link: model.links[link].name.clone(),
        xyz: (at + away * (gap + 0.5 * size[2])).into(),
        rpy_deg: [roll, pitch, yaw].map(f64::to_degrees),
        size,
    }
}

/// The point of a link's surface nearest to the middle of its upper side, and the outward direction
/// there, link frame, metres.
fn top(model: &Model, link: usize) -> (Vector, Vector) {
    let own = &model.links[link];
    let wide = |p: &[f32; 3]| Vector::from(p.map(f64::from));
    let upper = own.bounds.center().coords + Vector::z() * (0.5 * own.bounds.size()[2]);
    let apart = |i: &usize| (wide(&own.cad.points[*i]) - upper).norm_squared();
    let nearest = (0..own.cad.points.len()).min_by(|a, b| apart(a).total_cmp(&apart(b)));
    nearest.map_or((upper, Vector::z()), |i| {
        let outward = wide(&own.cad.normals[i]).try_normalize(0.5).unwrap_or(Vector::z());
        (wide(&own.cad.points[i]), outward)
    })
}

/// Links of the main chain that have a surface.
fn bodies(model: &Model) -> Vec<usize> {
    let first = model.main_chain.first().map(|&j| model.joints[j].parent);
    let links = first.into_iter().chain(model.main_chain.iter().map(|&j| model.joints[j].child));
    links.filter(|&l| !model.links[l].bounds.is_empty()).collect()
}
