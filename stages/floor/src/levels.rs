//! Finds floor levels among pieces of level surface: those that are large, low and seen from above.

use crate::Settings;
use crate::column::{GroundColumns, SpaceAround};
use crate::pieces::{GROUND, GroundNode, LevelPiece, fit, height};
use contract::{FloorLevel, PlanePatch, ScanId};
use geometry::{Plane, Vector};

/// Largest share of a ceiling's cells with something above, where the scanner is unknown.
const CEILING_ABOVE: f64 = 0.1;
/// Smallest share of a ceiling's cells with something below.
const CEILING_BELOW: f64 = 0.3;
/// Share of cells with something close above from which on nobody can stand there: a slab under
/// another.
const COVERED: f64 = 0.6;
/// Half-width of the window about the beam to a mirror image in which the level above must have
/// been seen, cells.
const NEAR_CELL: i32 = 1;

/// Pieces of level surface at one height.
#[derive(Debug, Clone)]
pub(crate) struct PieceLevel {
    /// Cells of all its pieces, sorted by cell.
    pub(crate) nodes: Vec<GroundNode>,
    /// Indices of its patches, ascending.
    pub(crate) patches: Vec<usize>,
    /// Mean plane; its normal points up.
    pub(crate) plane: Plane,
    /// RMS of heights about the mean plane, metres.
    pub(crate) waviness: f64,
    /// Area of its largest piece, m².
    pub(crate) largest: f64,
}

/// Positions of the scanners (world, metres; `None` where unknown), sorted by scan.
pub(crate) type ScannerPlaces = [(ScanId, Option<Vector>)];

/// Position of a scanner in the world, metres, if known.
pub(crate) fn scanner(scanners: &ScannerPlaces, id: ScanId) -> Option<Vector> {
    scanners.binary_search_by_key(&id, |s| s.0).ok().and_then(|i| scanners[i].1)
}

impl PieceLevel {
    fn new(piece: LevelPiece) -> Option<Self> {
        let (plane, waviness) = fit(&piece.nodes)?;
        let largest = piece.area();
        Some(Self { nodes: piece.nodes, patches: piece.patches, plane, waviness, largest })
    }

    /// Area of its cells, m².
    pub(crate) fn area(&self) -> f64 {
        self.nodes.len() as f64 * GROUND * GROUND
    }

    /// Whether `piece` belongs to this level: heights agree within what its distance allows.
    fn continues(&self, piece: &LevelPiece, settings: &Settings) -> bool {
        let mut off: Vec<f64> = piece
            .nodes
            .iter()
            .map(|n| {
                let p = n.place();
                p.z - height(&self.plane, p.x, p.y)
            })
            .collect();
        let off = geometry::robust::median(&mut off).unwrap_or(f64::INFINITY).abs();
        let tolerance = settings.level_tolerance.max(2.5 * self.waviness);
        let bend = settings.level_bend * self.distance(piece);
        off <= (tolerance + bend).min(settings.max_level_tolerance)
    }

    /// Horizontal gap between the bounds of both, metres.
    fn distance(&self, piece: &LevelPiece) -> f64 {
        let bounds =
            |nodes: &[GroundNode]| geometry::Aabb::of(nodes.iter().map(|n| n.place().into()));
        let (a, b) = (bounds(&self.nodes), bounds(&piece.nodes));
        let gap = |i: usize| (a.min[i] - b.max[i]).max(b.min[i] - a.max[i]).max(0.0);
        gap(0).hypot(gap(1))
    }

    fn join(&mut self, piece: LevelPiece) {
        // Small pieces hardly change the plane, so that a new fit for each is not worth its time.
        let refit = piece.nodes.len() * 20 >= self.nodes.len();
        self.nodes.extend(piece.nodes);
        self.nodes.sort_by(|a, b| a.cell.cmp(&b.cell).then(a.z.total_cmp(&b.z)));
        self.patches.extend(piece.patches);
        self.patches.sort_unstable();
        self.patches.dedup();
        if let (true, Some((plane, waviness))) = (refit, fit(&self.nodes)) {
            self.plane = plane;
            self.waviness = waviness;
        }
    }

    /// Share of its points that were seen through `upper`, a level above it: a mirror image.
    pub(crate) fn ghost_share(
        &self,
        upper: &Self,
        patches: &[PlanePatch],
        scanners: &ScannerPlaces,
    ) -> f64 {
        let (mut through, mut all) = (0.0, 0.0);
        for patch in self.patches.iter().map(|&i| &patches[i]) {
            let weight = patch.moments.n;
            all += weight;
            if let Some(from) = scanner(scanners, patch.scan) {
                through += weight * seen_through(patch, from, upper);
            }
        }
        if all > 0.0 { through / all } else { 0.0 }
    }

    fn covers(&self, x: f64, y: f64) -> bool {
        let cell = [x, y].map(|v| (v / GROUND).floor() as i32);
        (-NEAR_CELL..=NEAR_CELL).any(|d| {
            let low = [cell[0].saturating_add(d), cell[1].saturating_sub(NEAR_CELL)];
            let high = cell[1].saturating_add(NEAR_CELL);
            let at = self.nodes.partition_point(|n| n.cell < low);
            self.nodes.get(at).is_some_and(|n| n.cell[0] == low[0] && n.cell[1] <= high)
        })
    }
}

/// Share of a patch's cells that the scanner at `from` saw through `upper`.
pub(crate) fn seen_through(patch: &PlanePatch, from: Vector, upper: &PieceLevel) -> f64 {
    let mut n = 0;
    for &(cell, count, sum) in &patch.ground {
        let p = GroundNode { cell, z: sum / f64::from(count.max(1)), n: count }.place();
        let (above, below) = (upper.plane.distance(&from), upper.plane.distance(&p));
        if above > 0.0 && below < -0.1 {
            let t = above / (above - below);
            let q = from + (p - from) * t;
            n += usize::from(upper.covers(q.x, q.y));
        }
    }
    n as f64 / patch.ground.len().max(1) as f64
}

/// Pieces, sorted into floor and ceilings.
#[derive(Debug, Default)]
pub(crate) struct Levels {
    /// Floor levels, largest first.
    pub(crate) floor: Vec<PieceLevel>,
    /// Indices of the patches of ceilings, ascending. Their scanners are unknown; nothing can
    /// stand on them.
    pub(crate) ceilings: Vec<usize>,
}

/// Groups pieces into levels and selects those that are floor.
pub(crate) fn levels(
    pieces: Vec<LevelPiece>,
    patches: &[PlanePatch],
    columns: &GroundColumns,
    scanners: &ScannerPlaces,
    settings: &Settings,
) -> Levels {
    let mut groups: Vec<PieceLevel> = Vec::new();
    for piece in pieces {
        match groups.iter_mut().find(|group| group.continues(&piece, settings)) {
            Some(group) => group.join(piece),
            // A piece of a single cell may join a level, but is too small to begin one.
            None if piece.nodes.len() > 1 => groups.extend(PieceLevel::new(piece)),
            None => {}
        }
    }
    groups.retain(|g| {
        g.area() >= settings.min_area
            && g.plane.normal.z >= settings.max_floor_tilt.cos()
            && g.waviness <= settings.max_waviness
    });
    groups.sort_by_key(|group| std::cmp::Reverse(group.nodes.len()));
    let mut out = Levels::default();
    for group in groups {
        let ghost = out
            .floor
            .iter()
            .any(|upper| group.ghost_share(upper, patches, scanners) > settings.ghost_share);
        if ghost {
            continue;
        }
        let around = columns.around(&group.nodes);
        if is_ceiling(&group, around, patches, scanners) {
            out.ceilings.extend(group.patches);
        } else if around.near_below < settings.raised_share
            || group.largest >= settings.min_raised_area
        {
            out.floor.push(group);
        }
    }
    out.ceilings.sort_unstable();
    out
}

/// Whether a level was seen from below, by what lies around it; where the scanner is known, its
/// side is.
fn is_ceiling(
    level: &PieceLevel,
    around: SpaceAround,
    patches: &[PlanePatch],
    scanners: &ScannerPlaces,
) -> bool {
    let known = weight(level, patches, |p| scanner(scanners, p.scan).is_some());
    if 2.0 * known >= weight(level, patches, |_| true) {
        return false;
    }
    // Above a ceiling there is nothing, or the floor of the next storey close above.
    let bare = around.above < CEILING_ABOVE && around.below > CEILING_BELOW;
    bare || around.near_above > COVERED
}

fn weight(level: &PieceLevel, patches: &[PlanePatch], wanted: impl Fn(&PlanePatch) -> bool) -> f64 {
    level.patches.iter().map(|&i| &patches[i]).filter(|p| wanted(p)).map(|p| p.moments.n).sum()
}

/// The level as others see it: mean plane and height map.
pub(crate) fn describe(
    level: &PieceLevel,
    patches: &[PlanePatch],
    settings: &Settings,
) -> FloorLevel {
    let cell = settings.height_cell;
    let mut offs: Vec<([i32; 2], f64)> = level
        .nodes
        .iter()
        .map(|n| {
            let p = n.place();
            let at = [p.x, p.y].map(|v| (v / cell).floor() as i32);
            (at, p.z - height(&level.plane, p.x, p.y))
        })
        .collect();
    offs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let heights = offs
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| {
            // The median of the cell: a plate that was joined to the floor must not lift it.
            let off = 0.5 * (same[(same.len() - 1) / 2].1 + same[same.len() / 2].1);
            let [x, y] = same[0].0.map(|i| (f64::from(i) + 0.5) * cell);
            (same[0].0, height(&level.plane, x, y) + off)
        })
        .collect();
    let (plane, waviness, area) = (level.plane, level.waviness, level.area());
    let mut out = FloorLevel { plane, waviness, scatter: 0.0, area, cell, heights };
    out.scatter = scatter(&out, level.patches.iter().map(|&i| &patches[i]));
    out
}

/// Share of a level's points that count for its scatter; the others lie on things that were joined
/// to it, such as plates and cables.
const SCATTERED: f64 = 0.9;

/// Standard deviation of the points from the heights of a level, metres: the spread within patches
/// and the differences of patches, cell by cell.
fn scatter<'a>(level: &FloorLevel, patches: impl Iterator<Item = &'a PlanePatch>) -> f64 {
    let mut offs: Vec<(f64, u32)> = Vec::new();
    for patch in patches {
        for &(cell, n, sum) in &patch.ground {
            let at = GroundNode { cell, z: sum / f64::from(n.max(1)), n }.place();
            let off = level.height(at.x, at.y).map(|height| at.z - height);
            offs.extend(off.map(|off| (off.hypot(patch.rms), n)));
        }
    }
    offs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = offs.iter().map(|o| f64::from(o.1)).sum();
    let mut below = 0.0;
    let is_below = |o: &&(f64, u32)| {
        below += f64::from(o.1);
        below < SCATTERED * all
    };
    let n = offs.iter().take_while(is_below).count();
    offs.get(n).map_or(0.0, |o| o.0)
}
