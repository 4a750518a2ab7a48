//! Tells which points may be artefacts of beams that hit the edge of a robot in front of them.
//!
//! A beam has a width. If it hits an edge, its range lies between those of the edge and of the
//! surface behind, so that a curtain of such points hangs behind every outline. Those of a robot
//! move with it, and nothing is where they are.

use geometry::{Point, Pose, Vector};
use robot::Model;
use rustc_hash::FxHashMap;

/// A beam may hit a surface that it passes at this distance or less, metres: the radius of a beam,
/// and the errors of posture and model.
const GRAZE: f64 = 0.02;
/// Points nearer than this behind an edge belong to the surface itself, metres.
const BEHIND: f64 = 0.03;
/// By how much farther a surface counts for each metre that a beam passes beside it: an outline is
/// given by its edge, not by parts beside it that bulge towards the scanner.
const ASIDE: f64 = 2.0;
/// Spacing of the samples of a surface, metres.
const SPACING: f64 = 0.01;

/// The directions in which robots hide space from a scanner, with a rim around them.
pub struct Shadow {
    eye: Point,
    /// Width of a cell of directions, in components of a unit vector.
    width: f64,
    /// Distance of the surface in each direction, metres.
    near: FxHashMap<[i32; 3], f32>,
}

impl Shadow {
    /// The shadow of robots (each with the poses of its links) as seen from `eye`; all in one
    /// frame, metres.
    #[must_use]
    pub fn new(robots: &[(&Model, &[Pose])], eye: Point) -> Self {
        let seen = |&(model, poses): &(&Model, &[Pose])| -> Vec<Point> {
            let links = model.links.iter().zip(poses);
            let own = links.flat_map(|(link, pose)| {
                // Any prefix of the samples is spread evenly.
                let share = (f64::from(link.cad.spacing) / SPACING).powi(2).min(1.0);
                let n = (link.cad.points.len() as f64 * share).ceil() as usize;
                link.cad.points[..n].iter().map(move |p| pose * Point::from(p.map(f64::from)))
            });
            own.collect()
        };
        let all: Vec<Point> = robots.iter().flat_map(seen).collect();
        let nearest = all.iter().map(|p| (p - eye).norm()).fold(f64::INFINITY, f64::min);
        let nearest = nearest.clamp(GRAZE, 1e3);
        let mut out = Self { eye, width: 0.5 * GRAZE / nearest, near: FxHashMap::default() };
        all.iter().for_each(|p| out.add(p));
        out
    }

    /// Marks the directions about a place on a surface.
    fn add(&mut self, p: &Point) {
        let off = p - self.eye;
        let far = off.norm();
        if far < GRAZE {
            return;
        }
        let (direction, rim) = (off / far, (GRAZE + 0.5 * SPACING) / far);
        let n = (rim / self.width).ceil() as i32;
        let middle = self.cell(direction.into());
        let width = self.width;
        let along = |k: usize| {
            (middle[k] - n..=middle[k] + n).map(move |cell| (cell, (f64::from(cell) + 0.5) * width))
        };
        // Squares exclude most cells without a root; beside their rounding the lengths decide.
        let [low, high] =
            [1.0 - self.width, 1.0 + self.width].map(|length| length.max(0.0).powi(2));
        let may_cross = low - 1e-9..=high + 1e-9;
        for (i, x) in along(0) {
            for (j, y) in along(1) {
                let flat = x * x + y * y;
                let near = along(2).filter(|(_, z)| may_cross.contains(&(flat + z * z)));
                for (k, z) in near {
                    self.mark([i, j, k], [x, y, z], &direction, [far, rim]);
                }
            }
        }
    }

    /// Marks the cell about `at` if it is a direction within the rim of a surface in this
    /// direction, so far away.
    fn mark(&mut self, cell: [i32; 3], at: [f64; 3], direction: &Vector, [far, rim]: [f64; 2]) {
        let length = at.iter().map(|v| v * v).sum::<f64>().sqrt();
        // Only cells that the unit sphere intersects are directions.
        if (length - 1.0).abs() > self.width {
            return;
        }
        let aside = (0..3).map(|k| (at[k] / length - direction[k]).powi(2)).sum::<f64>().sqrt();
        if aside <= rim + self.width {
            let distance = (far + ASIDE * far * aside) as f32;
            let near = self.near.entry(cell).or_insert(distance);
            *near = near.min(distance);
        }
    }

    fn cell(&self, direction: [f64; 3]) -> [i32; 3] {
        direction.map(|v| (v / self.width).floor() as i32)
    }

    /// Whether the beam to a point may have hit an edge in front of it.
    #[must_use]
    pub fn is_grazed(&self, p: &Point) -> bool {
        let off = p - self.eye;
        let far = off.norm();
        let near = self.near.get(&self.cell((off / far.max(1e-9)).into()));
        near.is_some_and(|near| far > f64::from(*near) + BEHIND)
    }
}

/// A scanner with a `point_source_id` of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScannerAt {
    /// Position in the base frame, metres.
    pub at: Point,
    /// Angle between its beams, radians.
    pub step: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::Settings;

    #[test]
    fn points_behind_an_outline_are_grazed_and_no_others() {
        let dir = tempfile::tempdir().expect("a folder");
        let urdf = "<robot name='post'><link name='foot'><visual><origin xyz='0 0 0.5'/>\
            <geometry><cylinder radius='0.1' length='1'/></geometry></visual></link></robot>";
        let path = dir.path().join("post.urdf");
        std::fs::write(&path, urdf).expect("is written");
        let (mut model, _) = Model::load_urdf(&path, "post", &Settings::default()).expect("loads");
        model.sample(&Settings::default(), &contract::OneByOne);
        let poses = vec![Pose::identity(); model.links.len()];
        for far in [1.0, 3.0, 9.0] {
            let shadow = Shadow::new(&[(&model, &poses)], Point::new(-far, 0.0, 0.5));
            // By distance beside the outline and behind the axis of the post.
            let is_behind_at = |aside: f64, behind: f64| {
                let wide = (0.1 + aside) * (far + behind) / far;
                [-wide, wide].map(|y| shadow.is_grazed(&Point::new(behind, y, 0.5)))
            };
            for behind in [0.08, 0.3, 2.0] {
                assert_eq!(is_behind_at(0.003, behind), [true; 2], "{far} {behind}");
            }
            // Beside the post, away from it, and in front of it.
            assert_eq!(is_behind_at(0.02, 0.0), [false; 2], "{far}");
            assert_eq!(is_behind_at(0.06, 1.0), [false; 2], "{far}");
            assert!(!shadow.is_grazed(&Point::new(-0.4, 0.0, 0.5)), "{far}");
        }
    }
}
