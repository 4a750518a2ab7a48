//! Effects of a review: each of its entries gets a sentence that states what it changed, from a
//! comparison of the robots with and without the review. No entry is passed over in silence.

use super::{Decision, Review, ReviewPlace};
use crate::detect::robot_id::robot_id;
use contract::words::fixed;
use contract::{Fit, Verdict};
use export::ReviewEntry;
use geometry::Point;

/// Distance of bases below which two fits are of the same robot, metres.
const SAME_BASE: f64 = 0.35;

/// The robots with and without the review, which are compared to find the effect of each entry.
struct WithAndWithout<'a> {
    /// Robots that would be reported without the review.
    without: &'a [Fit],
    /// Robots that are reported, in the order of the result.
    with: &'a [Fit],
    /// Indices of the entries whose posture the scans contradict.
    wrong: &'a [usize],
}

/// The effect of an entry, and whether a person should look at it again.
struct Effect {
    what: String,
    is_odd: bool,
}

impl Effect {
    fn as_asked(what: String) -> Self {
        Self { what, is_odd: false }
    }

    fn odd(what: impl Into<String>) -> Self {
        Self { what: what.into(), is_odd: true }
    }
}

impl Review {
    /// The effect of each entry, in order, from the robots that would be reported without the
    /// review, the robots that are reported, and the entries whose posture the scans contradict.
    #[must_use]
    pub(crate) fn effects(
        &self,
        without: &[Fit],
        with: &[Fit],
        wrong: &[usize],
    ) -> Vec<ReviewEntry> {
        self.effects_of(&WithAndWithout { without, with, wrong })
    }

    /// The effect of each entry, in order.
    fn effects_of(&self, robots: &WithAndWithout<'_>) -> Vec<ReviewEntry> {
        let entry = |(k, place): (usize, &ReviewPlace)| {
            let Effect { what, is_odd } = match place.verdict {
                Some(Decision::Reject) => self.rejected(place, robots),
                Some(Decision::Accept) => self.accepted(place, robots),
                None => place.expected(robots),
            };
            let start = if place.joints.is_empty() {
                ""
            } else if robots.wrong.contains(&k) {
                "; its posture contradicts the scans and was not used"
            } else {
                "; the fit started at its posture"
            };
            let (word, at) = (place.word(), place.words());
            let did = format!("{word} near {at}: {what}{start}");
            let needs_look = is_odd || robots.wrong.contains(&k);
            ReviewEntry { entry: k + 1, at: place.at, did, needs_look }
        };
        self.places.iter().enumerate().map(entry).collect()
    }

    fn rejected(&self, place: &ReviewPlace, robots: &WithAndWithout<'_>) -> Effect {
        let gone: Vec<&Fit> = robots.without.iter().filter(|f| place.has(f)).collect();
        if gone.is_empty() {
            return Effect::odd("no robot was found there, so the entry has no effect");
        }
        let names: Vec<String> = gone.iter().map(|f| described(f)).collect();
        let mut what =
            format!("{} is not reported; its points are labelled as fixed", names.join(" and "));
        let is_trusted = gone.iter().any(|f| f.verdict == Verdict::Trusted);
        if is_trusted {
            what += "; without the review it would be trusted: check whether this is intended";
        }
        if let Some(other) = self.other(place, Decision::Accept, robots) {
            what +=
                &format!("; entry {other} accepts a robot there, but a rejection takes precedence");
            return Effect::odd(what);
        }
        Effect { what, is_odd: is_trusted }
    }

    fn accepted(&self, place: &ReviewPlace, robots: &WithAndWithout<'_>) -> Effect {
        let Some((at, fit)) = place.reported(robots.with) else {
            return match self.other(place, Decision::Reject, robots) {
                Some(other) => Effect::odd(format!(
                    "entry {other} rejects a robot there and takes precedence: no robot is reported"
                )),
                None => Effect::odd(place.missing()),
            };
        };
        let name = format!("{} {}", robot_id(at), fit.model_name);
        let Some(before) = place.before(fit, robots.without) else {
            let instead = robots.without.iter().filter(|f| place.has(f)).map(described);
            let instead: Vec<String> = instead.collect();
            return Effect::as_asked(if instead.is_empty() {
                format!("{name} is trusted; without the entry no robot would be reported there")
            } else {
                format!("{name} is trusted, instead of {}", instead.join(" and "))
            });
        };
        Effect::as_asked(if before.verdict == Verdict::Trusted {
            format!("{name} is trusted without the entry, which therefore has no effect")
        } else {
            let why = before.reasons.join("; ");
            format!("{name} is trusted; without the entry it was {}: {why}", before.verdict.word())
        })
    }

    /// Number of an entry with the opposite verdict about the same place: one whose place contains
    /// the same robot, or the middle of this place.
    fn other(
        &self,
        place: &ReviewPlace,
        verdict: Decision,
        robots: &WithAndWithout<'_>,
    ) -> Option<usize> {
        let both = |p: &ReviewPlace| {
            robots.without.iter().any(|f| p.has(f) && place.has(f))
                || p.is_within(place)
                || place.is_within(p)
        };
        let at = self.places.iter().position(|p| p.verdict == Some(verdict) && both(p));
        at.map(|at| at + 1)
    }
}

impl ReviewPlace {
    /// The request of the entry as a word.
    fn word(&self) -> String {
        let model = self.model.as_deref();
        match self.verdict {
            Some(Decision::Reject) => "reject".into(),
            Some(Decision::Accept) => model.map_or("accept".into(), |m| format!("accept {m}")),
            None => format!("expect {}", model.unwrap_or("a robot")),
        }
    }

    /// The effect of an entry without a verdict.
    fn expected(&self, robots: &WithAndWithout<'_>) -> Effect {
        let Some((at, fit)) = self.reported(robots.with) else {
            return Effect::odd(self.missing());
        };
        let name = format!("{} {}", robot_id(at), fit.model_name);
        let others: Vec<String> = robots
            .without
            .iter()
            .filter(|f| self.has(f) && f.model_name != fit.model_name)
            .map(described)
            .collect();
        Effect::as_asked(if others.is_empty() {
            format!("{name} stands there, {}", fit.verdict.word())
        } else {
            let verdict = fit.verdict.word();
            format!("{name} stands there, {verdict}, instead of {}", others.join(" and "))
        })
    }

    /// The sentence for a place without the expected robot.
    fn missing(&self) -> String {
        let what = self.model.as_deref().unwrap_or("robot");
        format!("no robot was found there, so no {what} is reported")
    }

    /// The reported robot here that explains most points, with its index.
    fn reported<'f>(&self, with: &'f [Fit]) -> Option<(usize, &'f Fit)> {
        self.best(with).map(|at| (at, &with[at]))
    }

    /// The same robot as it would be reported without the review.
    fn before<'f>(&self, fit: &Fit, without: &'f [Fit]) -> Option<&'f Fit> {
        let at = |f: &Fit| f.world_from_base.translation.vector;
        without
            .iter()
            .filter(|f| self.has(f) && f.model_name == fit.model_name)
            .find(|f| (at(f) - at(fit)).norm() < SAME_BASE)
    }

    /// Whether the middle of this place lies within another place.
    fn is_within(&self, other: &Self) -> bool {
        (Point::from(self.at) - Point::from(other.at)).norm() <= other.radius
    }
}

/// Model, verdict and score of a robot as text.
fn described(fit: &Fit) -> String {
    format!("{} ({}, score {})", fit.model_name, fit.verdict.word(), fixed(fit.score, 2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::review::{tests::fit, tests::place};

    fn told(places: Vec<ReviewPlace>, without: &[Fit]) -> Vec<(String, bool)> {
        let review = Review { places };
        let with = review.apply(without.to_vec());
        let robots = WithAndWithout { without, with: &with, wrong: &[] };
        review.effects_of(&robots).into_iter().map(|e| (e.did, e.needs_look)).collect()
    }

    fn trusted(model: &str, x: f64) -> Fit {
        Fit { verdict: Verdict::Trusted, score: 0.93, ..fit(model, x, 1.0) }
    }

    #[test]
    fn a_rejection_says_what_it_took_away_and_where_there_was_nothing() {
        let reject = |x: f64| place(x, None, Some(Decision::Reject));
        let doubtful = Fit { score: 0.5, ..fit("b", 5.0, 1.0) };
        let said =
            told(vec![reject(9.0), reject(5.1), reject(0.1)], &[trusted("a", 0.0), doubtful]);
        let expected = [
            (
                "reject near (9.00, 0.00, 0.00): no robot was found there, so the entry has no effect",
                true,
            ),
            (
                "reject near (5.10, 0.00, 0.00): b (doubtful, score 0.50) is not reported; its points are labelled as fixed",
                false,
            ),
            (
                "reject near (0.10, 0.00, 0.00): a (trusted, score 0.93) is not reported; its points are labelled as fixed; \
                 without the review it would be trusted: check whether this is intended",
                true,
            ),
        ];
        assert_eq!(said, expected.map(|(did, odd)| (did.to_owned(), odd)));
    }

    #[test]
    fn accept_and_reject_of_one_place_name_each_other() {
        let accept = place(0.0, None, Some(Decision::Accept));
        let reject = place(0.2, None, Some(Decision::Reject));
        for (n, places) in [(2, vec![accept.clone(), reject.clone()]), (1, vec![reject, accept])] {
            let said = told(places, &[trusted("a", 0.1)]);
            let [accepted, rejected] =
                if n == 2 { [&said[0], &said[1]] } else { [&said[1], &said[0]] };
            let goes_before = format!("entry {n} rejects a robot there and takes precedence");
            assert!(accepted.1 && accepted.0.contains(&goes_before), "{}", accepted.0);
            let other = format!("entry {} accepts a robot there", 3 - n);
            assert!(rejected.1 && rejected.0.contains(&other), "{}", rejected.0);
        }
    }

    #[test]
    fn what_is_accepted_says_what_it_was_and_what_is_missing_is_named() {
        let doubtful = Fit { reasons: vec!["few points".into()], ..fit("b", 5.0, 1.0) };
        let places = vec![
            place(0.0, None, Some(Decision::Accept)),
            place(5.0, None, Some(Decision::Accept)),
            place(9.0, Some("c"), None),
        ];
        let said = told(places, &[trusted("a", 0.0), doubtful]);
        let words: Vec<&str> =
            said.iter().map(|(did, _)| did.split(": ").nth(1).unwrap_or("")).collect();
        assert_eq!(words[0], "R1 a is trusted without the entry, which therefore has no effect");
        assert!(
            said[1].0.ends_with("R2 b is trusted; without the entry it was doubtful: few points"),
            "{}",
            said[1].0
        );
        assert!(said[2].1 && said[2].0.starts_with("expect c near (9.00"), "{}", said[2].0);
    }
}
