//! Simple closed bodies from outlines: prism, lathe, loft, tube, and bodies made of them.

use super::body::Solid;
use super::cap;
use geometry::{Point, Vector};
use std::f64::consts::TAU;

/// A closed ring of vertices, counter-clockwise as seen from the end of the loft.
pub type Ring = Vec<Point>;

/// A body between rings of equal length, closed at both ends, which must be star-shaped about their
/// centres.
#[must_use]
pub fn loft(rings: &[Ring]) -> Solid {
    let n = rings.first().map_or(0, Vec::len);
    let mut out = Solid::default();
    for ring in rings {
        out.vertices.extend_from_slice(ring);
    }
    let id = |ring: usize, k: usize| (ring * n + k % n) as u32;
    for r in 1..rings.len() {
        for k in 0..n {
            out.triangles.push([id(r - 1, k), id(r - 1, k + 1), id(r, k + 1)]);
            out.triangles.push([id(r - 1, k), id(r, k + 1), id(r, k)]);
        }
    }
    for (r, flip) in [(0, true), (rings.len() - 1, false)] {
        let middle = rings[r].iter().map(|p| p.coords).sum::<Vector>() / n as f64;
        let centre = out.vertices.len() as u32;
        out.vertices.push(Point::from(middle));
        for k in 0..n {
            let (a, b) = (id(r, k), id(r, k + 1));
            out.triangles.push(if flip { [centre, b, a] } else { [centre, a, b] });
        }
    }
    out
}

/// A rectangle with rounded corners in a plane z = constant, with centre, size in x and y, corner
/// radius (metres), and number of steps of each corner.
#[must_use]
pub fn rounded(centre: [f64; 3], size: [f64; 2], radius: f64, steps: usize) -> Ring {
    let radius = radius.min(0.499 * size[0]).min(0.499 * size[1]);
    let (hx, hy) = (0.5 * size[0] - radius, 0.5 * size[1] - radius);
    let mut out = Vec::with_capacity(4 * (steps + 1));
    for (corner, (sx, sy)) in
        [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].into_iter().enumerate()
    {
        for k in 0..=steps {
            let angle = TAU * 0.25 * (corner as f64 + k as f64 / steps as f64);
            out.push(Point::new(
                centre[0] + sx * hx + radius * angle.cos(),
                centre[1] + sy * hy + radius * angle.sin(),
                centre[2],
            ));
        }
    }
    out
}

/// A simple polygon (x, y; counter-clockwise) extruded from `z0` to `z1`, both ends chamfered by
/// `chamfer` metres.
#[must_use]
pub fn prism(outline: &[[f64; 2]], z0: f64, z1: f64, chamfer: f64) -> Solid {
    let inner = cap::inset(outline, chamfer);
    let flat = |z: f64, ring: &[[f64; 2]]| -> Ring {
        ring.iter().map(|p| Point::new(p[0], p[1], z)).collect()
    };
    let rings = if chamfer > 0.0 {
        vec![
            flat(z0, &inner),
            flat(z0 + chamfer, outline),
            flat(z1 - chamfer, outline),
            flat(z1, &inner),
        ]
    } else {
        vec![flat(z0, outline), flat(z1, outline)]
    };
    let n = outline.len();
    let mut out = loft(&rings);
    // A loft closes its ends with fans; an outline may be concave, so that ears replace them.
    out.triangles.truncate(2 * n * (rings.len() - 1));
    out.vertices.truncate(n * rings.len());
    let last = (n * (rings.len() - 1)) as u32;
    for [a, b, c] in cap::ears(if chamfer > 0.0 { &inner } else { outline }) {
        out.triangles.push([c, b, a]);
        out.triangles.push([a + last, b + last, c + last]);
    }
    out
}

/// A box about the origin with chamfered edges.
#[must_use]
pub fn cuboid(size: [f64; 3], chamfer: f64) -> Solid {
    let (x, y, z) = (0.5 * size[0], 0.5 * size[1], 0.5 * size[2]);
    let c = chamfer.min(0.4 * x).min(0.4 * y).min(0.4 * z);
    if c <= 0.0 {
        return prism(&[[-x, -y], [x, -y], [x, y], [-x, y]], -z, z, 0.0);
    }
    let outline = [
        [-x + c, -y],
        [x - c, -y],
        [x, -y + c],
        [x, y - c],
        [x - c, y],
        [-x + c, y],
        [-x, y - c],
        [-x, -y + c],
    ];
    prism(&outline, -z, z, c)
}

/// A body of revolution about z from its profile (radius, z), upwards, radii positive; flat ends.
#[must_use]
pub fn lathe(profile: &[[f64; 2]], n: usize) -> Solid {
    let rings: Vec<Ring> = profile
        .iter()
        .map(|&[radius, z]| {
            (0..n)
                .map(|k| {
                    let (sin, cos) = (TAU * k as f64 / n as f64).sin_cos();
                    Point::new(radius * cos, radius * sin, z)
                })
                .collect()
        })
        .collect();
    loft(&rings)
}

/// An upright cylinder of `n` sides with chamfered ends.
#[must_use]
pub fn disc(radius: f64, z0: f64, z1: f64, chamfer: f64, n: usize) -> Solid {
    if chamfer <= 0.0 {
        return lathe(&[[radius, z0], [radius, z1]], n);
    }
    let c = chamfer;
    lathe(&[[radius - c, z0], [radius, z0 + c], [radius, z1 - c], [radius - c, z1]], n)
}

/// `count` hexagonal bolt heads upright on the plane z = `z`, on a circle of `radius`; `size` is a
/// head's diameter.
#[must_use]
pub fn bolts(count: usize, radius: f64, z: f64, size: f64) -> Solid {
    Solid::of((0..count).map(|k| {
        let (sin, cos) = (TAU * (k as f64 + 0.5) / count as f64).sin_cos();
        disc(0.5 * size, -0.2 * size, 0.6 * size, 0.08 * size, 6).at([
            radius * cos,
            radius * sin,
            z,
        ])
    }))
}

/// A round tube of `n` sides along a path of at least two points, with flat ends. The cross-section
/// does not twist along the path.
#[must_use]
pub fn tube(path: &[Point], radius: f64, n: usize) -> Solid {
    let direction = |i: usize| -> Vector {
        let (a, b) = (path[i.saturating_sub(1)], path[(i + 1).min(path.len() - 1)]);
        (b - a).try_normalize(1e-12).unwrap_or_else(Vector::z)
    };
    let along = direction(0);
    let mut side =
        if along.x.abs() < 0.8 { along.cross(&Vector::x()) } else { along.cross(&Vector::y()) };
    let mut rings: Vec<Ring> = Vec::with_capacity(path.len());
    for (i, centre) in path.iter().enumerate() {
        let along = direction(i);
        side = (side - along * side.dot(&along)).try_normalize(1e-9).unwrap_or(side);
        let other = along.cross(&side);
        let ring = (0..n).map(|k| {
            let (sin, cos) = (TAU * k as f64 / n as f64).sin_cos();
            centre + (side * cos + other * sin) * radius
        });
        rings.push(ring.collect());
    }
    loft(&rings)
}
