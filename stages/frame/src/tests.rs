//! Synthetic rooms with boxes in them; scanners see everything from where they stand.

use crate::{Answer, Gathered, Panorama, Refusal, SessionSurfaces, at_stated, find, from_rough};
use contract::OneByOne;
use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};

/// A box: lowest and highest corner, metres.
type Block = [[f64; 3]; 2];

/// A room with blocks in it.
struct World {
    size: [f64; 3],
    blocks: Vec<Block>,
}

impl World {
    /// Distance to the first surface along a beam from a place inside.
    fn cast(&self, from: &Vector, along: &Vector) -> f64 {
        let mut nearest = f64::INFINITY;
        for i in 0..3 {
            let wall = if along[i] > 0.0 { self.size[i] } else { 0.0 };
            if along[i].abs() > 1e-9 {
                nearest = nearest.min((wall - from[i]) / along[i]);
            }
        }
        for [min, max] in &self.blocks {
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for i in 0..3 {
                let [a, b] = [min[i], max[i]].map(|v| (v - from[i]) / along[i]);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
            if enter < leave && enter > 0.0 {
                nearest = nearest.min(enter);
            }
        }
        nearest
    }

    /// The session of scanners at these places; `stated` converts the world to the session's frame.
    fn session(&self, scanners: &[[f64; 3]], stated: &Pose) -> SessionSurfaces {
        self.seen(scanners, stated, true)
    }

    /// A session with known or unknown scanner positions.
    fn seen(&self, scanners: &[[f64; 3]], stated: &Pose, is_known: bool) -> SessionSurfaces {
        let origin = (stated * nalgebra::Point3::from(scanners[0])).coords.map(f64::round);
        let mut gathered = Gathered::about(origin);
        let mut eyes = Vec::new();
        for scanner in scanners {
            let at = Vector::from(*scanner);
            let pose = stated * Pose::from_parts(at.into(), UnitQuaternion::identity());
            let place = pose.translation.vector;
            let mut eye = Panorama::new(&pose, &origin);
            for row in -150..150 {
                for col in 0..900 {
                    let (azimuth, elevation) = (f64::from(col) * 0.4, f64::from(row) * 0.4 + 0.1);
                    let [x, y, z] =
                        geometry::direction::unit(azimuth.to_radians(), elevation.to_radians());
                    let along = Vector::new(x, y, z);
                    // Two millimetres of noise, the same in each run.
                    let noise = (f64::from(row * 900 + col) * 12.9898).sin() * 0.002;
                    let p = along * (self.cast(&at, &along) + noise);
                    eye.add(p.map(|v| v as f32).into());
                    let world = (pose * nalgebra::Point3::from(p)).coords;
                    gathered.add(world.into(), is_known.then_some(&place));
                }
            }
            eyes.extend(is_known.then(|| eye.finish()));
        }
        SessionSurfaces { surfels: gathered.surfels(&[]), eyes }
    }
}

fn frame(shift: [f64; 3], yaw_deg: f64) -> Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw_deg.to_radians());
    Pose::from_parts(Translation3::from(Vector::from(shift)), turn)
}

/// The true pose of the new session's world in the earlier one, each about its own origin.
fn truth(old: &SessionSurfaces, new: &SessionSurfaces, stated: &Pose) -> Pose {
    Translation3::from(-old.surfels.origin)
        * stated.inverse()
        * Translation3::from(new.surfels.origin)
}

fn off(found: &Pose, truth: &Pose) -> (f64, f64) {
    let at = nalgebra::Point3::new(2.0, 1.0, 0.0);
    ((found * at - truth * at).norm(), found.rotation.angle_to(&truth.rotation).to_degrees())
}

/// A room with cabinets and posts that make it differ from itself turned by half a turn.
fn furnished() -> World {
    let blocks = vec![
        [[1.0, 1.0, 0.0], [1.6, 2.5, 1.8]],
        [[6.5, 0.8, 0.0], [7.7, 1.6, 1.1]],
        [[8.0, 5.0, 0.0], [8.4, 5.4, 2.5]],
        [[3.0, 6.0, 0.0], [5.0, 6.6, 1.2]],
        [[0.5, 4.0, 0.0], [1.0, 4.8, 2.0]],
    ];
    World { size: [10.0, 7.0, 4.0], blocks }
}

const OLD: [[f64; 3]; 3] = [[2.5, 3.0, 1.6], [7.0, 3.2, 1.8], [5.0, 5.0, 1.7]];
const NEW: [[f64; 3]; 2] = [[4.0, 2.5, 1.7], [6.0, 4.5, 1.5]];

#[test]
fn scans_in_any_frame_are_laid_on_the_plant() {
    let world = furnished();
    let old = world.session(&OLD, &Pose::identity());
    let mut changed = furnished();
    // A cabinet was pushed.
    changed.blocks[1] = [[5.5, 0.8, 0.0], [6.7, 1.6, 1.1]];
    for stated in [
        frame([3.0, 1.0, 0.0], 0.0),
        frame([-41.0, 17.0, 1.3], 133.0),
        frame([558_312.2, 5_240_857.4, 76.3], -27.5),
    ] {
        let new = changed.session(&NEW, &stated);
        let as_stated = truth(&old, &new, &Pose::identity());
        assert!(matches!(at_stated(&old, &new, &as_stated), Answer::Not(_)), "{stated}");
        let found = find(&old, &new, &as_stated, &OneByOne).expect("a clear place");
        let (shift, turn) = off(&found.laid.old_from_new, &truth(&old, &new, &stated));
        assert!(shift < 0.004 && turn < 0.03, "{shift} m, {turn}°: {found:?}");
        // The stated uncertainty must be of the order of the error.
        assert!(found.laid.sigma[..3].iter().all(|s| (1e-5..0.003).contains(s)), "{found:?}");
        assert!(found.evidence.share() > 0.9 && found.margin.is_none_or(|m| m > 200), "{found:?}");
    }
}

#[test]
fn a_stated_frame_holds_although_much_has_changed() {
    let old = furnished().session(&OLD, &Pose::identity());
    let mut changed = furnished();
    changed.blocks = vec![[[2.0, 5.0, 0.0], [3.4, 5.9, 1.5]], [[6.0, 1.0, 0.0], [6.5, 2.5, 2.0]]];
    let new = changed.session(&NEW, &Pose::identity());
    let as_stated = truth(&old, &new, &Pose::identity());
    let Answer::Holds(place) = at_stated(&old, &new, &as_stated) else { panic!("it holds") };
    assert!(place.evidence.n_where_new_saw_through > 50, "{place:?}");
    // A frame wrong by a few centimetres is corrected.
    let near = frame([0.05, 0.02, 0.0], 0.2);
    let new = changed.session(&NEW, &near);
    let as_stated = truth(&old, &new, &Pose::identity());
    let Answer::Near(place) = at_stated(&old, &new, &as_stated) else { panic!("it is near") };
    let (shift, turn) = off(&place.laid.old_from_new, &truth(&old, &new, &near));
    assert!(shift < 0.004 && turn < 0.03, "{shift} m, {turn}°");
}

/// A line of `n` equal cells with posts between them, in a hall that ends `beyond` metres after it.
fn cells(n: usize, beyond: f64) -> World {
    let cell = |k: usize| {
        let x = beyond + 4.0 * k as f64;
        let post = [[x, 2.0, 0.0], [x + 0.2, 4.0, 2.0]];
        let bench = [[x + 1.0, 3.0, 0.0], [x + 2.2, 3.6, 0.9]];
        let cabinet = [[x + 3.0, 3.2, 0.0], [x + 3.5, 3.8, 1.6]];
        [post, bench, cabinet]
    };
    let length = 4.0 * n as f64 + 2.0 * beyond;
    World { size: [length, 7.0, 4.0], blocks: (0..n).flat_map(cell).collect() }
}

#[test]
fn a_line_of_equal_cells_is_refused_unless_its_ends_decide() {
    for (n, beyond, is_clear) in [(9, 60.0, false), (5, 1.5, true)] {
        let world = cells(n, beyond);
        let scanners = |k: usize| {
            [beyond + 4.0 * k as f64 + 1.8, if k.is_multiple_of(2) { 1.0 } else { 6.0 }, 1.7]
        };
        // Only the middle of the line was scanned, so that its ends add little evidence.
        let middle = [0, 1, 2, 3, 4].map(|k| n / 2 - 2 + k);
        let old = world.session(&middle.map(scanners), &Pose::identity());
        let stated = frame([4.0, 0.0, 0.0], 0.0);
        let at = beyond + 4.0 * (n / 2) as f64;
        let new = world.session(&[[at + 1.0, 1.0, 1.8], [at + 2.0, 6.0, 1.6]], &stated);
        let as_stated = truth(&old, &new, &Pose::identity());
        match find(&old, &new, &as_stated, &OneByOne) {
            Ok(place) => {
                let (shift, _) = off(&place.laid.old_from_new, &truth(&old, &new, &stated));
                assert!(is_clear && shift < 0.01, "{place:?}");
            }
            Err(Refusal::Several(places)) => {
                assert!(!is_clear && places.len() > 1, "{places:?}");
                // A rough pose from the user decides, if surfaces confirm it. It is a turn about
                // the scanner, not about a far origin.
                let about = Translation3::from(new.eyes[0].at() + new.surfels.origin);
                let rough =
                    frame([-3.85, 0.1, 0.0], 0.0) * about * frame([0.0; 3], 1.0) * about.inverse();
                let rough = Translation3::from(-old.surfels.origin)
                    * rough
                    * Translation3::from(new.surfels.origin);
                let place = from_rough(&old, &new, &rough).expect("it is laid");
                let (shift, _) = off(&place.laid.old_from_new, &truth(&old, &new, &stated));
                assert!(shift < 0.01, "{shift}");
            }
            Err(refusal) => panic!("{refusal:?}"),
        }
    }
}

#[test]
fn clouds_without_scanners_are_laid_on_one_another_by_their_surfaces() {
    let world = furnished();
    let old = world.seen(&OLD, &Pose::identity(), false);
    for (stated, is_there) in [(frame([0.0; 3], 0.0), true), (frame([3.0, 1.0, 0.0], 70.0), false)]
    {
        let new = world.seen(&NEW, &stated, false);
        let as_stated = truth(&old, &new, &Pose::identity());
        let answer = at_stated(&old, &new, &as_stated);
        assert_eq!(matches!(answer, Answer::Holds(_)), is_there, "{answer:?}");
        let found = find(&old, &new, &as_stated, &OneByOne).expect("a clear place");
        let (shift, turn) = off(&found.laid.old_from_new, &truth(&old, &new, &stated));
        assert!(shift < 0.004 && turn < 0.03, "{shift} m, {turn}°: {found:?}");
    }
}

#[test]
fn another_room_is_refused() {
    let old = furnished().session(&OLD, &Pose::identity());
    let blocks = vec![[[2.0, 2.0, 0.0], [2.5, 6.0, 1.7]], [[7.0, 5.0, 0.0], [8.0, 8.0, 1.0]]];
    let other = World { size: [13.0, 9.5, 5.0], blocks };
    let new = other.session(&[[4.0, 2.5, 1.7], [6.0, 7.0, 1.5]], &frame([7.0, 2.0, 0.0], 40.0));
    let as_stated = truth(&old, &new, &Pose::identity());
    assert!(find(&old, &new, &as_stated, &OneByOne).is_err());
}
