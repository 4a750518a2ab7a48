//! Describes the content of inputs, and which results suffer from what they lack, for people and as
//! JSON.

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
    /// Path as given by the user.
    pub path: String,
    /// `E57`, `PTX`, `LAS` or `LAZ`.
    pub format: &'static str,
    /// Length of the file, bytes.
    pub n_bytes: u64,
    /// Units of the coordinates in the file; all lengths given here are in metres.
    pub units: Units,
    /// Facts that the file states, in the order of the reader.
    pub facts: Vec<Fact>,
    /// Number of points that the file does not flag as invalid, where known without reading it.
    pub n_points: Option<u64>,
    /// The scans, in the order of the file.
    pub scans: Vec<ScanDescription>,
}

/// A fact that a file states.
#[derive(Debug, Clone, Serialize)]
pub struct Fact {
    /// Name of the fact.
    pub name: String,
    /// Value as text.
    pub value: String,
}

/// The content of one scan.
#[derive(Debug, Clone, Serialize)]
pub struct ScanDescription {
    /// Display name.
    pub name: String,
    /// Point source id of LAS, where scans are told apart by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source_id: Option<u16>,
    /// Number of points, where the file states it.
    pub n_points: Option<u64>,
    /// Whether the scanner's position is known.
    pub scanner_known: bool,
    /// Pose of the scan frame in the world.
    pub world_from_scan: PoseText,
    /// Whether the file's rows and columns map to pixels of the lattice one to one.
    pub structured: bool,
    /// The lattice, where there is one.
    pub lattice: Option<LatticeText>,
    /// Bounds of the points in the world, metres, where they are stated in the world or were
    /// computed from the points.
    pub bounds: Option<BoundsText>,
    /// Stated bounds in the world, metres. Those that an E57 file states in the scan frame hold
    /// all points, but may be wider than they are.
    pub stated_bounds: Option<BoundsText>,
    /// Messages about what is missing and which results suffer from it.
    pub notes: Vec<String>,
}

/// A pose, as shown to people.
#[derive(Debug, Clone, Serialize)]
pub struct PoseText {
    /// Translation, metres.
    pub xyz: [f64; 3],
    /// Rotation as a unit quaternion.
    pub quat_wxyz: [f64; 4],
}

/// A lattice, as shown to people.
#[derive(Debug, Clone, Serialize)]
pub struct LatticeText {
    /// Elevation step, degrees.
    pub row_step_deg: f64,
    /// Azimuth step, degrees.
    pub col_step_deg: f64,
    /// Number of rows of the whole sphere.
    pub n_rows: u32,
    /// Number of columns of a full turn.
    pub n_cols: u32,
    /// Axis of the scan frame about which the scanner spins.
    pub axis: &'static str,
    /// Source of the steps: `rows and columns`, `irregular rows and columns` or `directions`.
    pub from: &'static str,
}

/// An axis-aligned bounding box.
#[derive(Debug, Clone, Serialize)]
pub struct BoundsText {
    /// Smallest corner, metres.
    pub min: [f64; 3],
    /// Largest corner, metres.
    pub max: [f64; 3],
}

/// Describes each input, in the order of the inputs. E57 files that are not large are read for the
/// bounds of their points.
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
        Format::Pts => "PTS",
        Format::Xyz => "XYZ",
        Format::Ply => "PLY",
        Format::Pcd => "PCD",
        Format::Memory => "memory",
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
            // The file has too many points to compute the bounds from them.
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
