//! Checks that the chunks and layers of a compressed tile fit into its file.
//!
//! The decoder allocates memory for as many chunks as the table states, and for layers as long as
//! each chunk states, before it reads them.

use crate::record::LasSettings;
use contract::fence;
use laz::LazVlr;
use laz::laszip::ChunkTable;
use std::io::{self, Read, Seek, SeekFrom};

/// Number of layers that every point has, in LAZ of LAS 1.4.
const POINT: usize = 9;

/// Checks the chunks of a file with `n_points` points, which begin with the offset of their table.
/// The decoder moves from chunk to chunk by the stated layers and counts, which must lead to the
/// same offsets as the table.
///
/// # Errors
/// If the file cannot be read; the inner error says in words what does not fit.
pub(crate) fn check(
    file: &mut (impl Read + Seek),
    at: u64,
    laz: &LazVlr,
    las: &LasSettings,
    n_points: u64,
) -> io::Result<Result<(), String>> {
    let record_len = las.record_len();
    let n_bytes = file.seek(SeekFrom::End(0))?;
    let table = number::<8>(file, at)?;
    if table < at + 8 || table.saturating_add(8) > n_bytes {
        return Ok(Err("its table of chunks lies outside the file".into()));
    }
    let n = number::<4>(file, table + 4)?;
    if n > (table - at - 8) / record_len as u64 {
        // Each chunk begins with an uncompressed record.
        return Ok(Err(format!("its table of chunks states {n} of them, which do not fit")));
    }
    file.seek(SeekFrom::Start(table))?;
    let varying = laz.uses_variable_size_chunks();
    let read = fence::fenced(|| ChunkTable::read(&mut &mut *file, varying));
    let chunks = match read {
        Ok(Ok(chunks)) => chunks,
        Ok(Err(error)) => return Ok(Err(error.to_string())),
        Err(panic) => return Ok(Err(panic)),
    };
    // Colour adds one layer, and so does each extra byte.
    let n_layers = POINT + usize::from(las.with_color) + las.extra_len();
    let head = (record_len + 4 + 4 * n_layers) as u64;
    let (mut from, mut left) = (at + 8, n_points);
    for chunk in chunks.as_ref() {
        let n_bytes = chunk.byte_count;
        if n_bytes > table - from || n_bytes < head {
            return Ok(Err(format!("a chunk cannot have {n_bytes} bytes here")));
        }
        let mut total = 0;
        for layer in 0..n_layers {
            total += number::<4>(file, from + (record_len + 4 + 4 * layer) as u64)?;
        }
        if total != n_bytes - head {
            return Ok(Err(format!("layers of {total} bytes do not fit into a chunk")));
        }
        let most = if varying { chunk.point_count } else { u64::from(laz.chunk_size()) };
        let n = number::<4>(file, from + record_len as u64)?;
        if n != most.min(left) {
            return Ok(Err(format!("a chunk states {n} points instead of {}", most.min(left))));
        }
        (from, left) = (from + n_bytes, left - n);
    }
    Ok(if left == 0 { Ok(()) } else { Err(format!("{left} points are in no chunk")) })
}

/// A little-endian number of `N` bytes at an offset.
fn number<const N: usize>(file: &mut (impl Read + Seek), at: u64) -> io::Result<u64> {
    let mut bytes = [0; 8];
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(&mut bytes[..N])?;
    Ok(u64::from_le_bytes(bytes))
}
