//! Cuts a PTX file into pieces: headers of scans, and lines of points.

use contract::{Error, Result, Weigh, is_ptx_no_return};
use std::io::Read;

/// Number of bytes that are read at once, and about the length of a piece.
const PIECE: usize = 1 << 20;
/// Longest line, bytes; seven numbers of 17 digits need 200.
const MAX_LINE: usize = 4096;
/// Number of lines of a header behind columns and rows: position, axes and matrix.
const N_POSE_LINES: u64 = 8;

/// Lines of a PTX file.
#[derive(Debug)]
pub struct PtxPiece {
    /// The lines as they are.
    pub(crate) bytes: Vec<u8>,
    /// Index of the scan.
    pub(crate) scan: usize,
    /// Number of lines of points; none in a header.
    pub(crate) n_lines: u64,
    /// Place of the first of its points among all that have a return, and number of these points.
    pub(crate) first_place: u64,
    pub(crate) n_valid: usize,
}

impl Weigh for PtxPiece {
    fn weight_bytes(&self) -> usize {
        self.bytes.len()
    }

    fn n_points(&self) -> u64 {
        self.n_lines
    }
}

/// What the next line is.
#[derive(Debug, Clone, Copy)]
enum PtxLine {
    Columns,
    Rows(u64),
    Pose { left: u64, n_points: u64 },
    Points { left: u64 },
}

/// Iterator over the pieces of a PTX file.
pub struct PtxPieces<R> {
    from: R,
    /// Bytes that were read, from the first one on that belongs to no piece yet.
    waiting: Vec<u8>,
    is_at_end: bool,
    next: PtxLine,
    scan: usize,
    place: u64,
    number: u64,
    has_failed: bool,
}

impl<R: Read> PtxPieces<R> {
    /// Starts at the beginning of a file.
    #[must_use]
    pub fn new(from: R) -> Self {
        let (waiting, next) = (Vec::new(), PtxLine::Columns);
        let (is_at_end, has_failed) = (false, false);
        Self { from, waiting, is_at_end, next, scan: 0, place: 0, number: 0, has_failed }
    }

    fn piece(&mut self) -> Result<Option<PtxPiece>> {
        let (mut end, mut n_lines, mut n_valid) = (0, 0, 0);
        let is_points = matches!(self.next, PtxLine::Points { .. });
        let (scan, first_place) = (self.scan, self.place);
        while end < PIECE && is_points == matches!(self.next, PtxLine::Points { .. }) {
            let Some(len) = self.line(end)? else { break };
            let line = &self.waiting[end..end + len];
            end += len;
            self.number += 1;
            if line.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            if is_points {
                n_lines += 1;
                n_valid += usize::from(!is_ptx_no_return(line.trim_ascii_end()));
            }
            let is_empty_scan = matches!(self.next, PtxLine::Pose { left: 1, n_points: 0 });
            self.next = self.after(&self.waiting[end - len..end])?;
            self.scan += usize::from(is_empty_scan);
        }
        if end == 0 {
            return self.check_end();
        }
        self.place += n_valid as u64;
        if is_points && !matches!(self.next, PtxLine::Points { .. }) {
            (self.scan, self.place) = (self.scan + 1, 0);
        }
        let rest = self.waiting.split_off(end);
        let bytes = std::mem::replace(&mut self.waiting, rest);
        Ok(Some(PtxPiece { bytes, scan, n_lines, first_place, n_valid }))
    }

    /// Length of the line that begins at byte `from` of what waits; `None` at the end of the file.
    fn line(&mut self, from: usize) -> Result<Option<usize>> {
        let mut seen = from;
        loop {
            if let Some(n) = self.waiting[seen..].iter().position(|b| *b == b'\n') {
                return Ok(Some(seen + n + 1 - from));
            }
            seen = self.waiting.len();
            if self.is_at_end {
                return Ok(Some(seen - from).filter(|len| *len > 0));
            }
            if seen - from > MAX_LINE {
                return Err(self.error("line is longer than any line of numbers"));
            }
            let read = (&mut self.from).take(PIECE as u64).read_to_end(&mut self.waiting)?;
            self.is_at_end = read == 0;
        }
    }

    /// What follows a line that is not blank.
    fn after(&self, line: &[u8]) -> Result<PtxLine> {
        let points = |left| if left == 0 { PtxLine::Columns } else { PtxLine::Points { left } };
        let number = || -> Result<u64> {
            let text = std::str::from_utf8(line).ok().and_then(|t| t.trim().parse::<f64>().ok());
            let is_count = |v: &f64| *v >= 0.0 && v.fract() == 0.0 && *v <= 1e12;
            let number = text.filter(is_count).map(|v| v as u64);
            number.ok_or_else(|| self.error("number of columns or rows is no count"))
        };
        Ok(match self.next {
            PtxLine::Columns => PtxLine::Rows(number()?),
            PtxLine::Rows(n_columns) => {
                let n_points = n_columns.checked_mul(number()?);
                let n_points = n_points.ok_or_else(|| self.error("too many rows"))?;
                PtxLine::Pose { left: N_POSE_LINES, n_points }
            }
            PtxLine::Pose { left: 1, n_points } => points(n_points),
            PtxLine::Pose { left, n_points } => PtxLine::Pose { left: left - 1, n_points },
            PtxLine::Points { left } => points(left - 1),
        })
    }

    fn check_end(&self) -> Result<Option<PtxPiece>> {
        match self.next {
            PtxLine::Columns => Ok(None),
            _ => Err(self.error("file ends within a scan")),
        }
    }

    fn error(&self, what: &str) -> Error {
        Error::bad_input(what).at(format!("line {}", self.number)).hint("export it again")
    }
}

impl<R: Read> Iterator for PtxPieces<R> {
    type Item = Result<PtxPiece>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.has_failed {
            return None;
        }
        let piece = self.piece();
        self.has_failed = piece.is_err();
        piece.transpose()
    }
}
