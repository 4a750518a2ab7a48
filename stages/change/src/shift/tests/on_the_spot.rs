//! Boxes that were turned nearly on the spot: old and new place overlap, and only corners changed.

use super::*;
use crate::occupancy::{OccupancyBuilder, SessionOccupancy};
use crate::shift::{ThingPoints, ThingVoxels, find_motions};
use crate::things::{Thing, ThingChange, ThingSettings, things};
use contract::OneByOne;

/// Area that a thinned point represents, m².
const AREA: f64 = 1.6e-4;

/// Both sessions, with what beams that ended show.
struct Seen<'a>([&'a Stage; 2]);

impl SessionBeams for Seen<'_> {
    fn evidence(&self, session: usize, world: [f64; 3]) -> SessionEvidence {
        let place = Vector::from(world);
        let ends = self.0[session].stations.iter().any(|from| {
            let beam = place - from;
            (self.0[session].range(from, &beam.normalize()).0 - beam.norm()).abs() < 0.04
        });
        if ends { SessionEvidence::Occupied } else { Both(self.0).evidence(session, world) }
    }
}

/// What a comparison of both sessions finds.
fn compared(then: &Stage, now: &Stage) -> Vec<Thing> {
    let beams = Seen([then, now]);
    let points = [then.points(), now.points()];
    let occupied: [SessionOccupancy; 2] = [0, 1].map(|k| {
        let mut out = OccupancyBuilder::default();
        for p in &points[k] {
            out.add(p.at.into(), AREA, beams.evidence(1 - k, p.at.into()));
        }
        out.finish()
    });
    let mut found = things(&occupied[0], &occupied[1], &ThingSettings::default(), &OneByOne);
    let voxels = ThingVoxels::of(&found, [&occupied[0], &occupied[1]]);
    let mut gathered = [ThingPoints::default(), ThingPoints::default()];
    for (k, own) in points.iter().enumerate() {
        for p in own {
            let off = |s: &&Vector| (*s - p.at).normalize().dot(&p.towards);
            let all = [then, now][k].stations.iter();
            let scanner = all.max_by(|a, b| off(a).total_cmp(&off(b))).expect("a station");
            gathered[k].add(&voxels, k, p.at.into(), Some((*scanner).into()));
        }
    }
    find_motions(&mut found, (&voxels, &gathered), &beams, &OneByOne);
    found
}

/// Asserts that no motion of a box is stated that it did not make.
fn no_wrong_motion(half: [f64; 3], was: Pose, is: Pose, stations: [&[[f64; 2]]; 2]) -> usize {
    let stage = |pose: Pose, k: usize| Stage {
        bodies: vec![(Body::Box(half), pose)],
        stations: stations[k].iter().map(|s| Vector::new(s[0], s[1], 1.7)).collect(),
    };
    let found = compared(&stage(was, 0), &stage(is, 1));
    let mut n = 0;
    for thing in found.iter().filter(|t| t.change == ThingChange::Moved) {
        let Some(Ok(motion)) = &thing.motion else { continue };
        // The box looks the same after half a turn.
        let half_turn = at(0.0, 0.0, 0.0, 180.0);
        let real = [is * was.inverse(), is * half_turn * was.inverse()];
        let best = real.iter().map(|real| {
            let turned = motion.turn.map_or(0.0, |[turn, _]| {
                let x = real.rotation.inverse() * Vector::new(turn.cos(), turn.sin(), 0.0);
                x.y.atan2(x.x).abs().to_degrees()
            });
            let (error, z) = off(motion, real);
            (turned, error.norm(), z)
        });
        let best = best.min_by(|a, b| (a.0 + 1e2 * a.1).total_cmp(&(b.0 + 1e2 * b.1)));
        let (turned, error, z) = best.expect("a motion");
        assert!(turned < 1.5 && z < 3.0, "{turned} {error} {z} {thing:?}");
        n += 1;
    }
    n
}

#[test]
fn a_box_turned_on_the_spot_gets_its_own_turn_or_none() {
    let stations: [&[[f64; 2]]; 2] = [&[[-3.5, -2.0], [3.0, 3.5]], &[[-2.5, 3.5], [3.5, 1.0]]];
    let mut n = 0;
    for (half, turn) in [
        ([0.29, 0.18, 0.23], 111.0),
        ([0.276, 0.229, 0.49], 145.0),
        ([0.4, 0.22, 0.26], 100.0),
        ([0.3, 0.25, 0.4], 130.0),
    ] {
        for first in [-145.0, 127.0] {
            let was = at(0.0, 0.0, half[2], first);
            n += no_wrong_motion(half, was, at(0.02, 0.05, half[2], first + turn), stations);
        }
    }
    assert!(n >= 2, "{n}");
}
