//! Errors by what a caller can do about them; one type for all rooms, since a stage's errors only
//! travel up.

use crate::quote;
use crate::words::without_numbers;
use std::fmt;
use std::path::Path;

/// What a caller can do about an error. As many kinds as there are reactions; each has an exit
/// code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kind {
    /// The input is broken or contradicts itself: mend or replace it. Exit code 4.
    BadInput,
    /// The input may be right, but is of a kind that is not read: convert it. Exit code 4.
    Unsupported,
    /// The machine refused: disk, permission, network share. Exit code 1.
    Io,
    /// A limit (memory, disk) would be broken: raise it or take less input. Exit code 5.
    OverBudget,
    /// Flags or settings contradict one another. Exit code 2.
    Usage,
    /// Somebody pressed Ctrl-C. Exit code 130.
    Cancelled,
    /// Ours: please report it. Exit code 1.
    Bug,
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, where, why.
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
    /// An error of `kind`; `what` is a half sentence.
    pub fn new(kind: Kind, what: impl Into<String>) -> Self {
        Self(Box::new(ErrorInner {
            kind,
            what: what.into(),
            place: None,
            hint: None,
            source: None,
        }))
    }

    /// Broken input.
    pub fn bad_input(what: impl Into<String>) -> Self {
        Self::new(Kind::BadInput, what)
    }

    /// What the system refuses about a file; a disk that is full is a limit, which the user can
    /// lift.
    pub fn of_file(what: impl Into<String>, path: &Path, cause: std::io::Error) -> Self {
        let is_full = is_full(&cause);
        let kind = if is_full { Kind::OverBudget } else { Kind::Io };
        Self::new(kind, what).because(cause).at(path.display()).hint(if is_full {
            "make room on the disk, or choose another --out"
        } else {
            "check that its folder is there, and that you may read and write it"
        })
    }

    /// What the system refuses about a file that is to be read: one that is not there, no longer or
    /// not as a file, or that ends early, is bad input.
    pub fn of_read(what: impl Into<String>, path: &Path, cause: std::io::Error) -> Self {
        let is_bad = is_missing(&cause);
        let kind = if is_bad { Kind::BadInput } else { Kind::Io };
        Self::new(kind, what).because(cause).at(path.display()).hint(if is_bad {
            "put it back as it was, or make it anew"
        } else {
            "check that you may read it, and that its disk or share is there"
        })
    }

    /// Whether it is for want of room on a disk.
    #[must_use]
    pub fn is_full_disk(&self) -> bool {
        let cause = self.0.source.as_ref().and_then(|s| s.downcast_ref::<std::io::Error>());
        cause.is_some_and(is_full)
    }

    /// Keeps the cause.
    #[must_use]
    pub fn because(mut self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        self.0.source = Some(source.into());
        self
    }

    /// Says where; the innermost place wins, an outer one is put before it.
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        self.0.place = Some(match self.0.place.take() {
            None => place.to_string(),
            Some(inner) => format!("{place}: {inner}"),
        });
        self
    }

    /// Forgets where, for who says it himself.
    #[must_use]
    pub fn without_place(mut self) -> Self {
        self.0.place = None;
        self
    }

    /// The same of another kind.
    #[must_use]
    pub fn of_kind(mut self, kind: Kind) -> Self {
        self.0.kind = kind;
        self
    }

    /// Says the way out.
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

    /// Where it happened, if known.
    #[must_use]
    pub fn place(&self) -> Option<&str> {
        self.0.place.as_deref()
    }

    /// The way out, if known.
    #[must_use]
    pub fn way_out(&self) -> Option<&str> {
        self.0.hint.as_deref()
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.0.place {
            // A path may hold anything, a line break among it; `what` and its source are sentences.
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

/// Whether a file that is to be read is not there, is none, or ends early: the input is to be
/// mended, not the machine.
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
