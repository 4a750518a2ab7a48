//! The expected course of a run: its stages with the time that each will probably take, and from
//! these how far the whole run is. Expectations come from the same rates as those of `plan`; what
//! has been measured since corrects them.

/// Weight of the expectation against what was measured so far, seconds: the first second of a run
/// says little about its speed.
const PRIOR: f64 = 5.0;
/// Bounds of the factor by which a run may be faster or slower than expected.
const PACE: [f64; 2] = [0.1, 20.0];
/// Time that a stage which takes longer than expected will go on, as a share of what it took.
const OVERDUE: f64 = 0.1;

/// A stage that took a smaller share of its expected time was answered by what an earlier run has
/// kept, and says nothing about speed.
const KEPT: f64 = 0.02;

/// Greatest share of a bar that stands for a guess.
const GUESSED: f64 = 0.2;

/// A stage of the course.
#[derive(Debug)]
struct CourseLeg {
    name: &'static str,
    /// Time that it will probably take, seconds.
    expected: f64,
    /// Time that it took, seconds, once it or a later one has begun or ended.
    took: Option<f64>,
    has_begun: bool,
}

/// The stages that a run will probably go through, in their order.
#[derive(Debug, Default)]
pub(super) struct Course {
    legs: Vec<CourseLeg>,
    /// The greatest share that was shown: a bar that goes back looks like an error.
    shown: f64,
    /// Whether the points were looked at; before, a bar that is far would stand still afterwards.
    is_known: bool,
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Whole {
    /// Share of its time that is over, 0 to 1.
    pub(super) share: f64,
    /// Seconds that it will probably go on.
    pub(super) to_go: f64,
}

impl Course {
    /// Says how long stages will take, in the order in which they will begin; replaces what was
    /// said of them before. `is_known` if it is more than a guess.
    pub(super) fn expect(&mut self, stages: &[(&'static str, f64)], is_known: bool) {
        self.is_known |= is_known;
        for &(name, expected) in stages {
            match self.legs.iter_mut().find(|leg| leg.name == name) {
                Some(leg) => leg.expected = expected,
                None => self.legs.push(CourseLeg { name, expected, took: None, has_begun: false }),
            }
        }
    }

    /// A stage begins. Earlier ones that have not begun will not come: their results were kept.
    pub(super) fn begin(&mut self, name: &str) {
        let Some(at) = self.legs.iter().position(|leg| leg.name == name) else { return };
        self.legs[at].has_begun = true;
        let skipped = self.legs[..at].iter_mut().filter(|leg| !leg.has_begun);
        skipped.for_each(|leg| (leg.has_begun, leg.took) = (true, Some(0.0)));
    }

    /// A stage has ended.
    pub(super) fn end(&mut self, name: &str, seconds: f64) {
        let leg = self.legs.iter_mut().find(|leg| leg.name == name && leg.took.is_none());
        leg.into_iter().for_each(|leg| leg.took = Some(seconds));
    }

    /// How far the run is after `elapsed` seconds, `seconds` after a stage has begun of which a
    /// share is done; `None` where nothing is known of its course.
    pub(super) fn whole(
        &mut self,
        name: &str,
        share: f64,
        seconds: f64,
        elapsed: f64,
    ) -> Option<Whole> {
        if self.legs.is_empty() {
            return None;
        }
        let pace = self.pace();
        let rest = self.legs.iter().filter(|leg| leg.took.is_none()).map(|leg| {
            let expected = leg.expected * pace;
            if leg.name == name { of_stage(expected, share, seconds) } else { expected }
        });
        // `sum` of nothing is -0, which people would see.
        let to_go = rest.fold(0.0, |sum, seconds| sum + seconds);
        let most = if self.is_known { 1.0 } else { GUESSED };
        self.shown = self.shown.max((elapsed / (elapsed + to_go).max(1e-9)).min(most));
        Some(Whole { share: self.shown, to_go })
    }

    /// Measured time of the stages that are over against the expected one.
    fn pace(&self) -> f64 {
        let over = self.legs.iter().filter_map(|leg| Some([leg.took?, leg.expected]));
        let [took, expected] = over
            .filter(|[took, expected]| *took > KEPT * expected)
            .fold([PRIOR; 2], |sum, leg| [sum[0] + leg[0], sum[1] + leg[1]]);
        (took / expected).clamp(PACE[0], PACE[1])
    }
}

/// Seconds that a stage goes on: as expected at first, and as measured the more of it is done.
fn of_stage(expected: f64, share: f64, seconds: f64) -> f64 {
    let measured = if share > 0.0 { seconds / share } else { 0.0 };
    let whole = (1.0 - share) * expected + share * measured;
    (whole - seconds).max(OVERDUE * seconds * (1.0 - share))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course() -> Course {
        let mut course = Course::default();
        course.expect(&[("robots", 10.0), ("ingest", 20.0), ("fit", 60.0), ("write", 10.0)], true);
        course
    }

    #[test]
    fn a_run_as_expected_ends_when_it_was_said_to() {
        let mut course = course();
        course.begin("robots");
        let at = |course: &mut Course, name, share, seconds, elapsed| {
            course.whole(name, share, seconds, elapsed).expect("a course")
        };
        assert_eq!(at(&mut course, "robots", 0.0, 0.0, 0.0), Whole { share: 0.0, to_go: 100.0 });
        assert_eq!(at(&mut course, "robots", 0.5, 5.0, 5.0).to_go, 95.0);
        course.end("robots", 10.0);
        course.begin("ingest");
        course.end("ingest", 20.0);
        course.begin("fit");
        // No place is searched, and half of the time is over.
        assert_eq!(at(&mut course, "fit", 0.0, 30.0, 60.0), Whole { share: 0.6, to_go: 40.0 });
        course.end("fit", 60.0);
        course.begin("write");
        course.end("write", 10.0);
        assert_eq!(at(&mut course, "list", 0.0, 0.0, 100.0), Whole { share: 1.0, to_go: 0.0 });
    }

    #[test]
    fn a_slow_machine_is_noticed_and_the_bar_never_goes_back() {
        let mut course = course();
        course.begin("robots");
        course.end("robots", 40.0);
        course.begin("ingest");
        let slow = course.whole("ingest", 0.0, 0.0, 40.0).expect("a course");
        // Four times as long as expected, less the weight of the expectation.
        assert!((slow.to_go - 90.0 * 45.0 / 15.0).abs() < 1e-9, "{slow:?}");
        course.expect(&[("fit", 600.0)], true);
        let more = course.whole("ingest", 0.0, 0.0, 40.0).expect("a course");
        assert!(more.to_go > slow.to_go && more.share >= slow.share, "{more:?}");
    }

    #[test]
    fn a_guess_moves_the_bar_a_little_only() {
        let mut course = Course::default();
        course.expect(&[("robots", 10.0), ("fit", 10.0)], false);
        course.begin("robots");
        let guessed = course.whole("robots", 0.5, 5.0, 5.0).expect("a course");
        assert_eq!(guessed, Whole { share: 0.2, to_go: 15.0 });
        course.expect(&[("fit", 10.0)], true);
        assert_eq!(course.whole("robots", 0.5, 5.0, 5.0).map(|w| w.share), Some(0.25));
        course.end("robots", 10.0);
        course.end("fit", 10.0);
        assert!(course.whole("list", 0.0, 0.0, 20.0).is_some_and(|w| w.to_go.is_sign_positive()));
    }

    #[test]
    fn what_was_kept_is_not_waited_for() {
        let mut course = course();
        course.begin("fit");
        assert_eq!(course.whole("fit", 0.0, 0.0, 0.0).map(|w| w.to_go), Some(70.0));
        // What takes longer than expected goes on for a while.
        assert_eq!(course.whole("fit", 0.0, 200.0, 200.0).map(|w| w.to_go), Some(30.0));
        assert_eq!(Course::default().whole("fit", 0.5, 1.0, 1.0), None);
        // Models of an earlier run are there at once, and the search is no faster for that.
        let mut again = self::course();
        again.begin("robots");
        again.end("robots", 0.01);
        assert_eq!(again.whole("ingest", 0.0, 0.0, 0.01).map(|w| w.to_go), Some(90.0));
    }
}
