//! Judges a pose of the new session: which surfels of each session lie on surfels of the other, and
//! which lie where beams of the other passed through. Level surfaces do not count, since a floor
//! fits on itself in any place.

use crate::panorama::Panorama;
use crate::refine::Laid;
use crate::session::SessionSurfaces;
use crate::surfels::Surfel;
use geometry::{Pose, Vector};
use nalgebra::Point3;

/// Two surfels belong to one plane if it passes both at this distance or less, metres.
const ON: f64 = 0.04;
/// Smallest cosine between the normals of two surfels of one plane (37°).
const ALIKE: f64 = 0.8;
/// Largest distance between the centres of such surfels, metres: a voxel and a half.
const ABOUT: f64 = 0.3;
/// Distance of centres below which surfels of which one is not flat are the same object, metres.
const NEAR: f64 = 0.15;
/// Largest distance of surfels of the earlier session from a new scanner, metres.
const FARTHEST: f64 = 20.0;

/// What the other session has at the place of a surfel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum SurfelState {
    /// Nothing is known, since no beam got there.
    #[default]
    Unknown,
    /// The same surface.
    Same,
    /// The same surface, but of a robot, which may have moved.
    SameRobot,
    /// Beams passed through.
    Through,
}

/// Evidence for and against a pose, in non-level surfels (0.04 m² each).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PoseEvidence {
    /// Number of new surfels on surfaces of the earlier session.
    pub n_on_old: usize,
    /// Number of new surfels where beams of the earlier session passed through.
    pub n_where_old_saw_through: usize,
    /// Number of all new surfels.
    pub n_new: usize,
    /// Number of surfels of the earlier session, near the new scanners, on surfaces of the new
    /// one.
    pub n_on_new: usize,
    /// Number of surfels of the earlier session where new beams passed through.
    pub n_where_new_saw_through: usize,
}

/// A pose with its evidence.
pub(crate) struct Judged {
    pub(crate) laid: Laid,
    pub(crate) evidence: PoseEvidence,
    new: Vec<SurfelState>,
    old: Vec<SurfelState>,
}

impl PoseEvidence {
    /// Number of surfels that lie on surfaces of the other session.
    #[must_use]
    pub fn n_same(&self) -> usize {
        self.n_on_old + self.n_on_new
    }

    /// Number of surfels where beams of the other session passed through.
    #[must_use]
    pub fn n_against(&self) -> usize {
        self.n_where_old_saw_through + self.n_where_new_saw_through
    }

    /// Share of the comparable surfels that lie on surfaces of the other session; 0 where none can
    /// be compared.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.n_same() as f64 / (self.n_same() + self.n_against()).max(1) as f64
    }

    /// Rank of a pose: number of surfels for it less twice the number against it.
    pub(crate) fn score(&self) -> i64 {
        self.n_same() as i64 - 2 * self.n_against() as i64
    }
}

/// Judges a pose by both sessions.
pub(crate) fn judge(old: &SessionSurfaces, new: &SessionSurfaces, laid: Laid) -> Judged {
    let pose = laid.old_from_new;
    let back = pose.inverse();
    let is_covered = |s: &Surfel| old.surfels.covers(&(pose * Point3::from(s.at)).coords);
    let state_new = |s: &Surfel| {
        if s.is_level() {
            return SurfelState::Unknown;
        }
        match state(s, &pose, old) {
            // Without beams, an object where the other session saw a floor or anything else, but
            // not the object, was not there.
            SurfelState::Unknown if old.eyes.is_empty() && is_covered(s) => SurfelState::Through,
            state => state,
        }
    };
    let scanners: Vec<Vector> = new.eyes.iter().map(Panorama::at).collect();
    let state_old = |s: &Surfel| {
        let at = (back * Point3::from(s.at)).coords;
        let is_near = |scanner: &Vector| (at - scanner).norm_squared() < FARTHEST * FARTHEST;
        if s.is_level() || !scanners.iter().any(is_near) {
            return SurfelState::Unknown;
        }
        match state(s, &back, new) {
            SurfelState::Same if s.may_move => SurfelState::SameRobot,
            SurfelState::Through if s.may_move => SurfelState::Unknown,
            state => state,
        }
    };
    let new_states: Vec<SurfelState> = new.surfels.all.iter().map(state_new).collect();
    let old_states: Vec<SurfelState> = old.surfels.all.iter().map(state_old).collect();
    let n = |all: &[SurfelState], wanted: &[SurfelState]| {
        all.iter().filter(|s| wanted.contains(s)).count()
    };
    let same = [SurfelState::Same, SurfelState::SameRobot];
    let evidence = PoseEvidence {
        n_on_old: n(&new_states, &same),
        n_where_old_saw_through: n(&new_states, &[SurfelState::Through]),
        n_new: new.surfels.all.iter().filter(|s| !s.is_level()).count(),
        n_on_new: n(&old_states, &same),
        n_where_new_saw_through: n(&old_states, &[SurfelState::Through]),
    };
    Judged { laid, evidence, new: new_states, old: old_states }
}

impl Judged {
    /// By how many more surfels of fixed objects another pose is contradicted than this one.
    /// Surfels that are seen through in both poses (a moved object) and those on a robot in either
    /// pose do not count.
    pub(crate) fn margin_over(&self, other: &Self) -> i64 {
        let sides = [(&self.new, &other.new), (&self.old, &other.old)];
        let all = sides.into_iter().flat_map(|(own, other)| own.iter().zip(other));
        let more = |(own, other): (&SurfelState, &SurfelState)| match (own, other) {
            (SurfelState::Same | SurfelState::Unknown, SurfelState::Through) => 1,
            (SurfelState::Through, SurfelState::Same | SurfelState::Unknown) => -1,
            _ => 0,
        };
        all.map(more).sum()
    }
}

/// What a session has at the place of a surfel of the other one; `pose` converts from the other's
/// world to its own.
fn state(surfel: &Surfel, pose: &Pose, other_session: &SessionSurfaces) -> SurfelState {
    let SessionSurfaces { surfels, eyes } = other_session;
    let at = (pose * Point3::from(surfel.at)).coords;
    let normal = pose.rotation * surfel.normal;
    let is_same = |other: &&Surfel| {
        let between = at - other.at;
        if surfel.is_flat() && other.is_flat() {
            other.cosine(&normal, surfel.is_signed) > ALIKE
                && other.normal.dot(&between).abs() < ON
                && between.norm_squared() < ABOUT * ABOUT
        } else {
            !other.is_level() && between.norm_squared() < NEAR * NEAR
        }
    };
    let mut found = SurfelState::Unknown;
    for other in surfels.about(&at).map(|i| &surfels.all[i]).filter(is_same) {
        if !other.may_move {
            return SurfelState::Same;
        }
        found = SurfelState::SameRobot;
    }
    if found == SurfelState::Unknown && eyes.iter().any(|eye| eye.sees_through(&at)) {
        return SurfelState::Through;
    }
    found
}
