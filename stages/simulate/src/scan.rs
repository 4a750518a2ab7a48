//! Scans a scene from one scanner: beams with range, truth and flags, column by column.

use crate::beams::{BeamHit, Beams};
use crate::columns::{Return, ScanFrame, SimColumns};
use crate::random::Random;
use crate::scene::{Mixed, Scanner};
use crate::world::BodySurface;
use contract::Result;
use geometry::{Pose, Vector};
use nalgebra::Matrix3;
use std::f64::consts::TAU;
use std::ops::Range;

/// Difference between the parts of a beam above which it counts as mixed, metres.
const MIXED_SPREAD: f64 = 0.03;
/// Distance of a neighbouring hit from the plane of a beam's triangle that shows an edge, metres.
const EDGE: f64 = 0.004;
/// Radius of the ring of outer sub-beams, as share of the beam's radius; it halves the beam's area.
const RING: f64 = 0.707;
/// Range at which half of the light is lost, metres.
const HALF_LIGHT: f64 = 25.0;
/// Reflectance below which a surface counts as black.
const BLACK: f32 = 0.15;

/// A scanner with everything that is the same for all beams.
pub(crate) struct Station {
    pub(crate) frame: ScanFrame,
    scanner: Scanner,
    /// Position within the scene, metres.
    origin: Vector,
    /// Rotation from the scan frame to the scene.
    scene_from_scan: Matrix3<f64>,
    /// Keys of the random numbers of its beams.
    keys: [u64; 2],
    /// Sine and cosine of each row's elevation.
    rows: Vec<[f64; 2]>,
    /// Sine and cosine of each column's azimuth.
    cols: Vec<[f64; 2]>,
}

impl Station {
    pub(crate) fn new(scanner: &Scanner, keys: [u64; 2], origin: [f64; 3]) -> Result<Self> {
        let shifted = |mut pose: Pose| {
            pose.translation.vector += Vector::from(origin);
            pose
        };
        let scene_from_scan = scanner.world_from_scan()?;
        let raster = scanner.raster.clone();
        let n_rows = raster.n_rows();
        let table = |n: u32, angle: &dyn Fn(u32) -> f64| -> Vec<[f64; 2]> {
            (0..n).map(|i| <[f64; 2]>::from(angle(i).sin_cos())).collect()
        };
        let rows = table(n_rows, &|row| raster.elevation(row));
        let cols = table(raster.n_cols(), &|col| raster.azimuth(col));
        let frame = ScanFrame {
            name: scanner.name.clone(),
            world_from_scan: shifted(scanner.stated_world_from_scan()?),
            true_world_from_scan: shifted(scene_from_scan),
            n_rows,
            n_cols: raster.n_cols(),
            raster,
        };
        Ok(Self {
            frame,
            scanner: scanner.clone(),
            origin: scene_from_scan.translation.vector,
            scene_from_scan: scene_from_scan.rotation.to_rotation_matrix().into_inner(),
            keys,
            rows,
            cols,
        })
    }

    /// Beams of the columns `cols`, see [`crate::Simulator::columns`].
    pub(crate) fn columns(
        &self,
        beams: &Beams,
        surfaces: &[BodySurface],
        cols: Range<u32>,
    ) -> SimColumns {
        let n_rows = self.rows.len();
        let cols = cols.start.min(self.frame.n_cols)..cols.end.min(self.frame.n_cols);
        let mut out = SimColumns::with_capacity(cols.start, self.frame.n_rows, cols.len() * n_rows);
        // Three columns at a time: an edge is found by comparing a beam with its four neighbours.
        let look = self.scanner.mixed.is_some();
        let mut before =
            if look { self.cast_column(beams, self.left_of(cols.start)) } else { Vec::new() };
        let mut here = self.cast_column(beams, Some(cols.start).filter(|_| !cols.is_empty()));
        for col in cols.clone() {
            let after_col =
                if look { self.right_of(col) } else { Some(col + 1).filter(|c| *c < cols.end) };
            let after = self.cast_column(beams, after_col);
            for row in 0..n_rows {
                let neighbours = [
                    before.get(row),
                    after.get(row),
                    row.checked_sub(1).and_then(|r| here.get(r)),
                    here.get(row + 1),
                ];
                let stated = self.stated(row, col);
                let answer =
                    self.measure(beams, surfaces, BeamAt { row, col }, &here[row], neighbours);
                out.push(answer, &stated);
            }
            before = std::mem::replace(&mut here, after);
        }
        out
    }

    fn is_full_turn(&self) -> bool {
        self.frame.raster.azimuth_deg[1] - self.frame.raster.azimuth_deg[0] >= 360.0
    }

    fn left_of(&self, col: u32) -> Option<u32> {
        let last = self.frame.n_cols.checked_sub(1)?;
        if col > 0 { Some(col - 1) } else { self.is_full_turn().then_some(last) }
    }

    fn right_of(&self, col: u32) -> Option<u32> {
        if col + 1 < self.frame.n_cols { Some(col + 1) } else { self.is_full_turn().then_some(0) }
    }

    /// Direction that the file states for a beam, scan frame.
    fn stated(&self, row: usize, col: u32) -> Vector {
        let [sin, cos] = self.cols[col as usize];
        let [rise, flat] = self.rows[row];
        Vector::new(flat * cos, flat * sin, rise)
    }

    fn random(&self, row: usize, col: u32, purpose: u64) -> Random {
        Random::keyed(&[self.keys[0], self.keys[1], row as u64, u64::from(col), purpose])
    }

    /// Thin beams through the middle of each pixel of a column; empty for no column.
    fn cast_column(&self, beams: &Beams, col: Option<u32>) -> Vec<SceneBeam> {
        let Some(col) = col else { return Vec::new() };
        let origin = self.origin;
        (0..self.rows.len())
            .map(|row| {
                let mut along = self.scene_from_scan * self.stated(row, col);
                if self.scanner.jitter > 0.0 {
                    let [a, b] = self.random(row, col, 1).normals();
                    let (u, v) = across(&along);
                    along = (along + (u * a + v * b) * self.scanner.jitter).normalize();
                }
                SceneBeam { along, hit: beams.cast(&origin, &along, self.scanner.max_range) }
            })
            .collect()
    }

    /// The return of a beam, whose four neighbours tell whether it hits an edge; `None` if it has
    /// none.
    fn measure(
        &self,
        beams: &Beams,
        surfaces: &[BodySurface],
        at: BeamAt,
        beam: &SceneBeam,
        neighbours: [Option<&SceneBeam>; 4],
    ) -> Option<Return> {
        let (hit, range, is_mixed) = match &self.scanner.mixed {
            Some(mixed) if self.is_edge(beams, surfaces, beam, neighbours) => {
                self.mix(beams, mixed, at, beam, neighbours)?
            }
            _ => {
                let hit = beam.hit?;
                (hit, hit.range, false)
            }
        };
        if hit.range < self.scanner.min_range {
            return None;
        }
        let surface = &surfaces[hit.surface as usize];
        let cosine = beams.cosine(hit.triangle, &beam.along);
        let mut random = self.random(at.row, at.col, 0);
        let lost = self.scanner.dropouts
            + if surface.reflectance < BLACK {
                self.scanner.dark_dropouts * (1.0 - cosine)
            } else {
                0.0
            };
        if random.unit() < lost {
            return None;
        }
        let sigma = self.scanner.noise + self.scanner.noise_per_metre * range;
        let noise = if sigma > 0.0 { sigma * random.normals()[0] } else { 0.0 };
        let measured = range + noise + self.scanner.range_bias;
        let light = f64::from(surface.reflectance) * (0.15 + 0.85 * cosine);
        let fade = 1.0 / (1.0 + (range / HALF_LIGHT).powi(2));
        let intensity = (light * fade) as f32;
        (measured > 0.0).then_some(Return {
            range: measured,
            intensity,
            label: surface.label,
            object: surface.object,
            is_mixed,
        })
    }

    /// Whether a neighbour's hit is not explained by the plane under this beam.
    fn is_edge(
        &self,
        beams: &Beams,
        surfaces: &[BodySurface],
        beam: &SceneBeam,
        neighbours: [Option<&SceneBeam>; 4],
    ) -> bool {
        let origin = self.origin;
        let thin = |b: &SceneBeam| b.hit.is_some_and(|h| surfaces[h.surface as usize].is_thin);
        thin(beam)
            || neighbours.into_iter().flatten().any(|other| match (&beam.hit, &other.hit) {
                (None, None) => false,
                (Some(a), Some(b)) => {
                    thin(other)
                        || (a.triangle != b.triangle
                            && (beams.plane_range(a.triangle, &origin, &other.along) - b.range)
                                .abs()
                                > EDGE)
                }
                _ => true,
            })
    }

    /// The range that a wide beam measures. Its thin parts are grouped by range, the group with
    /// most parts wins (the nearest at equal numbers), and its mean is the range. Returns the part
    /// nearest to that mean, the mean (metres), and whether the beam is mixed.
    fn mix(
        &self,
        beams: &Beams,
        mixed: &Mixed,
        at: BeamAt,
        beam: &SceneBeam,
        neighbours: [Option<&SceneBeam>; 4],
    ) -> Option<(BeamHit, f64, bool)> {
        let origin = self.origin;
        let seen = |b: &SceneBeam| b.hit.map(|h| h.range);
        let near = seen(beam)
            .or_else(|| neighbours.into_iter().flatten().filter_map(seen).min_by(f64::total_cmp))?;
        let radius = (mixed.radius + mixed.divergence * near) * RING / near.max(0.1);
        let (u, v) = across(&beam.along);
        let phase = self.random(at.row, at.col, 2).unit();
        let ring = mixed.sub_beams.saturating_sub(1);
        let mut parts: Vec<BeamHit> = beam.hit.into_iter().collect();
        for k in 0..ring {
            let (sin, cos) = (TAU * (f64::from(k) + phase) / f64::from(ring)).sin_cos();
            let along = (beam.along + (u * cos + v * sin) * radius).normalize();
            parts.extend(beams.cast(&origin, &along, self.scanner.max_range));
        }
        parts.sort_by(|a, b| a.range.total_cmp(&b.range));
        let mut best = 0..0;
        let mut from = 0;
        for to in 1..=parts.len() {
            if to == parts.len() || parts[to].range - parts[to - 1].range > mixed.depth {
                if to - from > best.len() {
                    best = from..to;
                }
                from = to;
            }
        }
        // A beam of which more than half has no return is too weak to be detected.
        if 2 * best.len() < (ring + 1) as usize && beam.hit.is_none() {
            return None;
        }
        let group = &parts[best];
        let mean = group.iter().map(|h| h.range).sum::<f64>() / group.len().max(1) as f64;
        let nearest = group
            .iter()
            .min_by(|a, b| (a.range - mean).abs().total_cmp(&(b.range - mean).abs()))?;
        let spread = group[group.len() - 1].range - group[0].range;
        Some((*nearest, mean, spread > MIXED_SPREAD))
    }
}

/// Row and column of a beam in the raster.
#[derive(Debug, Clone, Copy)]
struct BeamAt {
    row: usize,
    col: u32,
}

/// A thin beam in the scene.
struct SceneBeam {
    along: Vector,
    hit: Option<BeamHit>,
}

/// Two unit vectors perpendicular to a unit vector and to each other; the first is level if
/// possible.
fn across(along: &Vector) -> (Vector, Vector) {
    let u = Vector::z().cross(along).try_normalize(1e-6).unwrap_or_else(Vector::x);
    (u, along.cross(&u))
}
