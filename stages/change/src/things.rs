//! Voxels of what stands still in two sessions, and what each session's beams say of the other's,
//! in; what appeared, went and moved out.

use crate::occupancy::{EDGE, OccupancyCell, REACH, SessionOccupancy, bounds, connected};
use crate::split::parted;
use contract::Fan;
use geometry::Aabb;
use std::collections::{BTreeMap, BTreeSet};

/// Voxels with few points that are so many steps apart are of one thing: rows of beams that only
/// graze it lie that far apart.
const THIN_REACH: i32 = 3;
/// A thing of which at least this share changed is looked at whole.
const WHOLE: f64 = 0.2;
/// Most voxels of a thing that is looked at whole: what is larger is structure that something stood
/// against.
const MAX_WHOLE: usize = 40_000;
/// Of a thing that one session sees only in part, the other may see up to so many times the ground;
/// where one of its sides is seen in all its length, that may be all that is seen.
const MAX_PART: [f64; 2] = [2.5, 6.0];
/// A change on so many times the ground of one in the other session may be that thing and another
/// one beside it; one on more is no pair of things, and would take long to look through.
const WIDER: [f64; 2] = [1.4, 6.0];
/// How much the sizes of a thing may differ between two sessions, which see other sides of it, but
/// both its top: metres, and share of its sides and of its height.
const SAME_SIZE: (f64, [f64; 3]) = (0.12, [0.2, 0.2, 0.1]);
/// What has no more than this share of a thing's height, and its top as high as that one's, to so
/// many metres, and the same sides, is its top seen over something that hides the rest.
const FLAT: f64 = 0.5;
const SAME_TOP: f64 = 0.08;

/// So near each other are the ends of a thing of which something before it hides the middle,
/// metres.
const BESIDE: f64 = 0.1;

/// What is tuned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThingSettings {
    /// Smallest larger edge of a change, metres.
    pub min_size: f64,
    /// Fewest voxels and points of it.
    pub min_voxels: usize,
    /// Fewest points of it.
    pub min_points: u32,
    /// How near a robot's points a change is the robot's own, metres: what segmentation left of
    /// it.
    pub robot_margin: f64,
}

impl Default for ThingSettings {
    fn default() -> Self {
        Self { min_size: 0.12, min_voxels: 24, min_points: 60, robot_margin: 0.15 }
    }
}

/// What became of a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThingChange {
    /// It was not there before.
    Appeared,
    /// It is no longer there.
    Gone,
    /// It stands elsewhere.
    Moved,
}

/// A thing that stands still and is not where it was.
#[derive(Debug, Clone, PartialEq)]
pub struct Thing {
    /// What became of it.
    pub change: ThingChange,
    /// Bounds before, world, metres.
    pub then: Option<Aabb>,
    /// Bounds now.
    pub now: Option<Aabb>,
    /// Middle now less middle then, metres, where it moved.
    pub shift: Option<[f64; 3]>,
    /// Volume of the voxels that changed, m³: its surface, as far as it was seen.
    pub volume: f64,
    /// Points in them.
    pub n_points: u64,
    /// Voxels that are empty now.
    pub gone: Vec<OccupancyCell>,
    /// Voxels that are filled now.
    pub filled: Vec<OccupancyCell>,
}

/// One connected change.
#[derive(Debug, Clone)]
struct ChangePiece {
    cells: Vec<OccupancyCell>,
    n_points: u64,
    bounds: Aabb,
    /// With rows of beams about it that graze the thing, and whatever else lies there.
    wide: Aabb,
    /// Of all that it is connected with, where much of that changed: a thing pushed by less than
    /// its length stands in part where it stood.
    whole: Option<Aabb>,
}

impl ChangePiece {
    /// Several as one; `None` of none.
    fn of<'p>(pieces: impl Iterator<Item = &'p Self>) -> Option<Self> {
        pieces.cloned().reduce(|mut all, more| {
            all.cells.extend(more.cells);
            all.cells.sort_unstable();
            all.n_points += more.n_points;
            all.bounds = all.bounds.union(&more.bounds);
            all
        })
    }

    /// Bounds that the thing may have.
    fn boxes(&self) -> impl Iterator<Item = &Aabb> {
        self.whole.iter().chain([&self.wide, &self.bounds])
    }
}

impl SessionOccupancy {
    /// Connected changes that are large enough and no robot's.
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

    /// Changes, those in two of which one is as the other session has it and stands beside
    /// something else.
    fn apart(
        &self,
        pieces: &[ChangePiece],
        others: &[ChangePiece],
        settings: &ThingSettings,
    ) -> Vec<ChangePiece> {
        let two = |piece: &ChangePiece| {
            let times = |other: &Aabb| ground(&piece.bounds) / ground(other);
            let boxes = others.iter().flat_map(ChangePiece::boxes);
            let smaller = boxes.filter(|o| (WIDER[0]..WIDER[1]).contains(&times(o)));
            let parts = smaller.filter_map(|other| {
                let parts = parted(&piece.cells, other.size())?;
                let is_it = unlike(&bounds(&parts[0]), other) <= 1.0;
                (is_it && self.is_thing(&parts[1], settings)).then_some(parts)
            });
            parts.map(|parts| parts.map(|cells| self.piece_of(cells))).next()
        };
        pieces.iter().flat_map(|p| two(p).map_or_else(|| vec![p.clone()], Vec::from)).collect()
    }

    /// Changes of which few points are seen between them are one thing.
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
            && self.is_closed(cells)
    }

    /// One of two that stand side by side: what is about it is the other.
    fn piece_of(&self, cells: Vec<OccupancyCell>) -> ChangePiece {
        let bounds = bounds(&cells);
        ChangePiece { n_points: self.n_points(&cells), bounds, wide: bounds, whole: None, cells }
    }

    /// Changes, those joined that are parts of one thing which stands apart from others.
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

    /// All that some voxels are connected with: [`MAX_WHOLE`] and more where that is much.
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

/// What differs between two sessions: things that moved, then those that went, then those that
/// appeared, each by size.
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
    let gone = by_size(then.apart(&pieces[0], &pieces[1], settings));
    let filled = by_size(now.apart(&pieces[1], &pieces[0], settings));
    let mut moved = moved(&gone, &filled);
    complete(&mut moved, [&gone, &filled]);
    let one = |pair: &MovedPair| {
        let [was, is] = [(&gone, &pair.parts[0]), (&filled, &pair.parts[1])]
            .map(|(all, parts)| ChangePiece::of(parts.iter().map(|i| &all[*i])));
        let [then, now] = pair.boxes;
        Thing {
            then: Some(then),
            now: Some(now),
            shift: Some((now.center() - then.center()).into()),
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

/// A thing that stands elsewhere: changes that it is made of, then and now, and its bounds.
struct MovedPair {
    parts: [Vec<usize>; 2],
    boxes: [Aabb; 2],
}

/// Adds to things of which one session saw pieces apart from each other what makes them as large as
/// the other one saw them.
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
                let [before, after] = [&own, &with].map(|b| farthest_off(b, &other));
                let is_rest = after <= 1.0 && after < before;
                if is_rest || is_end(&piece.bounds, &own, &other) {
                    pair.boxes[side] = with;
                    pair.parts[side].push(i);
                }
            }
        }
    }
}

/// Whether a piece is an end of a thing of which `own` was seen, where the other session saw
/// `other`: beside it, as high as it, and both together are more like that one, and no larger. A
/// thing that was turned has other bounds.
fn is_end(piece: &Aabb, own: &Aabb, other: &Aabb) -> bool {
    let with = sides(&own.union(piece));
    let (own_sides, other) = (sides(own), sides(other));
    let is_within = (0..3).all(|i| with[i] - other[i] <= same(&with, &other, i));
    let all_off = |a: &[f64; 3]| (0..3).map(|i| off(a, &other, i)).sum::<f64>();
    own.grown(BESIDE).touches(piece)
        && (piece.max[2] - own.max[2]).abs() <= SAME_TOP
        && is_within
        && all_off(&with) < all_off(&own_sides)
}

/// Which of those that went stands elsewhere and the bounds there and here, the most alike first
/// chosen: a barrel must not take a pallet's new place.
fn moved(gone: &[ChangePiece], filled: &[ChangePiece]) -> Vec<MovedPair> {
    let pairs = (0..gone.len()).flat_map(|i| (0..filled.len()).map(move |j| (i, j)));
    let alike = pairs.filter_map(|(i, j)| {
        let (was, is) = (&gone[i], &filled[j]);
        let pair = |then: &Aabb, now: &Aabb| {
            let [then, now] = [lowered(then, now), lowered(now, then)];
            (unlike(&then, &now), i, j, [then, now])
        };
        let others = was.boxes().flat_map(|then| is.boxes().map(move |now| pair(then, now)));
        // Whole first: the two strips of a thing that was pushed a little are alike as well.
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
    Thing { change, then, now, shift: None, volume, n_points, gone, filled }
}

/// A box that may be the top of another one, of which one session saw no more: then down to where
/// the other stands.
fn lowered(top: &Aabb, other: &Aabb) -> Aabb {
    let is_flat = top.size()[2] < FLAT * other.size()[2];
    let is_as_high = (top.max[2] - other.max[2]).abs() <= SAME_TOP;
    let is_alike = (0..2).all(|i| off(&sides(top), &sides(other), i) <= 1.0);
    let mut out = *top;
    if is_flat && is_as_high && is_alike {
        out.min[2] = other.min[2];
    }
    out
}

/// Shorter and longer side on the ground, and height, metres.
fn sides(bounds: &Aabb) -> [f64; 3] {
    let [w, d, h] = bounds.size();
    [w.min(d), w.max(d), h]
}

/// How much a side may differ, metres.
fn same(a: &[f64; 3], b: &[f64; 3], i: usize) -> f64 {
    SAME_SIZE.0.max(SAME_SIZE.1[i] * a[i].max(b[i]))
}

/// How much it does, in parts of that.
fn off(a: &[f64; 3], b: &[f64; 3], i: usize) -> f64 {
    (a[i] - b[i]).abs() / same(a, b, i)
}

/// How much the side that differs most does.
fn farthest_off(a: &Aabb, b: &Aabb) -> f64 {
    let (a, b) = (sides(a), sides(b));
    (0..3).map(|i| off(&a, &b, i)).fold(0.0, f64::max)
}

/// How much two boxes differ in size, however they are turned about the vertical: up to 1 they may
/// be one thing, of which one session saw less than the other.
fn unlike(a: &Aabb, b: &Aabb) -> f64 {
    let (a, b) = (sides(a), sides(b));
    let (same, off) = (|i: usize| same(&a, &b, i), |i: usize| off(&a, &b, i));
    // The smaller one within the larger one, and no small part of it.
    let (small, large) = if a[0] * a[1] < b[0] * b[1] { (a, b) } else { (b, a) };
    let beyond = |i: usize| (small[i] - large[i]) / same(i);
    let is_side = (0..2).any(|i| (small[1] - large[i]).abs() <= same(i));
    let part =
        large[0] * large[1] / (small[0] * small[1]).max(1e-9) / MAX_PART[usize::from(is_side)];
    let seen_less = beyond(0).max(beyond(1)).max(part).max(off(2));
    (0..3).map(off).fold(0.0, f64::max).min(seen_less)
}

/// Area of the ground under a box, m².
fn ground(bounds: &Aabb) -> f64 {
    let [w, d, _] = bounds.size();
    w * d
}

#[cfg(test)]
mod tests;
