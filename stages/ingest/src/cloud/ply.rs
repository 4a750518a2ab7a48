//! The header of PLY files, whose vertices are the points.

use super::binary::{BinaryBody, BinarySlot, Scalar};
use super::body::{CloudSeed, RecordBody};
use super::fields::{CloudColor, CloudFields};
use super::header::HeaderLines;
use super::text_body::TextBody;
use contract::{Error, Kind, Result};

/// Longest record, bytes.
const MAX_STRIDE: usize = 1 << 16;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// An element of the header.
struct PlyElement {
    name: String,
    n: u64,
    /// Its properties, each with its name; `None` for a list.
    properties: Vec<(String, Option<Scalar>)>,
}

/// Reads the header of a PLY file; for text, the lines of the points are still to be counted.
pub(super) fn open(file: &[u8]) -> Result<CloudSeed> {
    let mut lines = HeaderLines::new(file);
    let (encoding, elements) = header(&mut lines)?;
    let Some(at) = elements.iter().position(|element| element.name == "vertex") else {
        return Err(lines.error("file has no element \"vertex\"").hint("export the points again"));
    };
    let vertex = &elements[at];
    let names: Vec<(String, usize)> =
        vertex.properties.iter().enumerate().map(|(i, p)| (p.0.clone(), i)).collect();
    let Some(mut fields) = CloudFields::by_names(&names) else {
        return Err(lines
            .error("element \"vertex\" lacks a property x, y or z")
            .hint("export the points again"));
    };
    // PLY has no packed colour.
    if let CloudColor::Packed { .. } = fields.color {
        fields.color = CloudColor::None;
    }
    let is_list = |e: &&PlyElement| e.properties.iter().any(|(_, scalar)| scalar.is_none());
    if encoding != Encoding::Ascii && elements[..=at].iter().any(|e| is_list(&e)) {
        let what = "PLY whose points hold lists or follow lists is not read";
        return Err(Error::new(Kind::Unsupported, what)
            .at("header")
            .hint("export the points without lists, or as E57 or LAS"));
    }
    let start = lines.end() as u64;
    let mut seed = match encoding {
        Encoding::Ascii => {
            if is_list(&vertex) {
                let what = "PLY whose points hold lists is not read";
                return Err(Error::new(Kind::Unsupported, what).at("header"));
            }
            let body = TextBody::new(None, names.len(), &fields.slots());
            let n_before = elements[..at].iter().fold(0_u64, |n, e| n.saturating_add(e.n));
            let mut seed = CloudSeed::new(RecordBody::Text(body), fields, vertex.n);
            seed.uncounted = Some((start, lines.number(), n_before));
            seed
        }
        _ => binary(&elements[..=at], fields, start, encoding == Encoding::Big, &lines, file)?,
    };
    if elements[at + 1..].iter().any(|e| e.n > 0 && e.name == "face") {
        seed.notes.push(
            "the file is a mesh: its corners are read as points, but they are not what a scanner measured".into(),
        );
    }
    Ok(seed)
}

fn binary(
    elements: &[PlyElement],
    fields: CloudFields,
    start: u64,
    is_big: bool,
    lines: &HeaderLines<'_>,
    file: &[u8],
) -> Result<CloudSeed> {
    let stride = |e: &PlyElement| -> usize {
        e.properties.iter().filter_map(|(_, scalar)| *scalar).map(Scalar::len).sum()
    };
    let Some((vertex, before)) = elements.split_last() else {
        return Err(Error::new(Kind::Bug, "a PLY file was taken without its elements"));
    };
    let n_before =
        before.iter().try_fold(0_u64, |sum, e| sum.checked_add(e.n.checked_mul(stride(e) as u64)?));
    let mut offset = 0;
    let mut offsets = Vec::new();
    for (_, scalar) in &vertex.properties {
        offsets.push(offset);
        offset += scalar.map_or(0, Scalar::len);
    }
    if offset > MAX_STRIDE {
        return Err(lines.error(format!("a point is too long, bytes \"{offset}\"")));
    }
    let slots = fields.slots().into_iter().filter_map(|(column, slot)| {
        let scalar = vertex.properties[column].1?;
        Some(BinarySlot { offset: offsets[column], stride: scalar.len(), scalar, slot })
    });
    let slots = slots.collect();
    let start = n_before.and_then(|n| start.checked_add(n));
    let end = start
        .and_then(|start| start.checked_add(vertex.n.checked_mul(offset as u64)?))
        .filter(|end| *end <= file.len() as u64);
    let (Some(start), Some(_)) = (start, end) else {
        return Err(super::header::too_short(vertex.n));
    };
    let body = BinaryBody { start, stride: offset, is_big, slots };
    Ok(CloudSeed::new(RecordBody::Binary(body), fields, vertex.n))
}

fn header(lines: &mut HeaderLines<'_>) -> Result<(Encoding, Vec<PlyElement>)> {
    let mut encoding = None;
    let mut elements: Vec<PlyElement> = Vec::new();
    lines.next()?;
    loop {
        let words = lines.next()?;
        match words.iter().map(|w| &**w).collect::<Vec<_>>()[..] {
            ["end_header"] => break,
            [] | ["comment" | "obj_info", ..] => {}
            ["format", which, _version] => {
                encoding = Some(match which {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(lines.error(format!("format is not known, \"{which}\""))),
                });
            }
            ["element", name, n] => {
                let n = n.parse();
                let n = n.map_err(|_| lines.error("number of elements is no count"))?;
                elements.push(PlyElement { name: name.into(), n, properties: Vec::new() });
            }
            ["property", "list", _, _, name] => property(lines, &mut elements, name, None)?,
            ["property", kind, name] => {
                let Some(scalar) = scalar(kind) else {
                    return Err(lines.error(format!("type is not known, \"{kind}\"")));
                };
                property(lines, &mut elements, name, Some(scalar))?;
            }
            _ => return Err(lines.error("line of the header is not known")),
        }
    }
    let Some(encoding) = encoding else {
        return Err(lines.error("header states no format"));
    };
    Ok((encoding, elements))
}

fn property(
    lines: &HeaderLines<'_>,
    elements: &mut [PlyElement],
    name: &str,
    scalar: Option<Scalar>,
) -> Result<()> {
    let Some(element) = elements.last_mut() else {
        return Err(lines.error("a property comes before any element"));
    };
    element.properties.push((name.to_owned(), scalar));
    Ok(())
}

fn scalar(name: &str) -> Option<Scalar> {
    Some(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "int64" => Scalar::I64,
        "uint64" => Scalar::U64,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}
