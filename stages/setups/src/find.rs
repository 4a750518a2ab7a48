//! Finds the setups of a cloud one after the other: axis, height, comb; what is explained is taken
//! away before the next.

use crate::axis::{self, AxisLine};
use crate::comb;
use crate::height;
use crate::owner::owners;
use crate::planes::{self, PlanarRun};
use crate::refine::wrapped;
use crate::setup::{Cause, ScanWindow, Setup, SetupLimits};
use geometry::robust::median;
use geometry::{Point, Vector};

/// What was found in a cloud.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FoundSetups {
    /// The setups, those of more columns first.
    pub setups: Vec<Setup>,
    /// For each window the setup from which it was measured, where that is clear.
    pub owners: Vec<Option<usize>>,
    /// Why there is no setup, or none for the windows that are left.
    pub cause: Option<Cause>,
}

/// Distance within which two results are one setup, metres: blocks over two columns make twins.
const TWINS: f64 = 0.2;
/// Number of axes in a row that may fail before the search ends.
const FAILURES: usize = 6;
/// Fewest windows that tell anything.
const FEWEST: usize = 12;

/// Finds the setups from which windows of points were measured. The answer depends on the windows
/// and their order only.
#[must_use]
pub fn find(windows: &[ScanWindow], settings: &SetupLimits) -> FoundSetups {
    let filled = windows.iter().filter(|w| w.points.len() >= settings.min_run_points).count();
    let none = |cause| FoundSetups {
        setups: Vec::new(),
        owners: vec![None; windows.len()],
        cause: Some(cause),
    };
    if filled < FEWEST {
        return none(Cause::FewPoints);
    }
    let origin = origin(windows);
    let runs = planes::runs(windows, &origin, settings);
    if runs.len() < FEWEST {
        return none(Cause::NoColumns);
    }
    let mut search = SetupSearch { windows, runs, origin, settings, setups: Vec::new() };
    let cause = search.all();
    let mut setups = search.setups;
    setups.sort_by_key(|setup| std::cmp::Reverse(setup.evidence.n_planes));
    let owners = owners(windows, &setups);
    for (i, setup) in setups.iter_mut().enumerate() {
        setup.col_step = col_step(windows, &owners, i, setup);
    }
    FoundSetups { setups, owners, cause }
}

/// The median of the windows' first points, so that numbers stay small in any frame of the world.
fn origin(windows: &[ScanWindow]) -> Vector {
    let first: Vec<&[f64; 3]> = windows.iter().filter_map(|w| w.points.first()).collect();
    let along = |axis: usize| {
        let mut values: Vec<f64> = first.iter().map(|p| p[axis]).collect();
        median(&mut values).unwrap_or_default().round()
    };
    Vector::new(along(0), along(1), along(2))
}

struct SetupSearch<'a> {
    windows: &'a [ScanWindow],
    runs: Vec<PlanarRun>,
    origin: Vector,
    settings: &'a SetupLimits,
    setups: Vec<Setup>,
}

impl SetupSearch<'_> {
    /// Finds all setups; says why there are no more, where runs are left.
    fn all(&mut self) -> Option<Cause> {
        let mut live: Vec<usize> = (0..self.runs.len()).collect();
        let mut refused: Vec<AxisLine> = Vec::new();
        let mut failures = 0;
        while self.setups.len() < self.settings.max_setups && failures < FAILURES {
            let seed = (self.setups.len() * FAILURES + refused.len()) as u64;
            let Some(line) = axis::find(&self.runs, &live, &refused, seed, self.settings) else {
                return self.cause(Cause::NoAxis, &live);
            };
            let profiles = height::profiles(&self.runs, &line);
            let certified = |h| comb::certified(&self.runs, &line, h, &self.origin);
            let found = height::find(&profiles).find_map(certified);
            let Some(setup) = found else {
                failures += 1;
                refused.push(line);
                continue;
            };
            failures = 0;
            let explained = owners(self.windows, std::slice::from_ref(&setup));
            let is_left = |i: &usize| {
                explained[self.runs[*i].window].is_none() && line.runs.binary_search(i).is_err()
            };
            live.retain(is_left);
            self.take(setup);
        }
        self.cause(Cause::NoComb, &live)
    }

    fn cause(&self, cause: Cause, live: &[usize]) -> Option<Cause> {
        (self.setups.is_empty() || live.len() * 20 > self.runs.len()).then_some(cause)
    }

    /// Adds a setup, or replaces its less clear twin.
    fn take(&mut self, setup: Setup) {
        let at = Vector::from(setup.position());
        let near = |other: &Setup| (Vector::from(other.position()) - at).norm() < TWINS;
        match self.setups.iter_mut().find(|other| near(other)) {
            None => self.setups.push(setup),
            Some(twin) if twin.evidence.clearness < setup.evidence.clearness => *twin = setup,
            Some(_) => {}
        }
    }
}

/// The azimuth between columns that follow one another in a window of a setup, radians: the median
/// of the steps from one column to the next.
fn col_step(
    windows: &[ScanWindow],
    owners: &[Option<usize>],
    setup: usize,
    of: &Setup,
) -> Option<f64> {
    /// Least and largest step that counts as one between neighbouring columns, in steps of
    /// elevation.
    const NEIGHBOURS: (f64, f64) = (0.2, 5.0);
    /// Fewest columns that tell.
    const FEWEST: usize = 8;
    let scanner_from_world = of.world_from_scanner.inverse();
    let step = of.comb[1];
    let mut all = Vec::new();
    for (window, _) in windows.iter().zip(owners).filter(|(_, o)| **o == Some(setup)) {
        let seen = window.points.iter().map(|p| (scanner_from_world * Point::from(*p)).coords);
        let flat: Vec<f64> =
            seen.filter(|p| p.z.abs() < 2.0 * p.x.hypot(p.y)).map(|p| p.y.atan2(p.x)).collect();
        let (Some(first), Some(last)) = (flat.first(), flat.last()) else { continue };
        let apart = wrapped(last - first).abs();
        // Only windows over two columns: those over more would count several steps.
        let jumps = flat.windows(2).filter(|w| wrapped(w[1] - w[0]).abs() > 0.5 * apart).count();
        if jumps == 1 && apart > NEIGHBOURS.0 * step && apart < NEIGHBOURS.1 * step {
            all.push(apart);
        }
    }
    if all.len() < FEWEST { None } else { median(&mut all) }
}
