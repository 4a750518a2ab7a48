//! Draws the surfels of two sessions as plans, and finds the shifts at which one plan fits best on
//! the other.
//!
//! Olson (2009) and Hess et al. (2016) find the pose of a scan by correlating rasters. Here the
//! correlation over all shifts is computed at once by Fourier transforms. Walls are drawn by the
//! side that they face, so that a wall does not fit on one that faces another way, and an object of
//! one session on bare floor of the other counts against a shift.

use crate::surfels::{Surfel, Surfels};
use geometry::fourier::{Complex32, Fft, forward, inverse};
use geometry::{Pose, Vector};
use nalgebra::Point3;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Smallest edge of a cell, metres; it is larger where a plan would have more than `MAX_CELLS` on a
/// side.
const CELL: f64 = 0.2;
/// Largest number of cells along a side of a plan.
const MAX_CELLS: f64 = 1024.0;
/// Largest count of surfels in a column: a high wall must not outweigh all objects in front of it.
const MAX_HIGH: f32 = 5.0;
/// Count of an occupied column of the earlier session.
const THERE: f32 = 1.0;
/// Layers of a plan: upright surfaces by the side they face, surfaces that are not flat, bare
/// floor.
const SIDES: usize = 4;
const ROUGH: usize = SIDES;
const BARE: usize = SIDES + 1;
const N_LAYERS: usize = SIDES + 2;
/// Weight of objects where the other session has bare floor.
const AGAINST: f32 = 1.0;
/// Largest distance from its centre up to which a session is drawn, metres.
const REACH: f64 = 40.0;
/// Smallest distance between two peaks of one yaw, metres.
const PEAK_APART: f64 = 0.7;
/// Largest number of peaks of one yaw.
const MAX_PEAKS: usize = 20;
/// Smallest height of a peak, as share of the highest.
const LEAST_PEAK: f32 = 0.3;

/// A horizontal shift (metres) with its score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    pub(crate) shift: [f64; 2],
    pub(crate) score: f32,
}

/// The Fourier transform of an earlier session's plan.
pub(crate) struct Plans {
    edge: f64,
    n: [usize; 2],
    /// Lowest corner of the raster, metres.
    corner: [f64; 2],
    /// Distance about its origin up to which the new session is drawn, metres.
    reach: f64,
    /// Direction that side 0 faces, radians.
    main: f64,
    layers: Vec<Vec<Complex32>>,
    fft: Fourier,
}

/// The layers of one session on a raster.
struct SessionPlan(Vec<Vec<f32>>);

impl Plans {
    /// Draws an earlier session for comparison with new ones; `main` is the direction that most of
    /// its walls face, radians.
    pub(crate) fn of(old: &Surfels, new: &Surfels, main: f64) -> Option<Self> {
        let (first, mut min, mut max) = (old.all.first()?.at, [0.0; 2], [0.0; 2]);
        for i in 0..2 {
            let along = || old.all.iter().map(move |s| s.at[i]);
            min[i] = along().fold(first[i], f64::min);
            max[i] = along().fold(first[i], f64::max);
        }
        let reach = new.all.iter().map(|s| s.at.xy().norm()).fold(0.0, f64::max).min(REACH);
        let size = [0, 1].map(|i| max[i] - min[i] + 2.0 * reach + 4.0 * CELL);
        let edge = CELL.max(size[0].max(size[1]) / MAX_CELLS);
        let n = size.map(|s| good_size((s / edge).ceil() as usize));
        let fft = Fourier::of(n);
        let corner = min.map(|v| v - edge);
        let mut plans = Self { edge, n, corner, reach, main, layers: Vec::new(), fft };
        let drawn = plans.draw(old.all.iter(), &Pose::identity(), corner, THERE);
        let widened =
            drawn.0.iter().enumerate().map(|(layer, raster)| {
                if layer == BARE { raster.clone() } else { widened(raster, n) }
            });
        let mut all: Vec<Vec<f32>> = widened.collect();
        // A layer of all objects, to compare with new bare floor.
        all.push((0..n[0] * n[1]).map(|i| drawn.stands(i)).collect());
        plans.layers = all.iter().map(|raster| plans.fft.forward(raster)).collect();
        Some(plans)
    }

    /// The shifts at which a new session, turned by `yaw` (radians) about its origin, fits.
    pub(crate) fn peaks(&self, new: &Surfels, yaw: f64) -> Vec<Peak> {
        let turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw);
        let pose = Pose::from_parts(nalgebra::Translation3::identity(), turn);
        let corner = [-self.reach - self.edge; 2];
        let near = new.all.iter().filter(|s| s.at.xy().norm() <= self.reach);
        let drawn = self.draw(near, &pose, corner, MAX_HIGH);
        let stands: Vec<f32> = (0..self.n[0] * self.n[1]).map(|i| drawn.stands(i)).collect();
        let mut sum = vec![Complex32::default(); stands.len()];
        let mut add = |old: &[Complex32], new: &[f32], weight: f32| {
            let new = self.fft.forward(new);
            let pairs = old.iter().zip(&new);
            sum.iter_mut().zip(pairs).for_each(|(sum, (o, n))| *sum += o * n.conj() * weight);
        };
        for layer in 0..BARE {
            add(&self.layers[layer], &drawn.0[layer], 1.0);
        }
        add(&self.layers[BARE], &stands, -AGAINST);
        add(&self.layers[N_LAYERS], &drawn.0[BARE], -AGAINST);
        let score = self.fft.backward(sum);
        self.highest(&score, corner)
    }

    /// Draws surfels at a pose; the count of a column is limited to `most`.
    fn draw<'s>(
        &self,
        surfels: impl Iterator<Item = &'s Surfel>,
        pose: &Pose,
        corner: [f64; 2],
        most: f32,
    ) -> SessionPlan {
        let [nx, ny] = self.n;
        let mut layers = vec![vec![0.0_f32; nx * ny]; N_LAYERS];
        for surfel in surfels {
            let at = (pose * Point3::from(surfel.at)).coords;
            let [x, y] = [0, 1].map(|i| ((at[i] - corner[i]) / self.edge).floor());
            if x < 0.0 || y < 0.0 || x >= nx as f64 || y >= ny as f64 {
                continue;
            }
            let cell = y as usize * nx + x as usize;
            if !surfel.is_flat() {
                layers[ROUGH][cell] += 0.5;
                continue;
            }
            if surfel.is_level() {
                layers[BARE][cell] = 1.0;
                continue;
            }
            let normal = pose.rotation * surfel.normal;
            for side in 0..SIDES {
                let angle = self.main + FRAC_PI_2 * side as f64;
                let along = normal.x * angle.cos() + normal.y * angle.sin();
                let share = if surfel.is_signed { along.max(0.0) } else { along };
                layers[side][cell] += (share * share) as f32;
            }
        }
        for layer in &mut layers {
            layer.iter_mut().for_each(|v| *v = v.min(most));
        }
        // Floor is bare where no object stands on it or beside.
        let drawn = SessionPlan(layers);
        let stands: Vec<f32> = (0..nx * ny).map(|i| drawn.stands(i)).collect();
        let beside = widened(&stands, self.n);
        let mut layers = drawn.0;
        layers[BARE].iter_mut().zip(&beside).for_each(|(v, s)| *v *= f32::from(*s == 0.0));
        SessionPlan(layers)
    }

    /// The highest peaks of a score over all shifts.
    fn highest(&self, score: &[f32], corner: [f64; 2]) -> Vec<Peak> {
        let [nx, ny] = self.n;
        let top = score.iter().copied().fold(0.0, f32::max);
        let at = |x: usize, y: usize| score[y % ny * nx + x % nx];
        let mut peaks: Vec<(f32, usize)> = Vec::new();
        for (i, &value) in score.iter().enumerate() {
            let (x, y) = (i % nx + nx, i / nx + ny);
            let steps = (0..9).filter(|k| *k != 4).map(|k| (x + k % 3 - 1, y + k / 3 - 1));
            if value > LEAST_PEAK * top && steps.clone().all(|(x, y)| at(x, y) <= value) {
                peaks.push((value, i));
            }
        }
        peaks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut out: Vec<Peak> = Vec::new();
        for (score, i) in peaks {
            let cells = [i % nx, i / nx];
            // The new session is drawn up to twice its reach, so that larger shifts are negative
            // ones.
            let shift = [0, 1].map(|k| {
                let (cell, n) = (cells[k] as f64, self.n[k] as f64);
                let largest = n - 2.0 * self.reach / self.edge - 2.0;
                let signed = if cell > largest { cell - n } else { cell };
                signed * self.edge + self.corner[k] - corner[k]
            });
            let is_apart =
                |p: &Peak| (p.shift[0] - shift[0]).hypot(p.shift[1] - shift[1]) > PEAK_APART;
            if out.len() < MAX_PEAKS && out.iter().all(is_apart) {
                out.push(Peak { shift, score });
            }
        }
        out
    }
}

impl SessionPlan {
    /// How many surfels of objects a cell has.
    fn stands(&self, i: usize) -> f32 {
        self.0[..BARE].iter().map(|layer| layer[i]).sum::<f32>().min(MAX_HIGH)
    }
}

/// Gives each cell the largest of its value and a share of its neighbours', so that a shift by half
/// a cell still fits.
fn widened(raster: &[f32], [nx, ny]: [usize; 2]) -> Vec<f32> {
    const SHARE: f32 = 0.7;
    let value = |x: usize, y: usize| raster[y % ny * nx + x % nx];
    let of = |i: usize| {
        let (x, y) = (i % nx + nx, i / nx + ny);
        let beside = (0..9).map(|k| value(x + k % 3 - 1, y + k / 3 - 1)).fold(0.0, f32::max);
        raster[i].max(SHARE * beside)
    };
    (0..raster.len()).map(of).collect()
}

/// The next larger number with small prime factors, for which transforms are fast.
fn good_size(n: usize) -> usize {
    let is_good = |n: &usize| {
        let mut n = *n;
        for factor in [2, 3, 5] {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
        }
        n == 1
    };
    (n.max(8)..).find(is_good).unwrap_or(n)
}

/// Two-dimensional Fourier transforms.
struct Fourier {
    n: [usize; 2],
    /// Transforms along x and y, forward and backward.
    plans: [[Arc<dyn Fft<f32>>; 2]; 2],
}

impl Fourier {
    fn of(n: [usize; 2]) -> Self {
        Self { n, plans: n.map(|n| [forward(n), inverse(n)]) }
    }

    fn forward(&self, raster: &[f32]) -> Vec<Complex32> {
        let all = raster.iter().map(|v| Complex32::new(*v, 0.0)).collect();
        self.both_ways(all, 0)
    }

    fn backward(&self, all: Vec<Complex32>) -> Vec<f32> {
        self.both_ways(all, 1).into_iter().map(|v| v.re).collect()
    }

    fn both_ways(&self, mut all: Vec<Complex32>, way: usize) -> Vec<Complex32> {
        let [nx, ny] = self.n;
        self.plans[0][way].process(&mut all);
        let mut turned = vec![Complex32::default(); all.len()];
        for y in 0..ny {
            for x in 0..nx {
                turned[x * ny + y] = all[y * nx + x];
            }
        }
        self.plans[1][way].process(&mut turned);
        for x in 0..nx {
            for y in 0..ny {
                all[y * nx + x] = turned[x * ny + y];
            }
        }
        all
    }
}
