//! Decides the verdict on a fit; no other file writes one. Verdict and reasons follow from the
//! evidence of the fit by the rules of `verdict/table.rs` (METHOD.md §15). What is found out later
//! (another model, a review, a rescan) is reported here as a [`VerdictEvent`].

mod evidence;
#[cfg(test)]
mod page;
mod rule;
mod table;
#[cfg(test)]
mod tests;
mod thresholds;
mod words;

use contract::{Fit, Verdict};

use crate::MeasuredScene;
use crate::adjust::Adjusted;
use evidence::FitEvidence;
pub(crate) use evidence::JudgedFit;
use rule::{AlsoAsked, Answers, EventRow, Property, Quantity, RowOutcome, VerdictChange, filled};
use table::RULES;
pub(crate) use thresholds::{MIN_AGREEING, RIVAL};

/// What is found out about a fit after its own evidence was judged, and bears on the verdict.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VerdictEvent<'a> {
    /// The points are too far off for the fit to be reported.
    Lost,
    /// The fit is by the method that goes link after link, which has no covariance.
    LinkAfterLink,
    /// Scans contradict one another about the robot; so many of them show this posture.
    ScansAgree(usize),
    /// Another model explains this share of the surface that the fit explains, of the same points.
    RivalModel {
        /// Name of the model in the library.
        model: &'a str,
        /// Surface explained by it, as a share of that explained by the fit.
        share: f64,
    },
    /// The places of the joints were calibrated; the verdict is that of the nominal fit, had its
    /// joints been known as well.
    Calibrated(Verdict),
    /// A rescan sees the robot stand as it stood, with this verdict.
    SeenAgain(Verdict),
    /// A rescan sees through the place where the robot stood.
    Gone,
    /// A rescan contradicts the posture and finds no other.
    Contradicted,
    /// A person accepts the robot in a review.
    Accepted,
}

/// Sets verdict and reasons by the rules.
pub(crate) fn decide(fit: &mut Fit, judged: &JudgedFit<'_>) {
    let mut findings = findings(&FitEvidence::of(fit, judged));
    fit.verdict = worst(&findings);
    findings.sort_by_key(|(outcome, _)| *outcome);
    fit.reasons = findings.into_iter().map(|(_, sentence)| sentence).collect();
}

/// The verdict that the rules give, which is not written.
pub(crate) fn by_rules(fit: &Fit, judged: &JudgedFit<'_>) -> Verdict {
    worst(&findings(&FitEvidence::of(fit, judged)))
}

/// The rows that hold, with their sentences, in the order of the table.
fn findings(evidence: &FitEvidence) -> Vec<(RowOutcome, String)> {
    let mut out = Vec::new();
    for rule in RULES {
        for at in 0..evidence.n_subjects(rule.subject) {
            let answers = evidence.about(at);
            if let Some(row) = rule.rows.iter().find(|row| row.holds(&answers)) {
                out.push((row.outcome, filled(row.sentence, &answers)));
            }
        }
    }
    out
}

fn worst(findings: &[(RowOutcome, String)]) -> Verdict {
    match findings.iter().map(|(outcome, _)| *outcome).min() {
        Some(RowOutcome::Refused) => Verdict::Refused,
        Some(RowOutcome::Doubtful) => Verdict::Doubtful,
        Some(RowOutcome::Note) | None => Verdict::Trusted,
    }
}

/// Whether one of the rows that are also asked on their own holds.
fn holds_any(evidence: &FitEvidence, asked: AlsoAsked) -> bool {
    RULES.iter().any(|rule| {
        let rows = || rule.rows.iter().filter(|row| row.also.contains(&asked));
        let mut subjects = 0..evidence.n_subjects(rule.subject);
        subjects.any(|at| rows().any(|row| row.holds(&evidence.about(at))))
    })
}

/// Whether what was adjusted is sure to be refused, whatever its wrist: its points are near the
/// model, not on it.
pub(crate) fn is_lost(best: &Adjusted, scene: &MeasuredScene<'_>) -> bool {
    holds_any(&FitEvidence::before_report(best, scene), AlsoAsked::BeforeReport)
}

/// Whether nothing that was measured contradicts a fit. If such a fit is doubtful, then because too
/// little of it was seen.
#[must_use]
pub fn is_uncontradicted(fit: &Fit, scene: &MeasuredScene<'_>) -> bool {
    fit.verdict != Verdict::Refused
        && !holds_any(&FitEvidence::of_surface(fit, scene), AlsoAsked::Contradicts)
}

/// Changes the verdict of a fit as the table says for an event, and adds its reason where the
/// verdict changes.
pub fn apply(fit: &mut Fit, event: &VerdictEvent<'_>) {
    let row = event.row();
    if !row.when.iter().all(|test| test.holds(event)) {
        return;
    }
    let reason = (!row.sentence.is_empty()).then(|| filled(row.sentence, event));
    match row.change {
        VerdictChange::Set(verdict) => {
            fit.verdict = verdict;
            fit.reasons = reason.into_iter().collect();
        }
        VerdictChange::AtMost(most) => {
            let most = most.unwrap_or(event.carried());
            if fit.verdict > most {
                fit.verdict = most;
                fit.reasons.extend(reason);
            }
        }
        VerdictChange::AtLeast(least) => {
            let least = least.unwrap_or(event.carried());
            if fit.verdict < least {
                fit.verdict = least;
                fit.reasons.splice(0..0, reason);
            }
        }
    }
}

/// Adds sentences to the reasons of a fit; its verdict stays.
pub fn note(fit: &mut Fit, sentences: impl IntoIterator<Item = String>) {
    fit.reasons.extend(sentences);
}

impl VerdictEvent<'_> {
    fn row(&self) -> &'static EventRow {
        match self {
            Self::Lost => &table::LOST,
            Self::LinkAfterLink => &table::LINK_AFTER_LINK,
            Self::ScansAgree(_) => &table::ONE_SCAN,
            Self::RivalModel { .. } => &table::RIVAL_MODEL,
            Self::Calibrated(_) => &table::CALIBRATED,
            Self::SeenAgain(_) => &table::SEEN_AGAIN,
            Self::Gone => &table::GONE,
            Self::Contradicted => &table::CONTRADICTED,
            Self::Accepted => &table::ACCEPTED,
        }
    }

    /// The verdict that the event tells of; doubtful where it tells of none.
    fn carried(&self) -> Verdict {
        match self {
            Self::Calibrated(verdict) | Self::SeenAgain(verdict) => *verdict,
            _ => Verdict::Doubtful,
        }
    }
}

impl Answers for VerdictEvent<'_> {
    fn number(&self, quantity: Quantity) -> f64 {
        match (self, quantity) {
            (Self::ScansAgree(n), Quantity::AgreeingScans) => *n as f64,
            (Self::RivalModel { share, .. }, Quantity::OtherExplained) => *share,
            _ => f64::NAN,
        }
    }

    fn is(&self, _: Property) -> bool {
        false
    }

    fn word(&self, name: &str) -> Option<String> {
        match (self, name) {
            (Self::RivalModel { model, .. }, "model") => Some((*model).to_owned()),
            _ => None,
        }
    }
}
