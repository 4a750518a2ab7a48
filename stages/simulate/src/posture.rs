//! Random postures of a model that do not pass through the floor or the robot itself.

use crate::random::Random;
use contract::{Error, Result};
use geometry::{Point, Pose};
use robot::{Mesh, Model};
use std::collections::{BTreeMap, BTreeSet};

/// Distance between the samples of a link, metres; thinner parts may pass through one another.
const SPACING: f64 = 0.03;
/// Distance between samples of two links at which they touch, metres; most crossing surfaces have
/// such a pair.
const TOUCH: f64 = 0.02;
/// Largest number of samples of a link.
const MAX_SAMPLES: usize = 4000;
/// Number of attempts; the most difficult real robot on a floor needs about 20.
const MAX_TRIES: usize = 2000;

/// Draws random postures of one model.
pub struct Postures<'a> {
    model: &'a Model,
    /// Samples of each link, link frame, metres.
    samples: Vec<Vec<Point>>,
    /// Pairs of links (smaller index first) that touch by design.
    joined: BTreeSet<(usize, usize)>,
}

impl<'a> Postures<'a> {
    /// Samples the links; links that touch in the home posture may touch in any.
    #[must_use]
    pub fn new(model: &'a Model) -> Self {
        let samples = model.links.iter().map(|l| sample(&l.mesh)).collect();
        let mut out = Self { model, samples, joined: BTreeSet::new() };
        out.joined =
            model.joints.iter().map(|j| (j.parent.min(j.child), j.parent.max(j.child))).collect();
        let home = out.placed(&model.poses(&model.home()));
        let touching = out.touching(&home, usize::MAX);
        out.joined.extend(touching);
        out
    }

    /// Adds a body (frame of the link) that a link carries and that must not touch anything either.
    #[must_use]
    pub fn carrying(mut self, link: usize, body: &Mesh) -> Self {
        // The body counts as part of its link: what may touch the link may touch it.
        self.samples[link].extend(sample(body));
        self
    }

    /// Draws a posture, uniform within the limits. `allowed` must hold for every sample (world,
    /// metres) of every link but the root, and no two links may touch that do not by design.
    ///
    /// # Errors
    /// `BadInput` after thousands of attempts: the place is too narrow for the model.
    pub fn draw(
        &self,
        random: &mut Random,
        world_from_base: &Pose,
        allowed: impl Fn(&Point) -> bool,
    ) -> Result<Vec<f64>> {
        for _ in 0..MAX_TRIES {
            let posture: Vec<f64> = (0..self.model.free.len())
                .map(|free| {
                    let [low, high] = self.model.limits(free);
                    random.between(low, high)
                })
                .collect();
            let poses: Vec<Pose> =
                self.model.poses(&posture).iter().map(|p| world_from_base * p).collect();
            let placed = self.placed(&poses);
            if placed[1..].iter().flatten().all(&allowed) && self.touching(&placed, 1).is_empty() {
                return Ok(posture);
            }
        }
        Err(Error::bad_input(format!(
            "no free posture was found for model \"{}\"",
            self.model.name
        ))
        .hint("give it more room, or a stand"))
    }

    fn placed(&self, poses: &[Pose]) -> Vec<Vec<Point>> {
        self.samples
            .iter()
            .zip(poses)
            .map(|(points, pose)| points.iter().map(|p| pose * p).collect())
            .collect()
    }

    /// The first `at_most` pairs of links that touch and do not by design.
    fn touching(&self, placed: &[Vec<Point>], at_most: usize) -> BTreeSet<(usize, usize)> {
        let cell = |p: &Point| [p.x, p.y, p.z].map(|v| (v / TOUCH).floor() as i32);
        let mut grid: BTreeMap<[i32; 3], Vec<(usize, Point)>> = BTreeMap::new();
        let mut out = BTreeSet::new();
        for (link, points) in placed.iter().enumerate() {
            // Compared with earlier links only, so that a link is not compared with itself.
            for p in points {
                let [x, y, z] = cell(p);
                for i in 0..27 {
                    let near = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
                    for (other, q) in grid.get(&near).into_iter().flatten() {
                        let pair = (*other, link);
                        if !self.joined.contains(&pair) && (p - q).norm() < TOUCH {
                            out.insert(pair);
                            if out.len() >= at_most {
                                return out;
                            }
                        }
                    }
                }
            }
            for p in points {
                grid.entry(cell(p)).or_default().push((link, *p));
            }
        }
        out
    }
}

/// Points spread over a mesh, about [`SPACING`] apart, identical for identical meshes.
fn sample(mesh: &Mesh) -> Vec<Point> {
    let corner = |i: u32| Point::from(mesh.vertices[i as usize].map(f64::from));
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(corner);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    let total: f64 = mesh.triangles.iter().map(area).sum();
    let each = (SPACING * SPACING).max(total / MAX_SAMPLES as f64);
    let mut random = Random::keyed(&[mesh.triangles.len() as u64]);
    let mut left = 0.5 * each;
    let mut out = Vec::new();
    for t in &mesh.triangles {
        left += area(t);
        let [a, b, c] = t.map(corner);
        while left >= each {
            left -= each;
            let (mut u, mut v) = (random.unit(), random.unit());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            out.push(a + (b - a) * u + (c - a) * v);
        }
    }
    out
}
