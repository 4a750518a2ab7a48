//! Reads lines and numbers from text files of points, independent of the format.

use contract::{Error, Result, quote};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Longest line, bytes; seven numbers of 17 digits need 200.
const MAX_LINE: u64 = 4096;
/// Number of bytes that are read at once.
const BUFFER: usize = 1 << 20;

/// Reads a file line by line; blank lines are skipped.
pub(crate) struct TextLines {
    reader: BufReader<File>,
    line: Vec<u8>,
    /// Number of the current line, from 1.
    number: u64,
    /// Byte after the current line.
    end: u64,
}

impl TextLines {
    /// Starts at byte `from` of a file, where line `number + 1` begins.
    pub(crate) fn open(path: &Path, from: u64, number: u64) -> Result<Self> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(from))?;
        Ok(Self {
            reader: BufReader::with_capacity(BUFFER, file),
            line: Vec::new(),
            number,
            end: from,
        })
    }

    /// Reads the next line that is not blank; returns false at the end of the file.
    pub(crate) fn advance(&mut self) -> Result<bool> {
        loop {
            self.line.clear();
            let n_bytes = (&mut self.reader).take(MAX_LINE).read_until(b'\n', &mut self.line)?;
            if n_bytes == 0 {
                return Ok(false);
            }
            self.number += 1;
            self.end += n_bytes as u64;
            if n_bytes as u64 == MAX_LINE && self.line.last() != Some(&b'\n') {
                return Err(self.error(format!(
                    "line is longer than any line of numbers, bytes \"{MAX_LINE}\""
                )));
            }
            let blank = self.line.iter().rposition(|b| !b.is_ascii_whitespace());
            if let Some(last) = blank {
                self.line.truncate(last + 1);
                return Ok(true);
            }
        }
    }

    /// The current line without trailing white space.
    pub(crate) fn line(&self) -> &[u8] {
        &self.line
    }

    /// Number of the current line, from 1.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }

    /// Byte after the current line.
    pub(crate) fn end(&self) -> u64 {
        self.end
    }

    /// An error about the current line.
    pub(crate) fn error(&self, what: impl Into<String>) -> Error {
        Error::bad_input(what).at(format!("line {}", self.number))
    }

    /// The numbers of the current line; an error if there are not exactly `N`.
    pub(crate) fn exactly<const N: usize>(&self) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        match numbers(&self.line, &mut out) {
            Ok(n) if n == N => Ok(out),
            Ok(n) => Err(self.error(format!("line must hold {N} numbers, not \"{n}\""))),
            Err(word) => Err(self.error(format!("not a number, \"{word}\""))),
        }
    }
}

/// Parses the numbers of a line into `out` and returns how many there are; those beyond the length
/// of `out` are only counted. The error is the word that is no number.
pub(crate) fn numbers(line: &[u8], out: &mut [f64]) -> std::result::Result<usize, String> {
    let mut n = 0;
    let mut rest = line;
    loop {
        while let [b' ' | b'\t' | b'\r' | b'\n' | 0x0c, after @ ..] = rest {
            rest = after;
        }
        if rest.is_empty() {
            return Ok(n);
        }
        let Some(slot) = out.get_mut(n) else {
            return Ok(n + rest.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).count());
        };
        let len = match plain(rest) {
            Some((value, len)) => {
                *slot = value;
                len
            }
            None => {
                let len = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
                let text = std::str::from_utf8(&rest[..len]).ok();
                *slot = text.and_then(|t| t.parse().ok()).ok_or_else(|| shown(&rest[..len]))?;
                len
            }
        };
        (n, rest) = (n + 1, &rest[len..]);
    }
}

/// The number that a word is.
#[inline]
pub(crate) fn number(word: &[u8]) -> Option<f64> {
    match plain(word) {
        Some((value, len)) if len == word.len() => Some(value),
        _ => std::str::from_utf8(word).ok()?.parse().ok(),
    }
}

/// A word for a message: shortened and printable.
pub(crate) fn shown(word: &[u8]) -> String {
    quote::shown(&String::from_utf8_lossy(&word[..word.len().min(40)])).into_owned()
}

/// The number at the beginning of a line and its length in bytes. Handles the common case only, but
/// exactly: with at most 15 digits and an optional point both the digits and the power of ten are
/// exact in `f64`, so that the one division rounds once.
#[inline]
fn plain(line: &[u8]) -> Option<(f64, usize)> {
    const POWERS: [f64; 16] =
        [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let sign = usize::from(line.first() == Some(&b'-'));
    let (mut value, mut n_digits, mut n_decimals, mut len) = (0_u64, 0, None, sign);
    for byte in &line[sign..] {
        match byte {
            b'0'..=b'9' if n_digits < 15 => {
                value = value * 10 + u64::from(byte - b'0');
                n_digits += 1;
                n_decimals = n_decimals.map(|n: usize| n + 1);
            }
            b'.' if n_decimals.is_none() => n_decimals = Some(0),
            b' ' | b'\t' | b'\r' | b'\n' | 0x0c => break,
            _ => return None,
        }
        len += 1;
    }
    if n_digits == 0 {
        return None;
    }
    let value = value as f64 / POWERS[n_decimals.unwrap_or(0)];
    Some((if sign == 1 { -value } else { value }, len))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A word of a line: a number as programs write it, or something that is nearly a number.
    fn word() -> impl Strategy<Value = String> {
        prop_oneof![
            any::<f64>().prop_map(|v| v.to_string()),
            (-1e7_f64..1e7, 0_usize..12).prop_map(|(v, n)| format!("{v:.n$}")),
            any::<f32>().prop_map(|v| format!("{v:e}")),
            "[-+]?[0-9]{0,20}[.]?[0-9]{0,20}",
            "[-+0-9.eE]{1,9}",
            "nan|inf|-inf|x|1,5",
        ]
    }

    proptest! {
        #[test]
        fn numbers_of_a_line_are_those_of_the_standard_library(
            words in prop::collection::vec(word().prop_filter("a word", |w| !w.is_empty()), 0..9),
            gap in prop::sample::select(vec![" ", "\t", "  ", " \r"]),
        ) {
            let line = words.join(gap);
            let mut out = [0.0; 7];
            let parsed: std::result::Result<Vec<f64>, &String> =
                words.iter().take(out.len()).map(|w| w.parse::<f64>().map_err(|_| w)).collect();
            match (numbers(line.as_bytes(), &mut out), parsed) {
                (Ok(n), Ok(wanted)) => {
                    prop_assert_eq!(n, words.len());
                    for (got, want) in out.iter().zip(&wanted) {
                        let same = got.to_bits() == want.to_bits() || got.is_nan() && want.is_nan();
                        prop_assert!(same, "{} for {} in {}", got, want, line);
                    }
                }
                (Err(word), Err(wrong)) => prop_assert_eq!(&word, wrong),
                (got, wanted) => prop_assert!(false, "{:?} where {:?}: {}", got, wanted, line),
            }
        }
    }

    fn of_word(word: &str) -> Option<f64> {
        let mut out = [0.0];
        let of_line = (numbers(word.as_bytes(), &mut out) == Ok(1)).then_some(out[0]);
        let alone = number(word.as_bytes());
        assert_eq!(of_line.map(f64::to_bits), alone.map(f64::to_bits), "{word}");
        alone
    }

    #[test]
    fn numbers_are_the_nearest_ones() {
        for word in [
            "0",
            "-0.0",
            "1",
            "-3.028748",
            "637012.240000",
            ".5",
            "5.",
            "1e-3",
            "123456789.012345",
            "+2.5",
            "12345678901234567890.5",
            "0.1234567890123456789",
            "-inf",
            "1E5",
            "000000000000000000001",
        ] {
            let want: f64 = word.parse().expect("a number");
            assert_eq!(of_word(word).map(f64::to_bits), Some(want.to_bits()), "{word}");
        }
        assert!(of_word("nan").is_some_and(f64::is_nan));
        for word in ["", "-", ".", "1,5", "1.2.3", "x", "--1", "1\u{a0}2"] {
            assert_eq!(of_word(word), None, "{word}");
        }
    }

    #[test]
    fn extra_numbers_are_counted() {
        let mut out = [0.0; 2];
        assert_eq!(numbers(b"  1 2\t3  ", &mut out), Ok(3));
        assert_eq!(out, [1.0, 2.0]);
        assert_eq!(numbers(b"1 x", &mut out), Err("x".into()));
    }
}
