//! Places from which the pattern of points on the floor looks like a raster: columns are lines
//! through the foot of the axis, rows are circles about it.

use super::floor::{FloorGrid, FloorPoints};
use contract::Fan;
use geometry::fourier::{self, Complex32, Fft};
use std::sync::Arc;

/// Cells on a side of the image of a square.
const SIDE: usize = 64;
/// Edges of the squares, metres.
const EDGES: [f32; 2] = [0.08, 0.16];
/// Fewest points of a square.
const IN_SQUARE: usize = 40;
/// Least power of a peak over that of points without order: among the 2048 waves of a square chance
/// has one in 80 squares, and its votes go anywhere.
const PEAK: f32 = 12.0;
/// Number of peaks of a square.
const PEAKS: usize = 3;
/// Shortest and longest period, metres.
const PERIODS: [f32; 2] = [0.0022, 0.025];
/// Distances of a scanner's foot from a square, metres.
const DISTANCES: [f64; 2] = [0.5, 6.0];
/// Greatest edge of a square by its distance: lines that run apart blur.
const FAN_ANGLE: f64 = 0.09;
/// Cell of the votes, metres.
pub(crate) const VOTE: f64 = 0.02;
/// Memory of a cell of the votes, bytes: the votes of this place, and those about it.
pub(crate) const VOTE_BYTES: usize = 8;

/// A wave of the density of points on the floor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FloorWave {
    /// Middle of the square, metres.
    pub(crate) at: [f64; 2],
    /// Direction of the wave, unit length.
    pub(crate) along: [f64; 2],
    /// Cycles per metre.
    pub(crate) frequency: f64,
    /// Edge of the square, metres.
    pub(crate) edge: f64,
}

/// A place where a scanner may have stood.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FootVote {
    pub(crate) at: [f64; 2],
    /// Votes over those about it.
    pub(crate) score: f64,
}

/// The waves of all squares of the floor.
pub(crate) fn waves(floor: &FloorPoints, fan: &dyn Fan) -> Vec<FloorWave> {
    let fft = fourier::forward(SIDE);
    EDGES.iter().flat_map(|edge| of_squares(floor, *edge, &fft, fan)).collect()
}

fn of_squares(
    floor: &FloorPoints,
    edge: f32,
    fft: &Arc<dyn Fft<f32>>,
    fan: &dyn Fan,
) -> Vec<FloorWave> {
    /// Squares of one piece of work.
    const AT_ONCE: usize = 256;
    let grid = FloorGrid::over(&floor.points, edge);
    let (order, firsts) = grid.sorted(&floor.points);
    let filled: Vec<usize> = (0..firsts.len() - 1)
        .filter(|i| (firsts[i + 1] - firsts[*i]) as usize >= IN_SQUARE)
        .collect();
    let pieces: Vec<&[usize]> = filled.chunks(AT_ONCE).collect();
    let found = fan.fan(pieces, |squares: &[usize]| {
        let mut image = SquareImage::new(fft.clone(), edge);
        let mut out = Vec::new();
        for pair in squares.chunks(2) {
            let low = |i: usize| {
                let at = [i % grid.n[0], i / grid.n[0]];
                [0, 1].map(|a| grid.low[a] + at[a] as f32 * edge)
            };
            let own = |i: usize| {
                let own = &order[firsts[i] as usize..firsts[i + 1] as usize];
                own.iter().map(|i| floor.points[*i as usize])
            };
            image.clear();
            for (second, i) in pair.iter().enumerate() {
                image.add(second, low(*i), own(*i));
            }
            image.transform();
            for (second, i) in pair.iter().enumerate() {
                image.peaks(second, low(*i), &mut out);
            }
        }
        out
    });
    found.concat()
}

/// Counts of two squares, as real and imaginary part, and their transform.
struct SquareImage {
    fft: Arc<dyn Fft<f32>>,
    edge: f32,
    pixels: Vec<Complex32>,
    turned: Vec<Complex32>,
    scratch: Vec<Complex32>,
    power: Vec<f32>,
    n: [f32; 2],
}

impl SquareImage {
    fn new(fft: Arc<dyn Fft<f32>>, edge: f32) -> Self {
        let zeros = vec![Complex32::default(); SIDE * SIDE];
        let scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
        let power = vec![0.0; SIDE * SIDE];
        Self { fft, edge, pixels: zeros.clone(), turned: zeros, scratch, power, n: [0.0; 2] }
    }

    fn clear(&mut self) {
        self.pixels.fill(Complex32::default());
        self.n = [0.0; 2];
    }

    fn add(&mut self, second: usize, low: [f32; 2], points: impl Iterator<Item = [f32; 3]>) {
        let scale = SIDE as f32 / self.edge;
        for p in points {
            let [x, y] = [0, 1].map(|a| (((p[a] - low[a]) * scale) as usize).min(SIDE - 1));
            let pixel = &mut self.pixels[y * SIDE + x];
            if second == 0 {
                pixel.re += 1.0;
            } else {
                pixel.im += 1.0;
            }
            self.n[second] += 1.0;
        }
    }

    fn transform(&mut self) {
        self.fft.process_with_scratch(&mut self.pixels, &mut self.scratch);
        for y in 0..SIDE {
            for x in 0..SIDE {
                self.turned[x * SIDE + y] = self.pixels[y * SIDE + x];
            }
        }
        self.fft.process_with_scratch(&mut self.turned, &mut self.scratch);
    }

    /// Adds the highest peaks of a square.
    fn peaks(&mut self, second: usize, low: [f32; 2], out: &mut Vec<FloorWave>) {
        let n = self.n[second];
        let half = (SIDE / 2) as i32;
        let at = |x: i32, y: i32| {
            let wrap = |v: i32| v.rem_euclid(SIDE as i32) as usize;
            wrap(x) * SIDE + wrap(y)
        };
        for y in -1..half {
            for x in -half..half {
                let (z, w) = (self.turned[at(x, y)], self.turned[at(-x, -y)].conj());
                let f = if second == 0 { z + w } else { z - w };
                self.power[at(x, y)] = 0.25 * f.norm_sqr() / n;
            }
        }
        let longest = self.edge / PERIODS[0];
        let least = (self.edge / PERIODS[1]).max(3.0);
        let mut best: Vec<(f32, i32, i32)> = Vec::new();
        for y in 0..half - 1 {
            for x in 1 - half..half - 1 {
                let size = ((x * x + y * y) as f32).sqrt();
                if size < least || size > longest || (y == 0 && x < 0) {
                    continue;
                }
                let p = self.power[at(x, y)];
                if p > PEAK && self.is_peak(p, x, y, at) {
                    best.push((p, x, y));
                }
            }
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0));
        best.truncate(PEAKS);
        for (_, x, y) in best {
            let mut sum = [0.0f32; 3];
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                let p = self.power[at(x + dx, y + dy)];
                sum = [sum[0] + p, sum[1] + p * dx as f32, sum[2] + p * dy as f32];
            }
            let k = [x as f32 + sum[1] / sum[0], y as f32 + sum[2] / sum[0]]
                .map(|v| f64::from(v / self.edge));
            let size = k[0].hypot(k[1]);
            out.push(FloorWave {
                at: low.map(|v| f64::from(v + 0.5 * self.edge)),
                along: k.map(|v| v / size),
                frequency: size,
                edge: f64::from(self.edge),
            });
        }
    }

    fn is_peak(&self, p: f32, x: i32, y: i32, at: impl Fn(i32, i32) -> usize) -> bool {
        (-1..=1).all(|dy| (-1..=1).all(|dx| self.power[at(x + dx, y + dy)] <= p))
    }
}

/// Places with more votes than those about them, the clearest first.
pub(crate) fn candidates(floor: &FloorPoints, waves: &[FloorWave], least: f64) -> Vec<FootVote> {
    let mut grid = FloorGrid::over(&floor.points, VOTE as f32);
    // A scanner may stand beside what is left of its floor.
    let margin = 25;
    grid.low = grid.low.map(|v| v - margin as f32 * VOTE as f32);
    grid.n = grid.n.map(|n| n + 2 * margin);
    let mut votes = vec![0f32; grid.n[0] * grid.n[1]];
    for wave in waves {
        vote(&grid, &mut votes, wave);
    }
    let mut score = votes.clone();
    blur(&mut score, grid.n, 1, 2);
    blur(&mut votes, grid.n, 15, 3);
    score.iter_mut().zip(&votes).for_each(|(v, b)| *v = (*v - b) / (b + 1.0).sqrt());
    drop(votes);
    let mut out = maxima(&score, &grid, least);
    out.sort_by(|a, b| b.score.total_cmp(&a.score));
    out
}

fn vote(grid: &FloorGrid, votes: &mut [f32], wave: &FloorWave) {
    let across = [-wave.along[1], wave.along[0]];
    let nearest = DISTANCES[0].max(wave.edge / FAN_ANGLE);
    for way in [wave.along, across] {
        for side in [1.0, -1.0] {
            let mut r = nearest;
            while r < DISTANCES[1] {
                let at = [0, 1]
                    .map(|a| (wave.at[a] + side * r * way[a] - f64::from(grid.low[a])) / VOTE);
                r += VOTE;
                if at[0] >= 0.0 && at[1] >= 0.0 {
                    let [x, y] = at.map(|v| v as usize);
                    if x < grid.n[0] && y < grid.n[1] {
                        votes[y * grid.n[0] + x] += 1.0;
                    }
                }
            }
        }
    }
}

/// Takes means over squares of `2 half + 1` cells, `times` times.
fn blur(out: &mut [f32], n: [usize; 2], half: usize, times: usize) {
    let mut line = Vec::new();
    for _ in 0..times {
        for axis in 0..2 {
            let (len, stride, other) = if axis == 0 { (n[0], 1, n[0]) } else { (n[1], n[0], 1) };
            for k in 0..n[1 - axis] {
                line.clear();
                line.extend((0..len).map(|i| out[k * other + i * stride]));
                let mut sum: f64 = line.iter().take(half).map(|v| f64::from(*v)).sum();
                for i in 0..len {
                    sum += line.get(i + half).map_or(0.0, |v| f64::from(*v));
                    if i > half {
                        sum -= f64::from(line[i - half - 1]);
                    }
                    out[k * other + i * stride] = (sum / (2 * half + 1) as f64) as f32;
                }
            }
        }
    }
}

fn maxima(score: &[f32], grid: &FloorGrid, least: f64) -> Vec<FootVote> {
    const REACH: usize = 4;
    let mut out = Vec::new();
    for y in 0..grid.n[1] {
        for x in 0..grid.n[0] {
            let s = score[y * grid.n[0] + x];
            if f64::from(s) < least {
                continue;
            }
            let ys = y.saturating_sub(REACH)..(y + REACH + 1).min(grid.n[1]);
            let is_most = ys.into_iter().all(|v| {
                let xs = x.saturating_sub(REACH)..(x + REACH + 1).min(grid.n[0]);
                xs.into_iter().all(|u| {
                    let other = score[v * grid.n[0] + u];
                    other < s || (other == s && (v, u) >= (y, x))
                })
            });
            if is_most {
                let at = [0, 1].map(|a| f64::from(grid.low[a]) + ([x, y][a] as f64 + 0.5) * VOTE);
                out.push(FootVote { at, score: f64::from(s) });
            }
        }
    }
    out
}

impl FootVote {
    /// The candidate by least squares of the lines of its columns, of one step.
    pub(crate) fn refined(&self, waves: &[FloorWave]) -> Self {
        let mut at = self.at;
        for reach in [0.06, 0.04, 0.03, 0.02, 0.02] {
            let lines = lines(waves, at, reach);
            let Some(mode) = mode(&lines) else { break };
            let mut h = nalgebra::Matrix2::zeros();
            let mut g = nalgebra::Vector2::zeros();
            for (wave, off, r, azimuth_step) in &lines {
                if (azimuth_step / mode).ln().abs() > 0.08 {
                    continue;
                }
                let sigma = 0.1 / (wave.edge * wave.frequency) * r + 0.001;
                let w = geometry::robust::tukey(*off, reach) / (sigma * sigma);
                let k = nalgebra::Vector2::from(wave.along);
                h += k * k.transpose() * w;
                g += k * (w * off);
            }
            let Some(inverse) = h.try_inverse() else { break };
            let by: nalgebra::Vector2<f64> = inverse * g;
            if by.norm().is_nan() || by.norm() > 0.05 {
                break;
            }
            at = [at[0] + by.x, at[1] + by.y];
        }
        let moved = (at[0] - self.at[0]).hypot(at[1] - self.at[1]);
        if moved > 0.05 { *self } else { Self { at, ..*self } }
    }
}

/// Waves whose lines pass a place, with their distance from it (signed, along the wave), the
/// distance of their squares, and the azimuth between lines.
fn lines(waves: &[FloorWave], at: [f64; 2], reach: f64) -> Vec<(FloorWave, f64, f64, f64)> {
    let of = |wave: &FloorWave| {
        let d = [wave.at[0] - at[0], wave.at[1] - at[1]];
        let r = d[0].hypot(d[1]);
        let off = d[0] * wave.along[0] + d[1] * wave.along[1];
        let is_near = r > DISTANCES[0].max(wave.edge / FAN_ANGLE) && r < 4.0 && off.abs() < reach;
        is_near.then(|| (*wave, off, r, 1.0 / (wave.frequency * r)))
    };
    waves.iter().filter_map(of).collect()
}

/// The most frequent azimuth between lines.
fn mode(lines: &[(FloorWave, f64, f64, f64)]) -> Option<f64> {
    const BIN: f64 = 0.05;
    let bin = |v: f64| ((v.ln() / BIN).floor() + 400.0).clamp(0.0, 799.0) as usize;
    let mut bins = vec![0usize; 801];
    for line in lines {
        bins[bin(line.3)] += 1;
    }
    let most = (0..800).max_by_key(|i| bins[*i] + bins[i + 1])?;
    (bins[most] + bins[most + 1] >= 6).then(|| ((most as f64 + 1.0 - 400.0) * BIN).exp())
}
