//! Motions of synthetic things, whose points are cast from stations.

use super::motion::{ThingMotion, UnknownMotion, motion};
use super::scan_set::ScanSet;
use super::search::SessionBeams;
use super::surfels::{ThingPoint, surfels};
use crate::occupancy::SessionEvidence;
use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};

mod on_the_spot;

/// Angle between beams, radians: 0.15°.
const BEAMS: f64 = 0.0026;
/// Range noise, metres.
const NOISE: f64 = 0.002;

/// An upright body that rays meet.
#[derive(Clone, Copy)]
enum Body {
    /// Half of the edges, metres.
    Box([f64; 3]),
    /// Radius and half of the height, metres.
    Drum(f64, f64),
}

/// A body at a pose (`world_from_body`), with boards that hide it, before a floor and far walls.
struct Stage {
    bodies: Vec<(Body, Pose)>,
    stations: Vec<Vector>,
}

fn at(x: f64, y: f64, z: f64, yaw_deg: f64) -> Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw_deg.to_radians());
    Pose::from_parts(Translation3::new(x, y, z), turn)
}

impl Body {
    /// Range at which a ray from a place enters the body; infinite where it passes.
    fn range(&self, from: &Vector, along: &Vector) -> f64 {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        let mut slab = |p: f64, d: f64, half: f64| {
            if d.abs() < 1e-12 {
                if p.abs() > half {
                    leave = -1.0;
                }
                return;
            }
            let (a, b) = ((-half - p) / d, (half - p) / d);
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        };
        match self {
            Self::Box(half) => (0..3).for_each(|i| slab(from[i], along[i], half[i])),
            Self::Drum(radius, half) => {
                slab(from.z, along.z, *half);
                let (a, b) = (along.xy().norm_squared(), from.xy().dot(&along.xy()));
                let root = b * b - a * (from.xy().norm_squared() - radius * radius);
                if root < 0.0 || a < 1e-12 {
                    return f64::INFINITY;
                }
                enter = enter.max((-b - root.sqrt()) / a);
                leave = leave.min((-b + root.sqrt()) / a);
            }
        }
        if enter < leave && enter > 0.0 { enter } else { f64::INFINITY }
    }
}

impl Stage {
    /// Range of a beam, and whether it meets the first body.
    fn range(&self, from: &Vector, along: &Vector) -> (f64, bool) {
        let floor = if along.z < 0.0 { -from.z / along.z } else { f64::INFINITY };
        let mut best = (floor.min(30.0), false);
        for (i, (body, pose)) in self.bodies.iter().enumerate() {
            let (p, d) = (
                pose.inverse_transform_point(&(*from).into()).coords,
                pose.rotation.inverse() * along,
            );
            let range = body.range(&p, &d);
            if range < best.0 {
                best = (range, i == 0);
            }
        }
        best
    }

    /// Points of the first body, thinned as those of a session are, with directions to scanners.
    fn points(&self) -> Vec<ThingPoint> {
        let (mut sums, mut k) = (std::collections::BTreeMap::new(), 0.0_f64);
        for from in &self.stations {
            let to = self.bodies[0].1.translation.vector - from;
            let (azimuth, elevation) = (to.y.atan2(to.x), to.z.atan2(to.xy().norm()));
            for (i, j) in (-300..=300).flat_map(|i| (-300..=300).map(move |j| (i, j))) {
                let (a, e) = (azimuth + BEAMS * f64::from(i), elevation + BEAMS * f64::from(j));
                let along = Vector::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin());
                let (range, is_it) = self.range(from, &along);
                if is_it {
                    k += 1.0;
                    let noise = ((k * 12.9898).sin() * 43758.5453).fract() * 1.7 * NOISE;
                    let p = from + (range + noise) * along;
                    let cell = [0, 1, 2].map(|c| (p[c] / 0.0125).floor() as i32);
                    let none = ScanSet::default();
                    let sum = sums.entry(cell).or_insert((Vector::zeros(), -along, 0.0, none));
                    (sum.0, sum.2) = (sum.0 + p, sum.2 + 1.0);
                    sum.3 = sum.3.with(ScanSet::of((*from).into()));
                }
            }
        }
        let one = |(sum, towards, n, scans)| ThingPoint { at: sum / n, towards, scans };
        sums.into_values().map(one).collect()
    }

    fn passes(&self, place: &Vector) -> bool {
        self.stations.iter().any(|from| {
            let beam = place - from;
            self.range(from, &beam.normalize()).0 > beam.norm() + 0.04
        })
    }
}

struct Both<'a>([&'a Stage; 2]);

impl SessionBeams for Both<'_> {
    fn evidence(&self, session: usize, world: [f64; 3]) -> SessionEvidence {
        let place = Vector::from(world);
        let near = |x: f64, y: f64| self.0[session].passes(&(place + Vector::new(x, y, 0.0)));
        // Beams are as wide as the footprint of a look-up.
        let sides = [[0.012, 0.0], [-0.012, 0.0], [0.0, 0.012], [0.0, -0.012]];
        if sides.iter().all(|s| near(s[0], s[1])) {
            SessionEvidence::Empty { is_pierced: false }
        } else {
            SessionEvidence::Unobserved
        }
    }
}

fn found(then: &Stage, now: &Stage) -> Result<ThingMotion, UnknownMotion> {
    let points = [then.points(), now.points()];
    let sides = points.each_ref().map(|p| surfels(p));
    motion(sides, points.map(|p| p.iter().map(|p| p.at).collect()), &Both([then, now]))
}

/// Error of a motion's shift, and its length over its standard deviation along the main axes.
fn off(found: &ThingMotion, real: &Pose) -> (Vector, f64) {
    let at = geometry::Point::from(found.at);
    let off = Vector::from(found.shift) - (real * at - at);
    let eigen = nalgebra::Matrix3::from(found.covariance).symmetric_eigen();
    let along = eigen.eigenvectors.transpose() * off;
    (off, along.component_div(&eigen.eigenvalues.map(f64::sqrt)).amax())
}

const CABINET: Body = Body::Box([0.5, 0.3, 0.9]);

fn stage(pose: Pose, stations: &[[f64; 2]]) -> Stage {
    let stations = stations.iter().map(|s| Vector::new(s[0], s[1], 1.7)).collect();
    Stage { bodies: vec![(CABINET, pose)], stations }
}

#[test]
fn a_cabinet_of_which_other_sides_are_seen_later_is_not_moved_by_its_middle() {
    // Front and left side first, front and right side later.
    let (was, is) = (at(0.0, 0.0, 0.9, 10.0), at(1.3, 0.4, 0.91, 40.0));
    let (then, now) = (stage(was, &[[-3.5, -3.0]]), stage(is, &[[5.5, -1.5]]));
    let found = found(&then, &now).expect("is found");
    let (error, z) = off(&found, &(is * was.inverse()));
    assert!(error.norm() < 0.012 && z < 3.0, "{error} {z} {found:?}");
    let [turn, sigma] = found.turn.expect("a turn");
    assert!((turn.to_degrees() - 30.0).abs() < 0.3 && sigma.to_degrees() < 0.5, "{found:?}");
    assert!(found.open.is_empty() && found.common.iter().all(|c| *c < 0.9), "{found:?}");
}

#[test]
fn two_sides_in_both_sessions_give_millimetres() {
    let (was, is) = (at(0.0, 0.0, 0.9, -20.0), at(-0.6, 0.25, 0.9, -17.0));
    let (then, now) = (stage(was, &[[-3.5, -3.0]]), stage(is, &[[-4.0, -2.0], [-2.5, -3.5]]));
    let found = found(&then, &now).expect("is found");
    let (error, z) = off(&found, &(is * was.inverse()));
    assert!(error.norm() < 0.003 && z < 3.0, "{error} {z} {found:?}");
    assert!(found.covariance[0][0].sqrt() < 0.005, "{found:?}");
}

#[test]
fn of_a_square_box_the_shift_is_stated_and_no_turn() {
    let (was, is) = (at(0.0, 0.0, 0.4, 10.0), at(0.8, 0.3, 0.4, 95.0));
    let square = |pose: Pose, x: f64| Stage {
        bodies: vec![(Body::Box([0.3, 0.3, 0.4]), pose)],
        stations: vec![Vector::new(x, -3.0, 1.7), Vector::new(x, 3.5, 1.7)],
    };
    let found = found(&square(was, -3.0), &square(is, -2.5)).expect("is found");
    let (error, z) = off(&found, &(is * was.inverse()));
    assert!(error.norm() < 0.02 && z < 3.0, "{error} {z} {found:?}");
    assert!(found.turn.is_none() && found.other_turns.is_empty(), "{found:?}");
}

#[test]
fn along_a_face_whose_ends_are_hidden_the_shift_is_open() {
    // The stations look through a gap between two boards at the middle of the front.
    let (was, is) = (at(0.0, 0.0, 0.9, 0.0), at(0.1, 1.2, 0.9, 0.0));
    let hidden = |pose: Pose, y: f64, x: f64| {
        let mut stage = stage(pose, &[[x, y - 4.0]]);
        let board = Body::Box([1.0, 0.02, 1.5]);
        stage.bodies.push((board, at(x - 1.2, y - 0.8, 1.5, 0.0)));
        stage.bodies.push((board, at(x + 1.2, y - 0.8, 1.5, 0.0)));
        // Nothing is seen over the top either.
        stage.bodies.push((Body::Box([3.0, 0.02, 0.5]), at(x, y - 0.8, 2.1, 0.0)));
        stage
    };
    let found = found(&hidden(was, 0.0, 0.0), &hidden(is, 1.2, 0.1)).expect("is found");
    let along: f64 = found.open.iter().map(|u| u[0] * u[0]).sum();
    assert!(along > 0.95 && found.open.iter().all(|u| u[1].abs() < 0.1), "{found:?}");
    let (error, z) = off(&found, &(is * was.inverse()));
    assert!(error.y.abs() < 0.006 && z < 3.0, "{error} {z} {found:?}");
}

#[test]
fn a_drum_turns_as_it_likes_and_its_axis_is_found() {
    let (was, is) = (at(0.0, 0.0, 0.45, 0.0), at(0.8, -0.5, 0.45, 70.0));
    let drum = |pose: Pose, x: f64, y: f64| Stage {
        bodies: vec![(Body::Drum(0.3, 0.45), pose)],
        stations: vec![Vector::new(x, y, 1.7)],
    };
    let found = found(&drum(was, -3.0, -2.0), &drum(is, 3.0, -3.5)).expect("is found");
    assert_eq!(found.turn, None, "{found:?}");
    let error = Vector::from(found.shift) - Vector::new(0.8, -0.5, 0.0);
    assert!(error.norm() < 0.01, "{error} {found:?}");
    assert!(found.at[0].hypot(found.at[1]) < 0.02, "{found:?}");
}

#[test]
fn sides_that_have_nothing_in_common_tell_nothing() {
    // A wall hides all but the front first; later a station straight above sees the top alone.
    let (was, is) = (at(0.0, 0.0, 0.9, 0.0), at(2.0, 0.0, 0.9, 0.0));
    let mut then = stage(was, &[[0.0, -4.0]]);
    then.bodies.push((Body::Box([3.0, 0.02, 0.5]), at(0.0, -0.8, 2.1, 0.0)));
    let mut now = stage(is, &[]);
    now.stations.push(Vector::new(2.0, 0.0, 4.0));
    assert_eq!(found(&then, &now), Err(UnknownMotion::NothingCommon));
    assert_eq!(
        motion([vec![], vec![]], [vec![], vec![]], &Both([&then, &now])).err(),
        Some(UnknownMotion::FewPoints)
    );
}
