//! Places in an E57 file in, bytes out: pages of 1024 bytes, of which the last four are a checksum
//! of the rest. Every checksum on the way is checked. Knows no packets and no points.

use contract::{Error, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes of a page; the only size that the standard's reference library writes or reads.
pub(super) const PAGE: u64 = 1024;
/// Bytes of a page before its checksum.
const PAYLOAD: u64 = PAGE - 4;
/// Pages read at once: 256 KiB keeps a disk busy and the second-level cache warm, and holds any
/// packet (64 KiB).
const WINDOW: u64 = 256;

/// An open file, seen without its checksums.
pub(super) struct Pages {
    file: File,
    n_pages: u64,
    /// First page of the window.
    first: u64,
    /// Pages of the window as they are on disk.
    raw: Vec<u8>,
    /// Payloads of those pages of the window that were checked.
    checked: Vec<u8>,
}

impl Pages {
    /// Opens a file; reads nothing.
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

    /// Bytes of the file without checksums.
    pub(super) fn len(&self) -> u64 {
        self.n_pages * PAYLOAD
    }

    /// Bytes of the file.
    pub(super) fn len_on_disk(&self) -> u64 {
        self.n_pages * PAGE
    }

    /// Place without checksums of a place on disk.
    pub(super) fn logical(&self, physical: u64) -> Result<u64> {
        if physical >= self.len_on_disk() || physical % PAGE >= PAYLOAD {
            return Err(Error::bad_input(format!(
                "an offset points outside the file or into a checksum, \"{physical}\""
            )));
        }
        Ok(physical / PAGE * PAYLOAD + physical % PAGE)
    }

    /// The page that holds a place.
    pub(super) fn page(at: u64) -> u64 {
        at / PAYLOAD
    }

    /// Bytes `at..at + len`, places without checksums; at most 64 KiB.
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

    /// Checks the pages of the window before page `until`: only those that are needed, so that
    /// damage elsewhere in the file (a picture, another scan) is not mistaken for damage here.
    fn check(&mut self, until: u64) -> Result<()> {
        let done = self.checked.len() as u64 / PAYLOAD;
        for n in done..until - self.first {
            let page = &self.raw[(n * PAGE) as usize..((n + 1) * PAGE) as usize];
            let (payload, stated) = page.split_at(PAYLOAD as usize);
            // The standard says little-endian, all files have it big-endian.
            if crc32c::crc32c(payload).to_be_bytes() != stated {
                return Err(Error::bad_input("page is damaged, its checksum does not match")
                    .at(format!("page {}", self.first + n))
                    .hint("copy the file again, or export it anew"));
            }
            self.checked.extend_from_slice(payload);
        }
        Ok(())
    }
}
