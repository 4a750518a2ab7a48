//! NumPy arrays: values in, a version 1.0 `.npy` file out, whose length is written at the end.

use crate::atomic::{AtomicFile, refused};
use contract::Result;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::PathBuf;

/// A type of array element.
pub trait Element: Copy {
    /// NumPy's name for it.
    const DESCR: &'static str;
    /// Appends its little-endian bytes.
    fn put(self, bytes: &mut Vec<u8>);
}

impl Element for u8 {
    const DESCR: &'static str = "|u1";
    fn put(self, bytes: &mut Vec<u8>) {
        bytes.push(self);
    }
}

impl Element for u16 {
    const DESCR: &'static str = "<u2";
    fn put(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

impl Element for i16 {
    const DESCR: &'static str = "<i2";
    fn put(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

/// Length of magic and header, bytes: room for any length, a multiple of 64 as NumPy asks for.
const HEADER: usize = 128;

/// Writes an array piece by piece.
pub struct NpyWriter<T> {
    file: BufWriter<AtomicFile>,
    path: PathBuf,
    bytes: Vec<u8>,
    n: u64,
    element: std::marker::PhantomData<T>,
}

impl<T: Element> NpyWriter<T> {
    /// Opens the file; its length need not be known.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        let mut file = BufWriter::with_capacity(1 << 18, AtomicFile::create(&path)?);
        file.write_all(&header::<T>("(0,)"))
            .map_err(|e| refused("array cannot be written", &path, e))?;
        Ok(Self { file, path, bytes: Vec::new(), n: 0, element: std::marker::PhantomData })
    }

    /// Appends values.
    pub fn push(&mut self, values: impl IntoIterator<Item = T>) -> Result<()> {
        self.bytes.clear();
        for value in values {
            value.put(&mut self.bytes);
            self.n += 1;
        }
        self.file
            .write_all(&self.bytes)
            .map_err(|e| refused("array cannot be written", &self.path, e))
    }

    /// Number of values so far.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.n
    }

    /// Holds no value.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Writes the length and gives the file its name. Returns the number of values.
    pub fn finish(self) -> Result<u64> {
        let n = self.n;
        self.end(&format!("({n},)"))
    }

    /// The same for an array of three dimensions, whose last one runs fastest.
    pub(crate) fn finish_as(self, [x, y, z]: &[usize; 3]) -> Result<u64> {
        debug_assert_eq!(self.n, (x * y * z) as u64);
        self.end(&format!("({x}, {y}, {z})"))
    }

    fn end(self, shape: &str) -> Result<u64> {
        let Self { mut file, path, n, .. } = self;
        file.seek(SeekFrom::Start(0))
            .and_then(|_| file.write_all(&header::<T>(shape)))
            .map_err(|e| refused("array cannot be finished", &path, e))?;
        let file = file
            .into_inner()
            .map_err(|e| refused("array cannot be finished", &path, e.into_error()))?;
        file.commit()?;
        Ok(n)
    }
}

/// Magic, version and dictionary, padded to [`HEADER`] bytes.
fn header<T: Element>(shape: &str) -> Vec<u8> {
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend(((HEADER - 10) as u16).to_le_bytes());
    out.extend(
        format!("{{'descr': '{}', 'fortran_order': False, 'shape': {shape}, }}", T::DESCR).bytes(),
    );
    out.resize(HEADER - 1, b' ');
    out.push(b'\n');
    out
}
