//! Detects the point format of a file by its first bytes, or refuses it with advice on what to do.

use crate::cloud::{HEAD, TextKind, kind};
use contract::{Error, Format, Kind, Result};
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

/// Bits of the point format in a LAS header that mark compressed points.
const COMPRESSED: u8 = 0b1100_0000;
/// Offset of the point format in a LAS header.
const POINT_FORMAT_AT: usize = 104;

/// Detects the format by the first bytes; the suffix only makes the error message clearer.
pub(crate) fn detect(path: &Path) -> Result<Format> {
    let mut head = Vec::new();
    File::open(path)?.take(HEAD).read_to_end(&mut head)?;
    let suffix = path.extension().map_or_else(String::new, |s| s.to_string_lossy().to_lowercase());
    if head.is_empty() {
        return Err(Error::bad_input("the file is empty"));
    }
    if head.starts_with(b"ASTM-E57") {
        return Ok(Format::E57);
    }
    if head.starts_with(b"LASF") {
        let compressed = head.get(POINT_FORMAT_AT).is_some_and(|f| f & COMPRESSED != 0);
        return Ok(if compressed { Format::Laz } else { Format::Las });
    }
    if is_ptx(&head) || (suffix == "ptx" && is_text(&head)) {
        return Ok(Format::Ptx);
    }
    if head.starts_with(b"ply\n") || head.starts_with(b"ply\r\n") {
        return Ok(Format::Ply);
    }
    if is_pcd(&head) {
        return Ok(Format::Pcd);
    }
    match kind(whole_lines(&head)).filter(|_| is_text(&head)) {
        Some(TextKind::Pts) => Ok(Format::Pts),
        Some(TextKind::Xyz) => Ok(Format::Xyz),
        None => Err(refusal(&head, &suffix)),
    }
}

/// Whether a file begins with two lines of one whole number each and then one of three numbers.
fn is_ptx(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head);
    let mut lines = text.lines().map(|l| l.split_whitespace().collect::<Vec<_>>());
    let mut whole = || lines.next().is_some_and(|w| w.len() == 1 && w[0].parse::<u64>().is_ok());
    whole()
        && whole()
        && lines.next().is_some_and(|w| w.len() == 3 && w.iter().all(|v| v.parse::<f64>().is_ok()))
}

/// Whether a file begins with the header of a PCD file, after comments.
fn is_pcd(head: &[u8]) -> bool {
    let mut lines = head.split(|b| *b == b'\n').map(<[u8]>::trim_ascii);
    let first = lines.find(|line| !line.is_empty() && !line.starts_with(b"#"));
    first.is_some_and(|line| line.starts_with(b"VERSION ") || line.starts_with(b"FIELDS "))
}

/// The lines of a file's beginning without the last one, which may be cut.
fn whole_lines(head: &[u8]) -> &[u8] {
    let end = head.iter().rposition(|b| *b == b'\n').filter(|_| head.len() as u64 == HEAD);
    &head[..end.unwrap_or(head.len())]
}

/// Whether bytes are text; names of columns may hold letters of any language.
fn is_text(head: &[u8]) -> bool {
    head.iter().all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace() || !b.is_ascii())
}

fn refusal(head: &[u8], suffix: &str) -> Error {
    const WAY: &str = "export the scans as E57, one scan a scanner position";
    let named = |what: &str| Error::new(Kind::Unsupported, format!("{what} is not read")).hint(WAY);
    if let "e57" | "las" | "laz" | "ptx" | "ply" | "pcd" = suffix {
        return Error::bad_input(format!(
            "the name ends in \"{suffix}\", but the content is something else"
        ))
        .at("byte 0")
        .hint("the file is damaged or misnamed; copy or export it again");
    }
    let start = |magic: &[u8]| head.starts_with(magic);
    match suffix {
        _ if start(b"PK\x03\x04") || start(b"\x1f\x8b") || start(b"7z\xbc\xaf") => {
            Error::new(Kind::Unsupported, "an archive is not read").hint("unpack it")
        }
        "fls" | "lsproj" => named("FARO's own format"),
        "zfs" | "zfprj" => named("Z+F's own format"),
        "rcp" | "rcs" => named("ReCap's own format"),
        "rdbx" | "rxp" => named("RIEGL's own format"),
        "lgs" | "lgsx" => named("Leica's own format"),
        "pts" | "xyz" | "txt" | "csv" | "asc" => named("text that does not begin with points")
            .hint("write x, y and z first in each line, or name the columns in the first line"),
        _ if is_text(head) => named("this text"),
        _ => named("this format"),
    }
}
