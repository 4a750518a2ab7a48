//! The error type of all crates, classified by what a caller can do about it. There is one type
//! for the whole workspace because a stage's errors are only ever passed upwards.

use crate::quote;
use crate::words::without_numbers;
use std::fmt;
use std::path::Path;

/// What a caller can do about an error. Each kind has an exit code; there are as many kinds as
/// there are different reactions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kind {
    /// The input is broken or contradicts itself; repair or replace it. Exit code 4.
    BadInput,
    /// The input may be valid, but is of a kind that is not supported; convert it. Exit code 4.
    Unsupported,
    /// The operating system refused an operation: disk, permission, network share. Exit code 1.
    Io,
    /// A limit on memory or disk would be exceeded; raise it or reduce the input. Exit code 5.
    OverBudget,
    /// Flags or settings contradict one another. Exit code 2.
    Usage,
    /// The user interrupted the program with Ctrl-C. Exit code 130.
    Cancelled,
    /// A fault of the program itself, to be reported. Exit code 1.
    Bug,
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// An error: what went wrong, where, the cause, and what the user can do about it.
///
/// Messages are half sentences: lower case, no full stop, the offending value in quotes, last.
#[derive(Debug)]
pub struct Error(Box<ErrorInner>);

#[derive(Debug)]
struct ErrorInner {
    kind: Kind,
    what: String,
    place: Option<String>,
    hint: Option<String>,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl Error {
    /// Makes an error of this kind; `what` is a half sentence.
    pub fn new(kind: Kind, what: impl Into<String>) -> Self {
        Self(Box::new(ErrorInner {
            kind,
            what: what.into(),
            place: None,
            hint: None,
            source: None,
        }))
    }

    /// Makes an error of kind [`Kind::BadInput`].
    pub fn bad_input(what: impl Into<String>) -> Self {
        Self::new(Kind::BadInput, what)
    }

    /// Makes an error from what the operating system reports about a file that is written or
    /// listed. A full disk is [`Kind::OverBudget`], since the user can make room.
    pub fn of_file(what: impl Into<String>, path: &Path, cause: std::io::Error) -> Self {
        let is_full = is_full(&cause);
        let kind = if is_full { Kind::OverBudget } else { Kind::Io };
        Self::new(kind, what).because(cause).at(path.display()).hint(if is_full {
            "make room on the disk, or choose another --out"
        } else {
            "check that its folder is there, and that you may read and write it"
        })
    }

    /// Makes an error from what the operating system reports about a file that is read. A file that
    /// is missing, is no regular file or ends early is [`Kind::BadInput`].
    pub fn of_read(what: impl Into<String>, path: &Path, cause: std::io::Error) -> Self {
        let is_bad = is_missing(&cause);
        let kind = if is_bad { Kind::BadInput } else { Kind::Io };
        Self::new(kind, what).because(cause).at(path.display()).hint(if is_bad {
            "put it back as it was, or make it anew"
        } else {
            "check that you may read it, and that its disk or share is there"
        })
    }

    /// Whether the cause is a full disk.
    #[must_use]
    pub fn is_full_disk(&self) -> bool {
        let cause = self.0.source.as_ref().and_then(|s| s.downcast_ref::<std::io::Error>());
        cause.is_some_and(is_full)
    }

    /// Attaches the error that caused this one.
    #[must_use]
    pub fn because(mut self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        self.0.source = Some(source.into());
        self
    }

    /// Attaches the place of the error. Outer places are put in front of inner ones.
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        self.0.place = Some(match self.0.place.take() {
            None => place.to_string(),
            Some(inner) => format!("{place}: {inner}"),
        });
        self
    }

    /// Drops the place, for callers that print it themselves.
    #[must_use]
    pub fn without_place(mut self) -> Self {
        self.0.place = None;
        self
    }

    /// Changes the kind and keeps the rest.
    #[must_use]
    pub fn of_kind(mut self, kind: Kind) -> Self {
        self.0.kind = kind;
        self
    }

    /// Attaches what the user can do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.0.hint = Some(hint.into());
        self
    }

    /// What a caller can do about it.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.0.kind
    }

    /// Where the error happened, if known.
    #[must_use]
    pub fn place(&self) -> Option<&str> {
        self.0.place.as_deref()
    }

    /// What the user can do about it, if known.
    #[must_use]
    pub fn way_out(&self) -> Option<&str> {
        self.0.hint.as_deref()
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.0.place {
            // Only the place is quoted: a path may hold line breaks, `what` and its source may not.
            write!(f, "{}: ", quote::shown(place))?;
        }
        f.write_str(&without_numbers(&self.0.what))?;
        if let Some(source) = &self.0.source {
            write!(f, " ({})", without_numbers(&source.to_string()))?;
        }
        if let Some(hint) = &self.0.hint {
            write!(f, "; {hint}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.source.as_ref().map(|s| &**s as &(dyn std::error::Error + 'static))
    }
}

impl From<std::io::Error> for Error {
    fn from(source: std::io::Error) -> Self {
        if is_missing(&source) {
            let what = match source.kind() {
                std::io::ErrorKind::NotFound => "it is not there",
                std::io::ErrorKind::UnexpectedEof => "it ends early",
                _ => "it is not of the kind, file or folder, that is read there",
            };
            return Self::new(Kind::BadInput, what).because(source).hint(
                "check the path; what is read must stay as it is until the program has ended",
            );
        }
        let kind = if is_full(&source) { Kind::OverBudget } else { Kind::Io };
        Self::new(kind, "the system refused").because(source)
    }
}

/// Whether a file that should be read is missing, is no regular file, or ends early. Then the
/// user must repair the input; nothing is wrong with the machine.
fn is_missing(cause: &std::io::Error) -> bool {
    use std::io::ErrorKind::{IsADirectory, NotADirectory, NotFound, UnexpectedEof};
    matches!(cause.kind(), NotFound | IsADirectory | NotADirectory | UnexpectedEof)
}

fn is_full(cause: &std::io::Error) -> bool {
    matches!(cause.kind(), std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_says_has_no_numbers() {
        let cause = || std::io::Error::from_raw_os_error(2);
        let whole = Error::of_file("cannot be read", Path::new("a.las"), cause()).to_string();
        let other = Error::bad_input(cause().to_string()).to_string();
        for text in [whole, other, Error::from(cause()).to_string()] {
            assert!(!text.contains("os error") && text.contains("file"), "{text}");
        }
    }
}
