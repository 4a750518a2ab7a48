//! Reads bytes of an E57 file, which consists of pages of 1024 bytes whose last four are a checksum
//! of the others. Each page that is read is checked.

use contract::{Error, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Length of a page, bytes; the standard's reference library supports no other.
pub(super) const PAGE: u64 = 1024;
/// Length of a page without its checksum, bytes.
const PAYLOAD: u64 = PAGE - 4;
/// Number of pages that are read at once: 256 KiB keep a disk busy, fit the second-level cache and
/// hold any packet (64 KiB).
const WINDOW: u64 = 256;

/// An open file, addressed by logical offsets, which do not count checksums.
pub(super) struct Pages {
    file: File,
    n_pages: u64,
    /// Number of the first page of the window.
    first: u64,
    /// Pages of the window as stored in the file.
    raw: Vec<u8>,
    /// Payloads of the pages of the window that have been checked.
    checked: Vec<u8>,
}

impl Pages {
    /// Opens a file without reading it.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path)?;
        let n_bytes = file.metadata()?.len();
        if n_bytes == 0 {
            return Err(Error::bad_input("file is empty, \"0\" bytes"));
        }
        if n_bytes % PAGE != 0 {
            return Err(Error::bad_input(format!(
                "file is truncated: its length is no multiple of a page of {PAGE} bytes, \"{n_bytes}\""
            ))
            .hint("copy the file again"));
        }
        Ok(Self { file, n_pages: n_bytes / PAGE, first: 0, raw: Vec::new(), checked: Vec::new() })
    }

    /// Length of the file without checksums, bytes.
    pub(super) fn len(&self) -> u64 {
        self.n_pages * PAYLOAD
    }

    /// Length of the file, bytes.
    pub(super) fn len_on_disk(&self) -> u64 {
        self.n_pages * PAGE
    }

    /// Converts an offset in the file to a logical one (without checksums).
    pub(super) fn logical(&self, physical: u64) -> Result<u64> {
        if physical >= self.len_on_disk() || physical % PAGE >= PAYLOAD {
            return Err(Error::bad_input(format!(
                "an offset points outside the file or into a checksum, \"{physical}\""
            )));
        }
        Ok(physical / PAGE * PAYLOAD + physical % PAGE)
    }

    /// Number of the page that holds a logical offset.
    pub(super) fn page(at: u64) -> u64 {
        at / PAYLOAD
    }

    /// The bytes from logical offset `at` on; at most 64 KiB.
    pub(super) fn read(&mut self, at: u64, len: usize) -> Result<&[u8]> {
        let end = at.checked_add(len as u64).filter(|end| *end <= self.len());
        let Some(end) = end else {
            return Err(Error::bad_input(format!(
                "file ends before what it announces, \"{len}\" bytes more"
            ))
            .at(format!("page {}", Self::page(at))));
        };
        let (from, until) = (Self::page(at), end.div_ceil(PAYLOAD).max(Self::page(at) + 1));
        if from < self.first || until > self.first + self.raw.len() as u64 / PAGE {
            self.load(from)?;
        }
        self.check(until)?;
        let start = (at - self.first * PAYLOAD) as usize;
        Ok(&self.checked[start..start + len])
    }

    /// Reads the window that begins at page `from`.
    fn load(&mut self, from: u64) -> Result<()> {
        let n_bytes = (self.n_pages - from).min(WINDOW) * PAGE;
        self.checked.clear();
        self.raw.clear();
        self.first = from;
        self.raw.resize(n_bytes as usize, 0);
        self.file.seek(SeekFrom::Start(from * PAGE))?;
        if let Err(e) = self.file.read_exact(&mut self.raw) {
            self.raw.clear();
            return Err(Error::from(e).at(format!("page {from}")));
        }
        Ok(())
    }

    /// Checks the pages of the window before page `until`. Only pages that are needed are checked,
    /// so that damage elsewhere in the file (a picture, another scan) causes no error here.
    fn check(&mut self, until: u64) -> Result<()> {
        let done = self.checked.len() as u64 / PAYLOAD;
        for n in done..until - self.first {
            let page = &self.raw[(n * PAGE) as usize..((n + 1) * PAGE) as usize];
            let (payload, stated) = page.split_at(PAYLOAD as usize);
            // The standard says little-endian; in all files the checksum is big-endian.
            if crc32c::crc32c(payload).to_be_bytes() != stated {
                return Err(Error::bad_input("page is damaged, its checksum does not match")
                    .at(format!("page {}", self.first + n))
                    .hint("copy or export the file again"));
            }
            self.checked.extend_from_slice(payload);
        }
        Ok(())
    }
}
