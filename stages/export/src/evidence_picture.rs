//! Draws the review page of one robot, for a check at a glance: distances of its points from the
//! fitted surface, each joint within its limits, the evidence for each link, verdict and runner-up.

use crate::canvas::{Canvas, INK, Rgb};
use crate::font::{
    self,
    TextSize::{Body, Title},
};
use crate::robot_picture::{FULL, RobotPicture, residual_color};
use contract::words::Unit;
use contract::{Certainty, Fit, Verdict};
use robot::{Joint, JointKind, Model};

/// Width of the page, pixels.
const WIDTH: i64 = 1126;
const SIDE: i64 = 560;
/// Height of a line, pixels.
const LINE: i64 = 16;
/// Left end and width of the bar that shows a joint's limits, pixels.
const BAR: (i64, i64) = (190, 240);
/// Left end of the table of links, pixels.
const LINKS: i64 = 700;
/// Columns of that table: head, and right end, pixels.
const COLUMNS: [(&str, i64); 4] =
    [("seen", 900), ("seen through", 990), ("rms mm", 1055), ("points", 1115)];
/// Range that is drawn for a joint without limits, radians: a turn to each side.
const NO_LIMITS: [f64; 2] = [-std::f64::consts::TAU, std::f64::consts::TAU];
/// Number of characters of a line across the page.
const INDENT: i64 = 24;
const GREY: Rgb = [96, 102, 110];
const PALE: Rgb = [226, 229, 234];
const RED: Rgb = [196, 30, 40];
const AMBER: Rgb = [176, 106, 0];
const BLUE: Rgb = [0, 90, 170];

/// Draws the review page; `title` names robot, model and verdict.
#[must_use]
pub fn draw_evidence(title: &str, picture: &RobotPicture, fit: &Fit, model: &Model) -> Canvas {
    let words = words(fit);
    let n_rows = fit.joints.len().max(fit.links.len()) as i64;
    let top = 36 + SIDE + 40;
    let height = top + LINE * (n_rows + 3 + words.len() as i64) + 10;
    let mut canvas = Canvas::new(WIDTH as usize, height as usize);
    canvas.text(8, 10, Title, verdict_color(fit.verdict), title);
    for (i, view) in picture.residuals().iter().enumerate() {
        canvas.paste(i as i64 * (SIDE + 6), 36, view);
    }
    scale(&mut canvas, 36 + SIDE + 6);
    canvas.text(8, top, Body, GREY, "joint");
    canvas.text(BAR.0, top, Body, GREY, "lower limit .. upper limit");
    canvas.text(BAR.0 + BAR.1 + 12, top, Body, GREY, "value, std. dev.");
    for (i, joint) in fit.joints.iter().enumerate() {
        let own = model.joints.iter().find(|j| j.name == joint.name);
        if let Some(own) = own {
            row(&mut canvas, top + LINE * (i as i64 + 1), fit, i, own);
        }
    }
    links(&mut canvas, top, fit);
    for (i, (indent, line)) in words.iter().enumerate() {
        canvas.text(8 + indent, top + LINE * (n_rows + 2 + i as i64), Body, INK, line);
    }
    canvas
}

/// The table of links: the evidence of the scans for each.
fn links(canvas: &mut Canvas, top: i64, fit: &Fit) {
    canvas.text(LINKS, top, Body, GREY, "link");
    for (head, right) in COLUMNS {
        canvas.text_to(right, top, Body, GREY, head);
    }
    let room = (COLUMNS[0].1 - LINKS - 50) as f32;
    for (i, link) in fit.links.iter().enumerate() {
        let y = top + LINE * (i as i64 + 1);
        let color = if link.violated > 0.1 { RED } else { INK };
        canvas.text(LINKS, y, Body, color, &font::shortened(Body, &link.name, room));
        let cells = [
            format!("{:.0} %", 100.0 * link.seen),
            format!("{:.1} %", 100.0 * link.violated),
            format!("{:.1}", 1e3 * link.rms),
            link.n_points.to_string(),
        ];
        for (cell, (_, right)) in cells.iter().zip(COLUMNS) {
            canvas.text_to(right, y, Body, color, cell);
        }
    }
}

fn verdict_color(verdict: Verdict) -> Rgb {
    match verdict {
        Verdict::Trusted => [20, 110, 60],
        Verdict::Doubtful => AMBER,
        Verdict::Refused => RED,
    }
}

fn certainty_color(certainty: Certainty) -> Rgb {
    match certainty {
        Certainty::Determined => BLUE,
        Certainty::Coarse => AMBER,
        Certainty::Undetermined => RED,
    }
}

/// Draws one joint: a bar for its limits, the value with its standard deviation, and other values
/// that fit as well.
fn row(canvas: &mut Canvas, y: i64, fit: &Fit, at: usize, own: &Joint) {
    let joint = &fit.joints[at];
    let [low, high] = own.limits.unwrap_or(NO_LIMITS);
    let place = |value: f64| {
        let share = ((value - low) / (high - low).max(1e-9)).clamp(0.0, 1.0);
        BAR.0 + (share * BAR.1 as f64).round() as i64
    };
    let name = font::shortened(Body, &joint.name, (BAR.0 - 20) as f32);
    canvas.text(8, y, Body, INK, &name);
    canvas.fill(BAR.0, y + 3, BAR.1, 3, PALE);
    for equal in &fit.equals {
        canvas.fill(place(equal.posture[at]), y, 2, 9, GREY);
    }
    let (from, to) = (place(joint.value - joint.sigma), place(joint.value + joint.sigma));
    let color = certainty_color(joint.certainty);
    canvas.fill(from, y + 2, (to - from).max(1), 5, color);
    canvas.fill(place(joint.value) - 1, y - 1, 3, 11, color);
    let unit = Unit::of(own.kind == JointKind::Prismatic);
    let words = unit.say_both(joint.value, joint.sigma) + joint.certainty.note();
    canvas.text(BAR.0 + BAR.1 + 12, y, Body, color, &words);
}

/// Draws the legend of the residual colours.
fn scale(canvas: &mut Canvas, y: i64) {
    let n = 21;
    for i in 0..n {
        let off = FULL * (2.0 * i as f32 / (n - 1) as f32 - 1.0);
        canvas.fill(60 + 12 * i, y, 12, 10, residual_color(off));
    }
    let full = format!("{:.0} mm", FULL * 1e3);
    canvas.text(8, y, Body, GREY, &format!("-{full}"));
    canvas.text(60 + 12 * n + 6, y, Body, GREY, &format!("+{full} before the surface"));
}

/// Verdict, reasons and runner-up, wrapped to the width of the page.
fn words(fit: &Fit) -> Vec<(i64, String)> {
    let mut all = vec![format!(
        "{}: score {:.3}, rms {:.2} mm",
        fit.verdict.word(),
        fit.score,
        1e3 * fit.rms
    )];
    all.extend(fit.reasons.iter().cloned());
    if let Some(other) = &fit.runner_up {
        let whose = if other.same_model { "another posture of " } else { "" };
        all.push(format!(
            "runner-up: {whose}{}, score {:.3}, margin {:.2}",
            other.model, other.score, other.margin
        ));
    }
    all.iter().flat_map(|text| wrapped(text)).collect()
}

/// A sentence in lines that are as wide as the page at most.
fn wrapped(text: &str) -> Vec<(i64, String)> {
    let mut lines = vec![(0, String::new())];
    for word in text.split_whitespace() {
        let last = lines.len() - 1;
        let (indent, line) = &mut lines[last];
        let longer = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
        let fits = *indent + Canvas::text_width(Body, &longer) <= WIDTH - 16;
        if fits || line.is_empty() {
            *line = longer;
        } else {
            lines.push((INDENT, word.to_owned()));
        }
    }
    lines
}
