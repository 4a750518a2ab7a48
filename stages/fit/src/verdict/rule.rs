//! The terms that the table of verdict rules is written in: numbers and properties of a fit that a
//! rule asks for, thresholds with their reasons, tests, exemptions, rows. With the answers to its
//! tests a row says whether it holds, and gives the sentence that people read.

use contract::Verdict;

/// What one row of the table does to the verdict of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RowOutcome {
    /// The fit is refused.
    Refused,
    /// The fit is doubtful, unless another row refuses it.
    Doubtful,
    /// The sentence is added, and the verdict stays.
    Note,
}

/// What a rule is asked about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Subject {
    /// Once for the whole robot.
    Robot,
    /// Once for each link of the model.
    EachLink,
    /// Once for each free joint.
    EachJoint,
}

/// A number that a rule asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    Score,
    Violation,
    Seen,
    Points,
    Rms,
    Noise,
    ExcusedNoise,
    HeldJoints,
    KnownJoints,
    KnownButLast,
    DeterminedJoints,
    Margin,
    LinkSeen,
    LinkViolation,
    JointPoints,
    JointSigma,
    JointOwnSigma,
    BeyondLimit,
    AgreeingScans,
    OtherExplained,
}

/// Something that holds or does not hold, which a rule asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Property {
    LinkAside,
    LinkHeld,
    LastJoint,
    SlidingJoint,
    DeterminedJoint,
    KnownScanners,
    OnlyScanners,
    TradeOff,
}

/// Where a threshold lies, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Limit {
    /// Always there.
    Fixed(f64),
    /// At so many times a number, and so much beyond.
    Multiple { of: Quantity, times: f64, beyond: f64 },
    /// At a fixed value or at so many times a number, whichever is larger.
    Larger { fixed: f64, of: Quantity, times: f64 },
}

/// How people read the values of a threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scale {
    /// Without a unit.
    Plain,
    /// A share of a whole, as per cent.
    Share,
    /// Metres, as millimetres.
    Length,
    /// Radians as degrees; for joints that slide the same number in metres, as millimetres.
    Joint,
    /// A count.
    Count,
}

/// A threshold, and why it is where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Threshold {
    pub(super) name: &'static str,
    pub(super) limit: Limit,
    pub(super) scale: Scale,
    pub(super) why: &'static str,
}

/// A question with the answer yes or no.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Test {
    /// The number is smaller than the threshold.
    Below(Quantity, Threshold),
    /// The number is at most the threshold.
    AtMost(Quantity, Threshold),
    /// The number is larger than the threshold.
    Above(Quantity, Threshold),
    /// The property holds.
    Is(Property),
    /// The property does not hold.
    IsNot(Property),
}

/// A case in which a row does not hold although all of its tests do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Exemption {
    pub(super) case: Test,
    pub(super) why: &'static str,
}

/// Questions that are asked of some rows on their own, besides the verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AlsoAsked {
    /// Before the fit is worth a report: it would be refused whatever else is found out.
    BeforeReport,
    /// Whether a measurement contradicts the fit, instead of too little having been seen.
    Contradicts,
}

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VerdictRow {
    pub(super) outcome: RowOutcome,
    /// All of these must hold.
    pub(super) when: &'static [Test],
    /// None of these may hold.
    pub(super) unless: &'static [Exemption],
    /// What people read; `{name}` stands for a value of the fit.
    pub(super) sentence: &'static str,
    pub(super) also: &'static [AlsoAsked],
}

/// Rows about one question. For each subject the first row that holds counts, and no other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VerdictRule {
    pub(super) name: &'static str,
    pub(super) subject: Subject,
    pub(super) rows: &'static [VerdictRow],
}

/// How an event changes the verdict; `None` stands for the verdict that the event carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum VerdictChange {
    /// The verdict becomes this, and all earlier reasons go.
    Set(Verdict),
    /// The verdict becomes no better than this.
    AtMost(Option<Verdict>),
    /// The verdict becomes no worse than this.
    AtLeast(Option<Verdict>),
}

/// One row of the table of events, which are found out after the fit's own evidence was judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EventRow {
    /// What was found out.
    pub(super) event: &'static str,
    pub(super) when: &'static [Test],
    pub(super) change: VerdictChange,
    /// What people read where the verdict changes; empty where earlier sentences say all.
    pub(super) sentence: &'static str,
    pub(super) why: &'static str,
}

/// Answers the questions of a row.
pub(super) trait Answers {
    /// SI units; shares 0..1.
    fn number(&self, quantity: Quantity) -> f64;
    /// Whether a property holds.
    fn is(&self, property: Property) -> bool;
    /// What stands for a name in a sentence; `None` where the name is not known.
    fn word(&self, name: &str) -> Option<String>;
}

impl Threshold {
    /// The value that a number is compared with, in the number's own unit.
    pub(super) fn value(&self, answers: &impl Answers) -> f64 {
        match self.limit {
            Limit::Fixed(value) => value,
            Limit::Multiple { of, times, beyond } => times * answers.number(of) + beyond,
            Limit::Larger { fixed, of, times } => fixed.max(times * answers.number(of)),
        }
    }
}

impl Test {
    pub(super) fn holds(&self, answers: &impl Answers) -> bool {
        match self {
            Self::Below(quantity, than) => answers.number(*quantity) < than.value(answers),
            Self::AtMost(quantity, than) => answers.number(*quantity) <= than.value(answers),
            Self::Above(quantity, than) => answers.number(*quantity) > than.value(answers),
            Self::Is(property) => answers.is(*property),
            Self::IsNot(property) => !answers.is(*property),
        }
    }
}

impl VerdictRow {
    pub(super) fn holds(&self, answers: &impl Answers) -> bool {
        self.when.iter().all(|test| test.holds(answers))
            && !self.unless.iter().any(|exemption| exemption.case.holds(answers))
    }
}

/// A sentence of the table with the values of a fit in it. Values are never read as names, whatever
/// the model calls its links.
pub(super) fn filled(sentence: &str, answers: &impl Answers) -> String {
    let (mut out, mut rest) = (String::with_capacity(sentence.len()), sentence);
    while let Some((before, behind)) = rest.split_once('{') {
        let (name, after) = behind.split_once('}').unwrap_or((behind, ""));
        out.push_str(before);
        out.push_str(&answers.word(name).unwrap_or_else(|| name.to_owned()));
        rest = after;
    }
    out + rest
}
