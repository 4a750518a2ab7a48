//! Collects what the variable length records of a LAS file declare about the units.

use super::declared::{Declaration, System};
use super::{geokeys, projjson, wkt};
use las::raw;

/// Bit of the global encoding that says that the WKT record counts and not the GeoTIFF keys.
pub(super) const WKT_COUNTS: u16 = 1 << 4;
/// Length of the header of a variable length record, bytes.
const HEADER: usize = 54;
/// Length of the header of an extended variable length record, bytes.
const EXTENDED: usize = 60;
/// Longest record that is read, bytes: texts of reference systems have a few thousand.
const MAX_BYTES: usize = 1 << 20;
/// Largest number of records that are read; writers use a handful.
const MAX_RECORDS: usize = 4096;

/// Organisations that define the records of reference systems.
pub(super) const PROJECTION: &[&str] = &["LASF_Projection", "liblas"];

/// All declarations of a file, the decisive one first.
pub(crate) fn read(raw: &raw::Header, data: &[u8]) -> Vec<Declaration> {
    let records = vlrs(raw, data);
    let find = |users: &[&str], id: u16| {
        let is_it = |r: &&VlrRecord<'_>| r.id == id && users.contains(&r.user.as_str());
        records.iter().find(is_it).map(|r| r.payload)
    };
    let of_wkt = |id| find(PROJECTION, id).and_then(wkt::read);
    let keys = find(PROJECTION, 34_735);
    let doubles = find(PROJECTION, 34_736).unwrap_or_default();
    let keys = keys.and_then(|keys| geokeys::read(keys, doubles));
    let json = find(&["PDAL", "LASF_Projection"], 4225).and_then(projjson::read);
    let text = of_wkt(2112);
    let last = if raw.global_encoding & WKT_COUNTS != 0 { [text, keys] } else { [keys, text] };
    let mut all: Vec<Declaration> =
        [of_wkt(4224), json].into_iter().chain(last).flatten().collect();
    // A stable sort: declarations of a coordinate system go before those of heights only.
    all.sort_by_key(|declaration| declaration.system == System::Unknown);
    all
}

/// A variable length record.
pub(super) struct VlrRecord<'a> {
    pub(super) user: String,
    pub(super) id: u16,
    pub(super) payload: &'a [u8],
}

/// The records before the points, then those after them, as far as they lie within the file.
pub(super) fn vlrs<'a>(raw: &raw::Header, data: &'a [u8]) -> Vec<VlrRecord<'a>> {
    let mut out = Vec::new();
    let n = raw.number_of_variable_length_records as usize;
    walk(data, usize::from(raw.header_size), n, HEADER, &mut out);
    if let Some(extended) = &raw.evlr {
        let start = usize::try_from(extended.start_of_first_evlr).unwrap_or(usize::MAX);
        walk(data, start, extended.number_of_evlrs as usize, EXTENDED, &mut out);
    }
    out
}

fn walk<'a>(
    data: &'a [u8],
    mut at: usize,
    n: usize,
    n_header: usize,
    out: &mut Vec<VlrRecord<'a>>,
) {
    for _ in 0..n.min(MAX_RECORDS) {
        let Some(header) = at.checked_add(n_header).and_then(|end| data.get(at..end)) else {
            return;
        };
        let user = header[2..18].iter().take_while(|b| **b != 0).map(|b| char::from(*b));
        let id = u16::from_le_bytes([header[18], header[19]]);
        let n_payload = if n_header == HEADER {
            usize::from(u16::from_le_bytes([header[20], header[21]]))
        } else {
            let length = header[20..28].first_chunk().map_or(0, |b| u64::from_le_bytes(*b));
            usize::try_from(length).unwrap_or(usize::MAX)
        };
        let start = at + n_header;
        let Some(end) = start.checked_add(n_payload).filter(|end| *end <= data.len()) else {
            return;
        };
        let user = user.collect::<String>().trim_end().to_owned();
        out.push(VlrRecord { user, id, payload: &data[start..end.min(start + MAX_BYTES)] });
        at = end;
    }
}
