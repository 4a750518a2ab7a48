//! Postures of a path in; postures so close to each other that nothing is missed between them, and
//! where on the way which part is near to what, out.

use crate::ContactLevel;
use crate::body::{PartTouch, PostureNear, RobotBody, STEP};
use crate::obstacle::What;
use crate::obstacles::Obstacles;
use geometry::Point;
use std::collections::BTreeMap;

/// A first guess of steps: so far do joints go in one, radians or metres. Arcs differ from their
/// chords by less than 0.2 % then.
const TURN: f64 = 0.1;
/// Most postures between two waypoints: a metre of reach turned about once takes 630.
const MAX_STEPS: usize = 1 << 14;
/// Postures that are looked at together.
const PIECE: usize = 8;

/// The way from one waypoint to the next, joints going straight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leg {
    /// Postures that are looked at, the first one included, the last one not.
    pub n_steps: usize,
    /// Some part jumps: a closed loop falls over to its other solution.
    pub jumps: bool,
}

/// Where on the way a part is near to something: waypoints are numbered from 0, and 1.5 lies midway
/// between the second and the third.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Index of the link.
    pub link: usize,
    /// It is what hangs on the link, not the link itself.
    pub hangs: bool,
    /// Nobody knows whether it hangs there: uncertain points beside the link as it was scanned.
    pub is_doubtful: bool,
    /// To what.
    pub what: What,
    /// How near at worst.
    pub level: ContactLevel,
    /// It is not nearer than where it was found; to obstacles that it was as near to.
    pub as_found: bool,
    /// Where that begins first and ends last.
    pub from: f64,
    /// See `from`.
    pub to: f64,
    /// At how many of the postures that are looked at.
    pub n_postures: usize,
    /// Where it is worst.
    pub worst: f64,
    /// It is at least so far there, metres.
    pub gap: f64,
    /// One of the obstacles there, frame of the base, metres; nothing for space beyond all that is
    /// known.
    pub at: Option<Point>,
    /// Cells of obstacles there.
    pub n: usize,
}

impl Contact {
    /// It leads into space of which nothing is known, and did not so where the robot was found;
    /// beyond all that is known nobody can tell.
    #[must_use]
    pub fn is_unseen(&self) -> bool {
        self.level == ContactLevel::Unseen && (!self.as_found || self.at.is_none())
    }
}

/// Which part, to what, and whether only as it was found.
type ContactKey = (usize, What, bool);

/// A path that is looked at piece by piece.
pub struct PathWalk<'a> {
    body: &'a RobotBody<'a>,
    around: &'a Obstacles,
    path: &'a [Vec<f64>],
    legs: &'a [Leg],
    /// Number of the first posture of each leg, and of the last waypoint.
    first: Vec<usize>,
    found: AsFound,
}

/// What is near at the postures of a piece, and how far closed loops stay open there, metres.
pub struct PieceContacts(Vec<(f64, PostureContacts, f64)>);

impl<'a> PathWalk<'a> {
    /// Along the waypoints (at least one), with a leg from each to the next; `found` is the posture
    /// that the robot was scanned in.
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
        Self { body, around, path, legs, first, found: AsFound::of(body.near(found, around)) }
    }

    /// Number of postures.
    #[must_use]
    pub fn n_postures(&self) -> usize {
        self.first[self.first.len() - 1] + 1
    }

    /// Number of pieces.
    #[must_use]
    pub fn n_pieces(&self) -> usize {
        self.n_postures().div_ceil(PIECE)
    }

    /// Looks at a piece; none of them asks for another.
    #[must_use]
    pub fn look(&self, piece: usize) -> PieceContacts {
        let own = piece * PIECE..((piece + 1) * PIECE).min(self.n_postures());
        let look = |at: usize| {
            let leg = self.first.partition_point(|first| *first <= at) - 1;
            let share = self
                .legs
                .get(leg)
                .map_or(0.0, |l| (at - self.first[leg]) as f64 / l.n_steps as f64);
            let from = &self.path[leg];
            let posture = between(from, self.path.get(leg + 1).unwrap_or(from), share);
            let near = self.body.near(&posture, self.around);
            let open = self.body.model.loop_gap(&posture);
            (leg as f64 + share, told(&near, &self.found, self.around), open)
        };
        PieceContacts(own.map(look).collect())
    }

    /// Adds what was near in the next piece.
    pub fn add(&self, looked: PieceContacts, to: &mut Contacts) {
        for (place, told, open) in looked.0 {
            to.add(self.body, self.around, place, told);
            if open > to.open.1 {
                to.open = (place, open);
            }
        }
    }
}

/// How many postures lie between a waypoint and the next.
#[must_use]
pub fn leg(body: &RobotBody<'_>, from: &[f64], to: &[f64]) -> Leg {
    let turn = from.iter().zip(to).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
    let mut n_steps = ((turn / TURN).ceil() as usize).clamp(1, MAX_STEPS);
    loop {
        let longest = longest(body, from, to, n_steps);
        // Whole turns in a step would look like none.
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

/// The longest way of any point of the robot from one of the postures to the next, metres: that of
/// a corner of its bounds.
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
        // Twice as many steps are wanted anyway.
        if longest > 2.0 * STEP {
            break;
        }
        before = now;
    }
    longest
}

/// The posture at a share of the way.
fn between(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect()
}

/// What comes nearer by less is as near as before, metres: scans are no finer.
const ROUNDING: f32 = 2e-3;

/// How near parts were to obstacles where the robot was found.
struct AsFound {
    touches: BTreeMap<(usize, usize), (ContactLevel, f32)>,
    outside: Vec<usize>,
}

impl AsFound {
    fn of(near: PostureNear) -> Self {
        let touch = |t: &PartTouch| ((t.part, t.obstacle), (t.level, t.gap));
        Self { touches: near.touches.iter().map(touch).collect(), outside: near.outside }
    }

    fn is(&self, touch: &PartTouch) -> bool {
        let before = self.touches.get(&(touch.part, touch.obstacle));
        before.is_some_and(|(level, gap)| *level >= touch.level && touch.gap >= gap - ROUNDING)
    }
}

/// What is near at one posture, the worst of each kind: how near, at least so far, which obstacle,
/// how many.
type PostureContacts = BTreeMap<ContactKey, (ContactLevel, f32, Option<usize>, usize)>;

fn told(near: &PostureNear, found: &AsFound, around: &Obstacles) -> PostureContacts {
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
        let key = (part, What::Unseen, found.outside.contains(&part));
        out.entry(key).or_insert((ContactLevel::Unseen, 0.0, None, 0));
    }
    out
}

/// All postures at which the same part is near to the same thing are one contact.
#[derive(Debug, Clone, Default)]
pub struct Contacts {
    all: BTreeMap<ContactKey, Contact>,
    /// Where closed loops stay open most, and how far, metres.
    open: (f64, f64),
}

impl Contacts {
    fn add(&mut self, body: &RobotBody<'_>, around: &Obstacles, place: f64, told: PostureContacts) {
        for (key, (level, gap, obstacle, n)) in told {
            let part = &body.parts[key.0];
            let now = Contact {
                link: part.link,
                hangs: part.hangs,
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

    /// Where closed loops stay open most, and how far, metres.
    #[must_use]
    pub fn open(&self) -> (f64, f64) {
        self.open
    }

    /// The worst first.
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
