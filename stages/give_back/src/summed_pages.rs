//! Writes bytes as pages of an E57 file, each with its checksum. What becomes known late is patched
//! at the end.

use crate::checked_pages::{PAGE, PAYLOAD, checksum};
use contract::Result;
use std::io::{Read, Seek, SeekFrom, Write};

/// Number of bytes of pages that are written at once.
const GATHER: usize = 1 << 19;

/// A file that is written page by page.
#[derive(Debug)]
pub(crate) struct SummedPages<W> {
    to: W,
    /// Whole pages, and the payload of the last one as far as it is known.
    waiting: Vec<u8>,
    /// Number of bytes of that payload.
    n_open: u64,
    /// Number of whole pages, waiting ones included.
    n_pages: u64,
    /// Bytes that replace others at a logical offset.
    patches: Vec<(u64, Vec<u8>)>,
}

impl<W: Read + Write + Seek> SummedPages<W> {
    /// Starts at the beginning of an empty file.
    pub(crate) fn new(to: W) -> Self {
        let waiting = Vec::with_capacity(GATHER + PAGE as usize);
        Self { to, waiting, n_open: 0, n_pages: 0, patches: Vec::new() }
    }

    /// Logical offset of the next byte.
    pub(crate) fn position(&self) -> u64 {
        self.n_pages * PAYLOAD + self.n_open
    }

    /// Offset in the file of a logical one.
    pub(crate) fn physical(logical: u64) -> u64 {
        logical / PAYLOAD * PAGE + logical % PAYLOAD
    }

    /// Appends bytes.
    pub(crate) fn write(&mut self, mut bytes: &[u8]) -> Result<()> {
        while !bytes.is_empty() {
            let n = bytes.len().min((PAYLOAD - self.n_open) as usize);
            let (now, later) = bytes.split_at(n);
            self.waiting.extend_from_slice(now);
            self.n_open += n as u64;
            bytes = later;
            if self.n_open == PAYLOAD {
                self.close_page()?;
            }
        }
        Ok(())
    }

    fn close_page(&mut self) -> Result<()> {
        let from = self.waiting.len() - PAYLOAD as usize;
        let sum = checksum(&self.waiting[from..]);
        self.waiting.extend_from_slice(&sum);
        (self.n_pages, self.n_open) = (self.n_pages + 1, 0);
        if self.waiting.len() >= GATHER {
            self.flush()?;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<()> {
        self.to.write_all(&self.waiting)?;
        self.waiting.clear();
        Ok(())
    }

    /// Appends zeros up to the next multiple of four bytes.
    pub(crate) fn align(&mut self) -> Result<()> {
        let n = self.position().next_multiple_of(4) - self.position();
        self.write(&[0; 3][..n as usize])
    }

    /// Replaces bytes that were written, when the file is finished.
    pub(crate) fn patch(&mut self, at: u64, bytes: &[u8]) {
        self.patches.push((at, bytes.to_vec()));
    }

    /// Fills the last page, writes all patches and returns the file and its length.
    pub(crate) fn finish(mut self) -> Result<W> {
        if self.n_open > 0 {
            self.write(&[0; PAYLOAD as usize][self.n_open as usize..])?;
        }
        self.flush()?;
        for (at, bytes) in std::mem::take(&mut self.patches) {
            self.apply(at, &bytes)?;
        }
        Ok(self.to)
    }

    /// Length that the finished file will have, bytes.
    pub(crate) fn n_bytes(&self) -> u64 {
        self.position().div_ceil(PAYLOAD) * PAGE
    }

    fn apply(&mut self, mut at: u64, mut bytes: &[u8]) -> Result<()> {
        while !bytes.is_empty() {
            let (page, within) = (at / PAYLOAD * PAGE, (at % PAYLOAD) as usize);
            let n = bytes.len().min(PAYLOAD as usize - within);
            let mut raw = [0; PAGE as usize];
            self.to.seek(SeekFrom::Start(page))?;
            self.to.read_exact(&mut raw)?;
            raw[within..within + n].copy_from_slice(&bytes[..n]);
            let sum = checksum(&raw[..PAYLOAD as usize]);
            raw[PAYLOAD as usize..].copy_from_slice(&sum);
            self.to.seek(SeekFrom::Start(page))?;
            self.to.write_all(&raw)?;
            (at, bytes) = (at + n as u64, &bytes[n..]);
        }
        Ok(())
    }
}
