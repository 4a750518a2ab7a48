//! One model in one scene, as all steps of the method read them.

use fit::{MeasuredScene, Prepared};
use geometry::{Point, Pose, Vector};

use crate::direction_grid::DirectionGrids;
use crate::settings::Settings;

/// One model in one scene.
pub(crate) struct SequentialFit<'a> {
    pub(crate) prepared: &'a Prepared<'a>,
    pub(crate) scene: &'a MeasuredScene<'a>,
    pub(crate) settings: &'a Settings,
    /// The points of the scene by the directions that scanners saw them in.
    pub(crate) grids: &'a DirectionGrids,
    /// The link that stands on the plane.
    pub(crate) base: usize,
}

impl SequentialFit<'_> {
    /// Root frame from the base link.
    pub(crate) fn base_pose(&self) -> Pose {
        self.prepared.model.poses(&self.prepared.model.home())[self.base]
    }

    /// The closest point of a link's surface, and its normal, link frame; `None` beyond the reach
    /// of the link's nearest-sample fields.
    pub(crate) fn closest(&self, link: usize, q: &Point) -> Option<(Point, Vector)> {
        let p = [q.x as f32, q.y as f32, q.z as f32];
        let facet = self.prepared.facet_about(link, p)?;
        let cad = &self.prepared.model.links[link].cad;
        let (x, n) = (facet.x.map(f64::from), facet.n.map(f64::from));
        let (x, n) = (Point::from(x), Vector::from(n));
        // The facet goes on beside its sample, about as far as to the next one.
        let beside = (q - x) - n * n.dot(&(q - x));
        let reach = f64::from(cad.spacing);
        let beside = if beside.norm() > reach { beside * (reach / beside.norm()) } else { beside };
        Some((x + beside, n))
    }
}
