//! Opens PTS files (a count, then a line a point, once or several times) and plain text with a line
//! a point (XYZ, CSV, TXT, ASC), with or without names of the columns.

use super::body::{CloudSeed, RecordBody};
use super::fields::CloudFields;
use super::text_body::{STRETCH, Stretch, TextBody, data, is_comment, separator, words};
use crate::text::{TextLines, number, shown};
use contract::{Error, Result};
use std::path::Path;

/// Number of first lines by which it is judged what the columns hold.
const N_JUDGED: usize = 64;
/// Number of bytes in which these lie.
const JUDGED_BYTES: u64 = 1 << 16;

/// A kind of text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TextKind {
    Pts,
    Xyz,
}

/// The kind of text that begins so: a count and then lines of numbers, or lines of at least three
/// numbers after comments and up to one line of names; `None` for other text.
pub(crate) fn kind(head: &[u8]) -> Option<TextKind> {
    let mut lines = head.split(|b| *b == b'\n').filter_map(data);
    let first = lines.next()?;
    let second = lines.next();
    let is_point = |line: &[u8]| {
        let words: Vec<&[u8]> = words(line, separator(line)).take(3).collect();
        words.len() == 3 && words.iter().all(|word| number(word).is_some())
    };
    if is_count(first) {
        return second.filter(|line| is_point(line)).map(|_| TextKind::Pts);
    }
    let is_named = || CloudFields::by_names(&named(first)).is_some();
    (is_point(first) || is_named()).then_some(TextKind::Xyz)
}

/// Whether a line is a number of points alone.
fn is_count(line: &[u8]) -> bool {
    !line.is_empty() && line.iter().all(u8::is_ascii_digit)
}

fn named(line: &[u8]) -> Vec<(String, usize)> {
    let names = words(line, separator(line)).enumerate();
    names.map(|(i, name)| (String::from_utf8_lossy(name).into_owned(), i)).collect()
}

/// Opens a text file: counts all lines, since only so places are known.
pub(super) fn open(path: &Path, kind: TextKind) -> Result<Vec<CloudSeed>> {
    let mut lines = TextLines::open(path, 0, 0)?;
    let mut out: Vec<CloudSeed> = Vec::new();
    match kind {
        TextKind::Xyz => out.push(table(path, &mut lines)?),
        TextKind::Pts => {
            let mut goes_on = next(&mut lines)?;
            while goes_on {
                let block = block(&mut lines, out.len() + 1)?;
                goes_on = block.1;
                out.push(block.0);
            }
        }
    }
    Ok(out)
}

/// Moves to the next line that is no comment.
fn next(lines: &mut TextLines) -> Result<bool> {
    while lines.advance()? {
        if data(lines.line()).is_some() {
            return Ok(true);
        }
    }
    Ok(false)
}

/// A block of a PTS file, from the line with its count on; and whether another one follows, at
/// whose count the lines then are.
fn block(lines: &mut TextLines, number: usize) -> Result<(CloudSeed, bool)> {
    let text = data(lines.line()).unwrap_or_default();
    let stated = std::str::from_utf8(text).ok().and_then(|t| t.parse::<u64>().ok());
    let Some(stated) = stated else {
        let what = format!("number of points is no count, \"{}\"", shown(text));
        return Err(lines.error(what).hint("the file is damaged; export it again"));
    };
    let count_line = lines.number();
    let found = counted(lines, |line, _| is_count(line))?;
    let goes_on = found.goes_on;
    let mut seed = seed_of(found, None)?;
    if seed.n_records < stated {
        let what = format!("file announces \"{stated}\" points here, but holds {}", seed.n_records);
        return Err(Error::bad_input(what)
            .at(format!("line {count_line}"))
            .hint("the file is truncated: copy or export it again"));
    }
    if seed.n_records > stated {
        seed.notes.push(format!(
            "the file announces {stated} points and holds {}: all are read",
            seed.n_records
        ));
    }
    seed.name = Some(format!("scan {number}"));
    Ok((seed, goes_on))
}

/// The records of a file without counts.
fn table(path: &Path, lines: &mut TextLines) -> Result<CloudSeed> {
    let mut comment: Vec<u8> = Vec::new();
    let (mut byte, mut line) = (0, 0);
    while lines.advance()? {
        let text = lines.line();
        if let Some(text) = data(text) {
            let is_names = words(text, separator(text)).take(3).any(|word| number(word).is_none());
            let names = if is_names { text.to_vec() } else { comment };
            let fields = CloudFields::by_names(&named(&names));
            if is_names && fields.is_none() {
                let what = format!("columns of x, y and z are not named, \"{}\"", shown(&names));
                return Err(lines
                    .error(what)
                    .hint("name the columns x, y and z in the first line"));
            }
            let n_names = named(&names).len();
            let fields = fields.map(|fields| (fields, n_names, is_names));
            let mut again = match is_names {
                true => TextLines::open(path, lines.end(), lines.number())?,
                false => TextLines::open(path, byte, line)?,
            };
            return seed_of(counted(&mut again, |_, _| false)?, fields);
        }
        if is_comment(text) {
            comment = text.to_vec();
        }
        (byte, line) = (lines.end(), lines.number());
    }
    Err(Error::bad_input("file holds no point").hint("export it again"))
}

/// The records of a file without names of columns, or with named `fields`, the number of names, and
/// whether these count for every line.
fn seed_of(found: CountedLines, fields: Option<(CloudFields, usize, bool)>) -> Result<CloudSeed> {
    if found.n > 0 && found.n_columns < 3 {
        let line = found.stretches.first().map_or(0, |stretch| stretch.line + 1);
        let n = found.n_columns;
        let what = format!("line of a point must hold at least 3 numbers, not \"{n}\"");
        return Err(Error::bad_input(what).at(format!("line {line}")));
    }
    let fields = match fields {
        Some((fields, n_names, counts)) if counts || n_names == found.n_columns => fields,
        _ => CloudFields::by_number(found.n_columns, &found.first),
    };
    let mut body = TextBody::new(found.separator, found.n_columns, &fields.slots());
    (body.stretches, body.end) = (found.stretches, found.end);
    Ok(CloudSeed::new(RecordBody::Text(body), fields, found.n))
}

/// Finds the lines of the points that a header of PLY or PCD announces, `n` of them after
/// `n_skipped` others from a byte and after a line.
pub(super) fn announced(
    path: &Path,
    (byte, line, n_skipped): (u64, u64, u64),
    n: u64,
    body: &mut TextBody,
) -> Result<()> {
    let mut lines = TextLines::open(path, byte, line)?;
    let before = counted(&mut lines, |_, at| at == n_skipped)?;
    let mut again = match n_skipped {
        0 => TextLines::open(path, byte, line)?,
        _ => TextLines::open(path, before.end, before.end_line)?,
    };
    let found = counted(&mut again, |_, at| at == n)?;
    if found.n < n {
        return Err(super::header::too_short(n));
    }
    (body.stretches, body.end) = (found.stretches, found.end);
    Ok(())
}

/// Lines of records, as they were counted.
#[derive(Debug, Default)]
struct CountedLines {
    n: u64,
    stretches: Vec<Stretch>,
    /// Byte after the last record, and the number of its line.
    end: u64,
    end_line: u64,
    /// Whether a line ended the records.
    goes_on: bool,
    separator: Option<u8>,
    n_columns: usize,
    /// Values of the first records; no number where a word is none.
    first: Vec<Vec<f64>>,
}

/// Counts the records from the next line on, up to a line at which they end, of which `is_end` gets
/// text and number of records before; the lines then are at it.
fn counted(lines: &mut TextLines, is_end: impl Fn(&[u8], u64) -> bool) -> Result<CountedLines> {
    let (end, end_line) = (lines.end(), lines.number());
    let mut out = CountedLines { end, end_line, ..CountedLines::default() };
    loop {
        let before = Stretch { byte: lines.end(), line: lines.number() };
        if !lines.advance()? {
            return Ok(out);
        }
        let Some(text) = data(lines.line()) else { continue };
        if is_end(text, out.n) {
            out.goes_on = true;
            return Ok(out);
        }
        if out.n == 0 {
            out.separator = separator(text);
            out.n_columns = words(text, out.separator).count();
        }
        if out.first.len() < N_JUDGED {
            let value = |word: &[u8]| number(word).unwrap_or(f64::NAN);
            out.first.push(words(text, out.separator).map(value).collect());
        }
        if out.n.is_multiple_of(STRETCH) {
            out.stretches.push(before);
        }
        out.n += 1;
        (out.end, out.end_line) = (lines.end(), lines.number());
    }
}

/// Number of bytes of a file's beginning by which its kind is judged.
pub(crate) const HEAD: u64 = JUDGED_BYTES;
