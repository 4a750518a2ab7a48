//! `bench scanners`: draws halls, writes their points as clouds without scanner positions in
//! several orders, finds the scanners, and compares them with the truth.

mod cloud;
mod row;

use super::cases::{CaseToRun, Cases};
use super::request::DrawnCases;
use crate::engine::Engine;
use crate::job::{Job, Means};
use crate::positions::{self, CloudOrder, CloudSetups, Ownership, SetupOfCloud};
use cloud::{DrawnCloud, Order};
use contract::{Error, PointRaster, Result};
use row::{FoundScanners, ScannersRow};
use std::path::Path;
use std::time::Instant;

/// Request of the bench.
#[derive(Debug, Clone)]
pub struct ScannersBench {
    /// Seed and folders.
    pub drawn: DrawnCases,
    /// Number of halls.
    pub n_cases: usize,
    /// Fewest and most setups of a hall.
    pub n_setups: [usize; 2],
    /// Greatest number of beams of a hall.
    pub n_beams: f64,
    /// Parts of the names of orders; all where there is none.
    pub orders: Vec<String>,
}

/// Number of points from which on a setup is to be found in any order.
const LARGE: usize = 1_000_000;
/// Distance within which a setup that is found is a true one, metres.
const SAME: f64 = 0.05;

/// Draws the halls and returns the table.
///
/// # Errors
/// Files that cannot be written.
pub fn scanners(bench: &ScannersBench, means: &Means, engine: &Engine) -> Result<String> {
    let temporary = tempfile::tempdir()?;
    let quiet = engine.quiet();
    let place = Cases { name: "scanners", drawn: &bench.drawn, temporary: temporary.path() };
    let cases = CaseToRun::numbered(&bench.drawn, bench.n_cases, |seed| ScannersRow {
        seed,
        ..ScannersRow::default()
    });
    let case = |row: &mut ScannersRow, _: &usize, dir: &Path| hall(row, bench, dir, means, &quiet);
    place.run(cases, case, row::table, engine)
}

/// One hall in all orders.
fn hall(
    row: &mut ScannersRow,
    bench: &ScannersBench,
    dir: &Path,
    means: &Means,
    engine: &Engine,
) -> Result<()> {
    std::fs::create_dir_all(dir).map_err(|e| Error::from(e).at(dir.display()))?;
    let of = |order| DrawnCloud::drawn(row.seed, bench.n_setups, bench.n_beams, order, engine);
    let drawn = of(None)?;
    row.drawn = drawn.drawn.clone();
    let is_wanted = |order: &Order| {
        bench.orders.is_empty() || bench.orders.iter().any(|part| order.word().contains(part))
    };
    for order in Order::ALL.into_iter().filter(is_wanted) {
        engine.cancel.check()?;
        let other = match order {
            Order::Carried => Some(DrawnCloud::carried(row.seed, engine)?),
            Order::Jitter(_) | Order::Ripple(_) => Some(of(Some(order))?),
            _ => None,
        };
        let cloud = other.as_ref().unwrap_or(&drawn).in_order(order, row.seed);
        let path = cloud.write(dir, order)?;
        let nowhere = std::path::PathBuf::new();
        let job = Job::new(vec![path.clone()], nowhere.clone(), nowhere, means.clone());
        let started = Instant::now();
        let job = Job { find_scanners: false, ..job };
        let opened =
            positions::open(&job, ingest::Before::default(), None, CloudOrder::Measured, engine)?;
        let found =
            positions::find(&opened.sources, CloudOrder::Any, means.sample_bytes(), engine)?;
        let seconds = started.elapsed().as_secs_f64();
        row.orders.push(compared(&cloud, order, &found, seconds));
        let _ = std::fs::remove_file(path);
    }
    Ok(())
}

/// What was found, beside the truth.
fn compared(
    cloud: &DrawnCloud,
    order: Order,
    found: &[CloudSetups],
    seconds: f64,
) -> FoundScanners {
    let mut out = FoundScanners {
        order: order.word(),
        n_points: cloud.points.len(),
        n_true: cloud.scanners.len(),
        seconds,
        unknown: found.iter().find_map(|cloud| cloud.unknown.clone()),
        ..FoundScanners::default()
    };
    let setups: Vec<&SetupOfCloud> = found.iter().flat_map(|cloud| &cloud.setups).collect();
    let owners = cloud.owners(&setups);
    let mut is_found = vec![false; cloud.scanners.len()];
    for (number, setup) in setups.into_iter().enumerate() {
        let off = |truth: &[f64; 3]| [0, 1, 2].map(|a| setup.position[a] - truth[a]);
        let length = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let offs = cloud.scanners.iter().map(off).enumerate();
        let nearest = offs.min_by(|a, b| length(a.1).total_cmp(&length(b.1)));
        let Some((truth, off)) = nearest.filter(|(_, off)| length(*off) < SAME) else {
            out.n_invented += 1;
            continue;
        };
        if std::mem::replace(&mut is_found[truth], true) {
            out.n_twins += 1;
            continue;
        }
        out.errors_mm.push(length(off) * 1e3);
        out.sigmas_mm.push(length(setup.sigma) * 1e3);
        let ratios = off.iter().zip(&setup.sigma).map(|(off, sigma)| (off / sigma).abs());
        out.ratios.extend(ratios);
        let by_raster = owners.iter().map(|owner| *owner == Some(number));
        let [right, wrong] = cloud.owned(&setup.ownership, truth, by_raster);
        out.n_right += right;
        out.n_wrong += wrong;
    }
    out.n_found = is_found.iter().filter(|found| **found).count();
    let mut left = vec![0usize; cloud.scanners.len()];
    let of_scanner = cloud.scan.iter().map(|scan| usize::from(*scan));
    of_scanner.for_each(|scan| left.get_mut(scan).into_iter().for_each(|n| *n += 1));
    let large = (0..left.len()).filter(|i| left[*i] >= LARGE);
    out.n_large = [large.clone().filter(|i| is_found[*i]).count(), large.count()];
    out
}

impl DrawnCloud {
    /// Number of points that an ownership gives to a setup, rightly and wrongly.
    fn owned(
        &self,
        ownership: &Ownership,
        truth: usize,
        by_raster: impl Iterator<Item = bool>,
    ) -> [usize; 2] {
        let mut counts = [0, 0];
        let mut count = |i: usize| counts[usize::from(usize::from(self.scan[i]) != truth)] += 1;
        match ownership {
            Ownership::Whole => (0..self.points.len()).for_each(&mut count),
            Ownership::Source(id) => {
                let own = (0..self.points.len()).filter(|i| self.ids[*i] == *id);
                own.for_each(&mut count);
            }
            Ownership::Places(places) => {
                let own = places.iter().flat_map(|[first, last]| *first as usize..=*last as usize);
                own.filter(|i| *i < self.points.len()).for_each(&mut count);
            }
            Ownership::Raster(_) => {
                (0..self.points.len())
                    .zip(by_raster)
                    .filter(|(_, is)| *is)
                    .for_each(|(i, _)| count(i));
            }
            Ownership::Untold | Ownership::Scattered => {}
        }
        counts
    }

    /// The setup to which each point is given by its raster, where rasters tell.
    fn owners(&self, setups: &[&SetupOfCloud]) -> Vec<Option<usize>> {
        let entries = setups.iter().enumerate().filter_map(|(i, setup)| {
            let raster = setup.entry.raster.as_ref().filter(|_| setup.is_usable)?;
            Some((i, raster, setup.entry.world_from_scan.inverse()))
        });
        let entries: Vec<_> = entries.collect();
        if entries.is_empty() {
            return Vec::new();
        }
        // As files round coordinates.
        let blur = 0.289 * self.drawn.quantum;
        let owner = |p: &[f64; 3]| {
            let p = p.map(|v| (v / self.drawn.quantum).round() * self.drawn.quantum);
            let seen = entries.iter().map(|(_, raster, scanner_from_world)| {
                (*raster, (scanner_from_world * nalgebra::Point3::from(p)).coords.into())
            });
            PointRaster::owner(seen, blur).map(|at| entries[at].0)
        };
        self.points.iter().map(owner).collect()
    }
}
