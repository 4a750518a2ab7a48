//! The segmentation step: labels of one tile's points near robots, and its residual voxels.

use crate::body::{StandingRobot, bodies, box_distance};
use crate::curves::Curves;
use crate::field::FIELD_REACH;
use crate::gather::{NearestLink, PointState, gather, world};
use crate::ground::FloorHeights;
use crate::raster::PixelRaster;
use crate::settings::Settings;
use contract::{
    Cluster, Error, Fan, Fit, Floor, Kind, LinkAt, Map, PointKind, Result, Scan, Tile, TileLabels,
};
use geometry::depth::{Rows, rotate, rows, transform};
use geometry::{Aabb, Pose, Vector};
use robot::{Model, Role};

/// Number of neighbouring points for which the links nearby are determined together.
const BLOCK: usize = 32;
/// Smallest cosine between the normals of a point and of a link (70°) for the point to lie on it.
const MIN_AGREEMENT: f32 = 0.35;
/// Distance from a link below which the normal does not matter, metres: at edges normals are wrong.
const NEAR_ENOUGH: f32 = 0.003;
/// Distance from the border of a region within which a body may continue outside, metres.
const BORDER: f32 = 0.03;
/// Height above the floor below which a voxel counts as standing on the floor, metres.
const GROUNDED: f64 = 0.06;
/// Number of the eight neighbours on a link that assigns a doubtful point to the link.
const PULL: usize = 4;

/// Labels the points of tiles near fitted robots.
pub struct Segment {
    bodies: Vec<StandingRobot>,
    /// For each fit and link, whether the link belongs to the tool.
    effectors: Vec<Vec<bool>>,
    ground: FloorHeights,
    scans: Vec<Scan>,
    /// Hoses outside of the surroundings of the robots.
    curves: Curves,
    settings: Settings,
}

/// Memory that is reused from tile to tile.
#[derive(Debug, Default)]
pub struct SegmentScratch {
    raster: PixelRaster,
    found: Vec<PointState>,
}

/// A link in the scan frame of one tile.
#[derive(Clone, Copy)]
struct LinkInTile<'a> {
    at: LinkAt,
    link: &'a crate::body::StandingLink,
    link_from_scan: Rows,
    min: [f32; 3],
    max: [f32; 3],
}

/// The links near a point.
struct About<'a> {
    /// Largest depth of the point within the reach of a link, metres.
    inset: f32,
    /// The best link by its field: distance in gates, link, distance in metres, and normal of the
    /// surface.
    best: Option<(f32, &'a LinkInTile<'a>, f32, [f32; 3])>,
    /// The nearest link by field, else by bounding box: both distances (metres) and the link.
    rough: (f32, f32, Option<&'a LinkInTile<'a>>),
}

fn effectors(model: Option<&Model>) -> Vec<bool> {
    model.map_or_else(Vec::new, |m| m.links.iter().map(|l| l.role == Role::Effector).collect())
}

impl Segment {
    /// A step for these fits (the robots of the result, in its order; refused ones give no labels).
    /// `scans` must be sorted by id.
    #[must_use]
    pub fn new(
        fits: &[Fit],
        models: &[Model],
        floor: &Floor,
        scans: &[Scan],
        settings: Settings,
        fan: &dyn Fan,
    ) -> Self {
        Self {
            bodies: bodies(fits, models, &settings, fan),
            effectors: fits.iter().map(|fit| effectors(models.get(fit.model))).collect(),
            ground: FloorHeights::new(floor, &settings),
            scans: scans.to_vec(),
            curves: Curves::default(),
            settings,
        }
    }

    /// Follows hoses out of the surroundings of the robots, up to the body where they end.
    /// `clusters` are those of the whole plant.
    #[must_use]
    pub fn following(mut self, clusters: &[Cluster]) -> Self {
        self.curves = Curves::follow(&self.bodies, clusters);
        self
    }

    /// World bounds in which points are examined, metres: each robot's region, and those of hoses.
    /// Only tiles that touch one need to be segmented.
    #[must_use]
    pub fn regions(&self) -> Vec<Aabb> {
        let curves = self.curves.bounds().iter().copied();
        self.bodies.iter().map(|body| body.region).chain(curves).collect()
    }

    /// Labels the links of tools as attachments: they belong to an effector, not to the robot.
    fn name_tools(&self, tile: &mut TileLabels) {
        let labels = tile.labels.iter_mut().map(|run| &mut run.what);
        for label in labels.filter(|label| label.kind == PointKind::Link) {
            let links = usize::try_from(label.robot).ok().and_then(|r| self.effectors.get(r));
            let link = usize::try_from(label.link).ok();
            if links.zip(link).is_some_and(|(links, link)| links.get(link) == Some(&true)) {
                label.kind = PointKind::Attachment;
            }
        }
    }

    /// The links whose surroundings overlap a tile.
    fn seen<'a>(&'a self, tile: &Tile, world_from_scan: &Pose) -> Vec<LinkInTile<'a>> {
        let mut out = Vec::new();
        let here =
            |body: &&StandingRobot| body.is_in(tile.at.scan) && body.region.touches(&tile.bounds);
        for body in self.bodies.iter().filter(here) {
            for link in body.links.iter().filter(|link| link.region().touches(&tile.bounds)) {
                out.push(LinkInTile {
                    at: LinkAt { robot: body.robot, link: link.index },
                    link,
                    link_from_scan: rows(&(link.world_from_link.inverse() * world_from_scan)),
                    min: link.bounds.min.map(|v| v as f32),
                    max: link.bounds.max.map(|v| v as f32),
                });
            }
        }
        out
    }

    /// The class of point `i` without its neighbours.
    fn judge(
        &self,
        seen: &[LinkInTile],
        p: [f32; 3],
        world: [f64; 3],
        normal: impl Fn() -> Option<[f32; 3]>,
    ) -> PointState {
        let About { inset, best, rough } = about(seen, p);
        let Some(nearest) = rough.2.filter(|_| inset > 0.0) else {
            return PointState::Default;
        };
        let height = self.ground.height_above(world);
        let touch = |at: LinkAt, distance: f32| NearestLink {
            link: at,
            distance,
            at_border: inset < BORDER,
            grounded: height.is_some_and(|h| h < GROUNDED),
        };
        let is_floor = self.ground.is_floor(world);
        if let Some((gates, s, distance, surface)) = best.filter(|b| b.0 <= 2.0) {
            let found = touch(s.at, distance);
            // The top of a stand continues beside the foot, within its gate.
            let above = s.link.above_foot(transform(&s.link_from_scan, p));
            if above.is_some_and(|above| f64::from(above) <= self.settings.foot_band) {
                return PointState::Default;
            }
            if height.is_some_and(|h| h <= self.settings.foot_band)
                && !self.on_side(s, surface, distance)
            {
                return PointState::Default;
            }
            let agrees = distance <= NEAR_ENOUGH
                || normal().is_none_or(|n| {
                    let n = rotate(&s.link_from_scan, n);
                    (n[0] * surface[0] + n[1] * surface[1] + n[2] * surface[2]).abs()
                        >= MIN_AGREEMENT
                });
            if gates <= 1.0 && agrees {
                return PointState::Link(found);
            }
            if !is_floor && agrees {
                return PointState::Doubt(found);
            }
        }
        if is_floor {
            PointState::Default
        } else {
            PointState::Residual(touch(nearest.at, rough.0))
        }
    }

    /// Lets the point of a hose that leaves the surroundings of a robot be examined outside of
    /// them.
    fn follow_curve(&self, world: [f64; 3], found: &mut PointState) {
        match (self.curves.at(world), &mut *found) {
            (Some((link, ends)), PointState::Default) if !self.ground.is_floor(world) => {
                let height = self.ground.height_above(world);
                *found = PointState::Residual(NearestLink {
                    link,
                    distance: f32::INFINITY,
                    at_border: ends,
                    grounded: height.is_some_and(|h| h < GROUNDED),
                });
            }
            (Some((_, false)), PointState::Residual(near)) => near.at_border = false,
            _ => {}
        }
    }

    /// Whether a point close to the floor lies on the upright side of a link, well inside its gate.
    fn on_side(&self, s: &LinkInTile, surface: [f32; 3], distance: f32) -> bool {
        let up = s.link.world_from_link.rotation.inverse() * Vector::z();
        let rise = surface[0] * up.x as f32 + surface[1] * up.y as f32 + surface[2] * up.z as f32;
        rise.abs() < 0.5 && distance <= 0.5 * s.link.gate
    }

    /// Decides doubtful points and veils by their neighbours.
    fn settle(&self, tile: &Tile, raster: Option<&PixelRaster>, found: &mut [PointState]) {
        let Some(raster) = raster else {
            // Without a raster doubtful points stay residual; `attach` decides by their voxels.
            for f in found.iter_mut() {
                if let PointState::Doubt(touch) = *f {
                    *f = PointState::Residual(touch);
                }
            }
            return;
        };
        let first = found.to_vec();
        for i in 0..first.len() {
            let (touch, is_doubt) = match first[i] {
                PointState::Doubt(touch) => (touch, true),
                PointState::Residual(touch) => (touch, false),
                _ => continue,
            };
            let (mut n_joined, mut n_link) = (0, 0);
            for by in (0..25).filter(|n| *n != 12).map(|n| [n / 5 - 2, n % 5 - 2]) {
                let Some(other) = raster.beside(tile, i, by) else {
                    continue;
                };
                if let PointState::Link(at) = first[other] {
                    n_link += 1;
                    let inner = by[0].abs() <= 1 && by[1].abs() <= 1;
                    n_joined += usize::from(
                        inner && at.link == touch.link && raster.connected(i, other, 1),
                    );
                }
            }
            found[i] = match (is_doubt, n_link > 0 && raster.is_veil(tile, i)) {
                (true, false) if n_joined >= PULL => PointState::Link(touch),
                (_, true) => PointState::Veil,
                _ => PointState::Residual(touch),
            };
        }
    }
}

impl Map for Segment {
    type In = Tile;
    type Out = TileLabels;
    type Scratch = SegmentScratch;

    fn apply(&self, tile: Tile, scratch: &mut SegmentScratch) -> Result<TileLabels> {
        let Some(scan) = self.scans.get(tile.at.scan.0 as usize) else {
            return Err(Error::new(Kind::Bug, format!("a tile of no scan: {:?}", tile.at)));
        };
        let empty = TileLabels {
            at: tile.at,
            mask: scan.mask,
            labels: Vec::new(),
            residuals: Vec::new(),
            voxels: Vec::new(),
        };
        let seen = self.seen(&tile, &scan.world_from_scan);
        let has_curves = self.curves.bounds().iter().any(|bounds| bounds.touches(&tile.bounds));
        if seen.is_empty() && !has_curves {
            return Ok(empty);
        }
        let raster = scan.lattice.as_ref().map(|lattice| {
            scratch.raster.fill(&tile, lattice, self.settings.sigma_range);
            &scratch.raster
        });
        let here = self.bodies.iter().filter(|body| body.is_in(tile.at.scan));
        let regions: Vec<&Aabb> = here.map(|body| &body.region).collect();
        scratch.found.clear();
        for (block, points) in tile.xyz.chunks(BLOCK).enumerate() {
            let near = near(&seen, points);
            if near.is_empty() && !has_curves {
                scratch.found.resize(scratch.found.len() + points.len(), PointState::Default);
                continue;
            }
            for (i, p) in points.iter().enumerate() {
                let at = block * BLOCK + i;
                let world = world(&scan.world_from_scan, *p);
                let mut found = if regions.iter().any(|region| region.contains(world)) {
                    self.judge(&near, *p, world, || raster.and_then(|r| r.normal(&tile, at)))
                } else {
                    PointState::Default
                };
                if has_curves {
                    self.follow_curve(world, &mut found);
                }
                scratch.found.push(found);
            }
        }
        self.settle(&tile, raster, &mut scratch.found);
        let normal = |i: usize| raster.and_then(|r| r.normal(&tile, i));
        let mut out = gather(&tile, &scan.world_from_scan, &scratch.found, normal, empty);
        self.name_tools(&mut out);
        Ok(out)
    }
}

/// The links that any point of a block may be near.
fn near<'a>(seen: &[LinkInTile<'a>], points: &[[f32; 3]]) -> Vec<LinkInTile<'a>> {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for p in points {
        for i in 0..3 {
            min[i] = if p[i] < min[i] { p[i] } else { min[i] };
            max[i] = if p[i] > max[i] { p[i] } else { max[i] };
        }
    }
    let middle: [f32; 3] = std::array::from_fn(|i| 0.5 * (min[i] + max[i]));
    let radius = (0..3).map(|i| (0.5 * (max[i] - min[i])).powi(2)).sum::<f32>().sqrt();
    let reach = seen.iter().map(|s| s.link.reach as f32).fold(0.0, f32::max).max(FIELD_REACH);
    // A millimetre for the rounding of transforms.
    let far = reach + radius + 1e-3;
    let is_near =
        |s: &&LinkInTile| box_distance(s.min, s.max, transform(&s.link_from_scan, middle)) <= far;
    seen.iter().filter(is_near).copied().collect()
}

/// The links near a point, by their fields and bounding boxes.
#[inline]
fn about<'a>(seen: &'a [LinkInTile<'a>], p: [f32; 3]) -> About<'a> {
    let mut out =
        About { inset: f32::NEG_INFINITY, best: None, rough: (f32::INFINITY, f32::INFINITY, None) };
    for s in seen {
        let q = transform(&s.link_from_scan, p);
        let outside = box_distance(s.min, s.max, q);
        out.inset = out.inset.max(s.link.reach as f32 - outside);
        let distance = match s.link.field.near(q) {
            Ok(near) => {
                let gates = near.distance / s.link.gate;
                if out.best.is_none_or(|b| gates < b.0) {
                    out.best = Some((gates, s, near.distance, near.normal));
                }
                near.distance
            }
            Err(distance) => distance,
        };
        // Far from every field the bounding box decides which link is nearest.
        if (distance, outside) < (out.rough.0, out.rough.1) || out.rough.2.is_none() {
            out.rough = (distance, outside, Some(s));
        }
    }
    out
}
