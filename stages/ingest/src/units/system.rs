//! The records in which a LAS file states its coordinate reference system, as they are.

use super::las::{PROJECTION, VlrRecord, WKT_COUNTS, vlrs};
use las::raw;

/// The coordinate reference system of LAS files: records of `LASF_Projection`, with their numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReferenceSystem {
    /// Either well-known text (2112, with its mathematical transform 2111 where there is one) or
    /// the three records of GeoTIFF (34735 to 34737).
    pub records: Vec<(u16, Vec<u8>)>,
}

/// Numbers of the records of well-known text, the decisive one first, and of GeoTIFF.
const TEXT: [u16; 2] = [2112, 2111];
const GEOTIFF: [u16; 3] = [34_735, 34_736, 34_737];

/// The system of a file; `None` where it states none.
pub(crate) fn read(raw: &raw::Header, data: &[u8]) -> Option<ReferenceSystem> {
    let all = vlrs(raw, data);
    let find = |id: &u16| {
        let is_it = |r: &&VlrRecord<'_>| r.id == *id && PROJECTION.contains(&r.user.as_str());
        all.iter().find(is_it).filter(|r| !r.payload.is_empty())
    };
    let of = |ids: &[u16]| -> Vec<(u16, Vec<u8>)> {
        if find(&ids[0]).is_none() {
            return Vec::new();
        }
        ids.iter().filter_map(find).map(|r| (r.id, r.payload.to_vec())).collect()
    };
    let (text, keys) = (of(&TEXT), of(&GEOTIFF));
    let text_counts = raw.global_encoding & WKT_COUNTS != 0 || keys.is_empty();
    let records = if text_counts && !text.is_empty() { text } else { keys };
    // What comes from a record of more than 64 KiB does not fit the records of a tile.
    let fits = records.iter().all(|(_, data)| u16::try_from(data.len()).is_ok());
    (!records.is_empty() && fits).then_some(ReferenceSystem { records })
}
