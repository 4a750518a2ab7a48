//! A small analytic ray caster with range noise and mixed pixels, which gives tiles with truth.
#![allow(dead_code, missing_docs, unreachable_pub)]

use contract::{InputId, Lattice, MaskId, Pixel, Scan, ScanId, TILE_SIDE, Tile, TileAt};
use geometry::{Aabb, Point, Pose, Vector};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::SplitMix64;

#[derive(Debug, Clone)]
pub enum Shape {
    /// z = tilt·(x, y) + wave·sin(x)·sin(y), inside bounds.
    Ground { z: f64, tilt: [f64; 2], wave: f64, x: [f64; 2], y: [f64; 2] },
    /// Axis-aligned box, seen from outside or inside.
    Block { min: [f64; 3], max: [f64; 3] },
    /// Cylinder from a to b, open ends.
    Pipe { a: Vector, b: Vector, r: f64 },
}

impl Shape {
    fn hit(&self, o: &Vector, d: &Vector) -> Option<f64> {
        match self {
            Self::Ground { z, tilt, wave, x, y } => {
                let height =
                    |p: &Vector| z + tilt[0] * p.x + tilt[1] * p.y + wave * p.x.sin() * p.y.sin();
                let slope = d.z - tilt[0] * d.x - tilt[1] * d.y;
                let mut t = -(o.z - z - tilt[0] * o.x - tilt[1] * o.y) / slope;
                for _ in 0..4 {
                    let p = o + d * t;
                    t -= (p.z - height(&p)) / slope;
                }
                let p = o + d * t;
                let inside = p.x >= x[0] && p.x <= x[1] && p.y >= y[0] && p.y <= y[1];
                (t > 1e-6 && t.is_finite() && inside).then_some(t)
            }
            Self::Block { min, max } => {
                let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
                for i in 0..3 {
                    let (a, b) = ((min[i] - o[i]) / d[i], (max[i] - o[i]) / d[i]);
                    near = near.max(a.min(b));
                    far = far.min(a.max(b));
                }
                let t = if near > 1e-6 { near } else { far };
                (near <= far && t > 1e-6).then_some(t)
            }
            Self::Pipe { a, b, r } => {
                let axis = (b - a).normalize();
                let (oa, dd) = (o - a, d - axis * axis.dot(d));
                let q = oa - axis * axis.dot(&oa);
                let (aa, bb, cc) = (dd.dot(&dd), q.dot(&dd), q.dot(&q) - r * r);
                let disc = bb * bb - aa * cc;
                if disc <= 0.0 || aa < 1e-15 {
                    return None;
                }
                let t = (-bb - disc.sqrt()) / aa;
                let s = axis.dot(&(o + d * t - a));
                (t > 1e-6 && s >= 0.0 && s <= (b - a).norm()).then_some(t)
            }
        }
    }
}

/// Mean 0, standard deviation 1, near enough.
fn normal(random: &mut SplitMix64) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

pub const NOTHING: usize = usize::MAX;

/// A tile with the truth of each of its points.
pub struct Truth {
    pub tile: Tile,
    /// Index of the shape, in the order of the tile's points.
    pub shape: Vec<usize>,
    /// Whether the point lies between surfaces, farther from both than neighbours on one surface
    /// are.
    pub veil: Vec<bool>,
    /// Whether the beam hit more than one surface.
    pub mixed: Vec<bool>,
}

pub struct Scene {
    pub shapes: Vec<Shape>,
    pub noise: f64,
    pub noise_growth: f64,
}

pub fn scan(position: [f64; 3], yaw: f64, step: f64) -> Scan {
    Scan {
        id: ScanId(0),
        input: InputId(0),
        mask: MaskId(0),
        name: "room".into(),
        source_id: None,
        places: Vec::new(),
        raster: None,
        scanner: contract::ScannerPosition::Stated,
        world_from_scan: Pose::new(Vector::from(position), Vector::z() * yaw),
        lattice: Some(Lattice::new(step, step, 0.0, 0.0)),
        stated_bounds: None,
        stated_points: None,
        notes: Vec::new(),
    }
}

impl Scene {
    fn cast(&self, o: &Vector, d: &Vector) -> (f64, usize) {
        let mut best = (f64::INFINITY, NOTHING);
        for (i, shape) in self.shapes.iter().enumerate() {
            if let Some(t) = shape.hit(o, d).filter(|t| *t < best.0) {
                best = (t, i);
            }
        }
        best
    }

    /// The tile at `row`, `col`; `None` where it holds nothing.
    pub fn tile(&self, scan: &Scan, row: u32, col: u32) -> Option<Truth> {
        let lattice = scan.lattice?;
        let o = scan.world_from_scan.translation.vector;
        let side = TILE_SIDE as i64 + 2;
        let direction = |i: i64, j: i64, di: f64, dj: f64| {
            let e = lattice.first_elevation + (i as f64 + di) * lattice.row_step;
            let a = lattice.first_azimuth + (j as f64 + dj) * lattice.col_step;
            Vector::from(geometry::direction::unit(a, e))
        };
        let (i0, j0) = (i64::from(row * TILE_SIDE) - 1, i64::from(col * TILE_SIDE) - 1);
        let world = |d: &Vector| scan.world_from_scan.rotation * d;
        let centres: Vec<(f64, usize)> = (0..side * side)
            .map(|k| self.cast(&o, &world(&direction(i0 + k / side, j0 + k % side, 0.0, 0.0))))
            .collect();
        let mut random = SplitMix64::seed_from_u64(u64::from(row) << 32 | u64::from(col));
        let mut out = Truth {
            tile: Tile {
                at: TileAt { scan: scan.id, row, col },
                first_place: 0,
                place: Vec::new(),
                pixel: Vec::new(),
                xyz: Vec::new(),
                bounds: Aabb::EMPTY,
                skip: 0,
                n_all: 0,
            },
            shape: Vec::new(),
            veil: Vec::new(),
            mixed: Vec::new(),
        };
        for k in 0..side * side {
            let (i, j) = (k / side, k % side);
            let pixel = Pixel { row: (i0 + i).max(0) as u32, col: (j0 + j).max(0) as u32 };
            if i == 0 || j == 0 || i == side - 1 || j == side - 1 {
                continue;
            }
            if pixel.row >= lattice.n_rows || pixel.col >= lattice.n_cols {
                continue;
            }
            let e = lattice.first_elevation + f64::from(pixel.row) * lattice.row_step;
            let (mut range, shape) = centres[k as usize];
            if e.abs() > std::f64::consts::FRAC_PI_2 || shape == NOTHING {
                continue;
            }
            let around = [k - 1, k + 1, k - side, k + side];
            let edge = around.iter().any(|&n| {
                let (r, s) = centres[n as usize];
                s != shape || (r - range).abs() > 0.05
            });
            let (mut mixed, mut veil) = (false, false);
            let sigma = self.noise + self.noise_growth * range;
            if edge {
                let mut ranges: Vec<f64> = Vec::new();
                for (di, dj) in (0..9).map(|n| (f64::from(n / 3) - 1.0, f64::from(n % 3) - 1.0)) {
                    let d = direction(i0 + i, j0 + j, 0.4 * di, 0.4 * dj);
                    ranges.extend(Some(self.cast(&o, &world(&d)).0).filter(|r| r.is_finite()));
                }
                if !ranges.is_empty() {
                    range = ranges.iter().sum::<f64>() / ranges.len() as f64;
                    let limit = range * lattice.row_step * 80_f64.to_radians().tan() + 4.3 * sigma;
                    mixed = ranges.iter().any(|r| (r - range).abs() > 5.0 * sigma);
                    let near = around
                        .iter()
                        .map(|&n| centres[n as usize].0)
                        .fold(f64::INFINITY, |a, r| a.min((r - range).abs()));
                    veil = near > limit && ranges.iter().all(|r| (r - range).abs() > limit);
                }
            }
            range += sigma * normal(&mut random);
            let p = direction(i0 + i, j0 + j, 0.0, 0.0) * range;
            out.tile.place.push(out.tile.place.len() as u32);
            out.tile.n_all += 1;
            out.tile.pixel.push(((i - 1) * 256 + (j - 1)) as u16);
            out.tile.xyz.push([p.x as f32, p.y as f32, p.z as f32]);
            let w = scan.world_from_scan * Point::from(p);
            out.tile.bounds.add([w.x, w.y, w.z]);
            out.shape.push(shape);
            out.veil.push(veil);
            out.mixed.push(mixed);
        }
        (!out.tile.is_empty()).then_some(out)
    }

    /// All tiles of a scan.
    pub fn tiles(&self, scan: &Scan) -> Vec<Truth> {
        let Some(lattice) = scan.lattice else {
            return Vec::new();
        };
        let mut out = Vec::new();
        for row in 0..lattice.n_rows.div_ceil(TILE_SIDE) {
            for col in 0..lattice.n_cols.div_ceil(TILE_SIDE) {
                out.extend(self.tile(scan, row, col));
            }
        }
        out
    }
}

/// Index of shapes in [`room`].
pub const FLOOR: usize = 0;
pub const ROOM: usize = 1;
pub const PIPE: usize = 2;
pub const TABLE: usize = 3;
pub const PEDESTAL: usize = 5;
pub const FOOT: usize = 6;

/// A room of 12 m × 9 m × 3 m with a tilted, wavy floor, a pipe of 50 mm radius, a table, a
/// pedestal with a round foot on it that leaves a ring, a column.
pub fn room(wave: f64) -> Scene {
    let whole = ([-6.0, 6.0], [-4.0, 5.0]);
    let shapes = vec![
        Shape::Ground { z: 0.0, tilt: [0.01, -0.004], wave, x: whole.0, y: whole.1 },
        Shape::Block { min: [-6.0, -4.0, -1.0], max: [6.0, 5.0, 3.0] },
        Shape::Pipe { a: Vector::new(-5.0, 2.0, 1.8), b: Vector::new(5.5, 2.5, 1.8), r: 0.05 },
        Shape::Block { min: [2.0, -2.0, 0.70], max: [3.6, -1.2, 0.74] },
        Shape::Block { min: [2.1, -1.9, -0.2], max: [2.16, -1.84, 0.7] },
        Shape::Block { min: [-2.3, 0.7, -0.2], max: [-1.7, 1.3, 0.5] },
        Shape::Pipe { a: Vector::new(-2.0, 1.0, 0.4), b: Vector::new(-2.0, 1.0, 1.2), r: 0.24 },
        Shape::Pipe { a: Vector::new(0.5, -3.0, -0.5), b: Vector::new(0.5, -3.0, 2.6), r: 0.2 },
    ];
    Scene { shapes, noise: 0.002, noise_growth: 1e-4 }
}
