//! Bodies of the hall: building, ground, columns, fences and furniture.

use crate::scene::{
    Building, Column, Fence, FenceFilling, Furniture, Scene, SceneFloor, SceneStand, Section,
    StandShape,
};
use crate::solid::{Solid, bolts, cuboid, disc, lathe, prism, tube};
use geometry::Point;

/// Thickness of walls and ceiling, metres; their outside is never seen.
const WALL: f64 = 0.2;
/// Largest distance of the ground's facets from its waves, metres: a tenth of a scanner's noise.
const FACET: f64 = 0.0002;
/// Largest number of cells along one side of the ground: 2 million triangles.
const MAX_CELLS: f64 = 1000.0;
/// Thickness of a fence wire, metres.
const WIRE: f64 = 0.004;
/// Distance of fence wires, metres.
const MESH: f64 = 0.05;
/// Distance of fence posts, metres.
const POSTS: f64 = 2.0;

/// A box between two corners.
fn slab(min: [f64; 3], max: [f64; 3], chamfer: f64) -> Solid {
    let size = [0, 1, 2].map(|i| max[i] - min[i]);
    cuboid(size, chamfer).at([0, 1, 2].map(|i| 0.5 * (min[i] + max[i])))
}

/// Walls and ceiling.
pub(crate) fn building(hall: &Building, lowest: f64) -> Solid {
    let [x, y, z] = [0.5 * hall.size[0], 0.5 * hall.size[1], hall.size[2]];
    let mut out = Solid::default();
    if hall.walls {
        // The walls reach below the lowest ground, so that no beam passes under them.
        let low = lowest - 0.5;
        out.add(&slab([-x - WALL, -y - WALL, low], [x + WALL, -y, z], 0.0));
        out.add(&slab([-x - WALL, y, low], [x + WALL, y + WALL, z], 0.0));
        out.add(&slab([-x - WALL, -y, low], [-x, y, z], 0.0));
        out.add(&slab([x, -y, low], [x + WALL, y, z], 0.0));
    }
    if hall.ceiling {
        out.add(&slab([-x - WALL, -y - WALL, z], [x + WALL, y + WALL, z + WALL], 0.0));
    }
    out
}

/// Edge of a ground cell, metres: as wide as [`FACET`] allows.
fn ground_cell(floor: &SceneFloor) -> f64 {
    // A chord of length c is c²·curvature/8 away from its arc; the shorter of the two waves counts.
    let curvature =
        floor.wave_amplitude * (1.37 * std::f64::consts::TAU / floor.wave_length).powi(2);
    (8.0 * FACET / curvature.max(1e-9)).sqrt().clamp(0.1, 2.0 * MAX_CELLS)
}

/// A surface over a rectangle with the given height at each place.
fn sheet(cell: f64, min: [f64; 2], max: [f64; 2], height: impl Fn(f64, f64) -> f64) -> Solid {
    let cells = [0, 1].map(|i| ((max[i] - min[i]) / cell).ceil().clamp(1.0, MAX_CELLS) as usize);
    let mut out = Solid::default();
    for j in 0..=cells[1] {
        for i in 0..=cells[0] {
            let x = min[0] + (max[0] - min[0]) * i as f64 / cells[0] as f64;
            let y = min[1] + (max[1] - min[1]) * j as f64 / cells[1] as f64;
            out.vertices.push(Point::new(x, y, height(x, y)));
        }
    }
    let id = |i: usize, j: usize| (j * (cells[0] + 1) + i) as u32;
    for j in 0..cells[1] {
        for i in 0..cells[0] {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            out.triangles.push([a, b, c]);
            out.triangles.push([a, c, d]);
        }
    }
    out
}

/// The ground with its raised levels (first), and the faces of their steps (second).
pub(crate) fn ground(scene: &Scene) -> (Solid, Solid) {
    let mut faces = Solid::default();
    let Some(floor) = &scene.floor else {
        return (Solid::default(), faces);
    };
    let cell = ground_cell(floor);
    let [x, y] = scene.ground_size().map(|s| 0.5 * s);
    let mut out = sheet(cell, [-x, -y], [x, y], |x, y| floor.base_height(x, y));
    for level in &floor.levels {
        let (a, b) = (level.min, level.max);
        out.add(&sheet(cell, a, b, |x, y| level.height + floor.base_height(x, y)));
        for (p, q) in [
            ([a[0], a[1]], [b[0], a[1]]),
            ([b[0], a[1]], [b[0], b[1]]),
            ([b[0], b[1]], [a[0], b[1]]),
            ([a[0], b[1]], [a[0], a[1]]),
        ] {
            faces.add(&step_face(cell, p, q, level.height, |x, y| floor.base_height(x, y)));
        }
    }
    (out, faces)
}

/// The upright face of a step from `p` to `q`.
fn step_face(
    cell: f64,
    p: [f64; 2],
    q: [f64; 2],
    height: f64,
    base: impl Fn(f64, f64) -> f64,
) -> Solid {
    let n = ((q[0] - p[0]).hypot(q[1] - p[1]) / cell).ceil().clamp(1.0, MAX_CELLS) as usize;
    let mut out = Solid::default();
    for i in 0..=n {
        let t = i as f64 / n as f64;
        let (x, y) = (p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t);
        let z = base(x, y);
        out.vertices.push(Point::new(x, y, z - 0.05));
        out.vertices.push(Point::new(x, y, z + height));
    }
    for i in 0..n as u32 {
        let k = 2 * i;
        out.triangles.push([k, k + 2, k + 3]);
        out.triangles.push([k, k + 3, k + 1]);
    }
    out
}

/// A column that stands on ground of height `z`.
pub(crate) fn column(column: &Column, z: f64) -> Solid {
    let (r, h) = (column.radius, column.height);
    let shaft = match column.section {
        Section::Round => disc(r, -0.05, h, 0.0, 48),
        Section::IBeam => {
            let (f, w) = (0.12 * r, 0.08 * r); // flange and web: half of what rolled sections of this size have
            let half =
                [[-r, -r], [r, -r], [r, -r + f], [w, -r + f], [w, r - f], [r, r - f], [r, r]];
            let rest = [[-r, r], [-r, r - f], [-w, r - f], [-w, -r + f], [-r, -r + f]];
            prism(&[half.as_slice(), &rest].concat(), -0.05, h, 0.0)
        }
    };
    let foot = Solid::of([
        cuboid([3.2 * r, 3.2 * r, 0.03], 0.004).at([0.0, 0.0, 0.01]),
        bolts(4, 1.8 * r, 0.025, 0.03),
    ]);
    Solid::of([shaft, foot]).at([column.xy[0], column.xy[1], z])
}

/// A fence over the ground: posts and panels (first), and the wires of its panels (second).
pub(crate) fn fence(fence: &Fence, ground: impl Fn(f64, f64) -> f64) -> (Solid, Solid) {
    let (dx, dy) = (fence.to[0] - fence.from[0], fence.to[1] - fence.from[1]);
    let length = dx.hypot(dy);
    let fields = (length / POSTS).ceil().max(1.0) as usize;
    let width = length / fields as f64;
    let (mut posts, mut wires) = (Solid::default(), Solid::default());
    for k in 0..=fields {
        let s = width * k as f64;
        let z = ground(fence.from[0] + dx * s / length, fence.from[1] + dy * s / length);
        posts.add(&slab(
            [s - 0.03, -0.03, z - 0.02],
            [s + 0.03, 0.03, z + fence.height + 0.05],
            0.004,
        ));
        posts.add(&slab([s - 0.08, -0.06, z - 0.01], [s + 0.08, 0.06, z + 0.012], 0.002));
        if k == fields {
            break;
        }
        // Panels start 0.15 m above the ground, as rules for guards allow.
        let (low, high) = (z + 0.15, z + fence.height);
        let (left, right) = (s + 0.04, s + width - 0.04);
        match fence.filling {
            FenceFilling::Panel => posts.add(&slab([left, -0.002, low], [right, 0.002, high], 0.0)),
            FenceFilling::Wires => wires.add(&wire_mesh([left, right], [low, high])),
        }
    }
    let yaw = dy.atan2(dx).to_degrees();
    let place = |s: Solid| s.turned([0.0, 0.0, yaw]).at([fence.from[0], fence.from[1], 0.0]);
    (place(posts), place(wires))
}

/// Wires up and across in the plane y = 0, inside a frame of 20 mm tube.
fn wire_mesh(x: [f64; 2], z: [f64; 2]) -> Solid {
    let mut out = Solid::default();
    let line = |a: [f64; 3], b: [f64; 3], r: f64| tube(&[Point::from(a), Point::from(b)], r, 6);
    let up = ((x[1] - x[0]) / MESH).round().max(1.0) as usize;
    let across = ((z[1] - z[0]) / MESH).round().max(1.0) as usize;
    for i in 1..up {
        let at = x[0] + (x[1] - x[0]) * i as f64 / up as f64;
        out.add(&line([at, 0.5 * WIRE, z[0]], [at, 0.5 * WIRE, z[1]], 0.5 * WIRE));
    }
    for i in 1..across {
        let at = z[0] + (z[1] - z[0]) * i as f64 / across as f64;
        out.add(&line([x[0], -0.5 * WIRE, at], [x[1], -0.5 * WIRE, at], 0.5 * WIRE));
    }
    for at in x {
        out.add(&line([at, 0.0, z[0] - 0.01], [at, 0.0, z[1] + 0.01], 0.01));
    }
    for at in z {
        out.add(&line([x[0], 0.0, at], [x[1], 0.0, at], 0.01));
    }
    out
}

/// A roller conveyor on ground height `z`.
pub(crate) fn conveyor(f: &Furniture, z: f64) -> Solid {
    let [l, w, h] = f.size;
    let mut out = Solid::default();
    for side in [-1.0, 1.0] {
        // A C-rail, open to the inside.
        let y = side * 0.5 * w;
        out.add(&slab([-0.5 * l, y - 0.003, h - 0.12], [0.5 * l, y + 0.003, h + 0.02], 0.0));
        let inner = y - side * 0.04;
        out.add(&slab([-0.5 * l, y.min(inner), h - 0.12], [0.5 * l, y.max(inner), h - 0.114], 0.0));
        for k in 0..=(l / 1.5).ceil() as usize {
            let x = (-0.5 * l + 0.06) + (l - 0.12) * k as f64 / (l / 1.5).ceil().max(1.0);
            out.add(&slab([x - 0.025, y - 0.025, -0.02], [x + 0.025, y + 0.025, h - 0.11], 0.003));
            out.add(&disc(0.05, -0.01, 0.012, 0.003, 16).at([x, y, 0.0]));
        }
    }
    let rollers = (l / 0.1).floor().max(1.0) as usize;
    for k in 0..rollers {
        let x = -0.5 * l + l * (k as f64 + 0.5) / rollers as f64;
        out.add(&disc(0.025, -0.5 * w + 0.004, 0.5 * w - 0.004, 0.0, 20).along_y().at([
            x,
            0.0,
            h - 0.02,
        ]));
    }
    // The drive hangs below one end, so that the two ends differ.
    out.add(&disc(0.08, -0.15, 0.15, 0.01, 24).along_y().at([0.5 * l - 0.5, 0.05, h - 0.25]));
    out.turned([0.0, 0.0, f.yaw_deg]).at([f.xy[0], f.xy[1], z])
}

/// A work bench with a shelf, a vice and a cabinet, on ground height `z`.
pub(crate) fn bench(f: &Furniture, z: f64) -> Solid {
    let [l, w, h] = f.size;
    let mut out = slab([-0.5 * l, -0.5 * w, h - 0.04], [0.5 * l, 0.5 * w, h], 0.004);
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let (x, y) = (sx * (0.5 * l - 0.06), sy * (0.5 * w - 0.06));
        out.add(&slab([x - 0.03, y - 0.03, -0.02], [x + 0.03, y + 0.03, h - 0.03], 0.003));
    }
    out.add(&slab(
        [-0.5 * l + 0.05, -0.5 * w + 0.05, 0.2],
        [0.5 * l - 0.05, 0.5 * w - 0.05, 0.22],
        0.0,
    ));
    out.add(&slab(
        [0.1 * l, -0.5 * w + 0.04, h - 0.45],
        [0.5 * l - 0.1, 0.5 * w - 0.08, h - 0.04],
        0.005,
    ));
    out.add(&slab([-0.4 * l, -0.5 * w, h], [-0.4 * l + 0.14, -0.5 * w + 0.2, h + 0.13], 0.015));
    out.add(&disc(0.012, -0.1, 0.1, 0.0, 12).along_x().at([
        -0.4 * l + 0.07,
        -0.5 * w - 0.06,
        h + 0.07,
    ]));
    out.turned([0.0, 0.0, f.yaw_deg]).at([f.xy[0], f.xy[1], z])
}

/// A stand from ground height `z` to its top.
pub(crate) fn stand(stand: &SceneStand, z: f64) -> Solid {
    let h = (stand.top - z).max(0.01);
    let s = stand.side;
    let plate = |side: f64, low: f64, high: f64| {
        cuboid([side, side, high - low], 0.004).at([0.0, 0.0, 0.5 * (low + high)])
    };
    let thick = (0.25 * h).min(0.03);
    let body = match stand.shape {
        StandShape::Pedestal => Solid::of([
            plate(s, h - thick, h),
            plate(1.15 * s, -0.02, thick),
            lathe(
                &[
                    [0.42 * s, 0.5 * thick],
                    [0.32 * s, 0.2 * h],
                    [0.32 * s, 0.8 * h],
                    [0.42 * s, h - 0.5 * thick],
                ],
                48,
            ),
            bolts(4, 0.72 * s, thick, 0.03),
        ]),
        StandShape::Table => {
            let leg = 0.5 * s - 0.05;
            let mut out = plate(s, h - thick, h);
            for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let (x, y) = (sx * leg, sy * leg);
                out.add(&slab(
                    [x - 0.04, y - 0.04, -0.02],
                    [x + 0.04, y + 0.04, h - 0.5 * thick],
                    0.004,
                ));
            }
            out.add(&slab([-leg, -0.03, 0.3 * h], [leg, 0.03, 0.3 * h + 0.06], 0.0));
            out
        }
        StandShape::Plinth => plate(s, -0.05, h),
    };
    body.turned([0.0, 0.0, stand.yaw_deg]).at([stand.xy[0], stand.xy[1], z])
}
