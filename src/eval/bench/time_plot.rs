//! Plot of run time against number of points, as SVG with logarithmic axes.

use std::fmt::Write as _;

/// Size of the picture and its margins, units of the picture.
const SIZE: [f64; 2] = [760.0, 420.0];
const MARGIN: f64 = 60.0;

/// A line for the runs and one for copies of their files; points, seconds, seconds of the copy.
pub(super) fn plot(rows: &[[f64; 3]]) -> String {
    let span = |of: &dyn Fn(&[f64; 3]) -> Vec<f64>| {
        let all: Vec<f64> = rows.iter().flat_map(of).filter(|v| *v > 0.0).collect();
        let low = all.iter().copied().fold(f64::MAX, f64::min).log10().floor();
        let high = all.iter().copied().fold(1e-9, f64::max).log10().ceil();
        if all.is_empty() { [0.0, 1.0] } else { [low, high.max(low + 1.0)] }
    };
    let (across, up) = (span(&|r| vec![r[0]]), span(&|r| vec![r[1], r[2]]));
    let place = |value: f64, span: [f64; 2], length: f64| {
        (value.max(1e-9).log10() - span[0]) / (span[1] - span[0]) * (length - 2.0 * MARGIN)
    };
    let x = |n: f64| MARGIN + place(n, across, SIZE[0]);
    let y = |s: f64| SIZE[1] - MARGIN - place(s, up, SIZE[1]);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"{}\" height=\"{}\" fill=\"white\"/>\n<text x=\"{MARGIN}\" y=\"24\" font-size=\"13\">time against \
         points</text>\n",
        SIZE[0], SIZE[1], SIZE[0], SIZE[1]
    );
    for power in across[0] as i32..=across[1] as i32 {
        let (at, bottom) = (x(10_f64.powi(power)), SIZE[1] - MARGIN);
        let _ = writeln!(
            out,
            "<path d=\"M{at:.1} {MARGIN}V{bottom}\" stroke=\"#ddd\"/><text x=\"{:.1}\" y=\"{}\">1e{power} points</text>",
            at - 20.0,
            bottom + 18.0
        );
    }
    for power in up[0] as i32..=up[1] as i32 {
        let at = y(10_f64.powi(power));
        let _ = writeln!(
            out,
            "<path d=\"M{MARGIN} {at:.1}H{}\" stroke=\"#ddd\"/><text x=\"12\" y=\"{:.1}\">1e{power} s</text>",
            SIZE[0] - MARGIN,
            at + 4.0
        );
    }
    for (column, color, name) in [(1, "#1f77b4", "run"), (2, "#d62728", "copy of the file")] {
        let places: Vec<String> =
            rows.iter().map(|r| format!("{:.1} {:.1}", x(r[0]), y(r[column]))).collect();
        let _ = writeln!(
            out,
            "<path d=\"M{}\" stroke=\"{color}\" fill=\"none\" stroke-width=\"2\"/>\
             <text x=\"{}\" y=\"{}\" fill=\"{color}\">{name}</text>",
            places.join("L"),
            SIZE[0] - 2.4 * MARGIN,
            24 + 16 * column
        );
        for row in rows {
            let _ = writeln!(
                out,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"{color}\"/>",
                x(row[0]),
                y(row[column])
            );
        }
    }
    out.push_str("</svg>\n");
    out
}
