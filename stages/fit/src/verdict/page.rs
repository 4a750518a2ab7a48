//! Writes the part of METHOD.md §15 that is made from the table of verdict rules, in Markdown.

use contract::Verdict;
use contract::words::Unit;

use super::rule::{
    AlsoAsked, EventRow, Limit, Property, Quantity, RowOutcome, Scale, Test, Threshold,
    VerdictChange, VerdictRow,
};
use super::table::{EVENTS, RULES};
use super::thresholds::{KNOWN_SIGMA, MOST_EXCUSED_NOISE, STOP_PLAY};

/// All numbers that rules ask for, in the order of the page.
const QUANTITIES: [Quantity; 20] = [
    Quantity::Score,
    Quantity::Violation,
    Quantity::Seen,
    Quantity::Points,
    Quantity::Rms,
    Quantity::Noise,
    Quantity::ExcusedNoise,
    Quantity::HeldJoints,
    Quantity::KnownJoints,
    Quantity::KnownButLast,
    Quantity::DeterminedJoints,
    Quantity::Margin,
    Quantity::LinkSeen,
    Quantity::LinkViolation,
    Quantity::JointPoints,
    Quantity::JointSigma,
    Quantity::JointOwnSigma,
    Quantity::BeyondLimit,
    Quantity::AgreeingScans,
    Quantity::OtherExplained,
];

/// The tables of rules, events, evidence and thresholds.
pub(super) fn page() -> String {
    let mut out = String::from(
        "**Rules.** Each is asked of the robot, of each link or of each joint; the first row of a \
         rule that holds counts.\nRows marked *before the report* are also asked before a fit is \
         worth a report, and end it. A rescan asks the rows\nmarked *contradiction* alone: if \
         none holds, a doubtful fit is doubtful because too little of it was seen.\n\n\
         | rule | holds when | then | unless | sentence |\n| --- | --- | --- | --- | --- |\n",
    );
    for rule in RULES {
        for (k, row) in rule.rows.iter().enumerate() {
            let name = if k == 0 { rule.name } else { "" };
            out += &rule_row(name, row);
        }
    }
    out += "\n**Exemptions** (the column *unless*):\n\n";
    for why in exemptions() {
        out += &why;
    }
    out += "\n**Events** are found out later and change the verdict that the rules gave.\n\n\
            | event | when | verdict | sentence | why |\n| --- | --- | --- | --- | --- |\n";
    for event in EVENTS {
        out += &event_row(event);
    }
    out += "\n**Evidence.**\n\n| name | is |\n| --- | --- |\n";
    for quantity in QUANTITIES {
        out += &format!("| `{}` | {} |\n", name(quantity), meaning(quantity));
    }
    out += "\n**Thresholds.**\n\n| evidence | threshold | why |\n| --- | --- | --- |\n";
    for (test, threshold) in thresholds() {
        out += &format!("| {} | `{}` | {} |\n", said(&test), threshold.name, threshold.why);
    }
    out
}

fn rule_row(rule: &str, row: &VerdictRow) -> String {
    let outcome = match row.outcome {
        RowOutcome::Refused => "refused",
        RowOutcome::Doubtful => "doubtful",
        RowOutcome::Note => "a note",
    };
    let also = row.also.iter().map(|also| match also {
        AlsoAsked::BeforeReport => " (before the report)",
        AlsoAsked::Contradicts => " (contradiction)",
    });
    let unless: Vec<String> = row.unless.iter().map(|e| said(&e.case)).collect();
    format!(
        "| {rule} | {} | {outcome}{} | {} | {} |\n",
        all(row.when),
        also.collect::<String>(),
        unless.join(", or "),
        row.sentence
    )
}

/// Each case once, with its reason.
fn exemptions() -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for exemption in RULES.iter().flat_map(|rule| rule.rows).flat_map(|row| row.unless) {
        let line = format!("- {}: {}.\n", said(&exemption.case), exemption.why);
        if !out.contains(&line) {
            out.push(line);
        }
    }
    out
}

fn event_row(row: &EventRow) -> String {
    let carried =
        |verdict: Option<Verdict>| verdict.map_or("the verdict that it carries", Verdict::word);
    let change = match row.change {
        VerdictChange::Set(verdict) => format!("{}, earlier reasons go", verdict.word()),
        VerdictChange::AtMost(verdict) => format!("at most {}", carried(verdict)),
        VerdictChange::AtLeast(verdict) => format!("at least {}", carried(verdict)),
    };
    let sentence = if row.sentence.is_empty() { "–" } else { row.sentence };
    format!("| {} | {} | {change} | {sentence} | {} |\n", row.event, all(row.when), row.why)
}

/// Each test of a number with its threshold once, in the order of the table.
fn thresholds() -> Vec<(Test, Threshold)> {
    let of_rules = RULES.iter().flat_map(|rule| rule.rows).flat_map(|row| row.when);
    let of_events = EVENTS.iter().flat_map(|row| row.when);
    let mut out: Vec<(Test, Threshold)> = Vec::new();
    for test in of_rules.chain(of_events) {
        let (Test::Below(_, threshold) | Test::AtMost(_, threshold) | Test::Above(_, threshold)) =
            test
        else {
            continue;
        };
        if out.iter().all(|(known, _)| known != test) {
            out.push((*test, *threshold));
        }
    }
    out
}

fn all(tests: &[Test]) -> String {
    tests.iter().map(said).collect::<Vec<_>>().join(", and ")
}

fn said(test: &Test) -> String {
    let compared = |sign: &str, quantity: Quantity, than: &Threshold| {
        format!("`{}` {sign} {}", name(quantity), value(than))
    };
    match test {
        Test::Below(quantity, than) => compared("<", *quantity, than),
        Test::AtMost(quantity, than) => compared("≤", *quantity, than),
        Test::Above(quantity, than) => compared(">", *quantity, than),
        Test::Is(property) => holds(*property).into(),
        Test::IsNot(property) => holds_not(*property).into(),
    }
}

fn value(threshold: &Threshold) -> String {
    let fixed = |value: f64| scaled(value, threshold.scale);
    match threshold.limit {
        Limit::Fixed(value) => fixed(value),
        Limit::Multiple { of, times, beyond: 0.0 } => format!("{times} `{}`", name(of)),
        Limit::Multiple { of, times, beyond } => {
            format!("{times} `{}` + {}", name(of), fixed(beyond))
        }
        Limit::Larger { fixed: least, of, times } => {
            format!("the larger of {} and {times} `{}`", fixed(least), name(of))
        }
    }
}

/// A value as people read it, without zeros at the end.
fn scaled(value: f64, scale: Scale) -> String {
    let plain = |value: f64, decimals: usize| {
        let text = format!("{value:.decimals$}");
        let text = if text.contains('.') { text.trim_end_matches('0') } else { &text };
        text.trim_end_matches('.').to_owned()
    };
    match scale {
        Scale::Plain => format!("{value:.2}"),
        Scale::Share => plain(value * 100.0, 1) + " %",
        Scale::Length => plain(value * 1e3, 1) + " mm",
        Scale::Joint if value == 0.0 => "0".into(),
        Scale::Joint => {
            let Unit { factor, .. } = Unit::DEGREES;
            format!("{}° or {} mm", plain(value * factor, 1), plain(value * 1e3, 1))
        }
        Scale::Count => plain(value, 0),
    }
}

fn name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Score => "score",
        Quantity::Violation => "violation",
        Quantity::Seen => "seen",
        Quantity::Points => "points",
        Quantity::Rms => "rms",
        Quantity::Noise => "σ_r",
        Quantity::ExcusedNoise => "excused_noise",
        Quantity::HeldJoints => "held_joints",
        Quantity::KnownJoints => "known_joints",
        Quantity::KnownButLast => "known_but_last",
        Quantity::DeterminedJoints => "determined_joints",
        Quantity::Margin => "margin",
        Quantity::LinkSeen => "link_seen",
        Quantity::LinkViolation => "link_violation",
        Quantity::JointPoints => "joint_points",
        Quantity::JointSigma => "sigma",
        Quantity::JointOwnSigma => "own_sigma",
        Quantity::BeyondLimit => "beyond_limit",
        Quantity::AgreeingScans => "agreeing_scans",
        Quantity::OtherExplained => "other_explained",
    }
}

fn meaning(quantity: Quantity) -> String {
    let known = scaled(KNOWN_SIGMA, Scale::Joint);
    match quantity {
        Quantity::Score => {
            "share of the judged surface that is explained, less 1.5 × the share contradicted \
             (§8)"
                .into()
        }
        Quantity::Violation => "share of the judged surface that beams went through".into(),
        Quantity::Seen => "share of the surface that could be judged".into(),
        Quantity::Points => "points on all links".into(),
        Quantity::Rms => "RMS distance of the points from the surface".into(),
        Quantity::Noise => "noise of the scene's ranges (§3)".into(),
        Quantity::ExcusedNoise => format!(
            "`σ_r`; at most {} of it where no depth camera measured: in a corridor scanned with 9 \
             mm, walls and cabinets had room for four small arms, 9.5 to 11.6 mm off",
            scaled(MOST_EXCUSED_NOISE, Scale::Length)
        ),
        Quantity::HeldJoints => format!(
            "share of the joints with σ < {known} by the scatter of the points alone, before a \
             camera's errors of shape widen it"
        ),
        Quantity::KnownJoints => format!("share of the joints with `sigma` < {known}"),
        Quantity::KnownButLast => "the same of all joints but the last".into(),
        Quantity::DeterminedJoints => format!(
            "share of the joints that are determined (by default σ < {:.3}°, and no other \
             value as good)",
            contract::DETERMINED_SIGMA.to_degrees()
        ),
        Quantity::Margin => {
            "how clearly the beams prefer the posture to the best other one (§14); infinite \
             where there is no other"
                .into()
        }
        Quantity::LinkSeen => "`seen` of one link".into(),
        Quantity::LinkViolation => "`violation` of one link".into(),
        Quantity::JointPoints => "points on the links that a joint moves".into(),
        Quantity::JointSigma => "reported standard deviation of a joint".into(),
        Quantity::JointOwnSigma => {
            "the same by the covariance alone: a tool that looks the same at several values stands \
             the same at all of them, and only what moves it counts"
                .into()
        }
        Quantity::BeyondLimit => format!(
            "how far a joint stands beyond its limit and the play of its stop ({:.0}° or {:.0} \
             mm); 0 for joints without limits",
            STOP_PLAY.turning.to_degrees(),
            STOP_PLAY.sliding * 1e3
        ),
        Quantity::AgreeingScans => "scans of a group that agree on a posture (§18)".into(),
        Quantity::OtherExplained => {
            "surface that the other model explains, of what this one explains (§16)".into()
        }
    }
}

fn holds(property: Property) -> &'static str {
    match property {
        Property::LinkAside => {
            "the link hangs beside the chain, fixed or as a multiple of a joint, and is no tool"
        }
        Property::LinkHeld => "the joint that places the link and the one before it are known",
        Property::LastJoint => "it is the last joint",
        Property::SlidingJoint => "the joint slides",
        Property::DeterminedJoint => "the joint is determined",
        Property::KnownScanners => "a scanner position is known",
        Property::OnlyScanners => "scanners at known positions measured everything",
        Property::TradeOff => "unknowns trade off (§14)",
    }
}

fn holds_not(property: Property) -> &'static str {
    match property {
        Property::LinkAside => "the link is part of the chain or of a tool",
        Property::LinkHeld => {
            "the joint that places the link or the one before it is not known (`held_joints`; the \
             last joint is not asked)"
        }
        Property::LastJoint => "it is not the last joint",
        Property::SlidingJoint => "the joint turns",
        Property::DeterminedJoint => "the joint is not determined",
        Property::KnownScanners => "no scanner position is known",
        Property::OnlyScanners => "a depth camera measured, or no scanner position is known",
        Property::TradeOff => "no unknowns trade off",
    }
}
