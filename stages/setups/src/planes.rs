//! Cuts windows of points into runs that lie in planes: columns of a scanner, or parts of them.

use crate::setup::{ScanWindow, SetupLimits};
use geometry::Vector;
use geometry::robust::median;
use nalgebra::{Matrix3, SymmetricEigen};

/// A run of points that lie in one plane and determine it.
#[derive(Debug, Clone)]
pub(crate) struct PlanarRun {
    /// Number of its window.
    pub(crate) window: usize,
    /// What the file says of whose points these are.
    pub(crate) source: u32,
    /// The points less the origin of the search, metres.
    pub(crate) points: Vec<Vector>,
    /// Mean of the points, metres.
    pub(crate) center: Vector,
    /// Unit normal.
    pub(crate) normal: Vector,
    /// Standard deviation of the normal about the direction in which the run is short, radians.
    pub(crate) normal_sigma: f64,
    /// Deviation of the points from the plane, metres RMS.
    pub(crate) rms: f64,
}

/// Sums of points and of their products up to each point of a window.
struct RunningMoments {
    sums: Vec<(Vector, Matrix3<f64>)>,
}

/// Mean, principal directions (least first) and standard deviations along them, metres.
struct RunSpread {
    center: Vector,
    directions: [Vector; 3],
    sd: [f64; 3],
}

impl RunningMoments {
    fn of(points: &[Vector]) -> Self {
        let mut sums = Vec::with_capacity(points.len() + 1);
        let mut sum = (Vector::zeros(), Matrix3::zeros());
        sums.push(sum);
        for p in points {
            sum = (sum.0 + p, sum.1 + p * p.transpose());
            sums.push(sum);
        }
        Self { sums }
    }

    fn spread(&self, from: usize, to: usize) -> RunSpread {
        let n = (to - from) as f64;
        let center = (self.sums[to].0 - self.sums[from].0) / n;
        let outer = (self.sums[to].1 - self.sums[from].1) / n - center * center.transpose();
        let eigen = SymmetricEigen::new(outer);
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let directions = order.map(|i| eigen.eigenvectors.column(i).into_owned());
        let sd = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
        RunSpread { center, directions, sd }
    }
}

/// Number of points by which a run is extended before it is tested again.
const STEP: usize = 16;
/// Least extent of a run across its longest direction, metres and in deviations from its plane: a
/// run along one straight line determines no plane.
const WIDE: (f64, f64) = (0.02, 10.0);
/// Least extent of a run along its longest direction, metres.
const LONG: f64 = 0.045;
/// Factor between the deviation of good runs of a cloud and the largest that is accepted.
const LOOSE: f64 = 4.0;
/// Least limit of the deviation, metres: coordinates are rounded to a millimetre in places.
const FINE: f64 = 0.000_6;
/// Independent points of a run that determine its normal: neighbours share their errors.
const INDEPENDENT: f64 = 30.0;

/// The runs of all windows; the points less `origin`.
pub(crate) fn runs(
    windows: &[ScanWindow],
    origin: &Vector,
    settings: &SetupLimits,
) -> Vec<PlanarRun> {
    let local: Vec<Vec<Vector>> = windows
        .iter()
        .map(|w| w.points.iter().map(|p| Vector::from(*p) - origin).collect())
        .collect();
    let limit = limit(&local, settings);
    let mut out = Vec::new();
    for (window, points) in local.iter().enumerate() {
        cut(points, limit, settings, |from, to, spread| {
            out.push(PlanarRun {
                window,
                source: windows[window].source,
                points: points[from..to].to_vec(),
                center: spread.center,
                normal: spread.directions[0],
                normal_sigma: spread.sd[0].max(1e-5)
                    / (spread.sd[1] * INDEPENDENT.min((to - from) as f64 / 4.0).sqrt()),
                rms: spread.sd[0],
            });
        });
    }
    out
}

/// The largest deviation from a plane that is accepted in this cloud, metres: some times that of
/// its better runs. Runs over two columns deviate more.
fn limit(windows: &[Vec<Vector>], settings: &SetupLimits) -> f64 {
    let n = settings.min_run_points;
    let mut all = Vec::new();
    for points in windows.iter().filter(|points| points.len() >= n) {
        let shift = points[0];
        let near: Vec<Vector> = points.iter().map(|p| p - shift).collect();
        let moments = RunningMoments::of(&near);
        let starts = (0..=points.len() - n).step_by(n);
        let spreads = starts.map(|from| moments.spread(from, from + n));
        all.extend(spreads.filter(is_wide).map(|s| s.sd[0]));
    }
    let at = all.len() / 4;
    if all.is_empty() {
        return settings.max_plane_rms;
    }
    let quartile = *all.select_nth_unstable_by(at, f64::total_cmp).1;
    (LOOSE * quartile).clamp(FINE, settings.max_plane_rms)
}

fn is_wide(spread: &RunSpread) -> bool {
    let [least, middle, most] = spread.sd;
    middle > WIDE.0.max(WIDE.1 * least) && most > LONG
}

/// Cuts points that follow one another where they leave a plane, and passes on what lies in one.
fn cut(
    points: &[Vector],
    limit: f64,
    settings: &SetupLimits,
    mut take: impl FnMut(usize, usize, RunSpread),
) {
    let least = settings.min_run_points;
    let shift = points.first().copied().unwrap_or_default();
    let near: Vec<Vector> = points.iter().map(|p| p - shift).collect();
    let moments = RunningMoments::of(&near);
    let mut from = 0;
    while from + least <= points.len() {
        if moments.spread(from, from + least).sd[0] > limit {
            from += STEP / 2;
            continue;
        }
        let mut to = from + least;
        while to + STEP <= points.len() && moments.spread(from, to + STEP).sd[0] <= limit {
            to += STEP;
        }
        // The last points may lie on the next column already.
        let end = if to + STEP <= points.len() { to - STEP } else { to };
        if end >= from + least - STEP {
            let mut spread = moments.spread(from, end);
            if is_wide(&spread) {
                spread.center += shift;
                take(from, end, spread);
            }
        }
        from = to;
    }
}

/// The median of values; 0 where there are none.
pub(crate) fn middle(mut values: Vec<f64>) -> f64 {
    median(&mut values).unwrap_or_default()
}
