//! Joins files of records that were written apart, one for each input, to the file that holds all
//! of them.

use crate::las::{LasSummary, LasWriter, head};
use crate::record::{LasSettings, RecordExtent};
use contract::{Error, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Number of records that are copied at a time.
const PIECE: usize = 8192;

impl LasSettings {
    /// The same records without compression, as files have them that are joined later.
    #[must_use]
    pub fn to_join(&self) -> Self {
        Self { compress: false, ..self.clone() }
    }
}

/// Writes the records of all `parts`, in their order, to the file `path` with records as `las`
/// says. The parts have the same records without compression ([`LasSettings::to_join`]).
///
/// # Errors
/// A part that cannot be read or is no such file; a file that cannot be written.
pub fn join_las(parts: &[PathBuf], path: &Path, las: &LasSettings) -> Result<LasSummary> {
    let mut writer = LasWriter::create(path, las.clone())?;
    let n_head = head(&las.to_join(), &RecordExtent::default())?.len() as u64;
    parts.iter().try_for_each(|part| append(part, n_head, las.record_len(), &mut writer))?;
    writer.finish()
}

/// Appends the records of one part behind its head of `n_head` bytes.
fn append(part: &Path, n_head: u64, record_len: usize, writer: &mut LasWriter) -> Result<()> {
    let failed = |e: std::io::Error| Error::of_read("records cannot be read", part, e);
    let mut file = File::open(part).map_err(failed)?;
    let n_bytes = file.metadata().map_err(failed)?.len();
    let n_body = n_bytes.checked_sub(n_head).filter(|n| n.is_multiple_of(record_len as u64));
    let mut left = n_body.ok_or_else(|| {
        let what = "the file does not hold whole records behind its header";
        Error::bad_input(what).at(part.display()).hint("start the job again: it is written anew")
    })?;
    file.seek(SeekFrom::Start(n_head)).map_err(failed)?;
    let mut piece = vec![0; PIECE * record_len];
    while left > 0 {
        let n = left.min(piece.len() as u64) as usize;
        file.read_exact(&mut piece[..n]).map_err(failed)?;
        let mut extent = RecordExtent::default();
        piece[..n].chunks_exact(record_len).for_each(|record| extent.add(steps(record)));
        writer.push_records(&piece[..n], &extent)?;
        left -= n as u64;
    }
    Ok(())
}

/// The coordinates of a record, in steps.
fn steps(record: &[u8]) -> [i32; 3] {
    [0, 4, 8].map(|at| {
        let bytes = [record[at], record[at + 1], record[at + 2], record[at + 3]];
        i32::from_le_bytes(bytes)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::PointColumns;
    use crate::record::Quantum;
    use contract::Label;
    use geometry::Aabb;

    #[test]
    fn parts_make_the_file_that_one_writer_makes() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |name: &str| dir.path().join(name);
        let world: Vec<[f64; 3]> = (0..30_001)
            .map(|i| {
                let t = f64::from(i) * 0.37;
                [t.sin() * 9.0, t.cos() * 7.0, (t * 0.1).sin()]
            })
            .collect();
        let labels = vec![Label::FIXED; world.len()];
        let push = |writer: &mut LasWriter, range: std::ops::Range<usize>| {
            let (world, labels) = (&world[range.clone()], &labels[range]);
            let points = PointColumns { world, labels, ..PointColumns::default() };
            writer.push(&points).expect("writes");
        };
        for compress in [false, true] {
            let las = LasSettings { compress, ..LasSettings::new(Quantum::around(&Aabb::EMPTY)) };
            let mut whole = LasWriter::create(at("whole"), las.clone()).expect("opens");
            let mut parts = Vec::new();
            for (k, range) in [0..0, 0..9_000, 9_000..9_001, 9_001..30_001].into_iter().enumerate()
            {
                push(&mut whole, range.clone());
                let mut part = LasWriter::create(at(&k.to_string()), las.to_join()).expect("opens");
                push(&mut part, range);
                parts.push(part.finish().expect("ends").path);
            }
            let whole = whole.finish().expect("ends");
            let joined = join_las(&parts, &at("joined"), &las).expect("joins");
            let bytes = |name: &str| std::fs::read(at(name)).expect("a file");
            assert!(bytes("whole") == bytes("joined"), "compressed: {compress}");
            assert_eq!((whole.n_points, whole.bounds), (joined.n_points, joined.bounds));
            assert_eq!(whole.sum.map(|s| s.crc32c), joined.sum.map(|s| s.crc32c));
            // A part that was cut is refused.
            std::fs::write(at("3"), &bytes("3")[..777]).expect("writes");
            assert!(join_las(&parts, &at("broken"), &las).is_err());
        }
    }
}
