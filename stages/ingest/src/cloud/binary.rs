//! Records of equal length: scalars at fixed offsets.

use super::fields::Slots;

/// Kind of a binary scalar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Length, bytes.
    pub(super) fn len(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The value of the bytes, which are as many as the scalar is long.
    #[inline]
    pub(super) fn value(self, bytes: &[u8], is_big: bool) -> f64 {
        let mut raw = [0; 8];
        let len = self.len();
        if is_big {
            bytes[..len].iter().rev().zip(&mut raw).for_each(|(from, to)| *to = *from);
        } else {
            raw[..len].copy_from_slice(&bytes[..len]);
        }
        let word = u64::from_le_bytes(raw);
        match self {
            Self::I8 => f64::from(word as u8 as i8),
            Self::U8 => f64::from(word as u8),
            Self::I16 => f64::from(word as u16 as i16),
            Self::U16 => f64::from(word as u16),
            Self::I32 => f64::from(word as u32 as i32),
            Self::U32 => f64::from(word as u32),
            Self::I64 => word as i64 as f64,
            Self::U64 => word as f64,
            Self::F32 => f64::from(f32::from_bits(word as u32)),
            Self::F64 => f64::from_bits(word),
        }
    }
}

/// A value of a record that is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BinarySlot {
    /// Bytes from the start of the record.
    pub(super) offset: usize,
    /// Length of the whole field, of which the first value is kept, bytes.
    pub(super) stride: usize,
    pub(super) scalar: Scalar,
    pub(super) slot: usize,
}

/// Records one after the other.
#[derive(Debug, Clone)]
pub(super) struct BinaryBody {
    /// Byte of the first record.
    pub(super) start: u64,
    /// Length of a record, bytes.
    pub(super) stride: usize,
    pub(super) is_big: bool,
    pub(super) slots: Vec<BinarySlot>,
}

impl BinaryBody {
    /// The values of a record.
    #[inline]
    pub(super) fn record(&self, bytes: &[u8]) -> Slots {
        let mut out = Slots::default();
        for slot in &self.slots {
            out[slot.slot] = slot.scalar.value(&bytes[slot.offset..], self.is_big);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalars_are_read_in_both_orders() {
        let check = |scalar: Scalar, little: &[u8], value: f64| {
            let big: Vec<u8> = little.iter().rev().copied().collect();
            assert_eq!(scalar.len(), little.len());
            assert_eq!(scalar.value(little, false).to_bits(), value.to_bits(), "{scalar:?}");
            assert_eq!(scalar.value(&big, true).to_bits(), value.to_bits(), "{scalar:?}");
        };
        check(Scalar::I8, &(-5_i8).to_le_bytes(), -5.0);
        check(Scalar::U8, &[200], 200.0);
        check(Scalar::I16, &(-500_i16).to_le_bytes(), -500.0);
        check(Scalar::U16, &60_000_u16.to_le_bytes(), 60_000.0);
        check(Scalar::I32, &(-70_000_i32).to_le_bytes(), -70_000.0);
        check(Scalar::U32, &4_000_000_000_u32.to_le_bytes(), 4e9);
        check(Scalar::I64, &(-9_i64).to_le_bytes(), -9.0);
        check(Scalar::U64, &9_u64.to_le_bytes(), 9.0);
        check(Scalar::F32, &1.5_f32.to_le_bytes(), 1.5);
        check(Scalar::F64, &(-0.1_f64).to_le_bytes(), -0.1);
    }
}
