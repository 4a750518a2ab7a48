//! Rows and table of pushed things: errors of their shifts by the number of sides that were seen.

use geometry::Vector;
use serde::Serialize;
use std::fmt::Write as _;

/// An error up to so many standard deviations is expected of nearly all.
const EXPECTED: f64 = 3.0;

/// Greatest standard deviation in any direction of a shift that counts as determined, metres.
const DETERMINED: f64 = 0.05;

/// One moved thing, and what was reported of it.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct ShiftRow {
    pub(super) kind: String,
    /// Upright sides that each session saw a good part of, and those that both saw.
    pub(super) sides: [usize; 3],
    /// Length of the true shift, metres, and true turn, degrees.
    pub(super) pushed: f64,
    pub(super) turned: f64,
    /// Whether it was reported as moved, between these places.
    pub(super) moved: bool,
    /// Why no shift is stated, where it is reported as moved.
    pub(super) unknown: Option<String>,
    /// Error of the shift of the stated place, metres.
    pub(super) error: Option<[f64; 3]>,
    /// Largest standard deviation of the shift in any direction, metres.
    pub(super) sigma: Option<f64>,
    /// Largest error over its standard deviation along the main axes of the covariance.
    pub(super) z: Option<f64>,
    /// Error of the turn, degrees, and the same over its standard deviation.
    pub(super) turn_error: Option<f64>,
    pub(super) turn_z: Option<f64>,
}

impl ShiftRow {
    /// Length of the error, metres.
    pub(super) fn off(&self) -> Option<f64> {
        self.error.map(|e| Vector::from(e).norm())
    }

    /// Whether the shift is stated as determined in each direction.
    pub(super) fn is_determined(&self) -> bool {
        self.error.is_some() && self.sigma.is_none_or(|sigma| sigma <= DETERMINED)
    }
}

/// One case.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct ShiftsRow {
    pub(super) seed: u64,
    pub(super) failed: Option<String>,
    pub(super) things: Vec<ShiftRow>,
    /// Bodies that are reported as changed and are none of the things.
    pub(super) n_invented: usize,
    /// Seconds of the rescan.
    pub(super) seconds: f64,
}

/// Which things a row of the table is about.
type ShiftClass = (&'static str, fn(&ShiftRow) -> bool);

/// The table, and a line for each thing that is off by more than it should be.
pub(super) fn table(rows: &[ShiftsRow]) -> String {
    let all: Vec<&ShiftRow> = rows.iter().flat_map(|row| &row.things).collect();
    let mut out = String::from(
        "| sides that each session sees | things | moved | shift stated | determined | error mm: median, 90 %, most | determined: median, 90 %, most | within 3 sigma | turn °: median, 90 % | turn within 3 sigma |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let classes: [ShiftClass; 6] = [
        ("one of them none", |row| least(row) == 0),
        ("at least one", |row| least(row) == 1),
        ("at least two", |row| least(row) >= 2),
        ("two, and none of them in both", |row| least(row) >= 2 && row.sides[2] == 0),
        ("two, and two of them in both", |row| least(row) >= 2 && row.sides[2] >= 2),
        ("all", |_| true),
    ];
    for (name, is_of) in classes {
        let own: Vec<&ShiftRow> = all.iter().copied().filter(|row| is_of(row)).collect();
        let _ = writeln!(out, "| {name} | {}", line(&own));
    }
    let failed = rows.iter().filter(|row| row.failed.is_some()).count();
    let n_invented: usize = rows.iter().map(|row| row.n_invented).sum();
    let _ = writeln!(
        out,
        "\n{} rescans, {failed} failed, {n_invented} changes that are none of the things",
        rows.len()
    );
    out
}

/// Number of sides that the session sees which sees fewer.
fn least(row: &ShiftRow) -> usize {
    row.sides[0].min(row.sides[1])
}

fn line(rows: &[&ShiftRow]) -> String {
    let moved = rows.iter().filter(|row| row.moved).count();
    let stated: Vec<&&ShiftRow> = rows.iter().filter(|row| row.error.is_some()).collect();
    let known: Vec<&&&ShiftRow> = stated.iter().filter(|row| row.is_determined()).collect();
    let off = |rows: &mut dyn Iterator<Item = f64>| spread(rows.map(|off| 1e3 * off).collect(), 1);
    let turns = stated.iter().filter_map(|row| row.turn_error).map(f64::abs).collect();
    format!(
        "{} | {moved} | {} | {} | {} | {} | {} | {} | {} |",
        rows.len(),
        stated.len(),
        known.len(),
        off(&mut stated.iter().filter_map(|row| row.off())),
        off(&mut known.iter().filter_map(|row| row.off())),
        within(stated.iter().filter_map(|row| row.z)),
        spread(turns, 2),
        within(stated.iter().filter_map(|row| row.turn_z)),
    )
}

/// Median, 90 % quantile and greatest of some numbers.
fn spread(mut values: Vec<f64>, digits: usize) -> String {
    if values.is_empty() {
        return "–".into();
    }
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
    let [median, most_of, most] = [0.5, 0.9, 1.0].map(at);
    format!("{median:.digits$}, {most_of:.digits$}, {most:.digits$}")
}

/// How many errors keep to what is expected of them.
fn within(z: impl Iterator<Item = f64>) -> String {
    let z: Vec<f64> = z.collect();
    let n = z.iter().filter(|z| **z <= EXPECTED).count();
    format!("{n} of {}", z.len())
}
