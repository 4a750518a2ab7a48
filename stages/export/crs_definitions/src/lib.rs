//! Stands in for the package `crs-definitions`, whose texts of all reference systems, 9 MB, made a
//! third of the program. Here they are compressed. `copc_converter` asks for the text of a system
//! that tiles state by GeoTIFF keys alone.

use std::io::Read;
use std::sync::OnceLock;

/// The compressed texts, which the build script writes.
static PACKED: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/texts"));
static TEXTS: OnceLock<Vec<(u16, &'static str)>> = OnceLock::new();

/// A coordinate reference system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Def {
    /// Its well-known text.
    pub wkt: &'static str,
}

/// The reference system of an EPSG code, if it is known. The first call unpacks all texts, which
/// then stay.
#[must_use]
pub fn from_code(code: u16) -> Option<Def> {
    let texts = TEXTS.get_or_init(|| unpacked().unwrap_or_default());
    let at = texts.binary_search_by_key(&code, |text| text.0).ok()?;
    Some(Def { wkt: texts[at].1 })
}

/// All codes with their texts, by code.
fn unpacked() -> Option<Vec<(u16, &'static str)>> {
    let mut all = Vec::new();
    flate2::read::DeflateDecoder::new(PACKED).read_to_end(&mut all).ok()?;
    let all: &'static [u8] = all.leak();
    let (n, rest) = all.split_first_chunk()?;
    let (lengths, mut texts) = rest.split_at_checked(6 * u32::from_le_bytes(*n) as usize)?;
    let mut out = Vec::new();
    for entry in lengths.chunks_exact(6) {
        let (code, length) = entry.split_first_chunk()?;
        let length = u32::from_le_bytes(length.try_into().ok()?) as usize;
        let (text, others) = texts.split_at_checked(length)?;
        out.push((u16::from_le_bytes(*code), std::str::from_utf8(text).ok()?));
        texts = others;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    #[test]
    fn texts_are_those_of_the_package() {
        let utm = super::from_code(32_632).expect("UTM 32 N is known");
        assert!(utm.wkt.contains("UTM zone 32N"), "{}", utm.wkt);
        assert_eq!(super::from_code(1), None);
    }
}
