//! Figures of labels by what the points truly lie on: links, tools, carried parts, hoses, and what
//! stands still.

use crate::eval::compare::Agreement;
use serde::Serialize;
use std::fmt::Write as _;

/// Counts of points of one kind: all, said to move, left open.
pub(super) type KindCount = [u64; 3];

/// Counts of a case by kind.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct KindScores {
    /// Robots, with the tools of their models.
    pub(super) robots: KindCount,
    pub(super) tools: KindCount,
    pub(super) carried: KindCount,
    pub(super) hoses: KindCount,
    pub(super) fixed: KindCount,
    /// Share of the points that move among those that are said to.
    pub(super) precision: f64,
}

/// Beginnings of the names of objects that move.
const MOVING: [&str; 4] = ["robot ", "tool of ", "carried ", "hose "];

/// Whether an object of a scene moves, by its name.
pub(super) fn moves(object: &str) -> bool {
    MOVING.iter().any(|kind| object.starts_with(kind))
}

impl KindScores {
    /// The counts of a comparison.
    pub(super) fn of(agreement: &Agreement) -> Self {
        let mut out = Self::default();
        for (name, count) in agreement.objects.iter().zip(&agreement.by_object) {
            let kind = match MOVING.iter().position(|kind| name.starts_with(kind)) {
                Some(0) => &mut out.robots,
                Some(1) => &mut out.tools,
                Some(2) => &mut out.carried,
                Some(_) => &mut out.hoses,
                None => &mut out.fixed,
            };
            kind.iter_mut().zip(count).for_each(|(sum, n)| *sum += n);
        }
        let [hit, _, wrong, _] = agreement.points.moving;
        out.precision = hit as f64 / (hit + wrong).max(1) as f64;
        out
    }

    fn kinds(&self) -> [KindCount; 5] {
        [self.robots, self.tools, self.carried, self.hoses, self.fixed]
    }
}

/// A table of the shares by kind, a line a suite; empty where no suite has points.
pub(super) fn kind_table<'a>(
    suites: impl Iterator<Item = (&'static str, Vec<(&'a KindScores, f64)>)>,
) -> String {
    let mut lines = String::new();
    for (name, rows) in suites.filter(|(_, rows)| !rows.is_empty()) {
        let _ = write!(lines, "| {name} ");
        let mut f1: Vec<f64> = rows.iter().map(|row| row.1).collect();
        f1.sort_by(f64::total_cmp);
        let precision: Vec<f64> = rows.iter().map(|row| row.0.precision).collect();
        let least = precision.iter().copied().fold(1.0, f64::min);
        let _ = write!(lines, "| {:.4} / {:.4} | {least:.4} ", at(&f1, 0.5), at(&f1, 0.1));
        for kind in 0..5 {
            let counts: Vec<KindCount> = rows.iter().map(|row| row.0.kinds()[kind]).collect();
            let _ = write!(lines, "| {} ", shares(&counts, kind == 4));
        }
        lines.push_str("|\n");
    }
    if lines.is_empty() {
        return lines;
    }
    format!(
        "\n| suite | F1 median / worst tenth | least precision | robots | tools | carried | hoses | fixed |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n{lines}\n\
         By what the points truly lie on: the share that is said to move in all cases together, in \
         the median and in the worst tenth of the cases, and the share that is left open; for what \
         stands still the shares in %.\n"
    )
}

/// The shares of one kind: said to move, whole, median and worst tenth, and left open.
fn shares(counts: &[KindCount], is_fixed: bool) -> String {
    let sum = |k: usize| counts.iter().map(|count| count[k]).sum::<u64>();
    let mut each: Vec<f64> = counts
        .iter()
        .filter(|count| count[0] > 0)
        .map(|count| count[1] as f64 / count[0] as f64)
        .collect();
    if each.is_empty() {
        return "–".into();
    }
    each.sort_by(f64::total_cmp);
    let whole = sum(1) as f64 / sum(0) as f64;
    let open = sum(2) as f64 / sum(0) as f64;
    if is_fixed {
        let shares = [whole, at(&each, 0.5), at(&each, 0.9), open].map(|v| 100.0 * v);
        return format!(
            "{:.4} ({:.4}, {:.4}), open {:.3}",
            shares[0], shares[1], shares[2], shares[3]
        );
    }
    format!("{whole:.3} ({:.3}, {:.3}), open {open:.3}", at(&each, 0.5), at(&each, 0.1))
}

/// The value at a share of a sorted list; 0 for an empty one.
fn at(sorted: &[f64], share: f64) -> f64 {
    let index = ((sorted.len() as f64 - 1.0) * share).round().max(0.0) as usize;
    sorted.get(index).copied().unwrap_or_default()
}
