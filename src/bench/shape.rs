//! A model in; the same as a real robot differs from it out: its surface off by a smooth field along its normals, as
//! castings are, or its joints elsewhere.

use geometry::{Pose, Vector};
use robot::{JointKind, Model};
use simulate::random::Random;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Waves that are added up.
const N_WAVES: usize = 3;
/// Largest wave number on an axis, radians a metre: waves of 0.8 m and longer.
const WAVE_NUMBER: f64 = 8.0;
/// Vertices of one corner that triangles do not share are one if they agree to this, metres.
const WELD: f32 = 1e-4;

/// Moves the surface of each link along its normals by about `amplitude` metres at most.
pub(super) fn warp(model: &mut Model, amplitude: f64, seed: u64) {
    for (l, link) in model.links.iter_mut().enumerate() {
        let mut random = Random::keyed(&[seed, l as u64, 0x5A]);
        let waves: Vec<(Vector, f64)> = (0..N_WAVES)
            .map(|_| {
                let k = Vector::from_fn(|_, _| random.between(-WAVE_NUMBER, WAVE_NUMBER));
                (k, random.between(0.0, TAU))
            })
            .collect();
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
            let field: f64 = waves.iter().map(|(k, phase)| (k.dot(&p) + phase).sin()).sum();
            let moved = p + n * (amplitude * field / N_WAVES as f64 * 1.4);
            *vertex = [moved.x as f32, moved.y as f32, moved.z as f32];
        }
    }
}

/// Moves the place of each free joint: shift on each axis, metres, turn about each but its own, degrees, one sigma.
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
