//! Planar regions of a raster with normals, grown over linked pixels from the flattest seeds.

use crate::Settings;
use crate::links::linked;
use crate::normals::Normals;
use crate::raster::TileRaster;
use geometry::{Moments, Vector};
use nalgebra::Matrix3;

/// Owner of a pixel that belongs to no region.
pub(crate) const FREE: u16 = 0;
/// Owner of a pixel of a rejected region: it is no seed any more, but other regions may take it.
const TRIED: u16 = 1;
/// Owner of the pixels of the region that is growing.
const GROWING: u16 = 2;
/// Number of the first accepted region.
pub(crate) const FIRST: u16 = 3;
/// Distance between seeds, pixels: a patch of the smallest area at any useful density holds
/// several.
const SEED_STEP: usize = 3;
/// Largest angles between neighbouring normals of the classes of seeds, radians; the flattest class
/// is tried first.
const SEED_CLASSES: [f32; 4] = [0.026, 0.06, 0.12, 0.24];
/// Number of points at the first refit.
const FIRST_REFIT: usize = 12;
/// Spread along a plane, in units of the spread across it, from which on points determine the
/// plane's direction better than the seed's window does. Close to the scanner, neighbours are
/// nearer to each other than their noise.
const MIN_SLENDERNESS: f64 = 6.0;
/// Cosine of the largest angle of the normal of a pixel near a crease (60°), whose window looks
/// around the corner.
const CREASE: f32 = 0.5;

/// One accepted region.
#[derive(Debug, Clone)]
pub(crate) struct Grown {
    /// Unit normal towards the scanner, scan frame.
    pub(crate) normal: [f32; 3],
    /// Range of its members in [`Regions::members`].
    pub(crate) members: std::ops::Range<usize>,
    /// Moments of its points, scan frame.
    pub(crate) moments: Moments,
}

/// All regions of one tile; buffers are reused.
#[derive(Debug, Default)]
pub(crate) struct Regions {
    /// Region of each pixel; [`FREE`] and [`TRIED`] are below [`FIRST`].
    pub(crate) owner: Vec<u16>,
    /// Pixels of all regions, one region after the other.
    pub(crate) members: Vec<u16>,
    /// Accepted regions, in order of acceptance.
    pub(crate) grown: Vec<Grown>,
    seeds: [Vec<u16>; SEED_CLASSES.len()],
}

/// The plane and the limits by which one region grows.
struct Growth {
    n: [f32; 3],
    d: f32,
    cosine: f32,
    angular: f32,
    flatness: f32,
}

impl Growth {
    /// Whether a point lies on the plane, within its noise along the normal.
    #[inline]
    fn holds(&self, p: [f32; 4], raster: &TileRaster) -> bool {
        let along = self.n[0] * p[0] + self.n[1] * p[1] + self.n[2] * p[2];
        let facing = along.abs() / p[3];
        let sigma = raster.noise.sigma(p[3]) * facing.max(0.2) + self.angular * p[3];
        (along - self.d).abs() <= 3.0 * sigma + self.flatness
    }

    #[inline]
    fn agrees(&self, n: [f32; 3], cosine: f32) -> bool {
        self.n[0] * n[0] + self.n[1] * n[1] + self.n[2] * n[2] >= cosine
    }

    fn refit(&mut self, sums: &PointSums) {
        let moments = sums.moments();
        let known = moments.plane().filter(|fit| fit.spread[1] >= MIN_SLENDERNESS * fit.rms);
        let Some(fit) = known else {
            let mean = moments.mean().map(|v| v as f32);
            self.d = self.n[0] * mean.x + self.n[1] * mean.y + self.n[2] * mean.z;
            return;
        };
        let n = fit.plane.normal.map(|v| v as f32);
        // Normals point towards the scanner, which is the origin.
        let sign = if fit.plane.offset > 0.0 { -1.0 } else { 1.0 };
        self.n = [n.x * sign, n.y * sign, n.z * sign];
        self.d = fit.plane.offset as f32 * sign;
    }
}

/// Moments of points about a near origin; they use symmetry and are cheaper than [`Moments`].
struct PointSums {
    origin: [f32; 3],
    s: [f64; 10],
}

impl PointSums {
    fn new(p: [f32; 4]) -> Self {
        Self { origin: [p[0], p[1], p[2]], s: [0.0; 10] }
    }

    #[inline]
    fn add(&mut self, p: [f32; 4]) {
        let [x, y, z] = std::array::from_fn(|i| f64::from(p[i] - self.origin[i]));
        let terms = [1.0, x, y, z, x * x, x * y, x * z, y * y, y * z, z * z];
        for (s, t) in self.s.iter_mut().zip(terms) {
            *s += t;
        }
    }

    fn moments(&self) -> Moments {
        let s = &self.s;
        Moments {
            origin: Vector::from(self.origin.map(f64::from)),
            n: s[0],
            sum: Vector::new(s[1], s[2], s[3]),
            outer: Matrix3::new(s[4], s[5], s[6], s[5], s[7], s[8], s[6], s[8], s[9]),
        }
    }
}

impl Regions {
    /// Grows all regions of `raster`.
    pub(crate) fn fill(&mut self, raster: &TileRaster, normals: &Normals, settings: &Settings) {
        self.owner.clear();
        self.owner.resize(raster.n_pixels(), FREE);
        self.members.clear();
        self.grown.clear();
        self.find_seeds(raster, normals);
        for class in 0..SEED_CLASSES.len() {
            let seeds = std::mem::take(&mut self.seeds[class]);
            for &seed in &seeds {
                if self.owner[usize::from(seed)] == FREE {
                    self.grow(usize::from(seed), raster, normals, settings);
                }
            }
            self.seeds[class] = seeds;
        }
    }

    fn find_seeds(&mut self, raster: &TileRaster, normals: &Normals) {
        self.seeds.iter_mut().for_each(Vec::clear);
        let limits = SEED_CLASSES.map(f32::cos);
        let side = raster.side;
        for row in (SEED_STEP / 2..side).step_by(SEED_STEP) {
            for col in (SEED_STEP / 2..side).step_by(SEED_STEP) {
                let at = row * side + col;
                if !raster.holds(at) || normals.error[at] == 0.0 {
                    continue;
                }
                let by = usize::from(normals.half[at]).clamp(1, 6);
                let n = normals.normal[at];
                let (mut least, mut count) = (1.0_f32, 0);
                let mut look = |other: usize| {
                    if normals.error[other] > 0.0 {
                        let m = normals.normal[other];
                        least = least.min(n[0] * m[0] + n[1] * m[1] + n[2] * m[2]);
                        count += 1;
                    }
                };
                if col >= by {
                    look(at - by);
                }
                if col + by < side {
                    look(at + by);
                }
                if row >= by {
                    look(at - by * side);
                }
                if row + by < side {
                    look(at + by * side);
                }
                let class = limits.iter().position(|&l| least >= l);
                if let (Some(class), true) = (class, count >= 2) {
                    self.seeds[class].push(at as u16);
                }
            }
        }
    }

    fn grow(&mut self, seed: usize, raster: &TileRaster, normals: &Normals, settings: &Settings) {
        let p = raster.xyzr[seed];
        let n = normals.normal[seed];
        let least = settings.normal_tolerance as f32;
        let most = settings.max_normal_tolerance as f32;
        let mut growth = Growth {
            n,
            d: n[0] * p[0] + n[1] * p[1] + n[2] * p[2],
            cosine: (3.0 * normals.error[seed]).clamp(least, most.max(least)).cos(),
            angular: settings.angular_noise as f32,
            flatness: settings.flatness as f32,
        };
        let first = self.members.len();
        let mut sums = PointSums::new(p);
        self.take(seed, &mut sums, raster);
        let (mut next, mut refit_at) = (first, FIRST_REFIT);
        while next < self.members.len() {
            let at = usize::from(self.members[next]);
            next += 1;
            for direction in 0..4 {
                let Some(other) = linked(raster, at, direction) else {
                    continue;
                };
                if self.owner[other] <= TRIED
                    && raster.holds(other)
                    && growth.agrees(normals.normal[other], growth.cosine)
                    && growth.holds(raster.xyzr[other], raster)
                {
                    self.take(other, &mut sums, raster);
                }
            }
            if self.members.len() - first >= refit_at {
                refit_at = 2 * (self.members.len() - first);
                growth.refit(&sums);
            }
        }
        self.settle(first, growth, &sums, raster, normals, settings);
    }

    fn take(&mut self, at: usize, sums: &mut PointSums, raster: &TileRaster) {
        self.owner[at] = GROWING;
        self.members.push(at as u16);
        sums.add(raster.xyzr[at]);
    }

    /// Refits a grown region, releases pixels that do not lie on it, adds its border, and keeps it
    /// if it is large enough.
    fn settle(
        &mut self,
        first: usize,
        mut growth: Growth,
        sums: &PointSums,
        raster: &TileRaster,
        normals: &Normals,
        settings: &Settings,
    ) {
        let width = |m: &Moments| m.plane().map_or(0.0, |f| f.spread[1] * 12_f64.sqrt());
        let narrow = settings.min_level_width.min(settings.min_patch_width);
        let enough = self.members.len() - first >= settings.min_patch_points;
        if !enough || width(&sums.moments()) < narrow {
            self.release(first);
            return;
        }
        growth.refit(sums);
        let mut kept = first;
        for i in first..self.members.len() {
            let at = self.members[i];
            if growth.holds(raster.xyzr[usize::from(at)], raster) {
                self.members[kept] = at;
                kept += 1;
            } else {
                self.owner[usize::from(at)] = TRIED;
            }
        }
        self.members.truncate(kept);
        if width(&sums.moments()) >= settings.min_patch_width {
            self.absorb(first, &growth, raster, normals);
        }
        let Some(&seed) = self.members.get(first) else {
            return;
        };
        let mut sums = PointSums::new(raster.xyzr[usize::from(seed)]);
        for &at in &self.members[first..] {
            sums.add(raster.xyzr[usize::from(at)]);
        }
        growth.refit(&sums);
        let number = usize::from(FIRST) + self.grown.len();
        if self.members.len() - first < settings.min_patch_points || number > usize::from(u16::MAX)
        {
            self.release(first);
            return;
        }
        for &at in &self.members[first..] {
            self.owner[usize::from(at)] = number as u16;
        }
        self.grown.push(Grown {
            normal: growth.n,
            members: first..self.members.len(),
            moments: sums.moments(),
        });
    }

    fn release(&mut self, first: usize) {
        for &at in &self.members[first..] {
            self.owner[usize::from(at)] = TRIED;
        }
        self.members.truncate(first);
    }

    /// Takes pixels around the region that lie on its plane, as far as windows reach, although
    /// their normals are missing or look around a crease.
    fn absorb(&mut self, first: usize, growth: &Growth, raster: &TileRaster, normals: &Normals) {
        let mut from = first;
        let most = self.members[first..]
            .iter()
            .step_by(64)
            .map(|&at| normals.half[usize::from(at)])
            .max()
            .unwrap_or(1);
        for _ in 0..=most {
            let to = self.members.len();
            for i in from..to {
                let at = usize::from(self.members[i]);
                for direction in 0..4 {
                    let Some(other) = linked(raster, at, direction) else {
                        continue;
                    };
                    let n = normals.normal[other];
                    if self.owner[other] <= TRIED
                        && raster.holds(other)
                        && (normals.error[other] == 0.0 || growth.agrees(n, CREASE))
                        && growth.holds(raster.xyzr[other], raster)
                    {
                        self.owner[other] = GROWING;
                        self.members.push(other as u16);
                    }
                }
            }
            from = to;
            if self.members.len() == to {
                return;
            }
        }
    }
}
