//! Turns a piece of records into what is written of it: moving points flagged or left out, classes,
//! robots and links beside them.

use crate::bits::{BitBuffer, BitPacker, unpack, width};
use crate::e57_records::RecordPiece;
use crate::e57_scan::{CoordinateKind, FieldRole, ScanNode};
use crate::fate::{GiveBack, GivenBack, PointFate, RobotNames, ScanFates};
use crate::legend::field_limits;
use contract::{Error, Map, Result, Weigh};

/// Value of a state without any valid coordinate. The other one, 1, would mean that coordinates are
/// a direction.
const INVALID: i64 = 2;

/// A field that is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WrittenField {
    /// A field of the original, bit by bit.
    Same { from: usize, bits: u32 },
    /// A state, from that of the original where it has one.
    State { of: CoordinateKind, from: Option<usize>, limits: [i64; 2] },
    /// Class, robot or link: index of the field, and its limits.
    Label { which: usize, limits: [i64; 2] },
}

impl WrittenField {
    pub(crate) fn bits(&self) -> u32 {
        match self {
            Self::Same { bits, .. } => *bits,
            Self::State { limits, .. } | Self::Label { limits, .. } => width(limits[0], limits[1]),
        }
    }
}

/// What becomes of the records of one scan.
#[derive(Debug, Clone)]
pub struct ScanPlan {
    pub(crate) how: GiveBack,
    /// The written fields in their order.
    pub(crate) fields: Vec<WrittenField>,
}

impl ScanPlan {
    /// The plan for a scan. A scan without points stays as it is.
    #[must_use]
    pub fn of(scan: &ScanNode, how: GiveBack, robots: &[RobotNames]) -> Self {
        let same = |from: usize| WrittenField::Same { from, bits: scan.fields[from].bits };
        if scan.n_records == 0 {
            return Self { how, fields: (0..scan.fields.len()).map(same).collect() };
        }
        let flags = |system: CoordinateKind| !how.drops && scan.systems.contains(&system);
        let mut fields = Vec::new();
        for (at, field) in scan.fields.iter().enumerate() {
            match (field.role, field.limits) {
                (FieldRole::Ours, _) => {}
                (FieldRole::State(of), Some([min, max])) if flags(of) => {
                    let limits = [min.min(0), max.max(INVALID)];
                    fields.push(WrittenField::State { of, from: Some(at), limits });
                }
                _ => fields.push(same(at)),
            }
        }
        for of in
            CoordinateKind::ALL.into_iter().filter(|of| flags(*of) && scan.state(*of).is_none())
        {
            fields.push(WrittenField::State { of, from: None, limits: [0, INVALID] });
        }
        if how.says_labels {
            let limits = field_limits(robots).into_iter().enumerate();
            fields.extend(limits.map(|(which, limits)| WrittenField::Label { which, limits }));
        }
        Self { how, fields }
    }
}

/// Records as they are written.
#[derive(Debug)]
pub struct MarkedPiece {
    /// Number of records.
    pub(crate) n: u64,
    /// The bits of each written field.
    pub(crate) fields: Vec<BitBuffer>,
    pub(crate) counts: GivenBack,
}

impl Weigh for MarkedPiece {
    fn weight_bytes(&self) -> usize {
        self.fields.iter().map(|bits| bits.bytes().len()).sum()
    }
}

/// The step that marks pieces of one scan.
pub struct RecordMarker<'a> {
    scan: &'a ScanNode,
    plan: &'a ScanPlan,
    fates: &'a dyn ScanFates,
}

impl<'a> RecordMarker<'a> {
    /// The step for a scan with these labels.
    #[must_use]
    pub fn new(scan: &'a ScanNode, plan: &'a ScanPlan, fates: &'a dyn ScanFates) -> Self {
        Self { scan, plan, fates }
    }

    /// The fate of each record.
    fn fates(&self, piece: &RecordPiece) -> Result<Vec<PointFate>> {
        let valid = self.fates.range(piece.first_place, piece.n_valid)?;
        if self.scan.valid_by.is_none() {
            return Ok(valid);
        }
        let mut valid = valid.into_iter();
        let mut of = |state: &i64| if *state == 0 { valid.next() } else { None };
        Ok(piece.states.iter().map(|state| of(state).unwrap_or(PointFate::UNKNOWN)).collect())
    }

    fn state(&self, piece: &RecordPiece, fates: &[PointFate], field: &WrittenField) -> BitBuffer {
        let WrittenField::State { from, limits: [min, _], .. } = *field else {
            return BitBuffer::default();
        };
        let bits = field.bits();
        let mut packer = BitPacker::with_room(piece.n, bits);
        let mut push = |i: usize, value: i64| {
            let value = if fates[i].is_out { INVALID } else { value };
            packer.push(value.wrapping_sub(min).cast_unsigned(), bits);
        };
        match from {
            None => (0..piece.n).for_each(|i| push(i, 0)),
            Some(at) => {
                let old = &self.scan.fields[at];
                let old_min = old.limits.map_or(0, |limits| limits[0]);
                let max = self.scan.fields[at].limits.map_or(INVALID, |limits| limits[1]);
                unpack(&piece.fields[at], old.bits, piece.n, |i, value| {
                    // Bits above the stated limit would not fit the written field.
                    push(i, old_min.wrapping_add(value.cast_signed()).clamp(old_min, max));
                });
            }
        }
        packer.finish()
    }

    fn label(&self, fates: &[PointFate], field: &WrittenField) -> Result<BitBuffer> {
        let WrittenField::Label { which, limits: [min, max] } = *field else {
            return Ok(BitBuffer::default());
        };
        let bits = field.bits();
        let mut packer = BitPacker::with_room(fates.len(), bits);
        for fate in fates.iter().filter(|fate| !(self.plan.how.drops && fate.is_out)) {
            let value = match which {
                0 => i64::from(fate.class),
                1 => i64::from(fate.robot),
                _ => i64::from(fate.link),
            };
            if value < min || value > max {
                let what = "a label names a robot or link that the result does not have";
                return Err(Error::bad_input(format!("{what}, \"{value}\"")));
            }
            packer.push((value - min).cast_unsigned(), bits);
        }
        Ok(packer.finish())
    }
}

impl Map for RecordMarker<'_> {
    type In = RecordPiece;
    type Out = MarkedPiece;
    type Scratch = ();

    fn apply(&self, mut piece: RecordPiece, (): &mut ()) -> Result<MarkedPiece> {
        let fates = self.fates(&piece)?;
        let n_out = fates.iter().filter(|fate| fate.is_out).count() as u64;
        let counts = GivenBack { n_valid: piece.n_valid as u64, n_out };
        let runs = (self.plan.how.drops && n_out > 0).then(|| kept_runs(&fates));
        let mut fields = Vec::with_capacity(self.plan.fields.len());
        for field in &self.plan.fields {
            fields.push(match *field {
                WrittenField::State { .. } => self.state(&piece, &fates, field),
                WrittenField::Label { .. } => self.label(&fates, field)?,
                WrittenField::Same { from, bits } => {
                    let bytes = std::mem::take(&mut piece.fields[from]);
                    let n_bits = piece.n as u64 * u64::from(bits);
                    match &runs {
                        None => BitBuffer::of(bytes, n_bits),
                        Some(runs) => compacted(&bytes, bits, runs),
                    }
                }
            });
        }
        let n_dropped = if runs.is_some() { n_out } else { 0 };
        Ok(MarkedPiece { n: piece.n as u64 - n_dropped, fields, counts })
    }
}

/// Runs of records that are kept: first record and number.
fn kept_runs(fates: &[PointFate]) -> Vec<[u64; 2]> {
    let mut runs: Vec<[u64; 2]> = Vec::new();
    let mut follows = false;
    for (i, fate) in fates.iter().enumerate() {
        match runs.last_mut() {
            _ if fate.is_out => {}
            Some(run) if follows => run[1] += 1,
            _ => runs.push([i as u64, 1]),
        }
        follows = !fate.is_out;
    }
    runs
}

/// The values of these runs.
fn compacted(bytes: &[u8], bits: u32, runs: &[[u64; 2]]) -> BitBuffer {
    let bits = u64::from(bits);
    let mut out = BitBuffer::default();
    if bits > 0 {
        runs.iter().for_each(|[first, n]| out.append(bytes, first * bits, n * bits));
    }
    out
}
