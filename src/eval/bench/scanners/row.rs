//! Rows of the bench of scanner positions, and their table.

use crate::eval::bench::cases::CaseRow;
use contract::words::fixed;
use serde::Serialize;
use std::fmt::Write as _;

/// Random values of a hall.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct DrawnScanners {
    pub(super) n_setups: usize,
    pub(super) step_deg: f64,
    pub(super) noise_mm: f64,
    /// Standard deviation of a beam's stored angles about its raster, arc seconds.
    pub(super) jitter_arcsec: f64,
    /// Amplitude of the graduation errors of both encoders, arc seconds.
    pub(super) ripple_arcsec: f64,
    pub(super) dropouts: f64,
    /// Step of the coordinates of the files, metres.
    pub(super) quantum: f64,
}

/// What was found in one cloud.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct FoundScanners {
    pub(super) order: String,
    pub(super) n_points: usize,
    pub(super) n_true: usize,
    pub(super) n_found: usize,
    pub(super) n_invented: usize,
    /// Setups of at least a million points that were found, and of all.
    pub(super) n_large: [usize; 2],
    /// Setups that were found twice.
    pub(super) n_twins: usize,
    /// Distance of each from the truth, and what was stated for it, millimetres.
    pub(super) errors_mm: Vec<f64>,
    pub(super) sigmas_mm: Vec<f64>,
    /// Error by deviation on each axis.
    pub(super) ratios: Vec<f64>,
    /// Points that were given to their setup, and to another one.
    pub(super) n_right: usize,
    pub(super) n_wrong: usize,
    pub(super) unknown: Option<String>,
    pub(super) seconds: f64,
}

/// A hall.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct ScannersRow {
    pub(super) seed: u64,
    pub(super) failed: Option<String>,
    pub(super) drawn: DrawnScanners,
    pub(super) orders: Vec<FoundScanners>,
}

impl CaseRow for ScannersRow {
    fn fail(&mut self, why: String) {
        self.failed = Some(why);
    }

    fn line(&self) -> String {
        if let Some(why) = &self.failed {
            return format!("{}: failed: {why}", self.seed);
        }
        let of = |o: &FoundScanners| {
            let invented = o.n_invented + o.n_twins;
            let extra = if invented > 0 { format!(" +{invented} invented") } else { String::new() };
            format!("{} {}/{}{extra}", o.order, o.n_found, o.n_true)
        };
        let all: Vec<String> = self.orders.iter().map(of).collect();
        format!("{}: {}", self.seed, all.join(", "))
    }
}

/// The table: one line for each order of points.
pub(super) fn table(rows: &[ScannersRow]) -> String {
    let mut text = String::from(
        "| order | clouds | setups | found | of ≥ 1 M points | twins | invented | error, mm: median | \
         95 % | worst | \
         error by sigma: median | 95 % | 98 % | points to their setup | to another | s a cloud |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut orders: Vec<&str> = Vec::new();
    for order in rows.iter().flat_map(|row| &row.orders) {
        if !orders.contains(&&*order.order) {
            orders.push(&order.order);
        }
    }
    for name in orders {
        let own = || rows.iter().flat_map(|row| &row.orders).filter(|o| o.order == name);
        let sum = |of: fn(&FoundScanners) -> usize| own().map(of).sum::<usize>();
        let errors = sorted(own().flat_map(|o| o.errors_mm.iter().copied()));
        let ratios = sorted(own().flat_map(|o| o.ratios.iter().copied()));
        let n_points = sum(|o| o.n_points).max(1) as f64;
        let share = |n: usize| format!("{} %", fixed(100.0 * n as f64 / n_points, 2));
        let seconds = own().map(|o| o.seconds).sum::<f64>() / own().count().max(1) as f64;
        let cells = [
            name.to_owned(),
            own().count().to_string(),
            sum(|o| o.n_true).to_string(),
            sum(|o| o.n_found).to_string(),
            format!("{} of {}", sum(|o| o.n_large[0]), sum(|o| o.n_large[1])),
            sum(|o| o.n_twins).to_string(),
            sum(|o| o.n_invented).to_string(),
            at(&errors, 0.5, 3),
            at(&errors, 0.95, 3),
            at(&errors, 1.0, 3),
            at(&ratios, 0.5, 2),
            at(&ratios, 0.95, 2),
            at(&ratios, 0.98, 2),
            share(sum(|o| o.n_right)),
            share(sum(|o| o.n_wrong)),
            fixed(seconds, 2),
        ];
        let _ = writeln!(text, "| {} |", cells.join(" | "));
    }
    let n_failed = rows.iter().filter(|row| row.failed.is_some()).count();
    if n_failed > 0 {
        let _ = writeln!(text, "\n{n_failed} halls failed");
    }
    text
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// The value below which a share of sorted values lies.
fn at(sorted: &[f64], share: f64, digits: usize) -> String {
    let last = sorted.len().saturating_sub(1) as f64;
    sorted.get((last * share).round() as usize).map_or("-".into(), |v| fixed(*v, digits))
}
