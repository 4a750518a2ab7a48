//! Deforms a model as real robots differ from theirs: a smooth displacement of the surface along
//! its normals, as castings have, a missing cover, a larger link, or shifted joints.

use geometry::{Pose, Vector};
use robot::{JointKind, Model};
use simulate::random::Random;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Number of waves in the sum.
const N_WAVES: usize = 3;
/// Largest wave number on an axis, radians a metre: waves of 0.8 m and longer.
const WAVE_NUMBER: f64 = 8.0;
/// Depth of a cover as a share of the link's size.
const COVER: f64 = 0.125;
/// Distance below which vertices of different triangles count as one corner, metres.
const WELD: f32 = 1e-4;

/// Moves the surface of each link along its normals by about `amplitude` metres at most: all around
/// it alike, so that it is too thick here and too thin there, or each of its six sides by itself.
pub(super) fn warp(model: &mut Model, amplitude: f64, each_side: bool, seed: u64) {
    for (l, link) in model.links.iter_mut().enumerate() {
        let mut random = Random::keyed(&[seed, l as u64, 0x5A]);
        let fields: Vec<Waves> =
            (0..if each_side { 6 } else { 1 }).map(|_| Waves::new(&mut random)).collect();
        let off = |p: &Vector, n: &Vector| -> f64 {
            let [field] = fields.as_slice() else {
                // Squares of a normal's parts add up to one.
                let side = |axis: usize| 2 * axis + usize::from(n[axis] < 0.0);
                return (0..3).map(|axis| n[axis] * n[axis] * fields[side(axis)].at(p)).sum();
            };
            field.at(p)
        };
        let mesh = Arc::make_mut(&mut link.mesh);
        let mut places: BTreeMap<[i32; 3], usize> = BTreeMap::new();
        let corner: Vec<usize> = mesh
            .vertices
            .iter()
            .map(|v| {
                let n = places.len();
                *places.entry(v.map(|c| (c / WELD).round() as i32)).or_insert(n)
            })
            .collect();
        let at = |i: u32| Vector::from(mesh.vertices[i as usize].map(f64::from));
        let mut normals = vec![Vector::zeros(); places.len()];
        for t in &mesh.triangles {
            let [a, b, c] = t.map(at);
            let n = (b - a).cross(&(c - a));
            t.iter().for_each(|&i| normals[corner[i as usize]] += n);
        }
        for (vertex, corner) in mesh.vertices.iter_mut().zip(&corner) {
            let Some(n) = normals[*corner].try_normalize(1e-12) else { continue };
            let p = Vector::from(vertex.map(f64::from));
            let moved = p + n * (amplitude * off(&p, &n));
            *vertex = [moved.x as f32, moved.y as f32, moved.z as f32];
        }
    }
}

/// A smooth field, about 1 at most.
struct Waves([(Vector, f64); N_WAVES]);

impl Waves {
    fn new(random: &mut Random) -> Self {
        Self(std::array::from_fn(|_| {
            let k = Vector::from_fn(|_, _| random.between(-WAVE_NUMBER, WAVE_NUMBER));
            (k, random.between(0.0, TAU))
        }))
    }

    fn at(&self, p: &Vector) -> f64 {
        let sum: f64 = self.0.iter().map(|(k, phase)| (k.dot(p) + phase).sin()).sum();
        sum / N_WAVES as f64 * 1.4
    }
}

/// Takes a cover off one link that moves: what lies within an eighth of its size of one of its
/// sides is not there.
pub(super) fn uncover(model: &mut Model, seed: u64) {
    let mut random = Random::keyed(&[seed, 0xC0F]);
    let Some(l) = any_moving(model, &mut random) else { return };
    let link = &mut model.links[l];
    let (bounds, size) = (link.bounds, link.bounds.size());
    let axis = ((random.unit() * 3.0) as usize).min(2);
    let is_high = random.unit() < 0.5;
    let mesh = Arc::make_mut(&mut link.mesh);
    let middle = |t: &[u32; 3]| {
        t.iter().map(|&i| f64::from(mesh.vertices[i as usize][axis])).sum::<f64>() / 3.0
    };
    let depth = |t: &[u32; 3]| match is_high {
        true => bounds.max[axis] - middle(t),
        false => middle(t) - bounds.min[axis],
    };
    let kept = mesh.triangles.iter().copied().filter(|t| depth(t) > COVER * size[axis]).collect();
    mesh.triangles = kept;
}

/// Makes the surface of one link that moves larger about its middle by a share of its size.
pub(super) fn scale(model: &mut Model, share: f64, seed: u64) {
    let mut random = Random::keyed(&[seed, 0x5CA]);
    let Some(l) = any_moving(model, &mut random) else { return };
    let link = &mut model.links[l];
    let middle = link.bounds.center();
    for vertex in &mut Arc::make_mut(&mut link.mesh).vertices {
        *vertex = [0, 1, 2].map(|i| {
            let v = f64::from(vertex[i]);
            (v + share * (v - middle[i])) as f32
        });
    }
}

/// One of the links with a surface, but for the first, which stands.
fn any_moving(model: &Model, random: &mut Random) -> Option<usize> {
    let bodies: Vec<usize> =
        (0..model.links.len()).filter(|&l| !model.links[l].bounds.is_empty()).skip(1).collect();
    bodies.get((random.unit() * bodies.len() as f64) as usize).copied()
}

/// Moves the place of each free joint: shift on each axis, metres, turn about each but its own,
/// degrees, one sigma.
pub(super) fn displace(model: &mut Model, [shift, turn]: [f64; 2], seed: u64) {
    let mut random = Random::keyed(&[seed, 0xF4A]);
    let free = model.free.clone();
    for joint in free {
        let joint = &mut model.joints[joint];
        let mut vector = |size: f64| Vector::from_fn(|_, _| random.normals()[0]) * size;
        let across = |v: Vector| v - joint.axis.into_inner() * v.dot(&joint.axis);
        let (mut moved, mut turned) = (vector(shift), vector(turn.to_radians()));
        if joint.kind == JointKind::Prismatic {
            moved = across(moved);
        } else {
            turned = across(turned);
        }
        joint.parent_from_joint *= Pose::new(moved, turned);
    }
}
