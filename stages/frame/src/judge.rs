//! A pose of the new session in the earlier one in; which surfels of each lie on surfels of the
//! other, and which lie where the beams of the other went through, out. Level surfaces are left
//! out: a floor lies on itself wherever it is laid.

use crate::refine::Laid;
use crate::surfels::Surfel;
use crate::{Panorama, SessionSurfaces};
use geometry::{Pose, Vector};
use nalgebra::Point3;

/// Two surfels are of one plane where it passes this near to both, metres, with normals at most 37°
/// apart …
const ON: f64 = 0.04;
const ALIKE: f64 = 0.8;
/// … and their middles at most so far apart, metres: a voxel and a half.
const ABOUT: f64 = 0.3;
/// Surfels of which one is not flat are the same thing where their middles are so near, metres.
const NEAR: f64 = 0.15;
/// Surfels of the earlier session are asked for up to this distance from a new scanner, metres.
const FARTHEST: f64 = 20.0;

/// What the other session has where a surfel lies.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum SurfelState {
    /// Nothing is known: no beam got there.
    #[default]
    Unknown,
    /// The same surface.
    Same,
    /// The same surface, of a robot, which may have moved.
    SameRobot,
    /// Beams went through.
    Through,
}

/// What speaks for and against a pose, in surfels of surfaces that are not level (0.04 m² each).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PoseEvidence {
    /// New surfels on surfaces of the earlier session.
    pub n_on_old: usize,
    /// New surfels where beams of the earlier session went through.
    pub n_where_old_saw_through: usize,
    /// All new surfels.
    pub n_new: usize,
    /// Surfels of the earlier session, near the new scanners, on surfaces of the new one.
    pub n_on_new: usize,
    /// Surfels of the earlier session where new beams went through.
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
    /// Surfels that lie on surfaces of the other session.
    #[must_use]
    pub fn n_same(&self) -> usize {
        self.n_on_old + self.n_on_new
    }

    /// Surfels where beams of the other session went through.
    #[must_use]
    pub fn n_against(&self) -> usize {
        self.n_where_old_saw_through + self.n_where_new_saw_through
    }

    /// Share of the surfels that can be compared that lie on surfaces of the other session; 0 where
    /// none can.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.n_same() as f64 / (self.n_same() + self.n_against()).max(1) as f64
    }

    /// For the order of poses: what speaks for it, less twice what speaks against it.
    pub(crate) fn score(&self) -> i64 {
        self.n_same() as i64 - 2 * self.n_against() as i64
    }
}

/// Asks both sessions.
pub(crate) fn judge(old: &SessionSurfaces, new: &SessionSurfaces, laid: Laid) -> Judged {
    let pose = laid.old_from_new;
    let back = pose.inverse();
    let is_covered = |s: &Surfel| old.surfels.covers(&(pose * Point3::from(s.at)).coords);
    let state_new = |s: &Surfel| {
        if s.is_level() {
            return SurfelState::Unknown;
        }
        match state(s, &pose, old) {
            // Without beams, what stands where a floor or anything else was seen and it was not was
            // not there.
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
    /// How many surfels more speak against another pose than against this one, of what stands
    /// still. What is seen through under both, since it was moved, is left out, and so is what
    /// lies on a robot under either.
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

/// What a session has where a surfel of the other one lies; `pose` brings that one's world into its
/// own.
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
