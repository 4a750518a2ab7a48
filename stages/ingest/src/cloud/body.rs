//! The records of a scan, in whichever way they are stored.

use super::binary::BinaryBody;
use super::fields::{CloudFields, Slots};
use super::packed::PackedBody;
use super::text_body::{STRETCH, TextBody};
use crate::reader::Extent;
use contract::Result;
use geometry::Pose;

/// How the records of a scan are stored.
#[derive(Debug)]
pub(super) enum RecordBody {
    Text(TextBody),
    Binary(BinaryBody),
    Packed(PackedBody),
}

/// A scan of a file as its header states it.
#[derive(Debug)]
pub(super) struct CloudSeed {
    pub(super) body: RecordBody,
    pub(super) fields: CloudFields,
    pub(super) n_records: u64,
    /// Name of the scan; `None` for that of the file.
    pub(super) name: Option<String>,
    /// Pose of the scanner, in the frame of the points, metres.
    pub(super) pose: Option<Pose>,
    pub(super) notes: Vec<String>,
    /// Byte, line and number of other lines after which the announced lines are still to be
    /// counted.
    pub(super) uncounted: Option<(u64, u64, u64)>,
}

impl CloudSeed {
    pub(super) fn new(body: RecordBody, fields: CloudFields, n_records: u64) -> Self {
        let notes = Vec::new();
        Self { body, fields, n_records, name: None, pose: None, notes, uncounted: None }
    }
}

impl RecordBody {
    /// Up to `n` of all `n_records` records from the `first` on.
    pub(super) fn records(
        &self,
        file: &[u8],
        first: u64,
        n: usize,
        n_records: u64,
    ) -> Result<Vec<Slots>> {
        let n = n_records.saturating_sub(first).min(n as u64) as usize;
        match self {
            _ if n == 0 => Ok(Vec::new()),
            Self::Text(body) => {
                let from = (first / STRETCH) as usize;
                let skip = (first % STRETCH) as usize;
                let bytes = body.bytes(from, (skip + n).div_ceil(STRETCH as usize));
                let bytes = &file[bytes.start as usize..bytes.end as usize];
                body.records(bytes, body.stretches[from].line).skip(skip).take(n).collect()
            }
            Self::Binary(body) => {
                let start = (body.start + first * body.stride as u64) as usize;
                let bytes = &file[start..start + n * body.stride];
                Ok(bytes.chunks_exact(body.stride).map(|bytes| body.record(bytes)).collect())
            }
            Self::Packed(body) => {
                let mut streams = body.streams(file, first)?;
                let mut out = Vec::with_capacity(n);
                while out.len() < n {
                    streams.more(n - out.len(), &mut out)?;
                }
                Ok(out)
            }
        }
    }

    /// The extents of all records, of about `n_each` each; `None` where records cannot be decoded
    /// independently.
    pub(super) fn extents(
        &self,
        n_records: u64,
        n_each: usize,
    ) -> Option<Box<dyn Iterator<Item = Extent> + Send + '_>> {
        match self {
            Self::Text(body) => {
                let n_stretches = n_each.div_ceil(STRETCH as usize).max(1);
                let of = move |from: usize| {
                    let first = from as u64 * STRETCH;
                    let n_points = (n_records - first).min(n_stretches as u64 * STRETCH);
                    Extent { bytes: body.bytes(from, n_stretches), first, n_points }
                };
                Some(Box::new((0..body.stretches.len()).step_by(n_stretches).map(of)))
            }
            Self::Binary(body) => {
                let (n_each, stride) = (n_each.max(1), body.stride as u64);
                let of = move |first: u64| {
                    let n_points = (n_records - first).min(n_each as u64);
                    let start = body.start + first * stride;
                    Extent { bytes: start..start + n_points * stride, first, n_points }
                };
                Some(Box::new((0..n_records).step_by(n_each).map(of)))
            }
            Self::Packed(_) => None,
        }
    }

    /// The records of an extent, from its bytes.
    pub(super) fn decode<'a>(
        &'a self,
        extent: &Extent,
        bytes: &'a [u8],
    ) -> Box<dyn Iterator<Item = Result<Slots>> + 'a> {
        match self {
            Self::Text(body) => {
                let stretch = body.stretches.get((extent.first / STRETCH) as usize);
                Box::new(body.records(bytes, stretch.map_or(0, |stretch| stretch.line)))
            }
            Self::Binary(body) => {
                Box::new(bytes.chunks_exact(body.stride).map(|bytes| Ok(body.record(bytes))))
            }
            Self::Packed(_) => Box::new(std::iter::empty()),
        }
    }

    /// Byte after the last record.
    pub(super) fn end(&self, n_records: u64) -> u64 {
        match self {
            Self::Text(body) => body.end,
            Self::Binary(body) => body.start + n_records * body.stride as u64,
            Self::Packed(body) => body.end(),
        }
    }
}
