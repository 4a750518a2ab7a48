//! The place of a scan's points, from a few of them: where its frame goes if no scanner is known,
//! and whether its scanner can be right.

use crate::frame::NO_RETURN;
use crate::oddities::no_returns_note;
use crate::reader::ScanSeed;
use crate::settings::Settings;
use contract::{Error, Kind, Result, ScannerPosition};
use geometry::Aabb;
use nalgebra::Vector3;

/// Message for scans without scanner position.
pub(crate) const NO_SCANNER: &str = "the scanner's position is not known: no free-space evidence, so postures are less \
     certain and wrong ones harder to refuse; give it with --scanners";
/// A scanner farther than this from the middle of its points was probably given in another frame,
/// metres.
const FAR_SCANNER: f64 = 2_000.0;
/// Number of windows, evenly spread over all points, in which points are looked at.
const WINDOWS: u64 = 8;

/// The place of some points.
pub(crate) struct PlaceLook {
    /// World coordinates, metres.
    pub(crate) points: Vec<[f64; 3]>,
    /// Number of these points outside the stated bounds; all where none are stated.
    pub(crate) outside: usize,
    /// Median of these points, metres.
    middle: Option<[f64; 3]>,
    /// Origin to use where no scanner is known: whole metres near the median.
    pub(crate) origin: [f64; 3],
}

/// Message for scans whose scanner's position was found from their points.
pub(crate) fn found_note(sigma: [f64; 3]) -> String {
    let most = sigma.iter().fold(0.0_f64, |most, s| s.max(most)) * 1e3;
    format!("the scanner's position was found from the points, to about {most:.2} mm")
}

impl PlaceLook {
    /// Number of points that are looked at in each window.
    pub(crate) const IN_WINDOW: usize = 256;

    /// First place of each window over `n` points.
    pub(crate) fn windows(n: u64) -> impl Iterator<Item = u64> {
        (0..if n == 0 { 0 } else { WINDOWS }).map(move |window| n * window / WINDOWS)
    }

    /// The place of finite points; `stated` are the stated bounds, and these with a margin.
    pub(crate) fn new(points: Vec<[f64; 3]>, stated: Option<(Aabb, Aabb)>) -> Self {
        let is_outside = |p: &&[f64; 3]| !stated.is_some_and(|(_, grown)| grown.contains(**p));
        let outside = points.iter().filter(is_outside).count();
        let middle = (!points.is_empty()).then(|| {
            [0, 1, 2].map(|a| {
                let mut values: Vec<f64> = points.iter().map(|p| p[a]).collect();
                values.sort_by(f64::total_cmp);
                values[values.len() / 2]
            })
        });
        let mut look = Self { points, outside, middle, origin: [0.0; 3] };
        let center = |(stated, _): (Aabb, Aabb)| stated.center().coords.into();
        let stated = stated.filter(|_| !look.bounds_wrong()).map(center);
        look.origin = stated.or(middle).unwrap_or_default().map(f64::round);
        look
    }

    pub(crate) fn bounds_wrong(&self) -> bool {
        self.outside * 2 > self.points.len()
    }

    /// Checks the place of a scan, by its scanner where that is known, else by the spread of its
    /// points, and notes what users should know.
    pub(crate) fn check(&self, scan: &mut ScanSeed, settings: &Settings) -> Result<()> {
        if scan.scanner_known {
            if let ScannerPosition::Found { sigma } = scan.position {
                scan.notes.push(found_note(sigma));
            }
            let n = self.n_at(scan.world_from_scan.translation.vector);
            if n > 0 {
                scan.notes.push(no_returns_note(n, self.points.len()));
            }
            return self.check_distance(scan, settings);
        }
        let far = self.far_from(scan.world_from_scan.translation.vector, settings.max_range);
        if far > 0 && far == self.points.len() {
            let what = format!(
                "none of {far} points looked at lies within {} km of their middle, \"{:?}\"",
                settings.max_range / 1000.0,
                self.origin
            );
            return Err(Error::bad_input(what)
                .hint("the file is damaged, or its unit is another: give it with --units"));
        }
        if far > 0 {
            scan.notes.push(format!(
                "{far} of {} points looked at lie more than {} km from the middle: such points are dropped",
                self.points.len(),
                settings.max_range / 1000.0
            ));
        }
        scan.notes.push(NO_SCANNER.into());
        Ok(())
    }

    fn check_distance(&self, scan: &mut ScanSeed, settings: &Settings) -> Result<()> {
        let Some(middle) = self.middle else { return Ok(()) };
        let distance = (Vector3::from(middle) - scan.world_from_scan.translation.vector).norm();
        if distance > settings.max_range {
            return Err(Error::new(
                Kind::Usage,
                format!("the scanner \"{}\" lies {distance:.0} m from its points", scan.name),
            )
            .hint("give its position in the same frame as the points"));
        }
        if distance > FAR_SCANNER {
            scan.notes.push(format!(
                "the scanner lies {distance:.0} m from the middle of the points: check that its position is in their frame"
            ));
        }
        Ok(())
    }

    /// Number of these points that lie at a scanner itself.
    fn n_at(&self, scanner: Vector3<f64>) -> usize {
        let is_at = |p: &&[f64; 3]| (0..3).all(|a| (p[a] - scanner[a]).abs() < NO_RETURN);
        self.points.iter().filter(is_at).count()
    }

    fn far_from(&self, origin: Vector3<f64>, max_range: f64) -> usize {
        let far = |p: &[f64; 3]| (0..3).any(|a| (p[a] - origin[a]).abs() > max_range);
        self.points.iter().filter(|p| far(p)).count()
    }
}
