//! Turns lines of points that move into lines of beams without return.

use crate::fate::{GivenBack, ScanFates};
use crate::ptx_pieces::PtxPiece;
use contract::{Error, Map, Result, Weigh, is_ptx_no_return};

/// Lines as they are written.
#[derive(Debug)]
pub struct MarkedLines {
    /// The lines.
    pub bytes: Vec<u8>,
    /// Index of the scan.
    pub scan: usize,
    /// Numbers of its points.
    pub counts: GivenBack,
}

impl Weigh for MarkedLines {
    fn weight_bytes(&self) -> usize {
        self.bytes.len()
    }
}

/// The step that marks lines of points.
pub struct LineMarker<'a> {
    fates: &'a [&'a dyn ScanFates],
}

impl<'a> LineMarker<'a> {
    /// The step for a file whose scans have these labels.
    #[must_use]
    pub fn new(fates: &'a [&'a dyn ScanFates]) -> Self {
        Self { fates }
    }
}

impl Map for LineMarker<'_> {
    type In = PtxPiece;
    type Out = MarkedLines;
    type Scratch = ();

    fn apply(&self, piece: PtxPiece, (): &mut ()) -> Result<MarkedLines> {
        let PtxPiece { bytes, scan, n_valid, first_place, .. } = piece;
        let mut counts = GivenBack { n_valid: n_valid as u64, n_out: 0 };
        if n_valid == 0 {
            return Ok(MarkedLines { bytes, scan, counts });
        }
        let all = self.fates.get(scan).ok_or_else(|| {
            let what = "file holds more scans than when its points were labelled";
            Error::bad_input(format!("{what}, \"{}\"", self.fates.len()))
        })?;
        let mut fates = all.range(first_place, n_valid)?.into_iter();
        let mut out = Vec::with_capacity(bytes.len());
        // Lines that stay are copied together.
        let (mut done, mut at) = (0, 0);
        for line in bytes.split_inclusive(|b| *b == b'\n') {
            let content = line.trim_ascii_end();
            let has_point = !content.is_empty() && !is_ptx_no_return(content);
            if has_point && fates.next().is_some_and(|fate| fate.is_out) {
                out.extend_from_slice(&bytes[done..at]);
                out.extend_from_slice(b"0 0 0");
                done = at + behind_coordinates(line);
                counts.n_out += 1;
            }
            at += line.len();
        }
        if counts.n_out == 0 {
            return Ok(MarkedLines { bytes, scan, counts });
        }
        out.extend_from_slice(&bytes[done..]);
        Ok(MarkedLines { bytes: out, scan, counts })
    }
}

/// Length of the first three words of a line, with the space before them.
fn behind_coordinates(line: &[u8]) -> usize {
    let mut at = 0;
    for _word in 0..3 {
        let space = line[at..].iter().take_while(|b| b.is_ascii_whitespace()).count();
        let word = line[at + space..].iter().take_while(|b| !b.is_ascii_whitespace()).count();
        at += space + word;
    }
    at
}
