//! Triangulates boxes, cylinders, capsules and spheres, oriented outward, and splits polygons.

use super::soup::Soup;
use std::f64::consts::{PI, TAU};

/// Sides of a round body: 13 would deviate by 3 % from the true radius, 48 deviate by 0.2 %.
const N_SIDES: u32 = 48;

/// Adds the triangles of a polygon as a fan, which is exact for convex polygons and what viewers do
/// with others.
pub(super) fn fan(soup: &mut Soup, corners: &[u32]) -> Result<(), String> {
    for k in 2..corners.len() {
        soup.add_triangle([corners[0], corners[k - 1], corners[k]])?;
    }
    Ok(())
}

/// A box centred at the origin, edges in metres.
pub(crate) fn cuboid(size: [f64; 3]) -> Soup {
    let mut soup = Soup::default();
    for n in 0..8_u32 {
        let side = |axis: u32| if n >> axis & 1 == 0 { -0.5 } else { 0.5 };
        soup.vertices.push([side(0) * size[0], side(1) * size[1], side(2) * size[2]]);
    }
    for quad in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    {
        soup.triangles.push([quad[0], quad[1], quad[2]]);
        soup.triangles.push([quad[0], quad[2], quad[3]]);
    }
    soup
}

/// A body of revolution about z from its profile of (radius, height), metres, from bottom to top.
/// The profile should start and end at radius 0.
fn lathe(profile: &[(f64, f64)]) -> Soup {
    let mut soup = Soup::default();
    for &(radius, z) in profile {
        for k in 0..N_SIDES {
            let angle = TAU * f64::from(k) / f64::from(N_SIDES);
            soup.vertices.push([radius * angle.cos(), radius * angle.sin(), z]);
        }
    }
    for ring in 0..profile.len() as u32 - 1 {
        for k in 0..N_SIDES {
            let (a, b) = (ring * N_SIDES + k, ring * N_SIDES + (k + 1) % N_SIDES);
            let (c, d) = (a + N_SIDES, b + N_SIDES);
            soup.triangles.push([a, b, d]);
            soup.triangles.push([a, d, c]);
        }
    }
    soup
}

/// A cylinder about z, centred at the origin, metres.
pub(crate) fn cylinder(radius: f64, length: f64) -> Soup {
    let half = 0.5 * length;
    lathe(&[(0.0, -half), (radius, -half), (radius, half), (0.0, half)])
}

/// A sphere centred at the origin, metres.
pub(crate) fn sphere(radius: f64) -> Soup {
    capsule(radius, 0.0)
}

/// A cylinder about z of this length with hemispheres on its ends, metres.
pub(crate) fn capsule(radius: f64, length: f64) -> Soup {
    let n = N_SIDES / 2;
    let mut profile = Vec::new();
    for k in 0..=n {
        let angle = PI * (f64::from(k) / f64::from(n) - 0.5);
        let shift = if k <= n / 2 { -0.5 * length } else { 0.5 * length };
        profile.push(((radius * angle.cos()).max(0.0), radius * angle.sin() + shift));
        if k == n / 2 && length > 0.0 {
            profile.push((radius, 0.5 * length));
        }
    }
    lathe(&profile)
}
