//! Open inputs in; what is in them, and what will be worse for what they lack, out: for people and
//! as JSON.

use crate::bounds;
use crate::raster::StepSource;
use crate::sources::Sources;
use crate::units::Units;
use contract::words::fixed;
use contract::{Fan, Format, Input, Scan, quote};
use geometry::{Aabb, Pose};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// What one input holds.
#[derive(Debug, Clone, Serialize)]
pub struct InputDescription {
    /// As given.
    pub path: String,
    /// `E57`, `PTX`, `LAS` or `LAZ`.
    pub format: &'static str,
    /// Length of the file, bytes.
    pub n_bytes: u64,
    /// Units of its coordinates as they stand in the file; all lengths here are metres.
    pub units: Units,
    /// What the file says of itself, in the order of the reader.
    pub facts: Vec<Fact>,
    /// Points that the file does not flag as invalid, where known without reading them.
    pub n_points: Option<u64>,
    /// In the order of the file.
    pub scans: Vec<ScanDescription>,
}

/// One thing that a file says of itself.
#[derive(Debug, Clone, Serialize)]
pub struct Fact {
    /// What it is.
    pub name: String,
    /// As text.
    pub value: String,
}

/// What one scan holds.
#[derive(Debug, Clone, Serialize)]
pub struct ScanDescription {
    /// Name for people.
    pub name: String,
    /// LAS point source id, where scans are told apart by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source_id: Option<u16>,
    /// Number of points, where stated.
    pub n_points: Option<u64>,
    /// Whether the scanner's position is known.
    pub scanner_known: bool,
    /// Pose of the scan frame in the world.
    pub world_from_scan: PoseText,
    /// Whether rows and columns of the file map to the lattice one to one.
    pub structured: bool,
    /// The lattice, where there is one.
    pub lattice: Option<LatticeText>,
    /// Bounds of its points in the world, metres, where they are known: stated in the world, or
    /// the points were read for it.
    pub bounds: Option<BoundsText>,
    /// Bounds in the world, metres, where the file states them; those that an E57 file states in
    /// the frame of the scan hold all points, but may be wider.
    pub stated_bounds: Option<BoundsText>,
    /// What is missing, and what will be worse for it.
    pub notes: Vec<String>,
}

/// A pose.
#[derive(Debug, Clone, Serialize)]
pub struct PoseText {
    /// Metres.
    pub xyz: [f64; 3],
    /// Unit quaternion.
    pub quat_wxyz: [f64; 4],
}

/// A lattice.
#[derive(Debug, Clone, Serialize)]
pub struct LatticeText {
    /// Elevation step, degrees.
    pub row_step_deg: f64,
    /// Azimuth step, degrees.
    pub col_step_deg: f64,
    /// Rows of the whole sphere.
    pub n_rows: u32,
    /// Columns of a turn.
    pub n_cols: u32,
    /// Axis of the scan frame that the scanner spins about.
    pub axis: &'static str,
    /// `rows and columns`, `irregular rows and columns` or `directions`.
    pub from: &'static str,
}

/// Bounds.
#[derive(Debug, Clone, Serialize)]
pub struct BoundsText {
    /// Metres.
    pub min: [f64; 3],
    /// Metres.
    pub max: [f64; 3],
}

/// Describes each input, in their order. E57 files that are not large are read for the bounds of
/// their points.
#[must_use]
pub fn describe(sources: &Sources, fan: &dyn Fan) -> Vec<InputDescription> {
    let read = bounds::read(sources, fan);
    let inputs = sources.inputs.iter().enumerate();
    inputs.map(|(i, input)| description(sources, i, input, &read)).collect()
}

fn description(
    sources: &Sources,
    at: usize,
    input: &Input,
    read: &BTreeMap<u32, Aabb>,
) -> InputDescription {
    let file = &sources.files[at];
    let scans = sources
        .scans
        .iter()
        .filter(|s| s.input == input.id)
        .zip(file.steps.iter().zip(&file.known));
    let masks = sources.masks.iter().filter(|m| m.input == input.id);
    InputDescription {
        path: input.path.display().to_string(),
        format: word(input.format),
        n_bytes: input.n_bytes,
        units: file.reader.units().clone(),
        facts: file.reader.facts().into_iter().map(|(name, value)| Fact { name, value }).collect(),
        n_points: masks.map(|m| m.n_points).sum(),
        scans: scans
            .map(|(scan, (steps, known))| {
                let is_exact = !matches!(input.format, Format::E57);
                let stated = scan.stated_bounds.filter(|_| is_exact);
                let bounds = read.get(&scan.id.0).copied().or(stated);
                scan_description(scan, *steps, *known, bounds)
            })
            .collect(),
    }
}

fn scan_description(
    scan: &Scan,
    steps: StepSource,
    scanner_known: bool,
    bounds: Option<Aabb>,
) -> ScanDescription {
    let mut notes = scan.notes.clone();
    match steps {
        StepSource::Irregular => notes.push(
            "rows and columns are not regular in angle: a pixel of the lattice may hold two points or none".into(),
        ),
        StepSource::Directions => notes.push(
            "no rows and columns: the lattice is rebuilt from directions, edges are a pixel less sharp, and beams \
             without return cannot be told from gaps"
                .into(),
        ),
        StepSource::Native | StepSource::None => {}
    }
    ScanDescription {
        name: scan.name.clone(),
        source_id: scan.source_id,
        n_points: scan.stated_points,
        scanner_known,
        world_from_scan: pose_text(&scan.world_from_scan),
        structured: steps == StepSource::Native,
        lattice: scan.lattice.as_ref().map(|lattice| LatticeText {
            row_step_deg: lattice.row_step.to_degrees(),
            col_step_deg: lattice.col_step.to_degrees(),
            n_rows: lattice.n_rows,
            n_cols: lattice.n_cols,
            axis: axis(lattice),
            from: match steps {
                StepSource::Native => "rows and columns",
                StepSource::Irregular => "irregular rows and columns",
                StepSource::Directions | StepSource::None => "directions",
            },
        }),
        bounds: bounds.as_ref().map(bounds_text),
        stated_bounds: scan.stated_bounds.as_ref().map(bounds_text),
        notes,
    }
}

fn word(format: Format) -> &'static str {
    match format {
        Format::E57 => "E57",
        Format::Ptx => "PTX",
        Format::Las => "LAS",
        Format::Laz => "LAZ",
    }
}

fn axis(lattice: &contract::Lattice) -> &'static str {
    let axis = lattice.lattice_from_scan.inverse() * nalgebra::Vector3::z();
    ["x", "y", "z"][axis.iamax()]
}

fn pose_text(pose: &Pose) -> PoseText {
    let (t, q) = (pose.translation.vector, pose.rotation);
    PoseText { xyz: [t.x, t.y, t.z], quat_wxyz: [q.w, q.i, q.j, q.k] }
}

fn bounds_text(bounds: &Aabb) -> BoundsText {
    BoundsText { min: bounds.min, max: bounds.max }
}

fn metres(v: &[f64; 3]) -> String {
    v.map(|v| fixed(v, 3)).join(" ")
}

impl fmt::Display for InputDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", quote::shown(&self.path))?;
        writeln!(f, "  format: {}", self.format)?;
        writeln!(f, "  bytes: {}", self.n_bytes)?;
        match self.n_points {
            Some(n) => writeln!(f, "  points: {n}")?,
            None => writeln!(f, "  points: known once read")?,
        }
        writeln!(f, "  units: {}", self.units)?;
        for fact in &self.facts {
            writeln!(f, "  {}: {}", quote::shown(&fact.name), quote::shown(&fact.value))?;
        }
        self.scans.iter().try_for_each(|scan| scan.fmt(f))
    }
}

impl fmt::Display for ScanDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "  scan: {}", quote::shown(&self.name))?;
        if let Some(id) = self.source_id {
            writeln!(f, "    point source id: {id}")?;
        }
        if let Some(n) = self.n_points {
            writeln!(f, "    points: {n}")?;
        }
        if self.scanner_known {
            let [w, x, y, z] = self.world_from_scan.quat_wxyz;
            writeln!(
                f,
                "    scanner: at {}, turned {w:.6} {x:.6} {y:.6} {z:.6}",
                metres(&self.world_from_scan.xyz)
            )?;
        } else {
            writeln!(f, "    scanner: not known")?;
        }
        if let Some(lattice) = &self.lattice {
            writeln!(
                f,
                "    lattice: {:.4} by {:.4} degrees (elevation by azimuth) about {}, from {}",
                lattice.row_step_deg, lattice.col_step_deg, lattice.axis, lattice.from
            )?;
        }
        match (&self.bounds, &self.stated_bounds) {
            (Some(b), _) => writeln!(f, "    bounds: {} to {}", metres(&b.min), metres(&b.max))?,
            // Too many points to read them for that.
            (None, Some(b)) => writeln!(
                f,
                "    bounds: within {} to {}, as stated in the frame of the scan",
                metres(&b.min),
                metres(&b.max)
            )?,
            (None, None) => {}
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "    note: {note}"))
    }
}
