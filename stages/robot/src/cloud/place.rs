//! Places on the surface of a mesh, and a random choice among them.

use crate::model::Mesh;
use nalgebra::Vector3;
use rand::Rng as _;
use rand_xoshiro::SplitMix64;

/// A place on the surface, with its normal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceSample {
    pub(crate) at: Vector3<f32>,
    pub(crate) normal: Vector3<f32>,
}

/// An integer in [0, n).
pub(crate) fn below(random: &mut SplitMix64, n: usize) -> usize {
    ((u128::from(random.next_u64()) * n as u128) >> 64) as usize
}

/// The corners of a triangle, metres.
pub(crate) fn corners(mesh: &Mesh, triangle: &[u32; 3]) -> [Vector3<f32>; 3] {
    triangle.map(|i| mesh.vertices[i as usize].into())
}
