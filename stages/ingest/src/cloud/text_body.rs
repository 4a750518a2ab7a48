//! Records as lines of text: where every few thousand of them begin, and their values.

use super::fields::{N_SLOTS, Slots};
use crate::text::{number, shown};
use contract::{Error, Result};

/// Number of records between the places that are kept.
pub(super) const STRETCH: u64 = 4096;
/// Mark that a column is not read.
const UNREAD: u8 = u8::MAX;
/// Byte order mark of UTF-8, which some programs write first.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// The beginning of a stretch of lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stretch {
    /// Byte of its first line, and number of the line before.
    pub(super) byte: u64,
    pub(super) line: u64,
}

/// Lines of records. Stretch `i` begins with record `i * STRETCH`.
#[derive(Debug, Clone)]
pub(super) struct TextBody {
    /// Byte between columns; `None` for white space.
    pub(super) separator: Option<u8>,
    pub(super) n_columns: usize,
    /// Slot of each column, as far as columns are read.
    slot_of: Vec<u8>,
    pub(super) stretches: Vec<Stretch>,
    /// Byte after the last record.
    pub(super) end: u64,
}

impl TextBody {
    pub(super) fn new(separator: Option<u8>, n_columns: usize, slots: &[(usize, usize)]) -> Self {
        let n_read = slots.iter().map(|(column, _)| column + 1).max().unwrap_or(0);
        let mut slot_of = vec![UNREAD; n_read];
        for (column, slot) in slots {
            slot_of[*column] = *slot as u8;
        }
        Self { separator, n_columns, slot_of, stretches: Vec::new(), end: 0 }
    }

    /// Bytes of some stretches.
    pub(super) fn bytes(&self, from: usize, n: usize) -> std::ops::Range<u64> {
        let at = |i: usize| self.stretches.get(i).map_or(self.end, |stretch| stretch.byte);
        at(from)..at(from.saturating_add(n))
    }

    /// The records of whole lines, of which the first has the number `line + 1`.
    pub(super) fn records<'a>(
        &'a self,
        bytes: &'a [u8],
        line: u64,
    ) -> impl Iterator<Item = Result<Slots>> + 'a {
        let lines = bytes.split(|b| *b == b'\n').zip(line + 1..);
        let data = lines.filter_map(|(text, line)| Some((data(text)?, line)));
        data.map(|(text, line)| self.record(text).map_err(|e| e.at(format!("line {line}"))))
    }

    /// The values of a line.
    fn record(&self, text: &[u8]) -> Result<Slots> {
        let mut out = [0.0; N_SLOTS];
        let mut n = 0;
        for (column, word) in words(text, self.separator).enumerate() {
            n = column + 1;
            let slot = self.slot_of.get(column).copied().unwrap_or(UNREAD);
            if slot != UNREAD {
                out[usize::from(slot)] = number(word).ok_or_else(|| {
                    Error::bad_input(format!("not a number, \"{}\"", shown(word)))
                        .hint("numbers need a decimal point, not a comma")
                })?;
            }
        }
        if n != self.n_columns {
            let what =
                format!("line holds not {} values as the first, but \"{n}\"", self.n_columns);
            return Err(Error::bad_input(what).hint("the file is damaged; export it again"));
        }
        Ok(out)
    }
}

/// A line without white space and marks around it; `None` for a blank line or a comment.
pub(super) fn data(line: &[u8]) -> Option<&[u8]> {
    let line = line.strip_prefix(MARK).unwrap_or(line).trim_ascii();
    (!line.is_empty() && !is_comment(line)).then_some(line)
}

/// Whether a line is a comment.
pub(super) fn is_comment(line: &[u8]) -> bool {
    let line = line.strip_prefix(MARK).unwrap_or(line);
    line.starts_with(b"#") || line.starts_with(b"//")
}

/// The byte between the columns of a line.
pub(super) fn separator(line: &[u8]) -> Option<u8> {
    [b';', b','].into_iter().find(|byte| line.contains(byte))
}

/// The columns of a line.
pub(super) fn words(line: &[u8], separator: Option<u8>) -> impl Iterator<Item = &[u8]> {
    let is_between = move |byte: &u8| match separator {
        Some(separator) => *byte == separator,
        None => byte.is_ascii_whitespace(),
    };
    let bare = |word: &[u8]| -> bool { !word.is_empty() };
    let all = line.split(is_between);
    all.filter(move |word| separator.is_some() || bare(word)).map(|word| {
        let word = word.trim_ascii();
        word.strip_prefix(b"\"").and_then(|w| w.strip_suffix(b"\"")).unwrap_or(word)
    })
}
