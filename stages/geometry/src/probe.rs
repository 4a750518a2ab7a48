//! Judges surface samples against depth images: whether a beam ended on each sample, passed through
//! it, or never reached it.

use crate::depth::{LANES, Looks, Rows, rotate, rows, transform};
use crate::{Eye, Pose};

/// Weight of a beam that did not return, relative to one that hit something behind the sample:
/// black paint and steel at a grazing angle swallow beams, too.
pub const NO_RETURN_WEIGHT: f32 = 0.3;
/// Cosine of the angle of incidence below which a surface is too oblique to appear in a scan.
pub const MIN_FACING: f32 = 0.15;

/// Counts of the evidence of beams about a set of surface samples at one pose.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Probe {
    /// Sum over the samples of −β·violation where seen through, a match in 0..1 where a beam ends
    /// on the sample, and −γ where it is hidden (METHOD.md §8).
    pub score: f32,
    /// Number of samples.
    pub n: u32,
    /// Number of samples that at least one beam could judge (hit or seen through).
    pub n_seen: u32,
    /// Number of samples with a beam that ends within the tolerance.
    pub n_on: u32,
    /// Number of samples that a beam passed by more than twice the tolerance.
    pub n_through: u32,
}

impl Probe {
    /// Mean score of a sample, in −β..1; 0 where there are no samples.
    #[must_use]
    pub fn mean(&self) -> f32 {
        if self.n == 0 { 0.0 } else { self.score / self.n as f32 }
    }

    /// Counts one sample: `through` is the degree to which beams pass through it, `on` how well a
    /// beam ends on it, each in 0..1. Passing through outweighs a match.
    #[inline]
    pub fn count(&mut self, through: f32, on: f32) {
        if through > 0.0 {
            self.score -= SEEN_THROUGH_PRICE * through;
            self.n_seen += 1;
            self.n_through += u32::from(through >= 1.0);
        } else if on > 0.0 {
            self.score += on;
            self.n_seen += 1;
            self.n_on += 1;
        } else {
            self.score -= HIDDEN_PRICE;
        }
    }

    /// Adds the counts of `other`.
    pub fn join(&mut self, other: &Self) {
        self.score += other.score;
        self.n += other.n;
        self.n_seen += other.n_seen;
        self.n_on += other.n_on;
        self.n_through += other.n_through;
    }

    /// Share of the judged samples that a beam passed through, 0..1.
    #[must_use]
    pub fn violation(&self) -> f32 {
        self.n_through as f32 / self.n_seen.max(1) as f32
    }

    /// Share of the samples that could be judged, 0..1.
    #[must_use]
    pub fn seen(&self) -> f32 {
        self.n_seen as f32 / self.n.max(1) as f32
    }
}

/// Price of a sample that is seen through, relative to one that is hit (METHOD.md §8).
const SEEN_THROUGH_PRICE: f32 = 1.5;
/// Price of a sample that no scan could judge (METHOD.md §8): above zero, so that poses that hide
/// the body gain nothing, and small, since most of a body is always hidden.
pub const HIDDEN_PRICE: f32 = 0.1;

/// Samples of the surface of a body, frame of the body; both slices have the same length.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceSamples<'a> {
    /// Places, metres.
    pub points: &'a [[f32; 3]],
    /// Outward unit normals.
    pub normals: &'a [[f32; 3]],
}

/// Probes surface samples of a body at the pose `local_from_body` against depth images. A beam
/// that passes through a sample in one scan outweighs a match in any other (METHOD.md §8).
/// `tolerance` is in metres. The result includes `before`, which is that of other samples.
#[must_use]
pub fn probe(
    eyes: &[Eye<'_>],
    before: Probe,
    samples: SurfaceSamples<'_>,
    local_from_body: &Pose,
    tolerance: f32,
) -> Probe {
    let SurfaceSamples { points, normals } = samples;
    let to_local = rows(local_from_body);
    let mut out = Probe { n: before.n + points.len() as u32, ..before };
    for (points, normals) in points.chunks(BLOCK).zip(normals.chunks(BLOCK)) {
        let mut block = SampleBlock::new(&to_local, points, normals);
        eyes.iter().for_each(|eye| block.ask(eye, tolerance));
        (0..points.len()).for_each(|i| out.count(block.through[i], block.on[i]));
    }
    out
}

/// Number of samples that are judged together, so that the loops over them are vectorised.
const BLOCK: usize = 80;

/// Samples in the local frame and the evidence about them so far.
struct SampleBlock {
    n: usize,
    p: [[f32; BLOCK]; 3],
    normal: [[f32; BLOCK]; 3],
    /// For each sample how far beams pass through it and how well one ends on it, 0..1 each.
    through: [f32; BLOCK],
    on: [f32; BLOCK],
}

impl SampleBlock {
    #[inline]
    fn new(to_local: &Rows, points: &[[f32; 3]], normals: &[[f32; 3]]) -> Self {
        let zero = [[0.0; BLOCK]; 3];
        let (n, through, on) = (points.len(), [0.0; BLOCK], [0.0; BLOCK]);
        let mut out = Self { n, p: zero, normal: zero, through, on };
        for (i, (p, normal)) in points.iter().zip(normals).enumerate() {
            let (p, normal) = (transform(to_local, *p), rotate(to_local, *normal));
            for axis in 0..3 {
                (out.p[axis][i], out.normal[axis][i]) = (p[axis], normal[axis]);
            }
        }
        out
    }

    /// Adds what one scanner saw of the samples.
    #[inline]
    fn ask(&mut self, eye: &Eye<'_>, tolerance: f32) {
        let mut which = [0_u8; BLOCK + 1];
        let n = self.facing(eye.at(), &mut which);
        let Some(last) = n.checked_sub(1) else { return };
        // Each of the three loops is done for all samples before the next: vectors that are read
        // right after their numbers were written one by one would have to wait for them.
        let mut local = [[0.0; BLOCK]; 3];
        for to in 0..n.next_multiple_of(LANES).min(BLOCK) {
            let i = usize::from(which[to.min(last)]).min(BLOCK - 1);
            for axis in 0..3 {
                local[axis][to] = self.p[axis][i];
            }
        }
        let mut looks = [Looks::NOTHING; BLOCK / LANES];
        let n_lanes = n.div_ceil(LANES);
        for (k, looks) in looks.iter_mut().enumerate().take(n_lanes) {
            // Copied by loops: the compiler leaves arrays that closures make out of vectors.
            let mut lanes = [[0.0; LANES]; 3];
            for (lanes, axis) in lanes.iter_mut().zip(&local) {
                lanes.copy_from_slice(&axis[k * LANES..][..LANES]);
            }
            *looks = eye.look_lanes(&lanes, 0.5 * tolerance);
        }
        for (looks, some) in looks.iter().zip(which[..n].chunks(LANES)) {
            let (through, on) = said(looks, tolerance);
            for (lane, &i) in some.iter().enumerate() {
                let i = usize::from(i);
                self.through[i] = self.through[i].max(through[lane]);
                self.on[i] = self.on[i].max(on[lane]);
            }
        }
    }

    /// Writes to `which` the indices of the samples that face the scanner at `at`, and returns
    /// their number. Samples that are already fully seen through are left out: no other scan can
    /// change their score.
    #[inline]
    fn facing(&self, at: [f32; 3], which: &mut [u8; BLOCK + 1]) -> usize {
        let (p, normal) = (&self.p, &self.normal);
        let mut is_facing = [false; BLOCK];
        // The `min` tells the compiler that no index is out of bounds.
        for i in 0..self.n.min(BLOCK) {
            let ray = [at[0] - p[0][i], at[1] - p[1][i], at[2] - p[2][i]];
            let along = normal[0][i] * ray[0] + normal[1][i] * ray[1] + normal[2][i] * ray[2];
            let far = ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2];
            // A beam through a body enters by a face towards the scanner, so faces away from it add
            // nothing.
            let is_front = along > 0.0 && along * along >= MIN_FACING * MIN_FACING * far;
            is_facing[i] = is_front && self.through[i] < 1.0;
        }
        let mut n = 0;
        for (i, is_facing) in is_facing.iter().enumerate().take(self.n) {
            which[n] = i as u8;
            n += usize::from(*is_facing);
        }
        n
    }
}

/// For each look, how far beams passed through the place and how well one ends on it, 0..1 each;
/// both are 0 where nothing is known.
#[inline]
fn said(looks: &Looks, tolerance: f32) -> ([f32; LANES], [f32; LANES]) {
    let (mut through, mut on) = ([0.0; LANES], [0.0; LANES]);
    let per_tolerance = 1.0 / tolerance;
    for i in 0..LANES {
        let [near, far, range] = [looks.near[i], looks.far[i], looks.range[i]];
        let ahead = looks.around[i] - range;
        let gone = ((ahead - tolerance) * per_tolerance).min(1.0);
        let gone = if ahead == f32::INFINITY { NO_RETURN_WEIGHT } else { gone };
        let off = (near - range).abs().min((far - range).abs());
        // Where `near` is NaN no beam went, even if beams in neighbouring cells did.
        let is_through = (ahead > tolerance) & !near.is_nan();
        through[i] = if is_through { gone } else { 0.0 };
        on[i] = if is_through { 0.0 } else { (1.0 - off * per_tolerance).max(0.0) };
    }
    (through, on)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::Empty;
    use crate::{DepthImage, Vector};
    use std::ops::Range;

    /// A wall at z = 5 in front of the camera, with a 1 m plate at z = 3.
    fn image() -> DepthImage {
        let mut image = DepthImage::new(Pose::identity(), 0.5, 200.0);
        for i in -250..250 {
            for j in -250..250 {
                let (x, y) = (i as f32 * 0.002, j as f32 * 0.002);
                let z = if x.abs() < 0.16 && y.abs() < 0.16 { 3.0 } else { 5.0 };
                image.splat([x * z, y * z, z]);
            }
        }
        image.finish(2, |_| Empty::Unknown);
        image
    }

    #[test]
    fn three_answers() {
        let image = image();
        let (points, normals) = (vec![[0.0, 0.0, 0.0]; 1], vec![[0.0, 0.0, -1.0]; 1]);
        let at = |z: f64| {
            let pose = Pose::from_parts(Vector::new(0.0, 0.0, z).into(), Default::default());
            let samples = SurfaceSamples { points: &points, normals: &normals };
            probe(&[Eye::new([&image])], Probe::default(), samples, &pose, 0.04)
        };
        let on = at(3.0);
        assert_eq!((on.n_on, on.n_through), (1, 0));
        assert!(on.score > 0.95);
        let through = at(2.5);
        assert_eq!((through.n_on, through.n_through), (0, 1));
        let hidden = at(3.5);
        assert_eq!((hidden.n_seen, hidden.n_on), (0, 0));
    }

    /// The reference: judges one sample after the other, by one scanner after the other.
    fn one_by_one(
        eyes: &[Eye<'_>],
        samples: SurfaceSamples<'_>,
        pose: &Pose,
        tolerance: f32,
    ) -> Probe {
        let SurfaceSamples { points, normals } = samples;
        let (to_local, per_tolerance) = (rows(pose), 1.0 / tolerance);
        let mut out = Probe { n: points.len() as u32, ..Probe::default() };
        for (p, n) in points.iter().zip(normals) {
            let (p, n) = (transform(&to_local, *p), rotate(&to_local, *n));
            let (mut through, mut on) = (0.0_f32, 0.0_f32);
            for eye in eyes {
                let ray: [f32; 3] = std::array::from_fn(|i| eye.at()[i] - p[i]);
                let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let along = dot(n, ray);
                let is_front =
                    along > 0.0 && along * along >= MIN_FACING * MIN_FACING * dot(ray, ray);
                let Some(look) = eye.look(p, 0.5 * tolerance).filter(|_| is_front) else {
                    continue;
                };
                let ahead = look.around - look.range;
                if ahead == f32::INFINITY {
                    through = through.max(NO_RETURN_WEIGHT);
                } else if ahead > tolerance {
                    through = through.max(((ahead - tolerance) * per_tolerance).min(1.0));
                } else {
                    let off = (look.near - look.range).abs().min((look.far - look.range).abs());
                    on = on.max(1.0 - off * per_tolerance);
                }
            }
            out.count(through, on);
        }
        out
    }

    #[test]
    fn samples_probed_together_give_the_same_as_one_by_one() {
        let mut random = 3_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        let image = |x: f64, next: &mut dyn FnMut() -> f32| {
            let pose = Pose::translation(x, 0.0, 0.0);
            let mut image = DepthImage::new(pose, 0.7, 90.0);
            for _ in 0..9000 {
                let z = 4.0 + 2.0 * next();
                image.splat([1.3 * next() * z, 1.3 * next() * z, z]);
            }
            image.finish(1, |d| if d[0] > 0.2 { Empty::Unknown } else { Empty::NoReturn });
            image
        };
        let images = [0.0, 0.6, -0.9].map(|x| image(x, &mut next));
        let eyes: Vec<Eye<'_>> = images.iter().map(|image| Eye::new([image])).collect();
        for n in [1, 15, 16, 130, 300] {
            for tolerance in [0.02, 0.1, 0.4] {
                let mut place = || [3.0 * next(), 3.0 * next(), 4.0 + 3.0 * next()];
                let points: Vec<[f32; 3]> = (0..n).map(|_| place()).collect();
                let normals: Vec<[f32; 3]> = (0..n).map(|_| [next(), next(), next()]).collect();
                let pose = Pose::rotation(Vector::new(0.1, 0.2, 0.3));
                let of = |before: Probe, which: Range<usize>| {
                    let (points, normals) = (&points[which.clone()], &normals[which]);
                    let samples = SurfaceSamples { points, normals };
                    probe(&eyes, before, samples, &pose, tolerance)
                };
                let together = of(Probe::default(), 0..n);
                let samples = SurfaceSamples { points: &points, normals: &normals };
                let each = one_by_one(&eyes, samples, &pose, tolerance);
                assert_eq!(together, each);
                // Judging a part and then the rest must give the same.
                assert_eq!(of(of(Probe::default(), 0..n / 3), n / 3..n), together);
                assert!(n < 16 || each.n_seen > 0);
            }
        }
    }
}
