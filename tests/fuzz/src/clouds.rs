//! Point files in; the laws of reading held, out: places ascend and lie in their mask, columns are
//! as long as one another, coordinates are finite, and how the reader cuts its strips changes no
//! point.

use crate::{file, refused};
use contract::{OneByOne, Strip};
use ingest::{Settings, Sources, Want};
use std::path::Path;

/// E57, as [`e57_file`] builds it.
pub fn e57(data: &[u8]) {
    read(&file("case.e57", &e57_file(data)));
}

/// LAS.
pub fn las(data: &[u8]) {
    read(&file("case.las", data));
}

/// LAZ.
pub fn laz(data: &[u8]) {
    read(&file("case.laz", data));
}

/// PTX.
pub fn ptx(data: &[u8]) {
    read(&file("case.ptx", data));
}

/// PTS, plain text, PLY and PCD, told apart by their beginning.
pub fn cloud(data: &[u8]) {
    read(&file("case.xyz", data));
}

/// Bytes of a page, and of its payload.
const PAGE: usize = 1024;
const PAYLOAD: usize = 1020;

/// An E57 file of a case: the bytes before the first `<?xml` are its binary sections, which lie
/// behind the header of 48 bytes; the rest is its description. Header and checksums, which no
/// mutation would ever get right, are made here.
#[must_use]
pub fn e57_file(data: &[u8]) -> Vec<u8> {
    let at = data.windows(5).position(|w| w == b"<?xml").unwrap_or(data.len());
    let (binary, xml) = data.split_at(at);
    let xml_at = (48 + binary.len()).next_multiple_of(4);
    let mut logical = vec![0; 48];
    logical.extend_from_slice(binary);
    logical.resize(xml_at, 0);
    logical.extend_from_slice(xml);
    logical.resize(logical.len().next_multiple_of(PAYLOAD), 0);
    let n_pages = logical.len() / PAYLOAD;
    let on_disk = |at: usize| (at / PAYLOAD * PAGE + at % PAYLOAD) as u64;
    let numbers = [(n_pages * PAGE) as u64, on_disk(xml_at), xml.len() as u64, PAGE as u64];
    logical[..8].copy_from_slice(b"ASTM-E57");
    logical[8..12].copy_from_slice(&1_u32.to_le_bytes());
    for (i, number) in numbers.into_iter().enumerate() {
        logical[16 + 8 * i..24 + 8 * i].copy_from_slice(&number.to_le_bytes());
    }
    let pages = logical.chunks(PAYLOAD);
    pages.flat_map(|page| [page, &crc32c::crc32c(page).to_be_bytes()].concat()).collect()
}

/// The parts of a file that [`e57_file`] puts together again.
#[must_use]
pub fn e57_parts(file: &[u8]) -> Vec<u8> {
    let logical: Vec<u8> =
        file.chunks(PAGE).flat_map(|page| page[..PAYLOAD.min(page.len())].to_vec()).collect();
    let number = |at: usize| {
        u64::from_le_bytes(logical[at..at + 8].try_into().expect("eight bytes")) as usize
    };
    let (xml_at, n_xml) = (number(24) / PAGE * PAYLOAD + number(24) % PAGE, number(32));
    logical[48..xml_at + n_xml].to_vec()
}

/// Points of one scan, with their places.
#[derive(Debug, Default, PartialEq)]
struct Points {
    places: Vec<u64>,
    xyz: Vec<[u32; 3]>,
    intensity: Vec<u16>,
    color: Vec<[u16; 3]>,
}

fn read(path: &Path) {
    let usual = read_with(path, &Settings::default());
    let short = read_with(path, &Settings { strip_points: 3, ..Settings::default() });
    match (&usual, &short) {
        (Some(usual), Some(short)) => assert_eq!(usual, short, "strips were cut otherwise"),
        (None, None) => {}
        _ => panic!("read in one way of cutting strips and not in the other"),
    }
}

/// All points by scan; nothing where the file is refused, at opening or later.
fn read_with(path: &Path, settings: &Settings) -> Option<Vec<Points>> {
    let opened = ingest::open(&[path.to_path_buf()], None, settings, &OneByOne);
    let sources = opened.map_err(|e| refused(&e)).ok()?;
    let said = ingest::describe(&sources, &OneByOne);
    assert_eq!(said.len(), 1, "one file, one description");
    let plain = points(&sources, Want::Coordinates)?;
    let all = points(&sources, Want::Everything)?;
    for (a, b) in plain.iter().zip(&all) {
        assert!(a.places == b.places && a.xyz == b.xyz, "attributes change the points");
    }
    Some(all)
}

fn points(sources: &Sources, want: Want) -> Option<Vec<Points>> {
    let mut scans: Vec<Points> = sources.scans.iter().map(|_| Points::default()).collect();
    let mut next = vec![0_u64; sources.masks.len()];
    let strips = sources.strips(sources.inputs[0].id, want).map_err(|e| refused(&e)).ok()?;
    for strip in strips {
        let strip = strip.map_err(|e| refused(&e)).ok()?;
        check(&strip, sources, &mut next, want);
        let scan = &mut scans[strip.scan.0 as usize];
        scan.places.extend(strip.place.iter().map(|p| strip.first_place + u64::from(*p)));
        scan.xyz.extend(strip.xyz.iter().map(|p| p.map(f32::to_bits)));
        if let Some(attributes) = strip.attributes {
            scan.intensity.extend(attributes.intensity);
            scan.color.extend(attributes.color);
        }
    }
    for scan in &scans {
        assert!(scan.places.is_sorted_by(|a, b| a < b), "a place comes twice, or goes back");
    }
    Some(scans)
}

fn check(strip: &Strip, sources: &Sources, next: &mut [u64], want: Want) {
    let n = strip.xyz.len();
    assert_eq!(n, strip.place.len(), "a place for each point");
    assert!(strip.xyz.iter().flatten().all(|v| v.is_finite()), "coordinates are finite");
    let mask = &sources.masks[strip.mask.0 as usize];
    assert_eq!(sources.scans[strip.scan.0 as usize].mask, mask.id, "a scan's mask");
    if let Some(last) = strip.place.last() {
        let last = strip.first_place + u64::from(*last);
        assert!(mask.n_points.is_none_or(|n| last < n), "place {last} is none of the mask");
        next[mask.id.0 as usize] = next[mask.id.0 as usize].max(last + 1);
    }
    assert_eq!(strip.attributes.is_some(), want == Want::Everything, "what was asked for");
    let Some(a) = &strip.attributes else { return };
    let lengths = [
        a.world.len(),
        a.intensity.len(),
        a.color.len(),
        a.gps_time.len(),
        a.classification.len(),
        a.source_id.len(),
    ];
    assert!(lengths.iter().all(|l| *l == n || *l == 0), "columns of {lengths:?} for {n} points");
    assert!(a.world.iter().flatten().all(|v| v.is_finite()), "the world is finite");
}
