//! Everything that was measured in a region, as fits of any model read it: what beams and points
//! say of a place, and the points with their views.

mod measured;
mod noise;

use contract::{Fan, InstallationPlane, Region, View};
use geometry::evidence::Cloud;
use geometry::{Evidence, Eye, Plane, Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::collections::HashSet;
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::Arc;

use crate::state::Hypothesis;
use crate::{Prepared, Settings};
use measured::Measured;

/// Points of a scene that may be a robot's, as indices into its points, ascending.
#[derive(Debug)]
pub(crate) struct Nearby {
    /// One a grid cell and view.
    pub(crate) thin: Vec<u32>,
    pub(crate) all: Vec<u32>,
}

/// How far beyond a robot's reach points may still be its own, metres: an error of the base.
const NEAR_MARGIN: f64 = 0.15;

/// Everything measured in a region, ready for fitting.
#[derive(Debug)]
pub struct MeasuredScene<'a> {
    /// The region.
    pub region: &'a Region,
    /// Views of it.
    pub views: Vec<&'a View>,
    /// What beams and points say.
    pub evidence: Evidence<'a>,
    /// What beams and points of those views say that suffice for a search.
    pub scouts: Evidence<'a>,
    /// Noise of the ranges as the points themselves show it, metres, one sigma; not below the
    /// settings' least.
    pub(crate) noise: f64,
    /// Number of neighbouring points that share one error: 1 where each errs by itself.
    pub(crate) n_alike: f64,
    /// All points that are not on a floor.
    pub(crate) points: Vec<Measured>,
    /// Indices into `points`, one a grid cell and view.
    pub(crate) thin: Vec<u32>,
}

/// The cells of a cloud without beams, metres.
struct CloudCells {
    /// Edge of a cell.
    edge: f32,
    /// How far about its points the cloud answers.
    reach: f32,
}

const CLOUD: CloudCells = CloudCells { edge: 0.02, reach: 0.10 };

impl<'a> MeasuredScene<'a> {
    /// Whether any of it was seen by a depth camera, which bends surfaces.
    pub(crate) fn has_camera(&self) -> bool {
        self.views.iter().any(|view| view.is_camera)
    }

    /// Gathers the points above the planes (given in the world) and thins them.
    #[must_use]
    pub fn new(
        region: &'a Region,
        views: &'a [View],
        floors: &[InstallationPlane],
        settings: &Settings,
        fan: &dyn Fan,
    ) -> Self {
        Self::of(region, &views.iter().collect::<Vec<_>>(), floors, settings, fan)
    }

    /// Gathers and thins the points of some of the views.
    pub(crate) fn of(
        region: &'a Region,
        views: &[&'a View],
        floors: &[InstallationPlane],
        settings: &Settings,
        fan: &dyn Fan,
    ) -> Self {
        let planes: Vec<Plane> = floors
            .iter()
            .filter(|p| p.is_floor)
            .map(|p| Plane {
                normal: p.plane.normal,
                offset: p.plane.offset - p.plane.normal.dot(&region.origin.coords),
            })
            .collect();
        let on_floor = |p: [f32; 3]| {
            let q = Vector::from(p.map(f64::from));
            planes.iter().any(|plane| plane.distance(&q).abs() < settings.floor_band)
        };
        let above = |(view, v): (usize, &View)| {
            let points = v.points.iter().filter(|p| !on_floor(**p));
            let points: Vec<Measured> =
                points.map(|p| Measured { p: *p, view: view as u16 }).collect();
            let thin = thin(&points, settings.thin as f32);
            (points, thin)
        };
        let (mut points, mut thin) = (Vec::new(), Vec::new());
        for (own, few) in fan.fan(views.iter().copied().enumerate().collect(), above) {
            let first = points.len() as u32;
            thin.extend(few.into_iter().map(|i| first + i));
            points.extend(own);
        }
        let cloud = views.iter().all(|view| view.images.is_empty()).then(|| {
            let few = thin.iter().map(|&i| points[i as usize].p).collect();
            Arc::new(Cloud::new(few, CLOUD.edge, CLOUD.reach))
        });
        let scouts = View::scouts(views, region);
        let scouts = Evidence::new(scouts.iter().map(|v| Eye::new(&v.images)), cloud.clone());
        let is_camera = views.iter().any(|view| view.is_camera);
        let least = if is_camera { settings.camera_noise } else { settings.min_noise };
        let noise = noise::of(views, &points, &thin, fan).max(least);
        Self {
            region,
            views: views.to_vec(),
            evidence: Evidence::new(views.iter().map(|v| Eye::new(&v.images)), cloud),
            scouts,
            noise,
            n_alike: if is_camera { settings.camera_alike } else { 1.0 },
            points,
            thin,
        }
    }

    /// Points within the reach of a robot with its base at a place, local frame.
    pub(crate) fn nearby(&self, prepared: &Prepared<'_>, base: &Point) -> Nearby {
        let [thin, all] = self.within(base, prepared.reach + NEAR_MARGIN);
        Nearby { thin, all }
    }

    /// A robot that stands so in the world, as a hypothesis that no search has scored.
    pub(crate) fn hypothesis(&self, world_from_base: &Pose, posture: Vec<f64>) -> Hypothesis {
        Hypothesis::at(self.world_from_local().inverse() * world_from_base, posture)
    }

    /// All points that are not on a floor, local frame, each with the index of its view.
    pub fn local_points(&self) -> impl Iterator<Item = (Point, u16)> {
        self.points.iter().map(|m| (Point::from(m.p.map(f64::from)), m.view))
    }

    /// The points that are not on a floor, one a grid cell and view, local frame.
    pub fn thinned_local_points(&self) -> impl Iterator<Item = Point> {
        self.thin.iter().map(|&i| Point::from(self.points[i as usize].p.map(f64::from)))
    }

    /// Thinned points, and all points, within `reach` metres of a place, local frame.
    fn within(&self, place: &Point, reach: f64) -> [Vec<u32>; 2] {
        let (c, r2) = (place.coords.cast::<f32>(), (reach * reach) as f32);
        let near = |i: &u32| (Vector3::from(self.points[*i as usize].p) - c).norm_squared() < r2;
        let all = (0..self.points.len() as u32).filter(near).collect();
        [self.thin.iter().copied().filter(near).collect(), all]
    }

    /// Thinned points within `reach` metres of a place, world, metres.
    #[must_use]
    pub fn places(&self, place: &Point, reach: f64) -> Vec<Point> {
        let world_from_local = self.world_from_local();
        let [thin, _] = self.within(&(world_from_local.inverse() * place), reach);
        let at = |i: u32| Point::from(self.points[i as usize].p.map(f64::from));
        thin.into_iter().map(|i| world_from_local * at(i)).collect()
    }

    /// World from the region's local frame.
    #[must_use]
    pub fn world_from_local(&self) -> Pose {
        Pose::from_parts(Translation3::from(self.region.origin.coords), UnitQuaternion::identity())
    }

    /// Where the scanner of a view stands, local frame; `None` where unknown.
    #[must_use]
    pub fn scanner(&self, view: u16) -> Option<Point> {
        self.views[usize::from(view)].scanner
    }
}

/// The first point of each grid cell, in the order of the points of one view.
fn thin(points: &[Measured], edge: f32) -> Vec<u32> {
    // 21 bits an axis: 25 km of 12 mm cells, folded over beyond.
    let cell = |v: f32| u64::from((v / edge).floor() as i32 as u32 & 0x1f_ffff);
    let key = |m: &Measured| cell(m.p[2]) << 42 | cell(m.p[1]) << 21 | cell(m.p[0]);
    let mut known = HashSet::with_hasher(BuildHasherDefault::<CellHasher>::default());
    let mut last = None;
    let mut is_new = |key| last.replace(key) != Some(key) && known.insert(key);
    (0..points.len() as u32).filter(|&i| is_new(key(&points[i as usize]))).collect()
}

/// Spreads the numbers of cells over a table: a product is enough, and far cheaper than what
/// withstands an attack.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.write_u64(u64::from(*b)));
    }

    fn write_u64(&mut self, key: u64) {
        // 2⁶⁴ over the golden ratio (Knuth, vol. 3, 6.4); the best bits are the highest, and the
        // table takes the lowest.
        self.0 = (self.0 ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(26);
    }
}
