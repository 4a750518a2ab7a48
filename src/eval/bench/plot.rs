//! Two plots as SVG: the distribution of the errors of each suite, and their comparison with the
//! stated deviations.

use super::score::AccuracyRow;
use std::fmt::Write as _;

/// Size of a picture and its margins, units of the picture.
const SIZE: [f64; 2] = [760.0, 420.0];
const MARGIN: [f64; 2] = [60.0, 40.0];
/// Range of the errors' axis, degrees, logarithmic.
const ERRORS: [f64; 2] = [1e-4, 1.0];
/// Range of the z axis.
const Z: f64 = 4.0;
const COLOURS: [&str; 8] =
    ["#1f77b4", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#8c564b", "#17becf", "#7f7f7f"];

/// Cumulative distribution of the errors of determined joints, suite by suite.
pub(super) fn errors(rows: &[AccuracyRow]) -> String {
    let x = |e: f64| {
        let t = (e.clamp(ERRORS[0], ERRORS[1]) / ERRORS[0]).ln() / (ERRORS[1] / ERRORS[0]).ln();
        MARGIN[0] + t * (SIZE[0] - 2.0 * MARGIN[0] - 100.0)
    };
    let ticks: Vec<(f64, String)> =
        [1e-4, 1e-3, 1e-2, 1e-1, 1.0].iter().map(|e| (x(*e), format!("{e}°"))).collect();
    let series = suites(rows).into_iter().map(|suite| {
        let own = rows.iter().filter(|r| r.suite == suite && r.right);
        let errors = own.flat_map(|r| r.turning().map(|j| j.error.abs().to_degrees()));
        let errors = errors.collect();
        (suite, errors)
    });
    picture("share of determined joints against error", &ticks, series.collect(), x)
}

/// Cumulative distribution of error over stated deviation of determined joints; the last line is
/// the ideal one.
pub(super) fn reliability(rows: &[AccuracyRow]) -> String {
    let x = |z: f64| MARGIN[0] + z.clamp(0.0, Z) / Z * (SIZE[0] - 2.0 * MARGIN[0] - 100.0);
    let ticks: Vec<(f64, String)> = (0..=4).map(|z| (x(f64::from(z)), z.to_string())).collect();
    let mut series: Vec<(String, Vec<f64>)> = suites(rows)
        .into_iter()
        .map(|suite| {
            let own = rows.iter().filter(|r| r.suite == suite && r.right);
            let z = own.flat_map(|r| r.determined().map(|j| (j.error / j.sigma).abs()));
            let z = z.collect();
            (suite, z)
        })
        .collect();
    series.push(("normal".into(), normal()));
    picture("share of determined joints against error / stated σ", &ticks, series, x)
}

fn suites(rows: &[AccuracyRow]) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for row in rows.iter().filter(|r| r.n_starts == 0 && !r.is_baseline) {
        if !out.contains(&row.suite) {
            out.push(row.suite.clone());
        }
    }
    out
}

/// Sizes of standard normal numbers at even shares, by bisection of the error function's series.
fn normal() -> Vec<f64> {
    let share = |z: f64| {
        // Integral of the density by Simpson's rule.
        let n = 64;
        let h = z / f64::from(n);
        let f = |k: i32| (-0.5 * (f64::from(k) * h).powi(2)).exp();
        let sum: f64 = (0..=n)
            .map(|k| f(k) * if k == 0 || k == n { 1.0 } else { f64::from(2 + 2 * (k % 2)) })
            .sum();
        sum * h / 3.0 * (2.0 / std::f64::consts::PI).sqrt()
    };
    let value = |k: i32| {
        let wanted = (f64::from(k) + 0.5) / 200.0;
        let (mut low, mut high) = (0.0, 2.0 * Z);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if share(middle) < wanted { low = middle } else { high = middle }
        }
        low
    };
    (0..200).map(value).collect()
}

/// Cumulative shares as lines, with a legend.
fn picture(
    title: &str,
    ticks: &[(f64, String)],
    series: Vec<(String, Vec<f64>)>,
    x: impl Fn(f64) -> f64,
) -> String {
    let [width, height] = SIZE;
    let y = |share: f64| height - MARGIN[1] - share * (height - 2.0 * MARGIN[1]);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n\
         <text x=\"{}\" y=\"20\" font-size=\"13\">{title}</text>\n",
        MARGIN[0]
    );
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let _ = writeln!(
            out,
            "<path d=\"M{} {:.1}H{}\" stroke=\"#ddd\"/><text x=\"20\" y=\"{:.1}\">{} %</text>",
            MARGIN[0],
            y(share),
            width - MARGIN[0] - 100.0,
            y(share) + 4.0,
            share * 100.0
        );
    }
    for (at, text) in ticks {
        let _ = writeln!(
            out,
            "<path d=\"M{at:.1} {:.1}V{:.1}\" stroke=\"#ddd\"/><text x=\"{at:.1}\" y=\"{:.1}\" \
             text-anchor=\"middle\">{text}</text>",
            y(0.0),
            y(1.0),
            height - 18.0
        );
    }
    for (i, (name, mut values)) in series.into_iter().enumerate() {
        if values.is_empty() {
            continue;
        }
        values.sort_by(f64::total_cmp);
        let n = values.len() as f64;
        let points: Vec<String> = (0_i32..)
            .zip(&values)
            .map(|(k, v)| format!("{:.1},{:.1}", x(*v), y((f64::from(k) + 1.0) / n)))
            .collect();
        let colour = COLOURS[i % COLOURS.len()];
        let dash = if i >= COLOURS.len() { " stroke-dasharray=\"5 3\"" } else { "" };
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"{dash}/>\
             <text x=\"{}\" y=\"{}\" fill=\"{colour}\">{name}</text>",
            points.join(" "),
            width - MARGIN[0] - 90.0,
            MARGIN[1] + 16.0 * i as f64
        );
    }
    out.push_str("</svg>\n");
    out
}
