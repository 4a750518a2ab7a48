//! Tables of the accuracy bench for people and for programs.

use super::labels::{LabelScores, share_of};
use super::score::AccuracyRow;
use super::sheet;
use contract::{Result, quote};
use std::fmt::Write as _;

/// One line a suite: what was found, how exact it is, whether standard deviations and verdicts
/// hold.
pub(super) fn table(rows: &[AccuracyRow]) -> String {
    let mut out = String::from(
        "| suite | cases | found | model | right | trusted | wrong, trusted | invented | rms ° | max ° | median worst ° \
         | base mm | tip mm | tip, world mm | surface mm | z rms | z > 3 \
         | link IoU | hoses % | lost % | s |\n",
    );
    out.push_str(&format!("|{}\n", " --- |".repeat(21)));
    let rows: Vec<&AccuracyRow> = rows.iter().filter(|r| r.n_starts == 0).collect();
    let mut suites: Vec<&str> = Vec::new();
    for row in &rows {
        if !suites.contains(&row.suite.as_str()) {
            suites.push(&row.suite);
        }
    }
    for suite in suites {
        let own: Vec<&AccuracyRow> = rows.iter().copied().filter(|r| r.suite == suite).collect();
        line(&mut out, suite, &own);
    }
    // A baseline's figures are not the product's.
    let ours: Vec<&AccuracyRow> = rows.iter().copied().filter(|r| !r.is_baseline).collect();
    line(&mut out, "**whole**", &ours);
    out.push_str(
        "\nErrors of the joints that a fit says the points determine, over the right fits; base, tip (in the base's frame, \
         and in the world) and 95 % of the surface: medians / largest; z: error over stated standard deviation. Labels, median / worst: intersection over \
         union of links, share of hoses' points said to move, share of fixed points said to move.\n",
    );
    let wrong: Vec<&AccuracyRow> =
        ours.into_iter().filter(|r| !r.right || r.n_invented > 0).collect();
    if !wrong.is_empty() {
        out.push_str("\nNot right, or with a robot too many:\n\n");
        wrong.iter().for_each(|row| {
            let _ = writeln!(out, "- {}", row.line());
        });
    }
    out
}

fn line(out: &mut String, name: &str, rows: &[&AccuracyRow]) {
    let n = |what: &dyn Fn(&AccuracyRow) -> bool| rows.iter().filter(|r| what(r)).count();
    let trusted = |r: &AccuracyRow| r.verdict == "trusted";
    let right: Vec<&AccuracyRow> = rows.iter().copied().filter(|r| r.right).collect();
    let errors: Vec<f64> = degrees(&right, |r| r.turning().map(|j| j.error.to_degrees()).collect());
    let z: Vec<f64> = degrees(&right, |r| r.determined().map(|j| j.error / j.sigma).collect());
    let rms = |v: &[f64]| (v.iter().fold(0.0, |sum, x| sum + x * x) / v.len().max(1) as f64).sqrt();
    let largest = |v: &[f64]| v.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let millimetres = |what: &dyn Fn(&AccuracyRow) -> f64| {
        let mut v: Vec<f64> = right.iter().map(|r| what(r) * 1e3).collect();
        format!("{:.2} / {:.2}", median(&mut v), largest(&v))
    };
    let mut worst: Vec<f64> = right.iter().map(|r| r.worst().to_degrees()).collect();
    let mut seconds: Vec<f64> = rows.iter().map(|r| r.seconds).collect();
    let share = z.iter().filter(|z| z.abs() > 3.0).count() as f64 / z.len().max(1) as f64;
    let _ = writeln!(
        out,
        "| {name} | {} | {} | {} | {} | {} | {} | {} | {:.4} | {:.4} | {:.4} | {} | {} | {} | {} | {:.2} | {:.1} % | {} | {} | {} | {:.1} |",
        rows.len(),
        n(&|r| r.found.is_some()),
        n(&|r| r.right_model),
        right.len(),
        n(&|r| r.right && trusted(r)),
        n(&|r| !r.right && trusted(r)),
        rows.iter().map(|r| r.n_invented).sum::<usize>(),
        rms(&errors),
        largest(&errors),
        median(&mut worst),
        millimetres(&|r| r.base[0]),
        millimetres(&|r| r.tip[0]),
        millimetres(&|r| r.tip[1]),
        millimetres(&|r| r.surface[1]),
        rms(&z),
        share * 100.0,
        shares(scores(&right, |t| t.links.clone()), f64::min, 1.0, 4),
        shares(scores(&right, |t| share_of(t.hoses).into_iter().collect()), f64::min, 100.0, 2),
        shares(
            scores(rows, |t| share_of([t.fixed[1], t.fixed[0]]).into_iter().collect()),
            f64::max,
            100.0,
            4
        ),
        median(&mut seconds),
    );
}

fn degrees(rows: &[&AccuracyRow], each: impl Fn(&AccuracyRow) -> Vec<f64>) -> Vec<f64> {
    rows.iter().flat_map(|r| each(r)).collect()
}

/// Figures of the labels of each case.
fn scores(rows: &[&AccuracyRow], each: impl Fn(&LabelScores) -> Vec<f64>) -> Vec<f64> {
    rows.iter().filter_map(|r| r.labels.as_ref()).flat_map(each).collect()
}

/// Median and worst of shares, multiplied by a factor; a dash without shares.
fn shares(
    mut values: Vec<f64>,
    worst: impl Fn(f64, f64) -> f64,
    factor: f64,
    digits: usize,
) -> String {
    let Some(end) = values.iter().copied().reduce(worst) else { return "–".into() };
    format!("{:.digits$} / {:.digits$}", factor * median(&mut values), factor * end)
}

fn median(values: &mut [f64]) -> f64 {
    geometry::robust::median(values).unwrap_or(0.0)
}

/// One line a joint.
///
/// # Errors
/// `Bug` where a line cannot be written.
pub(super) fn csv(rows: &[AccuracyRow]) -> Result<String> {
    let columns = [
        "suite",
        "model",
        "seed",
        "scanners",
        "robot_points",
        "found",
        "verdict",
        "right",
        "joint",
        "truth",
        "error",
        "sigma",
        "determined",
    ];
    let joints = rows.iter().flat_map(|row| row.joints.iter().map(move |joint| (row, joint)));
    let cells = joints.map(|(row, joint)| {
        [
            row.suite.clone(),
            quote::cell(&row.model),
            row.seed.to_string(),
            row.n_scanners.to_string(),
            row.n_robot_points.to_string(),
            quote::cell(row.found.as_deref().unwrap_or("")),
            row.verdict.clone(),
            row.right.to_string(),
            quote::cell(&joint.name),
            joint.truth.to_string(),
            joint.error.to_string(),
            joint.sigma.to_string(),
            joint.determined.to_string(),
        ]
    });
    sheet::csv(columns, cells)
}
