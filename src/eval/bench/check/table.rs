//! Tables of the path bench for people, and one line per path for programs.

use super::super::sheet;
use super::evidence::{PointCount, PointCounts};
use super::row::{CheckRow, PathRow};
use super::truth::True;
use crate::check::{PathDoubt, PathOutcome};
use contract::{Result, quote};
use std::fmt::Write as _;

/// All outcomes, as columns.
const OUTCOMES: [PathOutcome; 4] =
    [PathOutcome::Free, PathOutcome::Unknown, PathOutcome::Near, PathOutcome::Blocked];

/// Truth of a path, as text.
fn words(of: True) -> &'static str {
    match of {
        True::Free => "keeps the margin, in seen space",
        True::Unseen => "keeps the margin, not all of its space was seen",
        True::Grazes => "nearer than the margin, touches nothing",
        True::Unmet => "nearer than the margin to a wire that no beam met",
        True::Collides => "collides",
    }
}

/// Counts, shares and reasons.
pub(super) fn table(rows: &[CheckRow]) -> String {
    let every: Vec<&PathRow> = rows.iter().flat_map(|r| &r.paths).collect();
    // Of a robot whose posture is not certain nothing is called free.
    let (doubtful, all): (Vec<&PathRow>, Vec<&PathRow>) =
        every.iter().partition(|p| p.doubts.iter().any(|d| d == PathDoubt::Posture.word()));
    let mut out = String::from(
        "| what is true of a path | paths | free | unknown | near | blocked |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for of in [True::Free, True::Unseen, True::Grazes, True::Unmet, True::Collides] {
        let own: Vec<&&PathRow> = all.iter().filter(|p| p.truth == of).collect();
        let n = |outcome| own.iter().filter(|p| p.outcome == outcome).count();
        let counts: Vec<String> = OUTCOMES.iter().map(|o| n(o.word()).to_string()).collect();
        let _ = writeln!(out, "| {} | {} | {} |", words(of), own.len(), counts.join(" | "));
    }
    let count = |is: &dyn Fn(&PathRow) -> bool| all.iter().filter(|p| is(p)).count();
    let seen = count(&|p| p.truth == True::Free);
    let right = count(&|p| p.truth == True::Free && free(p));
    let _ = writeln!(
        out,
        "\n{} cells, {} paths; misses (colliding, called free): {}; free in seen space and called free: {right} of {seen} ({:.1} %); \
         free, called near or blocked: {}; {} robots of {} looked at",
        rows.len(),
        all.len(),
        every.iter().filter(|p| is_missed(p)).count(),
        100.0 * right as f64 / seen.max(1) as f64,
        count(&|p| p.is_wolf()),
        rows.iter().map(|r| r.n_checked).sum::<usize>(),
        rows.iter().map(|r| r.n_robots).sum::<usize>(),
    );
    out += &reasons("\nFree in seen space, and not called free:", &all, &|p: &PathRow| {
        p.truth == True::Free && !free(p)
    });
    out += &reasons("\nNot all seen, and called near or blocked:", &all, &|p: &PathRow| {
        p.truth == True::Unseen && p.is_wolf()
    });
    if !doubtful.is_empty() {
        let n = |is: &dyn Fn(&PathRow) -> bool| doubtful.iter().filter(|p| is(p)).count();
        let _ = writeln!(
            out,
            "\nBesides {} paths of robots whose posture is not certain: {} called free, {} unknown; {} keep the margin in seen space",
            doubtful.len(),
            n(&free),
            n(&|p| p.outcome == PathOutcome::Unknown.word()),
            n(&|p| p.truth == True::Free),
        );
    }
    for path in every.iter().filter(|p| is_missed(p)) {
        let _ = writeln!(out, "MISSED: {}", path.line());
    }
    out += &points(rows);
    for row in rows.iter().filter(|r| r.failed.is_some()) {
        let _ = writeln!(out, "- {}: {}", row.seed, row.failed.as_deref().unwrap_or_default());
    }
    out
}

/// Cells of points by what they lie on.
fn points(rows: &[CheckRow]) -> String {
    let mut all = PointCounts::new();
    for (name, own) in rows.iter().flat_map(|row| &row.points) {
        all.entry(name.clone()).or_default().add(*own);
    }
    if all.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "\n| cells of points on | all | dropped as strays | kept |\n| --- | --- | --- | --- |\n",
    );
    for (name, PointCount { n, n_dropped }) in &all {
        let _ = writeln!(out, "| {name} | {n} | {n_dropped} | {} |", n - n_dropped);
    }
    out
}

fn free(path: &PathRow) -> bool {
    path.outcome == PathOutcome::Free.word()
}

fn is_missed(path: &PathRow) -> bool {
    path.truth == True::Collides && free(path)
}

/// Paths of a kind by what was said of them.
fn reasons(head: &str, all: &[&PathRow], is: &dyn Fn(&PathRow) -> bool) -> String {
    let mut counts = std::collections::BTreeMap::new();
    for path in all.iter().filter(|p| is(p)) {
        *counts.entry(format!("{}: {}", path.outcome, path.why())).or_insert(0_usize) += 1;
    }
    if counts.is_empty() {
        return String::new();
    }
    let mut sorted: Vec<_> = counts.into_iter().collect();
    sorted.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    let lines: String = sorted.iter().map(|(why, n)| format!("- {n} × {why}\n")).collect();
    format!("{head}\n\n{lines}")
}

/// One line a path.
///
/// # Errors
/// `Bug` where a line cannot be written.
pub(super) fn csv(rows: &[CheckRow]) -> Result<String> {
    let columns = [
        "seed", "path", "robot", "model", "drawn", "truth", "gap_m", "nearest", "outcome",
        "doubts", "contacts",
    ];
    let paths = rows.iter().flat_map(|row| row.paths.iter().enumerate().map(move |p| (row, p)));
    let cells = paths.map(|(row, (at, p))| {
        [
            row.seed.to_string(),
            at.to_string(),
            p.robot.to_string(),
            quote::cell(&p.model),
            format!("{:?}", p.drawn),
            format!("{:?}", p.truth),
            format!("{:.4}", p.gap),
            quote::cell(&p.nearest),
            p.outcome.to_string(),
            quote::cell(&p.doubts.join(" ")),
            quote::cell(&p.contacts.join("; ")),
        ]
    });
    sheet::csv(columns, cells)
}
