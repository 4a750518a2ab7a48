//! Findings: messages to the user about problems of a robot library.

use contract::{Error, Kind};
use serde::{Deserialize, Serialize};
use std::fmt::Display;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Severity {
    /// Information; nothing needs to be done.
    Note,
    /// The model loads, but probably not as its author meant it.
    Warning,
    /// The model cannot be loaded.
    Error,
}

/// One message about a model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Name of the model; empty for the library itself.
    pub model: String,
    /// How bad it is.
    pub severity: Severity,
    /// The problem, as a half sentence.
    pub what: String,
    /// File and element that it concerns.
    pub place: String,
    /// What the user can do about it; empty where nothing needs to be done.
    pub way_out: String,
}

/// Largest number of findings of each severity for one model: a file of a few megabytes can have a
/// hundred thousand problems, and nobody reads as many.
const MAX_FINDINGS: usize = 100;

/// Collects the findings of one model while it is loaded.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    model: String,
    pub(crate) list: Vec<Finding>,
}

impl Findings {
    pub(crate) fn new(model: &str) -> Self {
        Self { model: model.to_owned(), list: Vec::new() }
    }

    fn add(&mut self, severity: Severity, place: &dyn Display, what: String, way_out: &str) {
        let (place, way_out) = (place.to_string(), way_out.to_owned());
        let n = self.list.iter().filter(|f| f.severity == severity).count();
        let finding = if n < MAX_FINDINGS {
            Finding { model: self.model.clone(), severity, what, place, way_out }
        } else {
            Finding {
                model: self.model.clone(),
                severity,
                what: format!(
                    "there are more than these {MAX_FINDINGS}; the others are not listed"
                ),
                place: String::new(),
                way_out: "correct those that are listed first".to_owned(),
            }
        };
        if !self.list.contains(&finding) {
            self.list.push(finding);
        }
    }

    pub(crate) fn note(&mut self, place: impl Display, what: impl Into<String>, way_out: &str) {
        self.add(Severity::Note, &place, what.into(), way_out);
    }

    pub(crate) fn warn(&mut self, place: impl Display, what: impl Into<String>, way_out: &str) {
        self.add(Severity::Warning, &place, what.into(), way_out);
    }

    pub(crate) fn fail(&mut self, place: impl Display, what: impl Into<String>, way_out: &str) {
        self.add(Severity::Error, &place, what.into(), way_out);
    }

    pub(crate) fn failed(&self) -> bool {
        self.list.iter().any(|f| f.severity == Severity::Error)
    }

    /// The first finding that prevents the model from loading, as an error.
    pub(crate) fn first_error(&self) -> Error {
        match self.list.iter().find(|f| f.severity == Severity::Error) {
            Some(f) => {
                let error = Error::bad_input(f.what.clone()).at(&f.place).at(&self.model);
                if f.way_out.is_empty() { error } else { error.hint(f.way_out.clone()) }
            }
            None => {
                Error::new(Kind::Bug, "a model failed to load without a finding").at(&self.model)
            }
        }
    }
}
