//! Examines postures along a path, so close to each other that no contact is missed between them,
//! and reports where on the path which part is near which obstacle.

use crate::body::{PartTouch, PostureNear, RobotBody, STEP};
use crate::contact_level::ContactLevel;
use crate::obstacle::ObstacleKind;
use crate::obstacles::Obstacles;
use geometry::Point;
use std::collections::BTreeMap;
/// Largest joint motion of a step in the first guess, radians or metres; arcs then differ from
/// their chords by less than 0.2 %.
const TURN: f64 = 0.1;
/// Largest number of postures between two waypoints; a full turn at a reach of one metre takes 630.
const MAX_STEPS: usize = 1 << 14;
/// Number of postures that are examined as one piece of work.
const PIECE: usize = 8;

/// The motion from one waypoint to the next, linear in the joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leg {
    /// Number of postures to examine, including the first waypoint and not the last.
    pub n_steps: usize,
    /// Whether a part jumps because a closed loop changes to its other solution.
    pub jumps: bool,
}

/// A stretch of a path on which a part is near something. Places on a path are counted in waypoints
/// from 0: 1.5 is midway between the second and the third.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Index of the link.
    pub link: usize,
    /// Whether points attached to the link are near, and not the link itself.
    pub is_attached: bool,
    /// Whether it is uncertain that these points are attached to the link.
    pub is_doubtful: bool,
    /// The kind of the obstacle.
    pub what: ObstacleKind,
    /// The worst level on the stretch.
    pub level: ContactLevel,
    /// Whether the part was as near to these obstacles in the posture in which it was scanned.
    pub as_found: bool,
    /// Place on the path where the contact first begins.
    pub from: f64,
    /// Place on the path where it last ends.
    pub to: f64,
    /// Number of examined postures with the contact.
    pub n_postures: usize,
    /// Place on the path where it is worst.
    pub worst: f64,
    /// Lower bound of the distance there, metres.
    pub gap: f64,
    /// One of the obstacles there, base frame, metres; `None` for space beyond everything known.
    pub at: Option<Point>,
    /// Number of obstacle cells there.
    pub n: usize,
}

impl Contact {
    /// Whether the part moves into unseen space in which it was not when scanned; beyond everything
    /// known this cannot be told, and counts.
    #[must_use]
    pub fn is_unseen(&self) -> bool {
        self.level == ContactLevel::Unseen && (!self.as_found || self.at.is_none())
    }
}

/// Index of the part, kind of the obstacle, and whether it was as near when scanned.
type ContactKey = (usize, ObstacleKind, bool);

/// A path that is examined piece by piece.
pub struct PathWalk<'a> {
    body: &'a RobotBody<'a>,
    around: &'a Obstacles,
    path: &'a [Vec<f64>],
    legs: &'a [Leg],
    /// Index of the first posture of each leg, and of the last waypoint.
    first: Vec<usize>,
    found: AsFound,
}

/// The contacts at the postures of a piece, and the gap of closed loops there, metres.
pub struct PieceContacts(Vec<(f64, PostureContacts, f64)>);

impl<'a> PathWalk<'a> {
    /// A walk along waypoints (at least one) with a leg from each to the next; `found` is the
    /// posture in which the robot was scanned.
    #[must_use]
    pub fn new(
        body: &'a RobotBody<'a>,
        around: &'a Obstacles,
        path: &'a [Vec<f64>],
        legs: &'a [Leg],
        found: &[f64],
    ) -> Self {
        let mut first = vec![0];
        for leg in legs {
            first.push(first[first.len() - 1] + leg.n_steps);
        }
        Self { body, around, path, legs, first, found: AsFound::of(body, found, around) }
    }

    /// Number of postures.
    #[must_use]
    pub fn n_postures(&self) -> usize {
        self.first[self.first.len() - 1] + 1
    }

    /// Distance between neighbouring beams where moving parts are at the waypoints, and half-way
    /// between them, metres: the largest, each by the scanner that resolves the place best, whether
    /// or not it sees the place. `None` without scanners of known position. Thinner things may
    /// stand there without a single point.
    #[must_use]
    pub fn beam_spacing(&self) -> Option<f64> {
        let halves = self.path.windows(2).map(|leg| between(&leg[0], &leg[1], 0.5));
        let postures = self.path.iter().cloned().chain(halves);
        let of_posture = |posture: Vec<f64>| {
            let poses = self.body.model.poses(&posture);
            let middles = self.body.bounds().map(|(link, b)| poses[link] * b.center());
            let all = middles.filter_map(|p| self.around.beam_spacing(&p));
            all.max_by(f64::total_cmp)
        };
        postures.filter_map(of_posture).max_by(f64::total_cmp)
    }

    /// Number of pieces.
    #[must_use]
    pub fn n_pieces(&self) -> usize {
        self.n_postures().div_ceil(PIECE)
    }

    /// Examines a piece, independently of all others.
    #[must_use]
    pub fn examine(&self, piece: usize) -> PieceContacts {
        let own = piece * PIECE..((piece + 1) * PIECE).min(self.n_postures());
        let examine = |at: usize| {
            let leg = self.first.partition_point(|first| *first <= at) - 1;
            let share = self
                .legs
                .get(leg)
                .map_or(0.0, |l| (at - self.first[leg]) as f64 / l.n_steps as f64);
            let from = &self.path[leg];
            let posture = between(from, self.path.get(leg + 1).unwrap_or(from), share);
            let near = self.body.near(&posture, self.around);
            let open = self.body.model.loop_gap(&posture);
            (leg as f64 + share, contacts_of_posture(&near, &self.found, self.around), open)
        };
        PieceContacts(own.map(examine).collect())
    }

    /// Adds the contacts of the next piece.
    pub fn add(&self, examined: PieceContacts, to: &mut Contacts) {
        for (place, contacts, open) in examined.0 {
            to.add(self.body, self.around, place, contacts);
            if open > to.open.1 {
                to.open = (place, open);
            }
        }
    }
}

/// The leg between two waypoints: the number of postures to examine.
#[must_use]
pub fn leg(body: &RobotBody<'_>, from: &[f64], to: &[f64]) -> Leg {
    let turn = from.iter().zip(to).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
    let mut n_steps = ((turn / TURN).ceil() as usize).clamp(1, MAX_STEPS);
    loop {
        let longest = longest(body, from, to, n_steps);
        // A step of whole turns would look like no motion.
        if longest <= STEP && turn <= TURN * n_steps as f64 {
            return Leg { n_steps, jumps: false };
        }
        if n_steps == MAX_STEPS {
            return Leg { n_steps, jumps: true };
        }
        let wanted = (n_steps as f64 * (longest / STEP).min(2.0) * 1.02).ceil() as usize;
        n_steps = wanted.clamp(n_steps + 1, MAX_STEPS);
    }
}

/// Largest distance that any point of the robot moves from one posture to the next, metres, from
/// the corners of its bounds.
fn longest(body: &RobotBody<'_>, from: &[f64], to: &[f64], n_steps: usize) -> f64 {
    let corners = |step: usize| -> Vec<Point> {
        let poses = body.model.poses(&between(from, to, step as f64 / n_steps as f64));
        let own =
            body.bounds().flat_map(|(link, b)| b.corners().map(|c| poses[link] * Point::from(c)));
        own.collect()
    };
    let mut before = corners(0);
    let mut longest = 0.0_f64;
    for step in 1..=n_steps {
        let now = corners(step);
        let ways = before.iter().zip(&now).map(|(a, b)| (b - a).norm());
        longest = ways.fold(longest, f64::max);
        // The number of steps is doubled in any case.
        if longest > 2.0 * STEP {
            break;
        }
        before = now;
    }
    longest
}

/// The posture at a share of the leg, 0..1.
fn between(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect()
}

/// An approach by less counts as unchanged distance, metres; scans are no finer.
const ROUNDING: f32 = 2e-3;

/// Distances of parts from obstacles in the posture in which the robot was scanned.
struct AsFound {
    touches: BTreeMap<(usize, usize), (ContactLevel, f32)>,
    outside: Vec<usize>,
}

impl AsFound {
    /// Also of what was little farther than the margin: a path may begin a little beside the
    /// posture that was found.
    fn of(body: &RobotBody<'_>, found: &[f64], around: &Obstacles) -> Self {
        let near = body.near_by(ROUNDING, found, around);
        let touch = |t: &PartTouch| ((t.part, t.obstacle), (t.level, t.gap));
        Self { touches: near.touches.iter().map(touch).collect(), outside: near.outside }
    }

    fn is(&self, touch: &PartTouch) -> bool {
        let before = self.touches.get(&(touch.part, touch.obstacle));
        before.is_some_and(|(level, gap)| *level >= touch.level && touch.gap >= gap - ROUNDING)
    }
}

/// The worst contact of each kind in one posture: level, lower bound of the distance (metres),
/// index of the obstacle, number of obstacles.
type PostureContacts = BTreeMap<ContactKey, (ContactLevel, f32, Option<usize>, usize)>;

fn contacts_of_posture(near: &PostureNear, found: &AsFound, around: &Obstacles) -> PostureContacts {
    let mut out = PostureContacts::new();
    for touch in &near.touches {
        let key = (touch.part, around.all[touch.obstacle].what, found.is(touch));
        let worst = out.entry(key).or_insert((touch.level, touch.gap, Some(touch.obstacle), 0));
        if (touch.level, -touch.gap) > (worst.0, -worst.1) {
            (worst.0, worst.1, worst.2) = (touch.level, touch.gap, Some(touch.obstacle));
        }
        worst.3 += 1;
    }
    for &part in &near.outside {
        let key = (part, ObstacleKind::Unseen, found.outside.contains(&part));
        out.entry(key).or_insert((ContactLevel::Unseen, 0.0, None, 0));
    }
    out
}

/// Joins the contacts of all postures: one for each part and kind of obstacle.
#[derive(Debug, Clone, Default)]
pub struct Contacts {
    all: BTreeMap<ContactKey, Contact>,
    /// Place on the path where closed loops are open most, and their gap, metres.
    open: (f64, f64),
}

impl Contacts {
    fn add(
        &mut self,
        body: &RobotBody<'_>,
        around: &Obstacles,
        place: f64,
        contacts: PostureContacts,
    ) {
        for (key, (level, gap, obstacle, n)) in contacts {
            let part = &body.parts[key.0];
            let now = Contact {
                link: part.link,
                is_attached: part.is_attached,
                is_doubtful: part.is_doubtful,
                what: key.1,
                level,
                as_found: key.2,
                from: place,
                to: place,
                n_postures: 1,
                worst: place,
                gap: f64::from(gap),
                at: obstacle.map(|o| Point::from(around.all[o].at.map(f64::from))),
                n,
            };
            let Some(before) = self.all.get_mut(&key) else {
                self.all.insert(key, now);
                continue;
            };
            (before.to, before.n_postures) = (place, before.n_postures + 1);
            if (level, -now.gap) > (before.level, -before.gap) {
                let (from, n_postures) = (before.from, before.n_postures);
                *before = Contact { from, n_postures, ..now };
            }
        }
    }

    /// Place on the path where closed loops are open most, and their gap, metres.
    #[must_use]
    pub fn open(&self) -> (f64, f64) {
        self.open
    }

    /// All contacts, the worst first.
    #[must_use]
    pub fn all(self) -> Vec<Contact> {
        let mut all: Vec<Contact> = self.all.into_values().collect();
        let order = |c: &Contact| (c.as_found, std::cmp::Reverse(c.level));
        all.sort_by(|a, b| order(a).cmp(&order(b)).then(a.from.total_cmp(&b.from)));
        all
    }
}

#[cfg(test)]
mod tests;
