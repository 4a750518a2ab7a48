//! A compressed tile in; whether its chunks and their layers fit into the file, out.
//!
//! The decoder takes memory for as many chunks as the table states, and for layers as long as each
//! chunk states, before it reads any of them.

use crate::record::LasSettings;
use contract::fence;
use laz::LazVlr;
use laz::laszip::ChunkTable;
use std::io::{self, Read, Seek, SeekFrom};

/// Layers of what each point has, in LAZ of LAS 1.4.
const POINT: usize = 9;

/// Checks the chunks of a file of so many points, which begin at a place with the place of their
/// table. The decoder goes from chunk to chunk as layers and counts lead it: they must lead it as
/// the table does.
///
/// # Errors
/// What does not fit, in words; a file that cannot be read.
pub(crate) fn check(
    file: &mut (impl Read + Seek),
    at: u64,
    laz: &LazVlr,
    las: &LasSettings,
    n_points: u64,
) -> io::Result<Result<(), String>> {
    if n_points == 0 {
        return Ok(Ok(()));
    }
    let record_len = las.record_len();
    let n_bytes = file.seek(SeekFrom::End(0))?;
    let table = number::<8>(file, at)?;
    if table < at + 8 || table.saturating_add(8) > n_bytes {
        return Ok(Err("its table of chunks lies outside the file".into()));
    }
    let n = number::<4>(file, table + 4)?;
    if n > (table - at - 8) / record_len as u64 {
        // Each begins with a record as it is.
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
    // Colours are one more, and so is each extra byte.
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
            return Ok(Err(format!("a chunk states {n} points where {} are due", most.min(left))));
        }
        (from, left) = (from + n_bytes, left - n);
    }
    Ok(if left == 0 { Ok(()) } else { Err(format!("{left} points are in no chunk")) })
}

/// A whole number of so many bytes at a place, the lowest first.
fn number<const N: usize>(file: &mut (impl Read + Seek), at: u64) -> io::Result<u64> {
    let mut bytes = [0; 8];
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(&mut bytes[..N])?;
    Ok(u64::from_le_bytes(bytes))
}
