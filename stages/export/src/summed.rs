//! Files whose checksum is computed while they are written, although their head is written last, so
//! that they need not be read again.

use crate::atomic::AtomicFile;
use contract::{Error, Result};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Length and CRC-32C of a written file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileSum {
    /// Path of the file.
    pub path: PathBuf,
    /// Length, bytes.
    pub n_bytes: u64,
    /// CRC-32C (Castagnoli) of all bytes.
    pub crc32c: u32,
}

/// Checksum of what follows a head.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct BodySum {
    n_bytes: u64,
    crc32c: u32,
}

impl BodySum {
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.n_bytes += bytes.len() as u64;
        self.crc32c = crc32c::crc32c_append(self.crc32c, bytes);
    }

    /// The checksum of the whole file, with its head.
    pub(crate) fn behind(&self, head: &[u8], path: &Path) -> FileSum {
        let n = self.n_bytes as usize;
        let crc32c = crc32c::crc32c_combine(crc32c::crc32c(head), self.crc32c, n);
        FileSum { path: path.to_path_buf(), n_bytes: head.len() as u64 + self.n_bytes, crc32c }
    }
}

/// An [`AtomicFile`] whose head is written last.
pub(crate) struct SummedFile {
    file: AtomicFile,
    body: BodySum,
}

impl SummedFile {
    /// Opens the file and writes a placeholder of the same length as the final head.
    pub(crate) fn create(path: &Path, head: &[u8]) -> Result<Self> {
        let mut file = AtomicFile::create(path)?;
        file.write_all(head).map_err(|e| Error::of_file("file cannot be written", path, e))?;
        Ok(Self { file, body: BodySum::default() })
    }

    /// Writes the head, and renames the file to its final name.
    pub(crate) fn finish(self, head: &[u8]) -> Result<FileSum> {
        let Self { mut file, body } = self;
        let path = file.path().to_path_buf();
        file.seek(SeekFrom::Start(0))
            .and_then(|_| file.write_all(head))
            .map_err(|e| Error::of_file("file cannot be finished", &path, e))?;
        file.commit()?;
        Ok(body.behind(head, &path))
    }
}

impl Write for SummedFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let n = self.file.write(bytes)?;
        self.body.add(&bytes[..n]);
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_is_that_of_the_file() {
        let path = std::env::temp_dir().join(format!("stillpoint-summed-{}", std::process::id()));
        // The last length is more than what is written past the page cache at once.
        for n in [0, 1, 70_000, 3 << 19, 2_000_001] {
            let mut file = SummedFile::create(&path, b"head").expect("opens");
            let body: Vec<u8> = (0..n).map(|i| (i * 7 % 251) as u8).collect();
            for piece in body.chunks(999) {
                file.write_all(piece).expect("writes");
            }
            let sum = file.finish(b"HEAD").expect("ends");
            let all = std::fs::read(&path).expect("a file");
            assert_eq!((sum.n_bytes, sum.crc32c), (all.len() as u64, crc32c::crc32c(&all)));
        }
        std::fs::remove_file(path).expect("goes");
    }
}
