//! A robot with the points attached to it: which of its parts are near which obstacles in a
//! posture.

use crate::contact_level::ContactLevel;
use crate::evidence::{supported_by_others, surface_threshold_of};
use crate::obstacle::{HALF_CELL, Obstacle, ObstacleKind};
use crate::obstacles::{Bin, Obstacles, Replaced};
use crate::pockets::remove_pockets;
use crate::shape::{Gap, PartShape};
use contract::Fan;
use geometry::{Aabb, Point, Pose};
use robot::{Link, Model};
use std::collections::BTreeMap;

/// Largest distance that a point of the robot moves between two examined postures, metres.
pub const STEP: f64 = 0.01;

/// Points attached to the links of a robot, by index of the link, link frame, metres.
pub type AttachedPoints = BTreeMap<usize, Vec<[f32; 3]>>;

/// Distance that a part may move between two examined postures of a path, metres.
const BETWEEN: f32 = 0.5 * STEP as f32;

/// Distance from the robot as scanned within which uncertain points are most likely its own,
/// metres: edges, cables and covers that its model lacks.
pub const BESIDE_REACH: f32 = 0.1;

/// Distance from a link's surface as scanned within which a point belongs to the link, metres.
/// Labels of links reach 6 to 12 mm. The points of an object that touches the robot remain beyond
/// this distance.
pub(crate) const SURFACE_REACH: f32 = 0.008;

/// Distance from the robot as scanned within which unseen space is a gap between its parts or
/// behind them, metres; an object that stands there would reach farther.
const UNSEEN_GAP: f32 = 0.025;

/// Distance from fixed points within which uncertain points belong to the fixed object and are not
/// attached to the robot, metres.
const FIXED_REACH: f32 = 0.04;

/// The surface of a link, or the points attached to it.
pub(crate) struct BodyPart {
    pub(crate) link: usize,
    pub(crate) is_attached: bool,
    /// Whether it consists of uncertain points beside the link, which may or may not be attached.
    pub(crate) is_doubtful: bool,
    bounds: Aabb,
    shape: PartShape,
}

/// Everything that moves with the joints of a robot.
pub struct RobotBody<'a> {
    pub(crate) model: &'a Model,
    pub(crate) parts: Vec<BodyPart>,
    /// Surfaces of links that no joint moves; points on them belong to the robot, too.
    still: Vec<BodyPart>,
    margin: f32,
    /// Largest distance at which attached points are looked up, metres.
    within: f32,
}

impl BodyPart {
    fn attached(link: usize, points: Vec<[f32; 3]>, within: f32) -> Self {
        let bounds = Aabb::of(points.iter().map(|p| p.map(f64::from)));
        Self {
            link,
            is_attached: true,
            is_doubtful: false,
            bounds,
            shape: PartShape::attached(points, within),
        }
    }
}

/// A part that is near an obstacle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PartTouch {
    pub(crate) part: usize,
    pub(crate) obstacle: usize,
    pub(crate) level: ContactLevel,
    /// Lower bound of their distance, metres.
    pub(crate) gap: f32,
}

/// All parts that are near something in one posture.
#[derive(Debug, Clone, Default)]
pub(crate) struct PostureNear {
    /// Sorted by part, then by obstacle.
    pub(crate) touches: Vec<PartTouch>,
    /// Parts that reach into space of which nothing is known.
    pub(crate) outside: Vec<usize>,
}

impl<'a> RobotBody<'a> {
    /// The moving parts of a model with the points attached to it. `margin` is the distance below
    /// which an obstacle counts as near, and `largest` the radius of the largest obstacle, metres.
    #[must_use]
    pub fn new(
        model: &'a Model,
        attached: AttachedPoints,
        margin: f64,
        largest: f64,
        fan: &dyn Fan,
    ) -> Self {
        let margin = margin as f32;
        let least = margin + BETWEEN + HALF_CELL;
        let moves = model.moving();
        let all: Vec<usize> = (0..model.links.len()).collect();
        let surfaces = fan.fan(all, |link| {
            let (mesh, bounds) = (&model.links[link].mesh, model.links[link].bounds);
            let shape = PartShape::surface(mesh, &bounds, least)?;
            Some(BodyPart { link, is_attached: false, is_doubtful: false, bounds, shape })
        });
        let (mut parts, still): (Vec<BodyPart>, Vec<BodyPart>) =
            surfaces.into_iter().flatten().partition(|part| moves[part.link]);
        let within = margin.max(BESIDE_REACH) + BETWEEN + largest as f32;
        for (link, points) in
            attached.into_iter().filter(|(link, points)| moves[*link] && !points.is_empty())
        {
            parts.push(BodyPart::attached(link, points, within));
        }
        Self { model, parts, still, margin, within }
    }

    /// Upper bound of the distance of all parts from the base's origin in any posture, metres.
    #[must_use]
    pub fn farthest(&self) -> f64 {
        let ways = self.model.ways();
        let far = |p: &BodyPart| farthest(&p.bounds) + ways[p.link];
        self.parts.iter().map(far).fold(0.0, f64::max)
    }

    /// Index of the link and bounds (link frame, metres) of each part.
    pub(crate) fn bounds(&self) -> impl Iterator<Item = (usize, &Aabb)> {
        self.parts.iter().map(|part| (part.link, &part.bounds))
    }

    /// Removes from `around` what belongs to the robot itself in the posture `found`, in which it
    /// was scanned. These are points on or inside its surface, whatever their label, stray points
    /// beside it, and unseen space that the robot filled or left as a small hole. A point beside
    /// the robot is a stray point if space is known and all its neighbours are points of the
    /// robot.
    ///
    /// Uncertain points beside the robot count twice: as obstacles [`ObstacleKind::Beside`], and as
    /// points that may be attached to the nearest part and move with it.
    pub fn remove_robot(&mut self, found: &[f64], around: &mut Obstacles) {
        let mut near: Vec<Option<(f32, usize)>> = vec![None; around.all.len()];
        for PartTouch { part, obstacle, gap, .. } in
            self.within(BESIDE_REACH, found, around).touches
        {
            let least = near[obstacle].get_or_insert((gap, part));
            if gap < least.0 {
                *least = (gap, part);
            }
        }
        let poses = self.model.poses(found);
        let from_base = |link: usize| PoseF32::of(&poses[link].inverse());
        let surfaces = self.parts.iter().filter(|part| !part.is_attached).chain(&self.still);
        let surfaces: Vec<(&BodyPart, PoseF32)> =
            surfaces.map(|part| (part, from_base(part.link))).collect();
        let is_on_robot = |at: [f32; 3], within: f32| {
            surfaces.iter().any(|(part, link_from_base)| {
                let p = link_from_base.of_point(at);
                is_near(&part.bounds, p, within) && part.shape.gap(p, within) != Gap::Far
            })
        };
        let is_stray = strays(around, &near, |o| is_on_robot(o.at, SURFACE_REACH));
        let (mut doubtful, split) = (AttachedPoints::new(), around.split.clone());
        let fixed = around.fixed(FIXED_REACH);
        around.replace(|at, o| match (near[at], o.what) {
            (None, _) => Replaced::Kept,
            (_, ObstacleKind::Fixed | ObstacleKind::Uncertain) if is_stray[at] => {
                Replaced::By(Vec::new())
            }
            (Some((_, part)), ObstacleKind::Uncertain) => {
                let link = self.parts[part].link;
                if fixed.is_near(o.at) {
                    return Replaced::By(vec![Obstacle { what: ObstacleKind::Beside, ..*o }]);
                }
                doubtful.entry(link).or_default().push(from_base(link).of_point(o.at));
                Replaced::By(vec![Obstacle { what: ObstacleKind::Beside, ..*o }])
            }
            (_, ObstacleKind::Unseen) => match split.parts(o) {
                Some(parts) => Replaced::By(
                    parts.filter(|p| !is_on_robot(p.at, p.radius + UNSEEN_GAP)).collect(),
                ),
                None => Replaced::Kept,
            },
            _ => Replaced::Kept,
        });
        remove_pockets(around);
        for (link, points) in doubtful {
            let part = BodyPart::attached(link, points, self.within);
            self.parts.push(BodyPart { is_doubtful: true, ..part });
        }
    }

    /// Everything that is nearer than the margin in a posture.
    pub(crate) fn near(&self, posture: &[f64], around: &Obstacles) -> PostureNear {
        self.within(self.margin, posture, around)
    }

    /// The same for a margin wider by `more` metres.
    pub(crate) fn near_by(&self, more: f32, posture: &[f64], around: &Obstacles) -> PostureNear {
        self.within(self.margin + more, posture, around)
    }

    fn within(&self, margin: f32, posture: &[f64], around: &Obstacles) -> PostureNear {
        let poses = self.model.poses(posture);
        let mut out = PostureNear::default();
        for (at, part) in self.parts.iter().enumerate() {
            let base_from_link = &poses[part.link];
            let grown = part.bounds.grown(f64::from(margin + BETWEEN));
            if around.reaches_unknown(&grown, base_from_link) {
                out.outside.push(at);
            }
            let link_from_base = PoseF32::of(&base_from_link.inverse());
            for bin in &around.bins {
                let query = PartQuery { at, margin, link_from_base: &link_from_base };
                self.bin(&query, bin, around, &mut out.touches);
            }
        }
        out
    }

    fn bin(
        &self,
        query: &PartQuery<'_>,
        bin: &Bin,
        around: &Obstacles,
        touches: &mut Vec<PartTouch>,
    ) {
        let &PartQuery { at, margin, link_from_base } = query;
        let part = &self.parts[at];
        let middle = link_from_base.of_point(bin.middle);
        let within = bin.radius + margin + BETWEEN;
        if !is_near(&part.bounds, middle, within) {
            return;
        }
        let obstacles = bin.range.clone().zip(&around.all[bin.range.clone()]);
        // Attached points give distances only up to the limit they were prepared for.
        if part.shape.is_unlimited() && part.shape.gap(middle, within) == Gap::Far {
            return;
        }
        for (obstacle, o) in obstacles {
            // Points that may be attached to the robot are no obstacle to themselves.
            if part.is_doubtful && o.what == ObstacleKind::Beside {
                continue;
            }
            let p = link_from_base.of_point(o.at);
            let within = o.radius + margin + BETWEEN;
            if !is_near(&part.bounds, p, within) {
                continue;
            }
            match part.shape.gap(p, within) {
                Gap::Far => {}
                Gap::Inside => touches.push(inside(at, obstacle, o)),
                Gap::At(gap) => {
                    let touch = touch(at, obstacle, o, margin, gap);
                    let is_confirmed = |touch: &PartTouch| {
                        around.split.parts(o).is_none_or(|mut parts| {
                            parts.any(|o| {
                                let p = link_from_base.of_point(o.at);
                                part.shape.gap(p, o.radius + margin + BETWEEN) != Gap::Far
                            })
                        }) || touch.level != ContactLevel::Unseen
                    };
                    touches.extend(touch.filter(is_confirmed));
                }
            }
        }
    }
}

/// For each obstacle, whether it belongs to the robot or is a stray point: of the points near the
/// robot as scanned, those on its surface and, where space is known, those beside it that no other
/// points support. `near` has, for each obstacle near the robot, its distance in metres and the
/// index of the nearest part.
fn strays(
    around: &Obstacles,
    near: &[Option<(f32, usize)>],
    is_on_robot: impl Fn(&Obstacle) -> bool,
) -> Vec<bool> {
    let mut out: Vec<bool> = (around.all.iter().zip(near))
        .map(|(o, near)| near.is_some() && o.is_point() && is_on_robot(o))
        .collect();
    if around.split.is_empty() {
        return out;
    }
    let points: Vec<Obstacle> = around.all.iter().filter(|o| o.is_point()).copied().collect();
    let others: Vec<usize> =
        (0..out.len()).filter(|&at| around.all[at].is_point() && !out[at]).collect();
    let all: Vec<Obstacle> = others.iter().map(|&at| around.all[at]).collect();
    let is_evident =
        supported_by_others(&all, surface_threshold_of(&points), |k| near[others[k]].is_some());
    for (at, is_evident) in others.into_iter().zip(is_evident) {
        out[at] = near[at].is_some() && !is_evident;
    }
    out
}

fn touch(part: usize, obstacle: usize, o: &Obstacle, margin: f32, gap: f32) -> Option<PartTouch> {
    // Between two postures the obstacle may be nearer by half a step.
    let gap = gap - o.radius - BETWEEN;
    let level = match o.what {
        _ if gap > margin => return None,
        ObstacleKind::Unseen => ContactLevel::Unseen,
        _ if gap <= 0.0 => ContactLevel::Hit,
        _ => ContactLevel::Near,
    };
    Some(PartTouch { part, obstacle, level, gap: gap.max(0.0) })
}

fn inside(part: usize, obstacle: usize, o: &Obstacle) -> PartTouch {
    let level =
        if o.what == ObstacleKind::Unseen { ContactLevel::Unseen } else { ContactLevel::Inside };
    PartTouch { part, obstacle, level, gap: 0.0 }
}

/// Upper bound of the distance of all links from the base's origin in any posture, metres.
#[must_use]
pub fn reach(model: &Model) -> f64 {
    let far = |(link, way): (&Link, f64)| farthest(&link.bounds) + way;
    model.links.iter().zip(model.ways()).map(far).fold(0.0, f64::max)
}

/// Largest distance of a place in a box from the origin of the link's frame, metres.
fn farthest(bounds: &Aabb) -> f64 {
    if bounds.is_empty() {
        return 0.0;
    }
    bounds.corners().into_iter().map(|c| Point::from(c).coords.norm()).fold(0.0, f64::max)
}

pub(crate) fn is_near(bounds: &Aabb, p: [f32; 3], within: f32) -> bool {
    let outside = |i: usize| {
        let v = f64::from(p[i]);
        (bounds.min[i] - v).max(v - bounds.max[i]).max(0.0)
    };
    (0..3).map(|i| outside(i).powi(2)).sum::<f64>() <= f64::from(within).powi(2)
}

/// A query for the obstacles near one part.
struct PartQuery<'a> {
    /// Index of the part.
    at: usize,
    /// Largest distance that counts as near, metres.
    margin: f32,
    link_from_base: &'a PoseF32,
}

/// A pose in single precision, for many points.
struct PoseF32 {
    rotation: [[f32; 3]; 3],
    shift: [f32; 3],
}

impl PoseF32 {
    fn of(pose: &Pose) -> Self {
        let m = pose.rotation.to_rotation_matrix();
        let rotation = std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)] as f32));
        Self { rotation, shift: pose.translation.vector.map(|v| v as f32).into() }
    }

    #[inline]
    fn of_point(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|i| {
            let r = &self.rotation[i];
            r[0] * x + r[1] * y + r[2] * z + self.shift[i]
        })
    }
}
