//! Which columns of a record hold coordinates, intensity and colour, by their names or their
//! number, and how their values become those of a point.

use crate::levels::Span;
use contract::Attributes;

/// Number of values that are kept of a record: x, y, z, intensity, and three of colour.
pub(super) const N_SLOTS: usize = 7;
/// Slots of the intensity and of the first value of colour.
const INTENSITY: usize = 3;
const COLOR: usize = 4;
/// Values of a record by slot.
pub(super) type Slots = [f64; N_SLOTS];

/// Ranges of intensity in the order in which they are tried: shares, bytes, PTS, 12 and 16 bits.
const SPANS: [Span; 5] = [
    Span { min: 0.0, max: 1.0 },
    Span { min: 0.0, max: 255.0 },
    Span { min: -2048.0, max: 2047.0 },
    Span { min: 0.0, max: 4095.0 },
    Span { min: 0.0, max: 65_535.0 },
];
/// Share of the intensities looked at that may lie outside a range.
const OUTSIDE: f64 = 0.01;

/// How a record states colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CloudColor {
    /// Not at all.
    None,
    /// Three columns, and the value that is the brightest.
    Channels { columns: [usize; 3], most: f64 },
    /// One column with the bytes 0x00RRGGBB, as an integer or as the bits of a float.
    Packed { column: usize, is_float: bool },
}

/// What the columns of a file hold.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CloudFields {
    pub(super) xyz: [usize; 3],
    pub(super) intensity: Option<usize>,
    pub(super) color: CloudColor,
    /// The intensities that become 0 and 65535.
    pub(super) span: Span,
}

impl CloudFields {
    /// Coordinates in these columns, and nothing else.
    pub(super) fn plain(xyz: [usize; 3]) -> Self {
        Self { xyz, intensity: None, color: CloudColor::None, span: SPANS[0] }
    }

    /// By the names of columns, each with its index; `None` where a coordinate has none.
    pub(super) fn by_names(names: &[(String, usize)]) -> Option<Self> {
        let column = |of: &[&str]| {
            names.iter().find(|(name, _)| of.contains(&&*plain(name))).map(|(_, column)| *column)
        };
        let xyz = [
            column(&["x", "easting", "east"])?,
            column(&["y", "northing", "north"])?,
            column(&["z", "height", "elevation"])?,
        ];
        let mut fields = Self::plain(xyz);
        fields.intensity = column(&["intensity", "i", "reflectance", "reflectivity"]);
        let channels = [column(&["red", "r"]), column(&["green", "g"]), column(&["blue", "b"])];
        if let [Some(r), Some(g), Some(b)] = channels {
            fields.color = CloudColor::Channels { columns: [r, g, b], most: 255.0 };
        } else if let Some(column) = column(&["rgb", "rgba"]) {
            fields.color = CloudColor::Packed { column, is_float: false };
        }
        Some(fields)
    }

    /// By the number of columns and a few records of a file without names. Columns of colour hold
    /// whole numbers from 0 to 255; other columns after the coordinates may be anything.
    pub(super) fn by_number(n_columns: usize, records: &[Vec<f64>]) -> Self {
        let mut fields = Self::plain([0, 1, 2]);
        let is_color = |first: usize| {
            let all = records.iter().flat_map(|r| r.get(first..first + 3).unwrap_or(&[f64::NAN]));
            n_columns >= first + 3
                && all.clone().next().is_some()
                && all.clone().all(|v| v.fract() == 0.0 && (0.0..=255.0).contains(v))
        };
        let color = |first: usize| {
            let columns = [first, first + 1, first + 2];
            CloudColor::Channels { columns, most: 255.0 }
        };
        match n_columns {
            4 => fields.intensity = Some(3),
            6 if is_color(3) => fields.color = color(3),
            7 if is_color(4) => (fields.intensity, fields.color) = (Some(3), color(4)),
            7.. if is_color(3) => fields.color = color(3),
            _ => {}
        }
        fields
    }

    /// The columns that are read, each with its slot.
    pub(super) fn slots(&self) -> Vec<(usize, usize)> {
        let xyz = self.xyz.into_iter().enumerate().map(|(slot, column)| (column, slot));
        let intensity = self.intensity.map(|column| (column, INTENSITY));
        let color: Vec<usize> = match self.color {
            CloudColor::None => Vec::new(),
            CloudColor::Channels { columns, .. } => columns.to_vec(),
            CloudColor::Packed { column, .. } => vec![column],
        };
        let color = color.into_iter().enumerate().map(|(i, column)| (column, COLOR + i));
        xyz.chain(intensity).chain(color).collect()
    }

    /// Fits the ranges of intensity and colour to some records, with a message where the
    /// intensities keep to no usual range.
    pub(super) fn suited(mut self, records: &[Slots]) -> (Self, Option<String>) {
        let brightest = |slots: std::ops::Range<usize>| {
            records.iter().flat_map(|r| &r[slots.clone()]).copied().fold(0.0, f64::max)
        };
        if let CloudColor::Channels { most, .. } = &mut self.color {
            let whole = records.iter().flat_map(|r| &r[COLOR..]).all(|v| v.fract() == 0.0);
            *most = match brightest(COLOR..N_SLOTS) {
                v if v > 255.0 => 65_535.0,
                v if v <= 1.0 && !whole => 1.0,
                _ => *most,
            };
        }
        let values: Vec<f64> = match self.intensity {
            None => return (self, None),
            Some(_) => records.iter().map(|r| r[INTENSITY]).collect(),
        };
        let n_outside = |span: &Span| values.iter().filter(|v| span.cuts(**v)).count() as f64;
        let fits = |span: &&Span| n_outside(span) <= OUTSIDE * values.len() as f64;
        let (span, note) = match SPANS.iter().find(fits) {
            Some(span) => (*span, None),
            None => SPANS[1].suited(&values, false),
        };
        self.span = span;
        (self, note)
    }

    /// Whether points have colour.
    pub(super) fn has_color(&self) -> bool {
        self.color != CloudColor::None
    }

    /// Appends intensity and colour of a record; returns whether the intensity was cut.
    pub(super) fn push(&self, attributes: &mut Attributes, record: &Slots) -> bool {
        // `as` saturates at both ends and turns NaN into 0.
        let mut cut = false;
        if self.intensity.is_some() {
            let value = record[INTENSITY];
            cut = self.span.cuts(value);
            let level = ((value - self.span.min) * self.span.scale()).round() as u16;
            attributes.intensity.push(level);
        }
        match self.color {
            CloudColor::None => {}
            CloudColor::Channels { most, .. } => {
                let scale = 65_535.0 / most;
                let of = |i: usize| (record[COLOR + i] * scale).round() as u16;
                attributes.color.push([of(0), of(1), of(2)]);
            }
            CloudColor::Packed { is_float, .. } => {
                let value = record[COLOR];
                let bits = if is_float { (value as f32).to_bits() } else { value as u32 };
                let of = |shift: u32| ((bits >> shift) & 0xff) as u16 * 257;
                attributes.color.push([of(16), of(8), of(0)]);
            }
        }
        cut
    }
}

/// A name of a column as it is compared: small letters, without marks, units and prefixes.
fn plain(name: &str) -> String {
    let name = name.to_lowercase();
    let name = name.split(['[', '(']).next().unwrap_or_default();
    let name = name.trim_matches(|c: char| !c.is_alphanumeric());
    let name = name.strip_prefix("scalar_").unwrap_or(name);
    name.strip_prefix("diffuse_").unwrap_or(name).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &str) -> Option<CloudFields> {
        let names = names.split(' ').enumerate().map(|(i, name)| (name.to_owned(), i));
        CloudFields::by_names(&names.collect::<Vec<_>>())
    }

    #[test]
    fn columns_are_known_by_their_names() {
        let fields = named("//X Y Z Scalar_Intensity R G B").expect("coordinates");
        assert_eq!((fields.xyz, fields.intensity), ([0, 1, 2], Some(3)));
        assert_eq!(fields.color, CloudColor::Channels { columns: [4, 5, 6], most: 255.0 });
        let fields = named("id \"Northing[m]\" Easting[m] Height[m] rgb").expect("coordinates");
        assert_eq!((fields.xyz, fields.intensity), ([2, 1, 3], None));
        assert_eq!(fields.color, CloudColor::Packed { column: 4, is_float: false });
        assert_eq!(named("x y intensity"), None);
        assert_eq!(named("x_mm y_mm z_mm"), None);
    }

    #[test]
    fn columns_without_names_are_known_by_their_values() {
        let of = |record: &[f64]| CloudFields::by_number(record.len(), &[record.to_vec()]);
        let color =
            |first| CloudColor::Channels { columns: [first, first + 1, first + 2], most: 255.0 };
        assert_eq!(of(&[1.0, 2.0, 3.0, 0.5]).intensity, Some(3));
        assert_eq!(of(&[1.0, 2.0, 3.0, 4.0, 5.0, 255.0]).color, color(3));
        // Normals are no colour.
        assert_eq!(of(&[1.0, 2.0, 3.0, 0.0, 0.6, 0.8]), CloudFields::plain([0, 1, 2]));
        let pts = of(&[1.0, 2.0, 3.0, -1613.0, 52.0, 70.0, 64.0]);
        assert_eq!((pts.intensity, pts.color), (Some(3), color(4)));
        let colored = of(&[1.0, 2.0, 3.0, 52.0, 70.0, 64.0, 0.25]);
        assert_eq!((colored.intensity, colored.color), (None, color(3)));
        assert_eq!(of(&[1.0; 5]), CloudFields::plain([0, 1, 2]));
    }

    #[test]
    fn values_become_sixteen_bits() {
        let mut fields = CloudFields::by_number(7, &[vec![0.0; 7]]);
        let record = |i: f64, c: f64| [0.0, 0.0, 0.0, i, c, c, c];
        (fields, _) = fields.suited(&[record(-2000.0, 255.0), record(2000.0, 0.0)]);
        let mut out = Attributes::default();
        assert!(!fields.push(&mut out, &record(-2048.0, 255.0)));
        assert!(fields.push(&mut out, &record(9999.0, f64::NAN)));
        assert_eq!(out.intensity, [0, 65_535]);
        assert_eq!(out.color, [[65_535; 3], [0; 3]]);
        let mut packed = CloudFields::plain([0, 1, 2]);
        packed.color = CloudColor::Packed { column: 3, is_float: true };
        let bits = f64::from(f32::from_bits(0x00ff_8001));
        assert!(!packed.push(&mut out, &[0.0, 0.0, 0.0, 0.0, bits, 0.0, 0.0]));
        assert_eq!(out.color[2], [65_535, 0x80 * 257, 257]);
    }
}
