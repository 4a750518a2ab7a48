//! Tables that do not follow the suites: the paper's Table 1, closed loops, and the basin of
//! convergence.

use super::score::{AccuracyRow, JointRow};
use contract::{Calibration, JointFrame};
use geometry::Pose;
use std::fmt::Write as _;

/// The source's Table 1: three postures of a robot with seven joints, after the sweep and after the
/// registration, degrees.
const PRINTED: [[[f64; 2]; 3]; 7] = [
    [[0.5, 0.002], [-0.3, -0.068], [-0.2, -0.022]],
    [[-0.2, 0.014], [0.4, -0.032], [0.3, 0.014]],
    [[-0.4, -0.058], [-0.1, -0.086], [-0.1, -0.037]],
    [[0.3, 0.212], [0.5, 0.297], [-0.2, -0.131]],
    [[-0.3, -0.241], [-0.8, -0.189], [-0.5, 0.010]],
    [[0.1, -0.002], [-0.7, -0.097], [0.3, 0.139]],
    [[0.2, 0.193], [-0.2, -0.243], [-0.6, -0.539]],
];
/// Postures side by side in a table.
const N_POSTURES: usize = 3;

/// All of them that the rows have something for.
pub(super) fn tables(rows: &[AccuracyRow]) -> String {
    let mut out = table_1(rows);
    out.push_str(&baselines(rows));
    out.push_str(&loops(rows));
    out.push_str(&calibration(rows));
    out.push_str(&basin(rows));
    out
}

/// Errors of each joint as the source prints them, ours beside them in the same cells.
fn table_1(rows: &[AccuracyRow]) -> String {
    let mut out = String::new();
    for model in models(rows, "source") {
        let of = |suite: &str| -> Vec<&AccuracyRow> {
            let own = rows.iter().filter(|r| r.suite == suite && r.model == model);
            own.take(N_POSTURES).collect()
        };
        let (source, ours) = (of("source"), of("paper"));
        let _ = writeln!(
            out,
            "\nErrors in the protocol of the method's source (its Table 1), ° (of what slides mm): {model}\n"
        );
        out.push_str("| joint |");
        for k in 1..=source.len() {
            let _ = write!(out, " {k}: swept | {k}: registered | {k}: ours | {k}: printed |");
        }
        let _ = writeln!(out, "\n|{}", " --- |".repeat(1 + 4 * source.len()));
        let n = source.iter().map(|r| r.joints.len()).max().unwrap_or(0);
        for j in 0..n {
            let name = source.iter().find_map(|r| r.joints.get(j)).map_or("", |joint| &joint.name);
            let _ = write!(out, "| {name} |");
            for (k, row) in source.iter().enumerate() {
                let joint = row.joints.get(j);
                let here = ours.iter().find(|o| o.seed == row.seed).and_then(|o| o.joints.get(j));
                let printed = PRINTED.get(j).map(|p| p[k]);
                let _ = write!(
                    out,
                    " {} | {} | {} | {} |",
                    error(joint, |j| j.rough),
                    error(joint, |j| Some(j.error)),
                    error(here, |j| Some(j.error)),
                    printed.map_or_else(String::new, |[a, b]| format!("{a} / {b}")),
                );
            }
            out.push('\n');
        }
    }
    out
}

/// The ways that are set beside one another, first the product's.
const WAYS: [&str; 5] =
    ["registration", "sequential", "sequential-adjusted", "scans-held", "from-truth"];

/// Errors of the baselines in the cells of `registration` that all methods solved, with the best
/// possible ones, over joints that the product states as determined.
fn baselines(rows: &[AccuracyRow]) -> String {
    let given = |way: &str| rows.iter().any(|r| r.suite == way);
    let ways: Vec<&str> = WAYS.into_iter().filter(|way| given(way)).collect();
    let mut out = String::new();
    if ways.len() < 2 || ways[0] != WAYS[0] {
        return out;
    }
    let of = |way: &str, cell: &AccuracyRow| {
        rows.iter().find(|r| r.suite == way && r.model == cell.model && r.seed == cell.seed)
    };
    let shared =
        |cell: &&AccuracyRow| cell.suite == WAYS[0] && ways.iter().all(|w| of(w, cell).is_some());
    let cells: Vec<&AccuracyRow> = rows.iter().filter(shared).collect();
    out.push_str("\nIn the same cells, over the joints that the product says to be determined; found: model and place are right.\n\n");
    out.push_str(
        "| way | found | rms ° | largest ° | tip mm, largest |\n| --- | --- | --- | --- | --- |\n",
    );
    for way in ways {
        let pairs = cells.iter().filter_map(|ours| Some((of(way, ours)?, *ours)));
        let found: Vec<(&AccuracyRow, &AccuracyRow)> =
            pairs.filter(|(row, _)| row.right_model).collect();
        let joints = found.iter().flat_map(|(row, ours)| row.joints.iter().zip(&ours.joints));
        let known = joints.filter(|(_, ours)| ours.determined && !ours.slides);
        let errors: Vec<f64> = known.map(|(joint, _)| joint.error.abs().to_degrees()).collect();
        let largest = errors.iter().copied().fold(0.0, f64::max);
        let tip = found.iter().map(|(row, _)| row.tip[0] * 1e3).fold(0.0, f64::max);
        let way = if way == WAYS[0] { "the product" } else { way };
        let _ = writeln!(
            out,
            "| {way} | {} of {} | {:.4} | {largest:.4} | {tip:.2} |",
            found.len(),
            cells.len(),
            rms(errors.iter().copied()),
        );
    }
    out
}

/// Links that follow through closed loops.
fn loops(rows: &[AccuracyRow]) -> String {
    let mut out = String::new();
    let each =
        ["loops", "branches"].map(|suite| models(rows, suite).into_iter().map(move |m| (suite, m)));
    for (suite, model) in each.into_iter().flatten() {
        let own = || rows.iter().filter(|r| r.suite == suite && r.model == model && r.right);
        if out.is_empty() {
            out.push_str("\nLinks of closed loops, in the frame of the base, largest over the right fits:\n\n");
            out.push_str("| suite | model | right | turn ° | shift mm | closure m |\n| --- | --- | --- | --- | --- | --- |\n");
        }
        let most = |of: &dyn Fn(&AccuracyRow) -> f64| own().map(of).fold(0.0, f64::max);
        let n = rows.iter().filter(|r| r.suite == suite && r.model == model).count();
        let _ = writeln!(
            out,
            "| {suite} | {model} | {} of {n} | {:.4} | {:.2} | {:.0e} |",
            own().count(),
            most(&|r| r.sub[0].to_degrees()),
            most(&|r| r.sub[1] * 1e3),
            most(&|r| r.loop_gap),
        );
    }
    out
}

/// Errors of calibrated joints, from single postures and from all postures of a robot together.
fn calibration(rows: &[AccuracyRow]) -> String {
    let mut out = String::new();
    for model in models(rows, "calibration") {
        if out.is_empty() {
            out.push_str("\nPlaces of joints against the model, rms over joints:\n\n");
            out.push_str("| model | postures | axis offset, mm: true / one posture / all | axis swing, °: true / one / all | z rms, one / all | joints, rms °: uncorrected / calibrated |\n| --- | --- | --- | --- | --- | --- |\n");
        }
        let own = || rows.iter().filter(|r| r.suite == "calibration" && r.model == model);
        let single: Vec<&(Calibration, Vec<Pose>)> =
            own().filter_map(|r| r.calibration.as_ref()).collect();
        let Some((_, real)) = single.first() else { continue };
        let all = fit::combine(&single.iter().map(|s| &s.0).collect::<Vec<_>>());
        let nothing = Calibration {
            frames: single[0]
                .0
                .frames
                .iter()
                .map(|f| JointFrame { shift: [0.0; 3], turn: [0.0; 3], ..f.clone() })
                .collect(),
            ..Calibration::default()
        };
        let truth = off(&[&nothing], real);
        let one = off(&single.iter().map(|s| &s.0).collect::<Vec<_>>(), real);
        let all = off(&all.iter().collect::<Vec<_>>(), real);
        let angles = |suite: &str| {
            let errors = rows
                .iter()
                .filter(|r| r.suite == suite && r.model == model)
                .flat_map(|r| r.turning());
            rms(errors.map(|j| j.error)).to_degrees()
        };
        let _ = writeln!(
            out,
            "| {model} | {} | {:.2} / {:.2} / {:.2} | {:.3} / {:.3} / {:.3} | {:.2} / {:.2} | {:.3} / {:.3} |",
            single.len(),
            truth[0] * 1e3,
            one[0] * 1e3,
            all[0] * 1e3,
            truth[1].to_degrees(),
            one[1].to_degrees(),
            all[1].to_degrees(),
            one[2],
            all[2],
            angles("frames"),
            angles("calibration"),
        );
    }
    out
}

/// Root mean squares over joints: error of the axis across itself, metres; of its direction,
/// radians; errors over standard deviations.
fn off(found: &[&Calibration], real: &[Pose]) -> [f64; 3] {
    let mut errors: [Vec<f64>; 3] = Default::default();
    for (frame, real) in found.iter().flat_map(|c| c.frames.iter().zip(real)) {
        let (shift, turn) = (real.translation.vector, real.rotation.scaled_axis());
        let error = JointFrame {
            shift: std::array::from_fn(|i| frame.shift[i] - shift[i]),
            turn: std::array::from_fn(|i| frame.turn[i] - turn[i]),
            ..frame.clone()
        };
        errors[0].push(error.offset()[0]);
        errors[1].push(error.swing()[0]);
        let both = error.shift.iter().chain(&error.turn);
        errors[2].extend(both.zip(&frame.sigma).map(|(e, s)| e / s));
    }
    errors.map(|e| rms(e.into_iter()))
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = values.fold((0, 0.0), |(n, sum), v| (n + 1, sum + v * v));
    (sum / f64::from(n.max(1))).sqrt()
}

/// Convergence basin: how close to the truth a search must start.
fn basin(rows: &[AccuracyRow]) -> String {
    let mut steps: Vec<f64> =
        rows.iter().filter(|r| r.n_starts > 0).map(|r| r.perturbed_deg).collect();
    steps.sort_by(f64::total_cmp);
    steps.dedup();
    let mut out = String::new();
    if steps.is_empty() {
        return out;
    }
    out.push_str(
        "\nStarts of the refinement alone that come home (all joints but the last within 0.3° of the truth, or of where \
         the start at it ends):\n\n",
    );
    out.push_str("| every joint off by up to, ° | starts | home |\n| --- | --- | --- |\n");
    for step in steps {
        let own = || rows.iter().filter(|r| r.n_starts > 0 && r.perturbed_deg == step);
        let (n, home) = own().fold((0, 0), |(n, home), r| (n + r.n_starts, home + r.n_home));
        let _ = writeln!(out, "| {step} | {n} | {:.0} % |", 100.0 * home as f64 / n as f64);
    }
    out
}

fn models(rows: &[AccuracyRow], suite: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for row in rows.iter().filter(|r| r.suite == suite) {
        if !out.contains(&row.model) {
            out.push(row.model.clone());
        }
    }
    out
}

fn error(joint: Option<&JointRow>, of: impl Fn(&JointRow) -> Option<f64>) -> String {
    let text = |joint: &JointRow| {
        let value = of(joint)?;
        let turns = || format!("{:.3}", value.to_degrees());
        Some(if joint.slides { format!("{:.3} mm", value * 1e3) } else { turns() })
    };
    joint.and_then(text).unwrap_or_else(|| "–".into())
}
