//! Reads bytes of an E57 file, which consists of pages of 1024 bytes whose last four are a checksum
//! of the others. Each page that is read is checked.

use contract::{Error, Kind, Result};
use std::io::{Read, Seek, SeekFrom};

/// Length of a page, bytes.
pub(crate) const PAGE: u64 = 1024;
/// Length of a page without its checksum, bytes.
pub(crate) const PAYLOAD: u64 = PAGE - 4;
/// Most bytes that are asked for at once: a packet.
pub(crate) const MOST: usize = 1 << 16;
/// Number of pages that are read at once: half a megabyte, which disks read nearly at full rate.
const WINDOW: u64 = 512;

/// The checksum of a page. The standard says little-endian; in all files it is big-endian.
pub(crate) fn checksum(payload: &[u8]) -> [u8; 4] {
    crc32c::crc32c(payload).to_be_bytes()
}

/// An E57 file, addressed by logical offsets, which do not count checksums.
#[derive(Debug)]
pub struct CheckedPages<R> {
    from: R,
    n_pages: u64,
    /// Number of the first page of the window.
    first: u64,
    /// Pages of the window as stored in the file.
    raw: Vec<u8>,
    /// Payloads of the pages of the window that have been checked.
    checked: Vec<u8>,
}

impl<R: Read + Seek> CheckedPages<R> {
    /// Measures the file.
    pub(crate) fn new(mut from: R) -> Result<Self> {
        let n_bytes = from.seek(SeekFrom::End(0))?;
        if n_bytes == 0 || n_bytes % PAGE != 0 {
            let what = format!("length of the file is no multiple of {PAGE} bytes, \"{n_bytes}\"");
            return Err(Error::bad_input(what).hint("copy the file again"));
        }
        Ok(Self { from, n_pages: n_bytes / PAGE, first: 0, raw: Vec::new(), checked: Vec::new() })
    }

    /// Length of the file without checksums, bytes.
    pub(crate) fn len(&self) -> u64 {
        self.n_pages * PAYLOAD
    }

    /// Converts an offset in the file to a logical one.
    pub(crate) fn logical(&self, physical: u64) -> Result<u64> {
        if physical >= self.n_pages * PAGE || physical % PAGE >= PAYLOAD {
            return Err(Error::bad_input(format!(
                "an offset points outside the file or into a checksum, \"{physical}\""
            )));
        }
        Ok(physical / PAGE * PAYLOAD + physical % PAGE)
    }

    /// The bytes from logical offset `at` on; at most [`MOST`].
    pub(crate) fn read(&mut self, at: u64, len: usize) -> Result<&[u8]> {
        if len > MOST {
            return Err(Error::new(Kind::Bug, "more bytes were asked for than a packet has"));
        }
        let end = at.checked_add(len as u64).filter(|end| *end <= self.len());
        let Some(end) = end else {
            let what = format!("file ends before what it announces, \"{len}\" bytes more");
            return Err(Error::bad_input(what).at(format!("page {}", at / PAYLOAD)));
        };
        let (from, until) = (at / PAYLOAD, end.div_ceil(PAYLOAD).max(at / PAYLOAD + 1));
        if from < self.first || until > self.first + self.raw.len() as u64 / PAGE {
            self.load(from.min(self.n_pages - 1))?;
        }
        self.check(until.min(self.n_pages))?;
        let start = (at - self.first * PAYLOAD) as usize;
        Ok(&self.checked[start..start + len])
    }

    /// Reads the window that begins at page `from`.
    fn load(&mut self, from: u64) -> Result<()> {
        let n_bytes = (self.n_pages - from).min(WINDOW) * PAGE;
        self.checked.clear();
        self.first = from;
        self.raw.resize(n_bytes as usize, 0);
        self.from.seek(SeekFrom::Start(from * PAGE))?;
        let read = self.from.read_exact(&mut self.raw);
        read.map_err(|e| {
            self.raw.clear();
            Error::from(e).at(format!("page {from}"))
        })
    }

    /// Checks the pages of the window before page `until`.
    fn check(&mut self, until: u64) -> Result<()> {
        let done = self.checked.len() as u64 / PAYLOAD;
        for n in done..until - self.first {
            let page = &self.raw[(n * PAGE) as usize..((n + 1) * PAGE) as usize];
            let (payload, stated) = page.split_at(PAYLOAD as usize);
            if checksum(payload) != stated {
                let what = "page is damaged, its checksum does not match";
                return Err(Error::bad_input(what)
                    .at(format!("page {}", self.first + n))
                    .hint("copy or export the file again"));
            }
            self.checked.extend_from_slice(payload);
        }
        Ok(())
    }
}
