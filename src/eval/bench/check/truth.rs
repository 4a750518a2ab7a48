//! True distances of a path, computed from meshes alone: how near a robot comes to other bodies,
//! and whether scanners could see the space that it passes.

use super::bodies::{MeshPart, OWN_SAMPLE, OwnVolume, hose_pieces, pieces, places};
use contract::Result;
use geometry::{Point, Pose};
use glamx::Vec3;
use parry3d::partitioning::BvhNode;
use parry3d::query;
use parry3d::shape::{TriMesh, Triangle};
use robot::Model;
use simulate::{BodyShape, Scene, Shapes};
use std::cell::Cell;

/// Greatest distance that is computed, metres.
pub(super) const FAR: f64 = 0.1;
/// Search radius beyond the nearest obstacle of each part, metres: the part need not be examined
/// again until it has moved by as much.
const AHEAD: f64 = 0.03;
/// Distance below which bodies touch, metres: rounding of single precision in a hall.
pub(super) const TOUCH: f64 = 5e-4;
/// Greatest motion of any point between two examined postures near an obstacle, metres.
const STEP: f64 = 2e-3;
/// Distance within which a seen position makes another one seen, metres: half an eighth of a voxel
/// of known space.
const SEEN_BESIDE: f64 = 0.0125;
/// Motion between postures that are examined for visibility, metres.
const SEEN_STEP: f64 = 0.02;
/// Range of the virtual scanners, metres.
const RANGE: f64 = 80.0;

/// A robot of a scene among all else.
pub(super) struct PathTruth<'a> {
    model: &'a Model,
    world_from_base: Pose,
    parts: Vec<MeshPart>,
    /// Pieces of its hoses, each with the link that is nearest to it.
    hoses: Vec<MeshPart>,
    standing: TriMesh,
    /// Index of the shape of each triangle of what stands.
    of: Vec<u32>,
    shapes: &'a Shapes,
    /// Where scanners stand, with their elevations, radians.
    scanners: Vec<(Point, [f64; 2])>,
    own: OwnVolume,
}

/// How near a path comes to something.
#[derive(Debug, Clone, Default)]
pub(super) struct Nearest {
    /// Metres; no more than [`FAR`].
    pub(super) gap: f64,
    /// The obstacle, if one is within range.
    pub(super) name: String,
    /// Which part.
    pub(super) link: usize,
    /// Where on the way, 0 to 1.
    pub(super) at: f64,
}

impl<'a> PathTruth<'a> {
    /// Of the robot of this index, as it stands in the scene.
    pub(super) fn new(
        scene: &Scene,
        shapes: &'a Shapes,
        robot: usize,
        model: &'a Model,
        posture: &[f64],
    ) -> Result<Self> {
        let world_from_base = scene.robots[robot].world_from_base();
        let poses = placed(model, &world_from_base, posture);
        let moves = model.moving();
        let is_own = |s: &&BodyShape| s.robot == Some(robot);
        let own = shapes.all.iter().filter(is_own);
        let parts = own.clone().filter_map(|s| Some((s.link?, s)));
        let parts = parts.filter(|(link, _)| moves[*link]);
        let parts: Vec<MeshPart> =
            parts.filter_map(|(link, shape)| MeshPart::of(link, shape, &poses[link])).collect();
        let hoses = own.clone().filter(|s| s.link.is_none());
        let hoses = hoses.flat_map(|hose| hose_pieces(hose, &parts, &poses)).collect();
        let foot = world_from_base.translation.vector.map(|v| v as f32);
        let (foot, reach) = (Vec3::from_array(foot.into()), clearance::reach(model) as f32 + 0.5);
        let (mut corners, mut triangles, mut of) = (Vec::new(), Vec::new(), Vec::new());
        for (at, shape) in shapes.all.iter().enumerate().filter(|(_, s)| !is_own(s)) {
            for t in &shape.triangles {
                pieces(t.map(Vec3::from_array), foot, reach, &mut |t| {
                    let first = corners.len() as u32;
                    corners.extend(t);
                    triangles.push([first, first + 1, first + 2]);
                    of.push(at as u32);
                });
            }
        }
        let bad = |_| contract::Error::bad_input("nothing stands around the robot");
        let standing = TriMesh::new(corners, triangles).map_err(bad)?;
        let scanners = scene.scanners.iter().map(|s| {
            let dome = s.raster.elevation_deg.map(f64::to_radians);
            (Point::from(s.position), dome)
        });
        let (scanners, volume) = (scanners.collect(), OwnVolume::of_bodies(own.clone()));
        let mut out = Self {
            model,
            world_from_base,
            parts,
            hoses,
            standing,
            of,
            shapes,
            scanners,
            own: volume,
        };
        let carried = own.filter(|s| !s.is_of_model && s.link.is_some());
        out.fill_seen(carried);
        Ok(out)
    }

    /// How near a posture is to something, no farther than [`FAR`], metres.
    fn gap(&self, posture: &[f64]) -> Nearest {
        let poses = placed(self.model, &self.world_from_base, posture);
        let mut best = Nearest { gap: FAR, ..Nearest::default() };
        for part in &self.parts {
            let pose = &poses[part.link];
            let corners = part.bounds.corners().map(|c| pose * Point::from(c));
            if part.keeps(&corners) >= best.gap {
                continue;
            }
            let within = (best.gap + AHEAD).min(FAR);
            let found = self.nearest(part, pose, within);
            part.kept.set(Some((found.map_or(within, |(gap, _)| gap), corners)));
            if let Some((gap, triangle)) = found.filter(|(gap, _)| *gap < best.gap) {
                let name = self.shapes.all[self.of[triangle as usize] as usize].name.clone();
                best = Nearest { gap, name, link: part.link, at: 0.0 };
            }
        }
        best
    }

    /// The nearest triangle to a part, where one is nearer than that.
    fn nearest(&self, part: &MeshPart, world_from_link: &Pose, within: f64) -> Option<(f64, u32)> {
        let (best, link_from_world) = (Cell::new(within as f32), world_from_link.inverse());
        let turn = link_from_world.rotation.to_rotation_matrix().into_inner().map(f64::abs);
        let is_near = |node: &BvhNode| {
            let (low, high) = (node.mins().to_array(), node.maxs().to_array());
            let half: [f64; 3] = std::array::from_fn(|i| 0.5 * f64::from(high[i] - low[i]));
            let middle: [f64; 3] = std::array::from_fn(|i| 0.5 * f64::from(high[i] + low[i]));
            let middle = link_from_world * Point::from(middle);
            let half = turn * geometry::Vector::from(half);
            let reach = f64::from(best.get());
            (0..3).all(|i| {
                middle[i] + half[i] + reach >= part.bounds.min[i]
                    && middle[i] - half[i] - reach <= part.bounds.max[i]
            })
        };
        let found = Cell::new(None);
        let look = |at: u32| {
            let corner = |p: Vec3| {
                let p = link_from_world * Point::from(p.to_array().map(f64::from));
                Vec3::new(p.x as f32, p.y as f32, p.z as f32)
            };
            let t = self.standing.triangle(at);
            let t = Triangle::new(corner(t.a), corner(t.b), corner(t.c));
            if let Some(gap) = apart(&part.mesh, &t, best.get()) {
                best.set(gap);
                found.set(Some((f64::from(gap), at)));
            }
        };
        part.last.get().into_iter().for_each(&look);
        self.standing.bvh().leaves(is_near).for_each(&look);
        part.last.set(found.get().map(|(_, at)| at).or(part.last.get()));
        found.get()
    }

    /// The nearest that a path comes to something: joints go straight from one posture to another.
    /// Exact below the margin only: what keeps it is looked at no closer than that takes.
    pub(super) fn along(&self, from: &[f64], to: &[f64], margin: f64) -> Nearest {
        let n = self.n_steps(from, to, STEP);
        let mut best = Nearest { gap: FAR, ..Nearest::default() };
        let mut step = 0;
        while step <= n {
            let at = step as f64 / n as f64;
            let now = self.gap(&between(from, to, at));
            if now.gap < best.gap {
                best = Nearest { at, ..now.clone() };
            }
            if now.gap <= TOUCH {
                break;
            }
            // No part gets nearer than what it moves.
            let skip = ((now.gap - best.gap.min(margin)) / STEP).floor().max(1.0);
            step += skip as usize;
        }
        best
    }

    /// Fills the voxels of those surfaces that scanners see: nobody knows how deep a part is that
    /// a robot carries.
    fn fill_seen<'s>(&mut self, shapes: impl Iterator<Item = &'s BodyShape>) {
        let mut seen = Vec::new();
        for t in shapes.flat_map(|s| &s.triangles) {
            places(&t.map(Vec3::from_array), OWN_SAMPLE, |p| {
                seen.extend(self.is_reached(&p).then_some(p));
            });
        }
        for at in seen.iter().filter_map(|p| self.own.grid.index(p.coords.into())) {
            self.own.filled[at] = true;
        }
    }

    /// Whether scanners saw all space that whatever moves on a path goes through, links, hoses and
    /// carried parts, and so far around it, metres, but for what the robot filled itself as it was
    /// scanned: a beam can go there, and ends on something.
    pub(super) fn is_seen(&self, from: &[f64], to: &[f64], around: f64) -> bool {
        let n = self.n_steps(from, to, SEEN_STEP);
        let ends = [from, to].map(|at| placed(self.model, &self.world_from_base, at));
        let moves = |part: &&MeshPart| {
            let [a, b] = [0, 1].map(|end| ends[end][part.link].to_homogeneous());
            (a - b).amax() > 1e-9
        };
        let moving: Vec<&MeshPart> = self.parts.iter().chain(&self.hoses).filter(moves).collect();
        (0..=n).all(|step| {
            let posture = between(from, to, step as f64 / n as f64);
            let poses = placed(self.model, &self.world_from_base, &posture);
            moving.iter().all(|part| {
                let pose = &poses[part.link];
                part.samples.iter().all(|(p, out)| {
                    let p = pose * p;
                    let beyond = p + (pose * out) * around;
                    self.is_known(&p) && self.is_known(&beyond)
                })
            })
        })
    }

    /// Whether a beam passes through the position, within the resolution of known space.
    fn is_known(&self, p: &Point) -> bool {
        let beside = |k: usize| {
            let mut q = *p;
            q[k / 2] += if k.is_multiple_of(2) { SEEN_BESIDE } else { -SEEN_BESIDE };
            q
        };
        self.is_seen_at(p) || (0..6).any(|k| self.is_seen_at(&beside(k)))
    }

    fn is_seen_at(&self, p: &Point) -> bool {
        let OwnVolume { grid, filled } = &self.own;
        grid.index(p.coords.into()).is_some_and(|at| filled[at]) || self.is_reached(p)
    }

    /// Whether a scanner's beam can go to the position, and ends on something.
    fn is_reached(&self, p: &Point) -> bool {
        self.scanners.iter().any(|(eye, dome)| {
            let way = p - eye;
            let rise = way.z.atan2(way.xy().norm());
            rise > dome[0]
                && rise < dome[1]
                && self.shapes.sees(eye, p)
                && self.shapes.ends(eye, p, RANGE)
        })
    }

    /// Steps between two postures in which no point moves farther than so, metres.
    fn n_steps(&self, from: &[f64], to: &[f64], most: f64) -> usize {
        /// Arcs in a step are short: chords tell their lengths.
        const COARSE: usize = 64;
        let corners = |k: usize| -> Vec<Point> {
            let posture = between(from, to, k as f64 / COARSE as f64);
            let poses = placed(self.model, &self.world_from_base, &posture);
            let own = self.parts.iter();
            own.flat_map(|p| p.bounds.corners().map(|c| poses[p.link] * Point::from(c))).collect()
        };
        let all: Vec<Vec<Point>> = (0..=COARSE).map(corners).collect();
        let ways = all.windows(2).flat_map(|w| w[0].iter().zip(&w[1]).map(|(a, b)| (b - a).norm()));
        let longest = ways.fold(0.0, f64::max);
        ((longest * COARSE as f64 / most).ceil() as usize).max(1)
    }
}

/// How far a triangle is from a mesh, where it is nearer than that; both in one frame, metres.
fn apart(mesh: &TriMesh, t: &Triangle, within: f32) -> Option<f32> {
    let (low, high) = (t.a.min(t.b).min(t.c), t.a.max(t.b).max(t.c));
    let gap = |node: &BvhNode, _: f32| {
        let off = (low - node.maxs()).max(node.mins() - high).max(Vec3::ZERO);
        off.length()
    };
    let here = parry3d::math::Pose::IDENTITY;
    let leaf = |at: u32, _: f32| query::distance(&here, &mesh.triangle(at), &here, t).ok();
    mesh.bvh().find_best(within, gap, leaf).map(|(_, found)| found.distance)
}

fn placed(model: &Model, world_from_base: &Pose, posture: &[f64]) -> Vec<Pose> {
    model.poses(posture).iter().map(|p| world_from_base * p).collect()
}

/// The posture at a share of the way.
pub(super) fn between(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect()
}
