//! The rules of the verdict as a whole: the page of the method that is made from them, the values
//! that their sentences name, and what events do to a verdict.

use contract::Verdict::{Doubtful, Refused, Trusted};
use std::path::{Path, PathBuf};

use super::evidence::FitEvidence;
use super::page::page;
use super::rule::{Answers, Subject, filled};
use super::table::{EVENTS, RULES};
use super::*;

/// Between these the page of the method is made from the table.
const MARKS: [&str; 2] =
    ["<!-- made from verdict/table.rs -->\n", "<!-- end of what is made from verdict/table.rs -->"];

fn method() -> (PathBuf, String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("METHOD.md");
    let text = std::fs::read_to_string(&path).expect("the page of the method can be read");
    (path, text)
}

/// The page of the method before, between and after the marks.
fn parts(text: &str) -> [&str; 3] {
    let (before, rest) = text.split_once(MARKS[0]).expect("the page has the first mark");
    let (made, after) = rest.split_once(MARKS[1]).expect("the page has the second mark");
    [before, made, after]
}

#[test]
fn the_method_tells_the_rules_as_they_are() {
    let (path, text) = method();
    let [_, made, _] = parts(&text);
    assert!(
        made == page(),
        "{} §15 is not what the table says: run `cargo test -p fit write_the_method -- --ignored`",
        path.display()
    );
}

#[test]
#[ignore = "writes METHOD.md §15 from the table"]
fn write_the_method() {
    let (path, text) = method();
    let [before, _, after] = parts(&text);
    let text = [before, MARKS[0], &page(), MARKS[1], after].concat();
    std::fs::write(path, text).expect("the page of the method can be written");
}

/// The names in a sentence.
fn names(sentence: &str) -> impl Iterator<Item = &str> {
    sentence.split('{').skip(1).map(|part| part.split('}').next().unwrap_or(part))
}

#[test]
fn sentences_name_values_that_there_are() {
    let evidence = FitEvidence::with_one_of_each();
    for rule in RULES {
        for name in rule.rows.iter().flat_map(|row| names(row.sentence)) {
            let is_of_robot = rule.subject == Subject::Robot;
            assert!(evidence.about(0).word(name).is_some(), "{}: {name}", rule.name);
            assert!(!is_of_robot || !name.starts_with("link") && !name.starts_with("joint"));
        }
    }
    let model = VerdictEvent::RivalModel { model: "b", share: 0.95 };
    for name in EVENTS.iter().flat_map(|row| names(row.sentence)) {
        assert!(model.word(name).is_some(), "{name}");
    }
}

#[test]
fn a_value_is_never_read_as_a_name() {
    let odd = VerdictEvent::RivalModel { model: "{model} {x", share: 0.95 };
    assert_eq!(filled("model '{model}' is", &odd), "model '{model} {x' is");
    assert_eq!(filled("none", &odd), "none");
}

#[test]
fn an_event_changes_the_verdict_and_gives_its_reason_where_it_does() {
    let after = |verdict: Verdict, event: VerdictEvent<'_>| {
        let mut fit = Fit { verdict, reasons: vec!["few points".into()], ..Fit::default() };
        apply(&mut fit, &event);
        (fit.verdict, fit.reasons.join("; "))
    };
    let same = |verdict: Verdict| (verdict, "few points".to_owned());
    let rival = |share: f64| VerdictEvent::RivalModel { model: "b", share };
    let doubted = "few points; model 'b' explains the points nearly as well";
    assert_eq!(after(Trusted, rival(0.91)), (Doubtful, doubted.into()));
    assert_eq!(after(Trusted, rival(0.90)), same(Trusted));
    assert_eq!(after(Doubtful, rival(0.95)), same(Doubtful));
    assert_eq!(after(Refused, rival(0.95)), same(Refused));
    let alone = "few points; only one scan shows this posture";
    assert_eq!(after(Trusted, VerdictEvent::ScansAgree(1)), (Doubtful, alone.into()));
    assert_eq!(after(Trusted, VerdictEvent::ScansAgree(2)), same(Trusted));
    assert_eq!(after(Trusted, VerdictEvent::Calibrated(Doubtful)), same(Doubtful));
    assert_eq!(after(Doubtful, VerdictEvent::Calibrated(Trusted)), same(Doubtful));
    assert_eq!(after(Doubtful, VerdictEvent::SeenAgain(Trusted)), same(Trusted));
    assert_eq!(after(Trusted, VerdictEvent::SeenAgain(Refused)), same(Trusted));
    let accepted = "accepted in review; few points";
    assert_eq!(after(Refused, VerdictEvent::Accepted), (Trusted, accepted.into()));
    assert_eq!(after(Trusted, VerdictEvent::Accepted), same(Trusted));
    assert_eq!(after(Trusted, VerdictEvent::Lost), (Refused, String::new()));
    let gone = "it is gone: the new scans see through it";
    assert_eq!(after(Trusted, VerdictEvent::Gone), (Refused, gone.into()));
    let lost = "the new scans contradict this posture and show no other";
    assert_eq!(after(Refused, VerdictEvent::Contradicted), (Doubtful, lost.into()));
}
