//! Tells for a place, from the views of scans, whether their beams passed through it, ended on it
//! or did not reach it.

use contract::{Region, View};
use geometry::Eye;
use geometry::depth::{LANES, Look, lanes};

/// A beam that ended farther than this behind a place passed through it, metres.
const BEYOND: f32 = 0.04;
/// A beam that ended within this distance of a place ended on it, metres: range noise, registration
/// and the slope of the surface within a cell of the depth image.
const ON: f32 = 0.02;
/// A beam that ended farther than this behind a point of its own session passed through the object
/// of that point, metres. Example for the value: rows 0.13° apart that graze a flat surface at 2°
/// from 5 m away end this far from each other.
const PIERCED: f32 = 0.3;
/// Views whose beams are farther apart than this at a place cannot show that the object is pierced,
/// metres: a single row may pass over all of a flat surface.
const MAX_GAP: f64 = 0.02;
/// Width around a place within which beams are looked up, metres.
const FOOTPRINT: f32 = 0.012;

/// What the beams of scans show about a place, from the weakest statement to the strongest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Visibility {
    /// No beam went in the direction of the place.
    #[default]
    Unseen = 0,
    /// A nearer surface hides the place.
    Hidden = 1,
    /// Beams ended a little beyond the place, so that it may lie on the surface that they hit or in
    /// front of it.
    Close = 2,
    /// All beams around the place ended far beyond it: nothing is there.
    Through = 3,
    /// A beam ended at the place: something is there.
    Onto = 4,
}

/// Queries of the visibility of places in the views of a region.
pub struct VisibilityQuery<'a> {
    region: &'a Region,
    views: Vec<(&'a View, Eye<'a>)>,
}

impl<'a> VisibilityQuery<'a> {
    /// Prepares queries of the views of a region.
    #[must_use]
    pub fn new(region: &'a Region, views: &'a [View]) -> Self {
        let views = views.iter().map(|view| (view, Eye::new(&view.images))).collect();
        Self { region, views }
    }

    /// Whether a beam of any scan ended far beyond a place, whatever other beams show. `world` is
    /// in the world frame, metres.
    #[must_use]
    pub fn is_pierced(&self, world: [f64; 3]) -> bool {
        let goes_on = |look: Look| look.near.is_finite() && look.near - look.range > PIERCED;
        let is_dense = |view: &View, look: &Look| view.beam_step * f64::from(look.range) <= MAX_GAP;
        self.looks(world).any(|(view, look)| is_dense(view, &look) && goes_on(look))
    }

    /// The look-up of each view that has beams in the direction of a place.
    fn looks(&self, world: [f64; 3]) -> impl Iterator<Item = (&View, Look)> + '_ {
        let p = self.local(world);
        self.views.iter().filter_map(move |(view, eye)| Some((*view, eye.look(p, FOOTPRINT)?)))
    }

    /// The visibility of a place in the world frame, metres: the strongest statement of all views.
    #[must_use]
    pub fn look(&self, world: [f64; 3]) -> Visibility {
        self.looks(world).map(|(_, look)| Visibility::of(&look)).max().unwrap_or_default()
    }

    /// Computes [`Self::look`] for many places (world frame, metres) into `out`, one after another
    /// for each view, so that its depth image stays in the processor's cache.
    pub fn look_all(&self, world: &[[f64; 3]], out: &mut Vec<Visibility>) {
        out.clear();
        out.resize(world.len(), Visibility::Unseen);
        // Places where no view has shown a surface so far; a further view cannot change the others.
        let mut open: Vec<(u32, [f32; 3])> =
            (0..).zip(world).map(|(i, world)| (i, self.local(*world))).collect();
        for (_, eye) in &self.views {
            for some in open.chunks(LANES) {
                let mut places = [[0.0; 3]; LANES];
                places.iter_mut().zip(some).for_each(|(place, (_, local))| *place = *local);
                let looks = eye.look_lanes(&lanes(&places[..some.len()]), FOOTPRINT);
                for (k, (i, _)) in some.iter().enumerate() {
                    let best = &mut out[*i as usize];
                    *best = (*best)
                        .max(looks.get(k).map_or(Visibility::Unseen, |look| Visibility::of(&look)));
                }
            }
            open.retain(|(i, _)| out[*i as usize] != Visibility::Onto);
        }
    }

    fn local(&self, world: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|i| (world[i] - self.region.origin[i]) as f32)
    }
}

impl Visibility {
    #[inline]
    fn of(look: &Look) -> Self {
        let is_on = |range: f32| (range - look.range).abs() <= ON;
        if is_on(look.near) || is_on(look.far) {
            Self::Onto
        } else if look.around.is_finite() && look.around - look.range > BEYOND {
            Self::Through
        } else if look.far < look.range {
            Self::Hidden
        } else if look.far.is_finite() {
            Self::Close
        } else {
            Self::Unseen
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::{MaskId, ScanId};
    use geometry::depth::Empty;
    use geometry::{Aabb, DepthImage, Point, Pose};

    /// A plate 3 m in front of the scanner with a gap, and another surface `behind` metres behind
    /// it.
    fn view(behind: f32) -> View {
        let mut image = DepthImage::new(Pose::identity(), 0.5, 200.0);
        for (i, j) in (-250..250).flat_map(|i| (-250..250).map(move |j| (i, j))) {
            let (x, y) = (i as f32 * 0.002, j as f32 * 0.002);
            let z = if x.abs() < 0.05 { 3.0 + behind } else { 3.0 };
            image.splat([x * z, y * z, z]);
        }
        image.finish(2, |_| Empty::Unknown);
        let (scanner, images) = (Some(Point::origin()), vec![image]);
        let (scan, mask, beam_step) = (ScanId(0), MaskId(0), 0.002);
        let (is_camera, points) = (false, Vec::new());
        View { scan, mask, scanner, beam_step, is_camera, images, points }
    }

    #[test]
    fn a_beam_that_ends_slightly_behind_pierces_nothing() {
        let region = Region { origin: Point::origin(), bounds: Aabb::EMPTY };
        let is_pierced = |behind: f32, x: f64| {
            VisibilityQuery::new(&region, &[view(behind)]).is_pierced([x, 0.0, 3.0])
        };
        assert!(is_pierced(0.8, 0.0));
        assert!(!is_pierced(0.8, 0.6));
        assert!(!is_pierced(0.1, 0.0));
        let far = View { beam_step: 0.01, ..view(0.8) };
        assert!(!VisibilityQuery::new(&region, &[far]).is_pierced([0.0, 0.0, 3.0]));
    }
}
