//! The header of PCD files of the Point Cloud Library.

use super::binary::{BinaryBody, BinarySlot, Scalar};
use super::body::{CloudSeed, RecordBody};
use super::fields::{CloudColor, CloudFields};
use super::header::{HeaderLines, too_short};
use super::packed::PackedBody;
use super::text_body::TextBody;
use crate::frame;
use contract::{Error, Kind, Result};
use geometry::Pose;
use nalgebra::{Translation3, Vector3};

/// Longest record, bytes.
const MAX_STRIDE: usize = 1 << 16;

/// A field of the records.
#[derive(Debug, Clone, Default)]
struct Field {
    name: String,
    size: usize,
    kind: char,
    count: usize,
}

/// What the header states.
#[derive(Debug, Default)]
struct PcdHeader {
    fields: Vec<Field>,
    n: Option<u64>,
    /// Width times height.
    area: Option<u64>,
    viewpoint: [f64; 7],
}

/// Reads the header of a PCD file; for text, the lines of the points are still to be counted.
/// `metres` is the length of the file's unit.
pub(super) fn open(file: &[u8], metres: [f64; 3]) -> Result<CloudSeed> {
    let mut lines = HeaderLines::new(file);
    let (header, encoding) = read(&mut lines)?;
    let Some(n) = header.n.or(header.area) else {
        return Err(lines.error("header states no number of points"));
    };
    let (names, columns) = names(&header);
    let Some(mut fields) = CloudFields::by_names(&names) else {
        return Err(lines
            .error("FIELDS lacks x, y or z")
            .hint("export the points with their coordinates"));
    };
    let scalars: Vec<Scalar> =
        header.fields.iter().map(|f| scalar(f, &lines)).collect::<Result<_>>()?;
    if let CloudColor::Packed { column, is_float } = &mut fields.color {
        let at = columns.iter().position(|c| c == column);
        *is_float = at.is_some_and(|at| scalars[at] == Scalar::F32);
    }
    let record: usize = header
        .fields
        .iter()
        .try_fold(0_usize, |sum, f| sum.checked_add(f.size.checked_mul(f.count)?))
        .filter(|record| (1..=MAX_STRIDE).contains(record))
        .ok_or_else(|| lines.error("a point is too long or empty"))?;
    let slots = slots(&header, &columns, &scalars, &fields);
    let start = lines.end() as u64;
    let pose = viewpoint(&header, metres)?;
    let mut seed = match &*encoding {
        "ascii" => {
            let n_columns = header.fields.iter().map(|f| f.count).sum();
            let body = TextBody::new(None, n_columns, &fields.slots());
            let mut seed = CloudSeed::new(RecordBody::Text(body), fields, n);
            seed.uncounted = Some((start, lines.number(), 0));
            seed
        }
        "binary" => {
            let end = n.checked_mul(record as u64).and_then(|len| len.checked_add(start));
            if end.is_none_or(|end| end > file.len() as u64) {
                return Err(too_short(n));
            }
            let body = BinaryBody { start, stride: record, is_big: false, slots };
            CloudSeed::new(RecordBody::Binary(body), fields, n)
        }
        "binary_compressed" => {
            let body = PackedBody::open(file, start, n, record, slots)?;
            CloudSeed::new(RecordBody::Packed(body), fields, n)
        }
        other => return Err(lines.error(format!("DATA is not known, \"{other}\""))),
    };
    seed.pose = pose;
    Ok(seed)
}

/// Where the values that are kept lie in a record. `columns` are the first columns of the fields,
/// `scalars` their types.
fn slots(
    header: &PcdHeader,
    columns: &[usize],
    scalars: &[Scalar],
    fields: &CloudFields,
) -> Vec<BinarySlot> {
    let mut offsets = Vec::new();
    let mut offset = 0;
    for field in &header.fields {
        offsets.push(offset);
        offset += field.size * field.count;
    }
    let slots = fields.slots().into_iter().filter_map(|(column, slot)| {
        let at = columns.iter().position(|c| *c == column)?;
        let field = &header.fields[at];
        let stride = field.size * field.count;
        Some(BinarySlot { offset: offsets[at], stride, scalar: scalars[at], slot })
    });
    slots.collect()
}

/// Names of the fields, each with its first column; and the first column of each field.
fn names(header: &PcdHeader) -> (Vec<(String, usize)>, Vec<usize>) {
    let mut column = 0;
    let mut columns = Vec::new();
    for field in &header.fields {
        columns.push(column);
        column += field.count;
    }
    let names = header.fields.iter().zip(&columns).map(|(f, column)| (f.name.clone(), *column));
    (names.collect(), columns)
}

/// The header, and how the points are encoded.
fn read(lines: &mut HeaderLines<'_>) -> Result<(PcdHeader, String)> {
    let mut header = PcdHeader { viewpoint: DEFAULT, ..PcdHeader::default() };
    let (mut width, mut height) = (None, None);
    loop {
        let words = lines.next()?;
        let Some((key, values)) = words.split_first() else { continue };
        match &**key {
            "VERSION" => {}
            "FIELDS" | "COLUMNS" => {
                let field = |name: &std::borrow::Cow<'_, str>| Field {
                    name: name.to_string(),
                    size: 4,
                    kind: 'F',
                    count: 1,
                };
                header.fields = values.iter().map(field).collect();
            }
            "SIZE" => set(lines, &mut header.fields, values, |f, v| {
                v.parse().ok().map(|size| f.size = size)
            })?,
            "TYPE" => set(lines, &mut header.fields, values, |f, v| {
                v.chars().next().map(|kind| f.kind = kind)
            })?,
            "COUNT" => set(lines, &mut header.fields, values, |f, v| {
                let count = v.parse().ok().filter(|n| *n <= MAX_STRIDE);
                count.map(|count| f.count = count)
            })?,
            "WIDTH" => width = Some(number(lines, values)?),
            "HEIGHT" => height = Some(number(lines, values)?),
            "POINTS" => header.n = Some(number(lines, values)?),
            "VIEWPOINT" => {
                let all: Vec<f64> = values.iter().filter_map(|v| v.parse().ok()).collect();
                header.viewpoint = all.try_into().map_err(|_| {
                    lines.error("VIEWPOINT must hold seven numbers: tx ty tz qw qx qy qz")
                })?;
            }
            "DATA" => {
                header.area = width.map(|w: u64| w.saturating_mul(height.unwrap_or(1)));
                let encoding = values.first().map_or_else(String::new, |v| v.to_string());
                return Ok((header, encoding));
            }
            key if key.starts_with('#') => {}
            _ => return Err(lines.error(format!("line of the header is not known, \"{key}\""))),
        }
    }
}

/// Sets a value of each field.
fn set(
    lines: &HeaderLines<'_>,
    fields: &mut [Field],
    values: &[std::borrow::Cow<'_, str>],
    put: impl Fn(&mut Field, &str) -> Option<()>,
) -> Result<()> {
    let is_set = fields.len() == values.len()
        && fields.iter_mut().zip(values).all(|(field, value)| put(field, value).is_some());
    is_set.then_some(()).ok_or_else(|| {
        lines
            .error("line does not hold one value for each of FIELDS")
            .hint("the header is damaged; export the file again")
    })
}

fn number(lines: &HeaderLines<'_>, values: &[std::borrow::Cow<'_, str>]) -> Result<u64> {
    let value = values.first().and_then(|v| v.parse().ok());
    value.ok_or_else(|| lines.error("line of the header holds no count"))
}

fn scalar(field: &Field, lines: &HeaderLines<'_>) -> Result<Scalar> {
    Ok(match (field.kind, field.size) {
        ('I', 1) => Scalar::I8,
        ('U', 1) => Scalar::U8,
        ('I', 2) => Scalar::I16,
        ('U', 2) => Scalar::U16,
        ('I', 4) => Scalar::I32,
        ('U', 4) => Scalar::U32,
        ('I', 8) => Scalar::I64,
        ('U', 8) => Scalar::U64,
        ('F', 4) => Scalar::F32,
        ('F', 8) => Scalar::F64,
        (kind, size) => {
            let name = &field.name;
            let what = format!("field '{name}' has an unknown type, \"{kind} of {size} bytes\"");
            return Err(lines.error(what));
        }
    })
}

/// What programs write that know no viewpoint.
const DEFAULT: [f64; 7] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// The pose of the scanner, in the frame of the points; `None` where the header states none.
fn viewpoint(header: &PcdHeader, metres: [f64; 3]) -> Result<Option<Pose>> {
    let v = header.viewpoint;
    if v == DEFAULT {
        return Ok(None);
    }
    let place = || "VIEWPOINT";
    if v.iter().any(|v| !v.is_finite()) {
        return Err(Error::new(Kind::BadInput, "VIEWPOINT holds what is no number").at(place()));
    }
    let rotation = frame::rotation([v[3], v[4], v[5], v[6]]).map_err(|e| e.at(place()))?;
    let at = Vector3::new(v[0] * metres[0], v[1] * metres[1], v[2] * metres[2]);
    Ok(Some(Pose::from_parts(Translation3::from(at), rotation)))
}
