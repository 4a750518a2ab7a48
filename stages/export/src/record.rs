//! LAS point records: a point in, the bytes of format 6 or 7 with our two extra fields out.

use contract::{Error, Kind, Label, PointKind, Result};
use geometry::Aabb;

/// Kind, LAS class (2 is the standard's ground, 64 and up are the user's) and name.
pub(crate) const CLASSES: [(PointKind, u8, &str); 5] = [
    (PointKind::Floor, 2, "floor"),
    (PointKind::Fixed, 64, "fixed"),
    (PointKind::Link, 65, "robot link"),
    (PointKind::Attachment, 66, "attachment, effector or carried part"),
    (PointKind::Uncertain, 69, "uncertain, counts as fixed"),
];

/// The LAS class of a kind of point.
#[must_use]
pub fn class_of(kind: PointKind) -> u8 {
    CLASSES.iter().find(|entry| entry.0 == kind).map_or(1, |entry| entry.1)
}

/// Scale and offset of LAS coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantum {
    /// Metres of one step on each axis.
    pub scale: [f64; 3],
    /// Metres of step zero.
    pub offset: [f64; 3],
}

impl Quantum {
    /// Steps of 0.1 mm about the middle of `bounds`, rounded to whole kilometres where the middle is farther than one
    /// from zero, so that tiles of one plant share it.
    #[must_use]
    pub fn around(bounds: &Aabb) -> Self {
        let middle = bounds.center();
        let offset = [0, 1, 2].map(|i| {
            let at: f64 = middle[i];
            if at.is_finite() { (at / 1000.0).trunc() * 1000.0 } else { 0.0 }
        });
        Self { scale: [1e-4; 3], offset }
    }

    fn step(&self, axis: usize, value: f64) -> Option<i32> {
        let step = ((value - self.offset[axis]) / self.scale[axis]).round();
        (step >= f64::from(i32::MIN) && step <= f64::from(i32::MAX)).then_some(step as i32)
    }
}

/// A variable length record to pass on, such as the reference system of an input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawVlr {
    /// Who defined it.
    pub user_id: String,
    /// Its number there.
    pub record_id: u16,
    /// In words.
    pub description: String,
    /// Its content.
    pub data: Vec<u8>,
}

/// What a LAS file holds and how.
#[derive(Debug, Clone, PartialEq)]
pub struct LasSettings {
    /// Scale and offset.
    pub quantum: Quantum,
    /// With colour (format 7) or without (format 6).
    pub with_color: bool,
    /// With the extra fields `RobotId` and `LinkId`.
    pub with_labels: bool,
    /// Compressed (LAZ).
    pub compress: bool,
    /// GPS times are adjusted standard time, as in the input's header.
    pub standard_gps_time: bool,
    /// Records to pass on.
    pub vlrs: Vec<RawVlr>,
}

impl LasSettings {
    /// Labelled, without colour, not compressed.
    #[must_use]
    pub fn new(quantum: Quantum) -> Self {
        Self {
            quantum,
            with_color: false,
            with_labels: true,
            compress: false,
            standard_gps_time: false,
            vlrs: Vec::new(),
        }
    }

    /// LAS point format.
    #[must_use]
    pub fn format(&self) -> u8 {
        if self.with_color { 7 } else { 6 }
    }

    /// Length of a record, bytes.
    #[must_use]
    pub fn record_len(&self) -> usize {
        30 + if self.with_color { 6 } else { 0 } + if self.with_labels { EXTRA_LEN } else { 0 }
    }
}

/// Length of our extra fields, bytes: two u16.
pub(crate) const EXTRA_LEN: usize = 4;

/// One point to be written.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LasPoint {
    /// World, metres.
    pub xyz: [f64; 3],
    /// 0..65535.
    pub intensity: u16,
    /// 0..65535 a channel; written by format 7 only.
    pub color: [u16; 3],
    /// GPS time, seconds.
    pub gps_time: f64,
    /// LAS class.
    pub class: u8,
    /// LAS point source id.
    pub source_id: u16,
    /// Index of the robot + 1, 0 for none.
    pub robot: u16,
    /// Index of the link + 1, 0 for none.
    pub link: u16,
}

impl LasPoint {
    /// Takes class, robot and link from a label.
    #[must_use]
    pub fn labelled(mut self, label: Label) -> Self {
        let one_based = |v: i16| u16::try_from(i32::from(v) + 1).unwrap_or(0);
        self.class = class_of(label.kind);
        self.robot = one_based(label.robot);
        self.link = one_based(label.link);
        self
    }
}

/// What a header must say of its points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) n: u64,
    /// In steps.
    pub(crate) min: [i32; 3],
    pub(crate) max: [i32; 3],
}

impl Default for Extent {
    fn default() -> Self {
        Self { n: 0, min: [i32::MAX; 3], max: [i32::MIN; 3] }
    }
}

/// Appends the record of a point.
#[inline]
pub(crate) fn encode(
    point: &LasPoint,
    settings: &LasSettings,
    extent: &mut Extent,
    out: &mut Vec<u8>,
) -> Result<()> {
    let mut steps = [0; 3];
    for i in 0..3 {
        let Some(step) = settings.quantum.step(i, point.xyz[i]) else {
            return Err(too_far(point.xyz));
        };
        steps[i] = step;
        extent.min[i] = extent.min[i].min(step);
        extent.max[i] = extent.max[i].max(step);
    }
    extent.n += 1;
    let mut bytes = [0; 40];
    for i in 0..3 {
        bytes[4 * i..4 * i + 4].copy_from_slice(&steps[i].to_le_bytes());
    }
    bytes[12..14].copy_from_slice(&point.intensity.to_le_bytes());
    // Return 1 of 1.
    bytes[14] = 0x11;
    bytes[16] = point.class;
    bytes[20..22].copy_from_slice(&point.source_id.to_le_bytes());
    bytes[22..30].copy_from_slice(&point.gps_time.to_le_bytes());
    let mut at = 30;
    let mut put = |value: u16| {
        bytes[at..at + 2].copy_from_slice(&value.to_le_bytes());
        at += 2;
    };
    if settings.with_color {
        point.color.into_iter().for_each(&mut put);
    }
    if settings.with_labels {
        put(point.robot);
        put(point.link);
    }
    out.extend_from_slice(&bytes[..at]);
    Ok(())
}

#[cold]
fn too_far(xyz: [f64; 3]) -> Error {
    Error::new(Kind::BadInput, format!("point does not fit into LAS coordinates: \"{xyz:?}\""))
        .hint("choose a larger scale or an offset near the points")
}
