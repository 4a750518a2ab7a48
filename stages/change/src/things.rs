//! Finds the things that appeared, went or moved between two sessions, from the occupied voxels of
//! both.

use crate::occupancy::{EDGE, OccupancyCell, REACH, SessionOccupancy, bounds, connected};
use crate::shift::motion::{ThingMotion, UnknownMotion};
use crate::split::split_by_size;
use contract::Fan;
use geometry::Aabb;
use std::collections::{BTreeMap, BTreeSet};

/// Voxels with few points at most this many steps apart belong to one thing: rows of beams that
/// graze a surface lie that far apart.
const THIN_REACH: i32 = 3;
/// Least share of a connected thing that must have changed for the whole thing to be compared.
const WHOLE: f64 = 0.2;
/// Largest number of voxels of a thing that is compared as a whole. Anything larger is a structure
/// that the thing stood against.
const MAX_WHOLE: usize = 40_000;
/// Largest ratio of the footprints of one thing in two sessions, where one saw only a part of it.
/// The second value applies where one side was seen in its full length, which may be all that was
/// seen.
const MAX_PART: [f64; 2] = [2.5, 6.0];
/// Range of the ratio of footprints in which a change may consist of a thing of the other session
/// and another thing beside it. A change that is larger is no pair, and would take long to search.
const WIDER: [f64; 2] = [1.4, 6.0];
/// Tolerance between the sizes of one thing in two sessions, which see different sides of it: a
/// length in metres, or, where larger, a share of each of its sides and of its height, whose top
/// both see.
const SAME_SIZE: (f64, [f64; 3]) = (0.12, [0.2, 0.2, 0.1]);
/// A change that is flatter than this share of another's height, whose top is within `SAME_TOP`
/// metres of the other's and whose sides agree, is the other's top, seen over something that hides
/// the rest.
const FLAT: f64 = 0.5;
const SAME_TOP: f64 = 0.08;

/// Largest gap between the ends of a thing whose middle is hidden by something in front of it,
/// metres.
const BESIDE: f64 = 0.1;

/// The settings of the search for things.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThingSettings {
    /// Least length of the longest edge of a change, metres.
    pub min_size: f64,
    /// Fewest voxels of a change.
    pub min_voxels: usize,
    /// Fewest points of a change.
    pub min_points: u32,
    /// Distance from a robot's points within which a change is attributed to the robot, metres:
    /// points that segmentation did not assign.
    pub robot_margin: f64,
}

impl Default for ThingSettings {
    fn default() -> Self {
        Self { min_size: 0.12, min_voxels: 24, min_points: 60, robot_margin: 0.15 }
    }
}

/// How a thing changed between the sessions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThingChange {
    /// The thing is new.
    Appeared,
    /// The thing is no longer there.
    Gone,
    /// The thing stands in another place.
    Moved,
}

/// A thing that is not part of a robot and changed between the sessions.
#[derive(Debug, Clone, PartialEq)]
pub struct Thing {
    /// How it changed.
    pub change: ThingChange,
    /// Bounds in the earlier session; world frame, metres.
    pub then: Option<Aabb>,
    /// Bounds in the later session; world frame, metres.
    pub now: Option<Aabb>,
    /// Its motion, if it moved and the motion was asked for ([`crate::find_motions`]).
    pub motion: Option<Result<ThingMotion, UnknownMotion>>,
    /// Volume of the voxels that changed, m³. They lie on the surface of the thing, as far as it
    /// was seen.
    pub volume: f64,
    /// Number of points in these voxels.
    pub n_points: u64,
    /// Voxels that are empty in the later session.
    pub gone: Vec<OccupancyCell>,
    /// Voxels that are filled in the later session.
    pub filled: Vec<OccupancyCell>,
}

/// One connected change.
#[derive(Debug, Clone)]
struct ChangePiece {
    cells: Vec<OccupancyCell>,
    n_points: u64,
    bounds: Aabb,
    /// Bounds with sparse voxels around it, where beams graze the thing or hit something beside
    /// it.
    wide: Aabb,
    /// Bounds of the whole connected thing, if a large share of it changed. A thing pushed by less
    /// than its length stands partly where it stood before.
    whole: Option<Aabb>,
}

impl ChangePiece {
    /// Joins several pieces to one; `None` if there are none.
    fn of<'p>(pieces: impl Iterator<Item = &'p Self>) -> Option<Self> {
        pieces.cloned().reduce(|mut all, more| {
            all.cells.extend(more.cells);
            all.cells.sort_unstable();
            all.n_points += more.n_points;
            all.bounds = all.bounds.union(&more.bounds);
            all
        })
    }

    /// The bounds that the thing may have.
    fn boxes(&self) -> impl Iterator<Item = &Aabb> {
        self.whole.iter().chain([&self.wide, &self.bounds])
    }
}

impl SessionOccupancy {
    /// Connected changes that are large enough and do not belong to a robot.
    fn pieces(&self, other: &Self, settings: &ThingSettings) -> Vec<ChangePiece> {
        let mut thin = self.changed(other);
        let mut left: BTreeSet<OccupancyCell> =
            thin.iter().copied().filter(|c| self.is_solid(c)).collect();
        let margin = (settings.robot_margin / EDGE).ceil() as i32;
        let is_near = |cell: &OccupancyCell| {
            self.has_robot_near(cell, margin) || other.has_robot_near(cell, margin)
        };
        let mut out = Vec::new();
        while let Some(first) = left.pop_first() {
            let cells = connected(first, REACH, |c| left.remove(c), usize::MAX);
            if self.is_thing(&cells, settings)
                && 2 * cells.iter().filter(|c| is_near(c)).count() < cells.len()
            {
                out.push(cells);
            }
        }
        thin.retain(|cell| !is_near(cell));
        self.wholes(self.joined(out, thin))
    }

    /// The changes, each split in two where one part agrees with a thing of the other session and
    /// the rest is another thing beside it.
    fn separated(
        &self,
        pieces: &[ChangePiece],
        others: &[ChangePiece],
        settings: &ThingSettings,
    ) -> Vec<ChangePiece> {
        let split = |piece: &ChangePiece| {
            let times = |other: &Aabb| ground(&piece.bounds) / ground(other);
            let boxes = others.iter().flat_map(ChangePiece::boxes);
            let smaller = boxes.filter(|o| (WIDER[0]..WIDER[1]).contains(&times(o)));
            let parts = smaller.filter_map(|other| {
                let parts = split_by_size(&piece.cells, other.size())?;
                let is_it = size_difference(&bounds(&parts[0]), other) <= 1.0;
                (is_it && self.is_thing(&parts[1], settings)).then_some(parts)
            });
            parts.map(|parts| parts.map(|cells| self.piece_of(cells))).next()
        };
        pieces.iter().flat_map(|p| split(p).map_or_else(|| vec![p.clone()], Vec::from)).collect()
    }

    /// Joins changes that are connected by sparse voxels to one thing.
    fn joined(
        &self,
        pieces: Vec<Vec<OccupancyCell>>,
        mut thin: BTreeSet<OccupancyCell>,
    ) -> Vec<ChangePiece> {
        let mut out = Vec::new();
        thin.extend(pieces.iter().flatten());
        let mut left: BTreeMap<OccupancyCell, Vec<OccupancyCell>> =
            pieces.into_iter().map(|cells| (cells[0], cells)).collect();
        while let Some((first, mut cells)) = left.pop_first() {
            thin.remove(&first);
            let all = connected(first, THIN_REACH, |c| thin.remove(c), usize::MAX);
            for cell in &all {
                cells.extend(left.remove(cell).into_iter().flatten());
            }
            cells.sort_unstable();
            out.push(ChangePiece { wide: bounds(&all), ..self.piece_of(cells) });
        }
        out
    }

    /// Whether connected voxels are large and solid enough for a thing.
    fn is_thing(&self, cells: &[OccupancyCell], settings: &ThingSettings) -> bool {
        let size = bounds(cells).size().iter().fold(0.0_f64, |a, b| a.max(*b));
        cells.len() >= settings.min_voxels
            && self.n_points(cells) >= u64::from(settings.min_points)
            && size >= settings.min_size
            && self.is_opaque(cells)
    }

    /// Makes a piece of voxels, with the bounds of exactly these.
    fn piece_of(&self, cells: Vec<OccupancyCell>) -> ChangePiece {
        let bounds = bounds(&cells);
        ChangePiece { n_points: self.n_points(&cells), bounds, wide: bounds, whole: None, cells }
    }

    /// Joins changes that are parts of one connected thing.
    fn wholes(&self, mut pieces: Vec<ChangePiece>) -> Vec<ChangePiece> {
        let mut out = Vec::new();
        while let Some(mut piece) = pieces.pop() {
            let all = self.standing(&piece.cells);
            let is_part = |other: &ChangePiece| other.cells.iter().any(|c| all.contains(c));
            let parts = pieces.iter().filter(|p| is_part(p));
            let n = piece.cells.len() + parts.map(|p| p.cells.len()).sum::<usize>();
            if all.len() < MAX_WHOLE && n as f64 >= WHOLE * all.len() as f64 {
                for part in pieces.extract_if(.., |p| is_part(p)) {
                    piece.cells.extend(part.cells);
                    piece.wide = piece.wide.union(&part.wide);
                }
                piece.cells.sort_unstable();
                let whole = bounds(&all).union(&piece.wide);
                piece = ChangePiece {
                    wide: piece.wide,
                    whole: Some(whole),
                    ..self.piece_of(piece.cells)
                };
            }
            out.push(piece);
        }
        out
    }

    /// The solid voxels that some voxels are connected with; the search stops at about
    /// [`MAX_WHOLE`].
    fn standing(&self, cells: &[OccupancyCell]) -> BTreeSet<OccupancyCell> {
        let mut all: BTreeSet<OccupancyCell> = cells.iter().copied().collect();
        for first in cells {
            if all.len() < MAX_WHOLE {
                connected(*first, 1, |c| self.is_solid(c) && all.insert(*c), MAX_WHOLE);
            }
        }
        all
    }
}

/// Finds the things that differ between two sessions: first those that moved, then those that went,
/// then those that appeared, each sorted by descending number of voxels. The two directions of the
/// comparison run on `fan`.
#[must_use]
pub fn things(
    then: &SessionOccupancy,
    now: &SessionOccupancy,
    settings: &ThingSettings,
    fan: &dyn Fan,
) -> Vec<Thing> {
    let by_size = |mut pieces: Vec<ChangePiece>| {
        pieces.sort_by_key(|p| std::cmp::Reverse(p.cells.len()));
        pieces
    };
    let pieces =
        fan.fan(vec![(then, now), (now, then)], |(own, other)| own.pieces(other, settings));
    let gone = by_size(then.separated(&pieces[0], &pieces[1], settings));
    let filled = by_size(now.separated(&pieces[1], &pieces[0], settings));
    let mut moved = moved(&gone, &filled);
    complete(&mut moved, [&gone, &filled]);
    let one = |pair: &MovedPair| {
        let [was, is] = [(&gone, &pair.parts[0]), (&filled, &pair.parts[1])]
            .map(|(all, parts)| ChangePiece::of(parts.iter().map(|i| &all[*i])));
        let [then, now] = pair.boxes;
        Thing {
            then: Some(then),
            now: Some(now),
            ..thing(ThingChange::Moved, was.as_ref(), is.as_ref())
        }
    };
    let mut out: Vec<Thing> = moved.iter().map(one).collect();
    let is_left = |side: usize, i: usize| moved.iter().all(|m| !m.parts[side].contains(&i));
    let went = gone.iter().enumerate().filter(|(i, _)| is_left(0, *i));
    out.extend(went.map(|(_, was)| thing(ThingChange::Gone, Some(was), None)));
    let came = filled.iter().enumerate().filter(|(i, _)| is_left(1, *i));
    out.extend(came.map(|(_, is)| thing(ThingChange::Appeared, None, Some(is))));
    out
}

/// A thing that moved: the indices of its pieces and its bounds (world frame, metres), each in the
/// earlier and in the later session.
struct MovedPair {
    parts: [Vec<usize>; 2],
    boxes: [Aabb; 2],
}

/// Adds further pieces to moved things of which one session saw several pieces, as long as the size
/// comes nearer to that of the other session.
fn complete(moved: &mut [MovedPair], pieces: [&[ChangePiece]; 2]) {
    for at in 0..moved.len() {
        for side in 0..2 {
            for (i, piece) in pieces[side].iter().enumerate() {
                if moved.iter().any(|pair| pair.parts[side].contains(&i)) {
                    continue;
                }
                let pair = &mut moved[at];
                let (own, other) = (pair.boxes[side], pair.boxes[1 - side]);
                let with = own.union(&piece.bounds);
                let [before, after] = [&own, &with].map(|b| largest_difference(b, &other));
                let is_rest = after <= 1.0 && after < before;
                if is_rest || is_end(&piece.bounds, &own, &other) {
                    pair.boxes[side] = with;
                    pair.parts[side].push(i);
                }
            }
        }
    }
}

/// Whether a piece is one end of a thing of which `own` was seen, where the other session saw
/// `other`: it lies beside `own`, its top is as high, and both together are more like `other` in
/// size and not larger. The bounds of a thing that turned differ.
fn is_end(piece: &Aabb, own: &Aabb, other: &Aabb) -> bool {
    let with = sides(&own.union(piece));
    let (own_sides, other) = (sides(own), sides(other));
    let is_within = (0..3).all(|i| with[i] - other[i] <= tolerance(&with, &other, i));
    let sum_of_differences =
        |a: &[f64; 3]| (0..3).map(|i| relative_difference(a, &other, i)).sum::<f64>();
    own.grown(BESIDE).touches(piece)
        && (piece.max[2] - own.max[2]).abs() <= SAME_TOP
        && is_within
        && sum_of_differences(&with) < sum_of_differences(&own_sides)
}

/// Pairs pieces that went with pieces that appeared, where their sizes agree. The most similar
/// pairs are chosen first, so that a barrel does not take the new place of a pallet.
fn moved(gone: &[ChangePiece], filled: &[ChangePiece]) -> Vec<MovedPair> {
    let pairs = (0..gone.len()).flat_map(|i| (0..filled.len()).map(move |j| (i, j)));
    let alike = pairs.filter_map(|(i, j)| {
        let (was, is) = (&gone[i], &filled[j]);
        let pair = |then: &Aabb, now: &Aabb| {
            let [then, now] = [lowered(then, now), lowered(now, then)];
            (size_difference(&then, &now), i, j, [then, now])
        };
        let others = was.boxes().flat_map(|then| is.boxes().map(move |now| pair(then, now)));
        // The whole things are compared first: a thing that was pushed a little leaves two strips,
        // which are similar, too.
        let whole = was.whole.zip(is.whole).map(|(then, now)| pair(&then, &now));
        let is_alike = |pair: &(f64, usize, usize, [Aabb; 2])| pair.0 <= 1.0;
        whole.filter(is_alike).or(others.filter(is_alike).min_by(|a, b| a.0.total_cmp(&b.0)))
    });
    let mut alike: Vec<_> = alike.collect();
    alike.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<MovedPair> = Vec::new();
    for (_, i, j, boxes) in alike {
        if out.iter().all(|pair| pair.parts[0] != [i] && pair.parts[1] != [j]) {
            out.push(MovedPair { parts: [vec![i], vec![j]], boxes });
        }
    }
    out.sort_by_key(|pair| pair.parts[0][0]);
    out
}

fn thing(change: ThingChange, was: Option<&ChangePiece>, is: Option<&ChangePiece>) -> Thing {
    let (then, now) = (was.map(|p| p.bounds), is.map(|p| p.bounds));
    let cells = |p: Option<&ChangePiece>| p.map(|p| p.cells.clone()).unwrap_or_default();
    let (gone, filled) = (cells(was), cells(is));
    let main = is.or(was);
    let n_points = main.map_or(0, |p| p.n_points);
    let volume = main.map_or(0.0, |p| p.cells.len() as f64 * EDGE.powi(3));
    Thing { change, then, now, motion: None, volume, n_points, gone, filled }
}

/// If a box may be the top of another one of which its session saw no more, the box extended down
/// to the base of the other; otherwise the box itself.
fn lowered(top: &Aabb, other: &Aabb) -> Aabb {
    let is_flat = top.size()[2] < FLAT * other.size()[2];
    let is_as_high = (top.max[2] - other.max[2]).abs() <= SAME_TOP;
    let is_alike = (0..2).all(|i| relative_difference(&sides(top), &sides(other), i) <= 1.0);
    let mut out = *top;
    if is_flat && is_as_high && is_alike {
        out.min[2] = other.min[2];
    }
    out
}

/// The shorter and the longer side on the ground and the height of a box, metres.
fn sides(bounds: &Aabb) -> [f64; 3] {
    let [w, d, h] = bounds.size();
    [w.min(d), w.max(d), h]
}

/// Tolerance of a side, metres.
fn tolerance(a: &[f64; 3], b: &[f64; 3], i: usize) -> f64 {
    SAME_SIZE.0.max(SAME_SIZE.1[i] * a[i].max(b[i]))
}

/// Difference of a side as a multiple of its tolerance.
fn relative_difference(a: &[f64; 3], b: &[f64; 3], i: usize) -> f64 {
    (a[i] - b[i]).abs() / tolerance(a, b, i)
}

/// The largest difference of any side as a multiple of its tolerance.
fn largest_difference(a: &Aabb, b: &Aabb) -> f64 {
    let (a, b) = (sides(a), sides(b));
    (0..3).map(|i| relative_difference(&a, &b, i)).fold(0.0, f64::max)
}

/// Difference of the sizes of two boxes, whatever their rotation about the vertical axis. Up to 1
/// they may be one thing, of which one session may have seen less than the other.
fn size_difference(a: &Aabb, b: &Aabb) -> f64 {
    let (a, b) = (sides(a), sides(b));
    let (tolerance, relative_difference) =
        (|i: usize| tolerance(&a, &b, i), |i: usize| relative_difference(&a, &b, i));
    // The smaller one must fit into the larger one, and must not be a small part of it.
    let (small, large) = if a[0] * a[1] < b[0] * b[1] { (a, b) } else { (b, a) };
    let beyond = |i: usize| (small[i] - large[i]) / tolerance(i);
    let is_side = (0..2).any(|i| (small[1] - large[i]).abs() <= tolerance(i));
    let part =
        large[0] * large[1] / (small[0] * small[1]).max(1e-9) / MAX_PART[usize::from(is_side)];
    let partial_view = beyond(0).max(beyond(1)).max(part).max(relative_difference(2));
    (0..3).map(relative_difference).fold(0.0, f64::max).min(partial_view)
}

/// Area of the footprint of a box, m².
fn ground(bounds: &Aabb) -> f64 {
    let [w, d, _] = bounds.size();
    w * d
}

#[cfg(test)]
mod tests;
