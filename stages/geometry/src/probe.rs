//! Judging a surface by the beams. Depth images and surface samples in; out comes whether a beam ended on each sample,
//! went through it, or never got there.

use crate::depth::{rotate, rows, transform};
use crate::{Eye, Pose};

/// Weight of a beam that did not come back, against one that hit something behind: black paint and glancing
/// steel swallow beams too.
pub const NO_RETURN_WEIGHT: f32 = 0.3;
/// Cosine below which a surface is too oblique to be expected in the scan.
pub const MIN_FACING: f32 = 0.15;

/// What the beams say about a set of surface samples at one pose.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Probe {
    /// Sum over samples of: −β·violation, or match in 0..1, or −γ where hidden.
    pub score: f32,
    /// Number of samples.
    pub n: u32,
    /// Samples that some beam could judge (on the surface or seen through).
    pub n_seen: u32,
    /// Samples with a beam ending on them, within the tolerance.
    pub n_on: u32,
    /// Samples that a beam passed through by more than twice the tolerance.
    pub n_through: u32,
}

impl Probe {
    /// Mean score of a sample, in −β..1; 0 for none.
    #[must_use]
    pub fn mean(&self) -> f32 {
        if self.n == 0 { 0.0 } else { self.score / self.n as f32 }
    }

    /// Counts one sample: how far it is seen through and how well a beam ends on it, 0..1 each; through outweighs on.
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

    /// Share of judged samples that a beam passed through.
    #[must_use]
    pub fn violation(&self) -> f32 {
        self.n_through as f32 / self.n_seen.max(1) as f32
    }

    /// Share of samples that could be judged.
    #[must_use]
    pub fn seen(&self) -> f32 {
        self.n_seen as f32 / self.n.max(1) as f32
    }
}

/// Price of a sample seen through, against one on the surface (fit.md §4d).
const SEEN_THROUGH_PRICE: f32 = 1.5;
/// Price of a sample that no scan could judge: small, so that hiding is not rewarded (fit.md §4d).
pub const HIDDEN_PRICE: f32 = 0.1;

/// Judges surface samples (`points` with outward `normals`, in the frame of a body) with the body at
/// `local_from_body`: one beam through a sample in any scan outweighs any match in another (fit.md §4d).
#[must_use]
pub fn probe(
    eyes: &[Eye<'_>],
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
    local_from_body: &Pose,
    tolerance: f32,
) -> Probe {
    let (to_local, per_tolerance) = (rows(local_from_body), 1.0 / tolerance);
    let mut out = Probe { n: points.len() as u32, ..Probe::default() };
    for (p, n) in points.iter().zip(normals) {
        let (p, n) = (transform(&to_local, *p), rotate(&to_local, *n));
        let (mut through, mut on) = (0.0_f32, 0.0_f32);
        for eye in eyes {
            let at = eye.at();
            let ray = [at[0] - p[0], at[1] - p[1], at[2] - p[2]];
            let along = n[0] * ray[0] + n[1] * ray[1] + n[2] * ray[2];
            // A beam through a body enters by a front face: back faces tell nothing new.
            if along <= 0.0 {
                continue;
            }
            let far = ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2];
            if along * along < MIN_FACING * MIN_FACING * far {
                continue;
            }
            let Some(look) = eye.look(p, 0.5 * tolerance) else { continue };
            let ahead = look.around - look.range;
            if ahead > tolerance {
                let v = if ahead == f32::INFINITY {
                    NO_RETURN_WEIGHT
                } else {
                    ((ahead - tolerance) * per_tolerance).min(1.0)
                };
                through = through.max(v);
                if through >= 1.0 {
                    // No other scan can make it worse or better.
                    break;
                }
            } else {
                let off = (look.near - look.range).abs().min((look.far - look.range).abs());
                on = on.max(1.0 - off * per_tolerance);
            }
        }
        out.count(through, on);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::Empty;
    use crate::{DepthImage, Vector};

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
            probe(&[Eye::new([&image])], &points, &normals, &pose, 0.04)
        };
        let on = at(3.0);
        assert_eq!((on.n_on, on.n_through), (1, 0));
        assert!(on.score > 0.95);
        let through = at(2.5);
        assert_eq!((through.n_on, through.n_through), (0, 1));
        let hidden = at(3.5);
        assert_eq!((hidden.n_seen, hidden.n_on), (0, 0));
    }
}
