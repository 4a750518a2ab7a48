//! The points of one scan in the description of an E57 file: its number of records and its fields.

use crate::bits::width;
use crate::e57_nodes::{count, end_tag, is_ours, standard_child, value_at};
use contract::{Error, Kind, Result};
use roxmltree::Node;
use std::ops::Range;

/// What a field is for, as far as it matters here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FieldRole {
    /// Flags coordinates of one kind as invalid.
    State(CoordinateKind),
    /// A class, robot or link of an earlier export.
    Ours,
    /// Anything else.
    Other,
}

/// Kinds of coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CoordinateKind {
    Cartesian,
    Spherical,
}

impl CoordinateKind {
    pub(crate) const ALL: [Self; 2] = [Self::Cartesian, Self::Spherical];

    /// Names of the three coordinates.
    fn axes(self) -> [&'static str; 3] {
        match self {
            Self::Cartesian => ["cartesianX", "cartesianY", "cartesianZ"],
            Self::Spherical => ["sphericalRange", "sphericalAzimuth", "sphericalElevation"],
        }
    }

    /// Name of the field that flags them as invalid.
    pub(crate) fn state(self) -> &'static str {
        match self {
            Self::Cartesian => "cartesianInvalidState",
            Self::Spherical => "sphericalInvalidState",
        }
    }
}

/// A field of a record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct FieldNode {
    pub(crate) role: FieldRole,
    /// Number of bits of a value.
    pub(crate) bits: u32,
    /// Least and largest value of an integer.
    pub(crate) limits: Option<[i64; 2]>,
    /// Place of its element in the description.
    pub(crate) at: Range<usize>,
}

/// The points of one scan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanNode {
    /// Number of records, as announced.
    pub n_records: u64,
    /// Offset of its section in the file.
    pub(crate) offset: u64,
    /// Place of the number of records in the description.
    pub(crate) count_at: Range<usize>,
    pub(crate) fields: Vec<FieldNode>,
    /// Kinds of coordinates that it has.
    pub(crate) systems: Vec<CoordinateKind>,
    /// The field by which a record counts as valid: that of Cartesian coordinates where it has
    /// them.
    pub(crate) valid_by: Option<usize>,
    /// Before the end tag of the list of fields.
    pub(crate) prototype_end: Option<usize>,
    /// Lists of groups, which refer to records by their numbers.
    pub(crate) groupings: Vec<Range<usize>>,
}

impl ScanNode {
    /// Reads the element `points` of a scan.
    pub(crate) fn read(points: &Node) -> Result<Self> {
        let n_records = count(points, "recordCount")?;
        let prototype = standard_child(points, "prototype");
        let elements: Vec<Node> = prototype
            .iter()
            .flat_map(|prototype| prototype.children().filter(Node::is_element))
            .collect();
        let fields = elements.iter().map(field).collect::<Result<Vec<_>>>()?;
        let has = |name: &str| elements.iter().any(|n| is_standard(n, name));
        let systems: Vec<CoordinateKind> = CoordinateKind::ALL
            .into_iter()
            .filter(|s| s.axes().iter().all(|axis| has(axis)))
            .collect();
        let of =
            |system: CoordinateKind| fields.iter().position(|f| f.role == FieldRole::State(system));
        let valid_by = systems.first().and_then(|system| of(*system));
        let scan = points.parent().filter(Node::is_element);
        let groupings = scan.and_then(|scan| standard_child(&scan, "pointGroupingSchemes"));
        let text = points.document().input_text();
        Ok(Self {
            n_records,
            offset: count(points, "fileOffset")?,
            count_at: value_at(points, "recordCount")?,
            prototype_end: prototype.and_then(|prototype| end_tag(text, &prototype)),
            groupings: groupings.iter().map(Node::range).collect(),
            fields,
            systems,
            valid_by,
        })
    }

    /// Number of bits of a record.
    pub(crate) fn record_bits(&self) -> u64 {
        self.fields.iter().map(|field| u64::from(field.bits)).sum()
    }

    /// Index of the field that flags coordinates of a kind as invalid.
    pub(crate) fn state(&self, system: CoordinateKind) -> Option<usize> {
        self.fields.iter().position(|f| f.role == FieldRole::State(system))
    }
}

/// Whether an element is one of the standard with this name.
fn is_standard(node: &Node, name: &str) -> bool {
    let home = node.document().root_element().tag_name().namespace();
    node.tag_name().name() == name && node.tag_name().namespace() == home
}

/// Reads the element of a field.
fn field(node: &Node) -> Result<FieldNode> {
    let name = node.tag_name().name();
    let limits = || -> Result<[i64; 2]> {
        let [min, max] = [("minimum", i64::MIN), ("maximum", i64::MAX)].map(|(limit, default)| {
            let text = node.attribute(limit);
            text.map_or(Ok(default), |text| {
                text.trim().parse().map_err(|e: std::num::ParseIntError| {
                    let what = format!("{limit} of field '{name}' is no number, \"{text}\"");
                    Error::bad_input(what).because(e)
                })
            })
        });
        let limits = [min?, max?];
        if limits[1] < limits[0] {
            let what = format!("limits of field '{name}' are reversed, \"{limits:?}\"");
            return Err(Error::bad_input(what));
        }
        Ok(limits)
    };
    let (bits, limits) = match (node.attribute("type"), node.attribute("precision")) {
        (Some("Float"), Some("single")) => (32, None),
        (Some("Float"), None | Some("double")) => (64, None),
        (Some("Integer"), _) => limits().map(|l| (width(l[0], l[1]), Some(l)))?,
        (Some("ScaledInteger"), _) => limits().map(|l| (width(l[0], l[1]), None))?,
        (other, _) => {
            let what = format!("field '{name}' has a type that is not read, \"{other:?}\"");
            return Err(Error::new(Kind::Unsupported, what));
        }
    };
    let state = CoordinateKind::ALL.into_iter().find(|system| is_standard(node, system.state()));
    let role = match state {
        Some(_) if limits.is_none() => {
            let what = format!("field '{name}' is no integer");
            return Err(Error::new(Kind::Unsupported, what));
        }
        Some(system) => FieldRole::State(system),
        None if is_ours(node) => FieldRole::Ours,
        None => FieldRole::Other,
    };
    Ok(FieldNode { role, bits, limits, at: node.range() })
}
