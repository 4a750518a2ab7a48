//! Writes NumPy arrays (`.npy`, version 1.0) whose length becomes known at the end.

use crate::summed::{FileSum, SummedFile};
use contract::{Error, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A type of array element.
pub trait Element: Copy {
    /// The type's name in NumPy.
    const DESCR: &'static str;
    /// Length of an element, bytes.
    const LEN: usize;
    /// Writes the element as little-endian bytes.
    fn put(self, bytes: &mut [u8]);
}

impl Element for u8 {
    const DESCR: &'static str = "|u1";
    const LEN: usize = 1;
    #[inline]
    fn put(self, bytes: &mut [u8]) {
        bytes.copy_from_slice(&self.to_le_bytes());
    }
}

impl Element for u16 {
    const DESCR: &'static str = "<u2";
    const LEN: usize = 2;
    #[inline]
    fn put(self, bytes: &mut [u8]) {
        bytes.copy_from_slice(&self.to_le_bytes());
    }
}

impl Element for u64 {
    const DESCR: &'static str = "<u8";
    const LEN: usize = 8;
    #[inline]
    fn put(self, bytes: &mut [u8]) {
        bytes.copy_from_slice(&self.to_le_bytes());
    }
}

impl Element for i16 {
    const DESCR: &'static str = "<i2";
    const LEN: usize = 2;
    #[inline]
    fn put(self, bytes: &mut [u8]) {
        bytes.copy_from_slice(&self.to_le_bytes());
    }
}

impl Element for f32 {
    const DESCR: &'static str = "<f4";
    const LEN: usize = 4;
    #[inline]
    fn put(self, bytes: &mut [u8]) {
        bytes.copy_from_slice(&self.to_le_bytes());
    }
}

/// Length of magic number and header, bytes: enough for any length, and a multiple of 64 as NumPy
/// requires.
const HEADER: usize = 128;

/// The bytes of `n` elements of `len` bytes each, from element `first` on, of a file that
/// [`NpyWriter`] wrote.
pub(crate) fn read_bytes(path: &Path, first: u64, n: usize, len: usize) -> Result<Vec<u8>> {
    let mut bytes = vec![0; n * len];
    let read = File::open(path).and_then(|mut file| {
        file.seek(SeekFrom::Start(HEADER as u64 + first * len as u64))?;
        file.read_exact(&mut bytes)
    });
    read.map_err(|e| Error::of_read("array cannot be read back", path, e))?;
    Ok(bytes)
}

/// Number of bytes of the elements of a file that [`NpyWriter`] wrote.
pub(crate) fn n_bytes(path: &Path) -> std::io::Result<u64> {
    Ok(std::fs::metadata(path)?.len().saturating_sub(HEADER as u64))
}

/// Reads a list of places (u64, ascending) in a mask of `n_points` entries that [`NpyWriter`]
/// wrote.
///
/// # Errors
/// If the file cannot be read, or if its places do not ascend or lie outside the mask.
pub fn read_places(path: &Path, n_points: u64) -> Result<Vec<u64>> {
    let n_bytes =
        std::fs::metadata(path).map_err(|e| Error::of_read("list cannot be read", path, e))?.len();
    let n = n_bytes.saturating_sub(HEADER as u64) / 8;
    let bytes = read_bytes(path, 0, n as usize, 8)?;
    let (whole, _) = bytes.as_chunks::<8>();
    let places: Vec<u64> = whole.iter().map(|b| u64::from_le_bytes(*b)).collect();
    let in_order = places.is_sorted_by(|a, b| a < b);
    let is_whole = in_order && places.last().is_none_or(|last| *last < n_points);
    is_whole.then_some(places).ok_or_else(|| {
        let what = format!("the list does not hold ascending places among {n_points} points");
        Error::bad_input(what).at(path.display()).hint("run the whole plant again")
    })
}

/// Writes an array piece by piece.
pub struct NpyWriter<T> {
    file: SummedFile,
    path: PathBuf,
    bytes: Vec<u8>,
    n: u64,
    element: std::marker::PhantomData<T>,
}

impl<T: Element> NpyWriter<T> {
    /// Opens the file; the length of the array need not be known.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        let file = SummedFile::create(&path, &header::<T>("(0,)"))?;
        Ok(Self { file, path, bytes: Vec::new(), n: 0, element: std::marker::PhantomData })
    }

    /// Appends values.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn push(&mut self, values: &[T]) -> Result<()> {
        self.bytes.resize(values.len() * T::LEN, 0);
        for (value, bytes) in values.iter().zip(self.bytes.chunks_exact_mut(T::LEN)) {
            value.put(bytes);
        }
        self.n += values.len() as u64;
        self.file
            .write_all(&self.bytes)
            .map_err(|e| Error::of_file("array cannot be written", &self.path, e))
    }

    /// Number of values so far.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.n
    }

    /// Whether there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Writes the length and renames the file to its final name.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(self) -> Result<FileSum> {
        let n = self.n;
        self.end(&format!("({n},)"))
    }

    /// Finishes the file as an array of three dimensions, the last of which varies fastest.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish_as(self, [x, y, z]: &[usize; 3]) -> Result<FileSum> {
        debug_assert_eq!(self.n, (x * y * z) as u64);
        self.end(&format!("({x}, {y}, {z})"))
    }

    fn end(self, shape: &str) -> Result<FileSum> {
        self.file.finish(&header::<T>(shape))
    }
}

/// Magic number, version and dictionary, padded to [`HEADER`] bytes.
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
