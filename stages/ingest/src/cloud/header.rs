//! Lines of text at the beginning of a file whose rest may be binary.

use contract::{Error, Result};

/// Largest header, bytes. Real ones have a few hundred, and comments some more.
const MAX_HEADER: usize = 1 << 16;

/// The lines of a header, one after the other.
pub(super) struct HeaderLines<'a> {
    file: &'a [u8],
    at: usize,
    number: u64,
}

impl<'a> HeaderLines<'a> {
    pub(super) fn new(file: &'a [u8]) -> Self {
        Self { file: &file[..file.len().min(MAX_HEADER)], at: 0, number: 0 }
    }

    /// The words of the next line.
    pub(super) fn next(&mut self) -> Result<Vec<std::borrow::Cow<'a, str>>> {
        let rest = &self.file[self.at..];
        let Some(len) = rest.iter().position(|b| *b == b'\n') else {
            return Err(self
                .error("header does not end")
                .hint("the file is truncated or damaged: copy or export it again"));
        };
        self.at += len + 1;
        self.number += 1;
        let words = rest[..len].split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        Ok(words.map(String::from_utf8_lossy).collect())
    }

    /// Byte after the current line.
    pub(super) fn end(&self) -> usize {
        self.at
    }

    /// Number of the current line, from 1.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// An error about the current line.
    pub(super) fn error(&self, what: impl Into<String>) -> Error {
        Error::bad_input(what).at(format!("line {}", self.number))
    }
}

/// The error of a file that holds fewer points than its header announces.
pub(super) fn too_short(n: u64) -> Error {
    Error::bad_input(format!("file is too short for the announced points, \"{n}\""))
        .at("header")
        .hint("the file is truncated or its header is wrong: copy or export it again")
}
