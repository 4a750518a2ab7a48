//! The raster of angles by which the points of a scanner are told from those of others, where
//! neither their order nor an id tells.

use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The raster of a scanner's beams as its points have it, in the frame of the scanner.
///
/// The points of another scanner lie on it by chance only. So a point belongs to a scanner if it
/// lies on both combs of angles of this one, and clearly beside those of all others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointRaster {
    /// Azimuth between columns and elevation between rows, radians.
    pub steps: [f64; 2],
    /// Azimuth of a column in each sector of azimuth, from −180° on, and elevation of a row in each
    /// band of elevation, from −90° on, as a share of the step: encoders err along the circle.
    pub phases: [Vec<f64>; 2],
    /// Deviation of azimuth and elevation up to which a point counts as on the raster, steps.
    pub within: [f64; 2],
    /// Deviation up to which a point on the raster of another scanner may be of this one, steps.
    pub apart: [f64; 2],
}

/// Whether a point is on a raster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnRaster {
    /// On both combs.
    Yes,
    /// Beside a comb by no more than errors may move a point.
    Perhaps,
    /// Clearly beside a comb.
    No,
}

/// Elevation beyond which azimuths mean little, radians.
const STEEP: f64 = 1.3;
/// Error of coordinates that may move a point, in the deviations that are stated for them.
const BLURRED: f64 = 3.0;

impl PointRaster {
    /// Largest number of phases of a comb.
    pub const MOST_PHASES: usize = 3600;

    /// Whether a point (scanner frame, metres) is on the raster; `blur` is the standard deviation
    /// of its coordinates across the beam, metres.
    #[must_use]
    pub fn has(&self, p: [f64; 3], blur: f64) -> OnRaster {
        let flat = p[0].hypot(p[1]);
        let range = flat.hypot(p[2]);
        let elevation = p[2].atan2(flat);
        if flat < 1e-6 || elevation.abs() > STEEP {
            return OnRaster::Perhaps;
        }
        let off = self.deviations([p[1].atan2(p[0]), elevation]).map(f64::abs);
        let moved = [blur / flat, blur / range];
        let may_be = (0..2).all(|k| off[k] <= self.apart[k] + BLURRED * moved[k] / self.steps[k]);
        match (may_be, (0..2).all(|k| off[k] <= self.within[k])) {
            (_, true) => OnRaster::Yes,
            (true, false) => OnRaster::Perhaps,
            (false, false) => OnRaster::No,
        }
    }

    /// Deviation of azimuth and elevation (radians, seen from the scanner) from the nearest column
    /// and row, steps.
    #[must_use]
    pub fn deviations(&self, angles: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|kind| {
            let phases = &self.phases[kind];
            let phase = phases.get(Self::sector(kind, angles[kind], phases.len()));
            let off = angles[kind] / self.steps[kind] - phase.copied().unwrap_or_default();
            off - off.round()
        })
    }

    /// The sector of an azimuth (kind 0), or band of an elevation (kind 1), among `n`.
    #[must_use]
    pub fn sector(kind: usize, angle: f64, n: usize) -> usize {
        let (from, span) = if kind == 0 { (PI, TAU) } else { (FRAC_PI_2, PI) };
        // Below zero, a cast gives zero.
        (((angle + from) / span * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// The only one of some rasters that a point is surely on: it is on this one, and clearly
    /// beside all others. Each raster comes with the point in its frame.
    #[must_use]
    pub fn owner<'a>(
        rasters: impl IntoIterator<Item = (&'a Self, [f64; 3])>,
        blur: f64,
    ) -> Option<usize> {
        let mut owner = None;
        for (i, (raster, p)) in rasters.into_iter().enumerate() {
            match raster.has(p, blur) {
                OnRaster::No => {}
                OnRaster::Yes if owner.is_none() => owner = Some(i),
                // Two claim it, or one that may have it.
                _ => return None,
            }
        }
        owner
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raster() -> PointRaster {
        PointRaster {
            steps: [0.004, 0.002],
            phases: [vec![0.25; 72], vec![0.5; 36]],
            within: [0.1; 2],
            apart: [0.2; 2],
        }
    }

    /// A point at an azimuth and elevation in steps of the raster.
    fn point(column: f64, row: f64, range: f64) -> [f64; 3] {
        let (azimuth, elevation) = (column * 0.004, row * 0.002);
        let flat = range * elevation.cos();
        [flat * azimuth.cos(), flat * azimuth.sin(), range * elevation.sin()]
    }

    #[test]
    fn a_point_belongs_to_the_only_raster_that_it_can_be_on() {
        let one = raster();
        assert_eq!(one.has(point(-300.75, 17.5, 4.0), 0.0), OnRaster::Yes);
        assert_eq!(one.has(point(-300.6, 17.5, 4.0), 0.0), OnRaster::Perhaps);
        assert_eq!(one.has(point(-300.25, 17.5, 4.0), 0.0), OnRaster::No);
        // Rounded coordinates of a near point.
        assert_eq!(one.has(point(-300.25, 17.5, 0.5), 0.001), OnRaster::Perhaps);
        assert_eq!(one.has([0.0, 0.0, 2.0], 0.0), OnRaster::Perhaps);
        let owner = |points: [[f64; 3]; 2]| PointRaster::owner(points.map(|p| (&one, p)), 0.0);
        let (on, beside, near) =
            (point(8.25, 3.5, 2.0), point(8.7, 3.5, 2.0), point(8.4, 3.5, 2.0));
        assert_eq!(owner([beside, on]), Some(1));
        assert_eq!(owner([on, beside]), Some(0));
        assert_eq!((owner([on, on]), owner([on, near]), owner([near, beside])), (None, None, None));
    }
}
