//! Decodes the bytes of one field: floats and bit-packed integers that continue from packet to
//! packet.

use contract::{Error, Result};
use e57::RecordDataType;

/// Number of bytes after the end that a load of 16 bytes may touch.
const PADDING: usize = 16;

/// How a value is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Coding {
    Single,
    Double,
    /// `stored + min`, bit-packed.
    Integer {
        min: i64,
    },
    /// `(stored + min) · scale + offset`, bit-packed.
    Scaled {
        min: i64,
        scale: f64,
        offset: f64,
    },
}

/// The undecoded bytes of one field.
#[derive(Debug, Clone)]
pub(super) struct FieldStream {
    coding: Coding,
    /// Number of bits of a value; 0 where all values are equal.
    bits: u64,
    /// Whether the values are needed; if not, only their number is kept.
    wanted: bool,
    /// Bytes that are not decoded yet, after some that are.
    bytes: Vec<u8>,
    /// Number of bits held, including decoded ones.
    n_bits: u64,
    /// Number of bits decoded.
    at: u64,
}

impl FieldStream {
    /// An empty stream.
    pub(super) fn new(data_type: &RecordDataType, wanted: bool) -> Result<Self> {
        let (coding, bits) = match *data_type {
            RecordDataType::Single { .. } => (Coding::Single, 32),
            RecordDataType::Double { .. } => (Coding::Double, 64),
            RecordDataType::Integer { min, max } => {
                (Coding::Integer { min }, integer_bits(min, max))
            }
            RecordDataType::ScaledInteger { min, max, scale, offset } => {
                if !scale.is_finite() || scale == 0.0 || !offset.is_finite() {
                    return Err(Error::bad_input(format!(
                        "scale of a field is no number, \"{scale}\""
                    )));
                }
                (Coding::Scaled { min, scale, offset }, integer_bits(min, max))
            }
        };
        Ok(Self { coding, bits, wanted, bytes: Vec::new(), n_bits: 0, at: 0 })
    }

    /// Number of bits of a value.
    pub(super) fn bits(&self) -> u64 {
        self.bits
    }

    /// Number of whole values held; `None` where a value takes no bits, so that there is no limit.
    pub(super) fn available(&self) -> Option<u64> {
        (self.n_bits - self.at).checked_div(self.bits)
    }

    /// Memory of the stream, bytes.
    pub(super) fn weight_bytes(&self) -> usize {
        self.bytes.len()
    }

    /// Adds the bytes of one packet.
    pub(super) fn append(&mut self, bytes: &[u8]) {
        let whole = self.at / 8;
        if self.wanted {
            self.bytes.drain(..whole as usize);
            self.bytes.extend_from_slice(bytes);
        }
        self.at -= whole * 8;
        self.n_bits = self.n_bits - whole * 8 + bytes.len() as u64 * 8;
    }

    /// Whether at most the padding at the end of a stream is left: integers are written in words of
    /// up to 64 bits.
    pub(super) fn is_spent(&self) -> bool {
        let left = self.n_bits - self.at;
        match self.coding {
            Coding::Single | Coding::Double => left == 0,
            Coding::Integer { .. } | Coding::Scaled { .. } => left < 64,
        }
    }

    /// Skips `n` values, which must be available.
    pub(super) fn skip(&mut self, n: usize) {
        self.at += n as u64 * self.bits;
    }

    /// Decodes the next `n` values, which must be available, replacing the content of `out`.
    pub(super) fn numbers(&mut self, n: usize, out: &mut Vec<f64>) {
        out.clear();
        let from = self.at / 8;
        match self.coding {
            // Floats begin on whole bytes, since all values of the stream have whole bytes.
            Coding::Single => {
                let bytes = &self.bytes[from as usize..][..n * 4];
                out.extend(
                    bytes.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))),
                );
            }
            Coding::Double => {
                let bytes = &self.bytes[from as usize..][..n * 8];
                out.extend(bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)));
            }
            Coding::Integer { min } => self.unpack(n, out, |v| (v as i64).wrapping_add(min) as f64),
            Coding::Scaled { min, scale, offset } => {
                self.unpack(n, out, |v| (v as i64).wrapping_add(min) as f64 * scale + offset);
            }
        }
        self.skip(n);
    }

    /// Decodes the next `n` values as integers (floats are truncated), replacing the content of
    /// `out`.
    pub(super) fn integers(&mut self, n: usize, out: &mut Vec<i64>) {
        out.clear();
        match self.coding {
            Coding::Integer { min } => {
                self.unpack(n, out, |v| (v as i64).wrapping_add(min));
                self.skip(n);
            }
            _ => {
                let mut numbers = Vec::with_capacity(n);
                self.numbers(n, &mut numbers);
                out.extend(numbers.iter().map(|v| *v as i64));
            }
        }
    }

    /// Appends the results of `each` for the next `n` stored values.
    #[inline]
    fn unpack<T>(&mut self, n: usize, out: &mut Vec<T>, each: impl Fn(u64) -> T) {
        if self.bits == 0 {
            out.extend((0..n).map(|_| each(0)));
            return;
        }
        let len = self.bytes.len();
        self.bytes.resize(len + PADDING, 0);
        let (first, bits, mask) =
            (self.at as usize, self.bits as usize, u64::MAX >> (64 - self.bits));
        let bytes = &self.bytes[..];
        // A value of up to 57 bits lies in the eight bytes from its first; a longer one in sixteen.
        if bits <= 57 {
            out.extend((0..n).map(|k| {
                let at = first + k * bits;
                let word = bytes[at / 8..].first_chunk().map_or(0, |b| u64::from_le_bytes(*b));
                each(word >> (at % 8) & mask)
            }));
        } else {
            out.extend((0..n).map(|k| {
                let at = first + k * bits;
                let word = bytes[at / 8..].first_chunk().map_or(0, |b| u128::from_le_bytes(*b));
                each((word >> (at % 8)) as u64 & mask)
            }));
        }
        self.bytes.truncate(len);
    }
}

/// Number of bits needed for `max − min`.
fn integer_bits(min: i64, max: i64) -> u64 {
    u64::from(64 - max.wrapping_sub(min).cast_unsigned().leading_zeros())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Packs values of `bits` bits, lowest bit first.
    fn pack(values: &[u64], bits: u32) -> Vec<u8> {
        let mut out = vec![0_u8; (values.len() * bits as usize).div_ceil(8)];
        for (n, value) in values.iter().enumerate() {
            for bit in 0..bits as usize {
                let at = n * bits as usize + bit;
                out[at / 8] |= ((value >> bit & 1) as u8) << (at % 8);
            }
        }
        out
    }

    #[test]
    fn every_width_comes_back_over_packets_of_any_cut() {
        for bits in 1..=64_u32 {
            let mask = u64::MAX >> (64 - bits);
            let values: Vec<u64> = (0..97_u64)
                .map(|n| n.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(n as u32) & mask)
                .collect();
            let min = if bits == 64 { i64::MIN } else { -5 };
            let max = min.wrapping_add(mask.cast_signed());
            let mut stream =
                FieldStream::new(&RecordDataType::Integer { min, max }, true).expect("plain");
            assert_eq!(stream.bits(), u64::from(bits));
            let mut got = Vec::new();
            let mut part = Vec::new();
            for bytes in pack(&values, bits).chunks(13) {
                stream.append(bytes);
                let n =
                    stream.available().expect("has bits").min((values.len() - got.len()) as u64);
                stream.integers(n as usize, &mut part);
                got.extend_from_slice(&part);
            }
            let want: Vec<i64> = values.iter().map(|v| min.wrapping_add(v.cast_signed())).collect();
            assert_eq!(got, want, "{bits} bits");
            assert!(stream.is_spent());
        }
    }

    #[test]
    fn constants_take_no_bits() {
        let data_type = RecordDataType::ScaledInteger { min: 7, max: 7, scale: 0.5, offset: 1.0 };
        let mut stream = FieldStream::new(&data_type, true).expect("plain");
        let mut out = Vec::new();
        stream.numbers(3, &mut out);
        assert_eq!((stream.available(), out), (None, vec![4.5; 3]));
        let broken = RecordDataType::ScaledInteger { min: 0, max: 7, scale: f64::NAN, offset: 1.0 };
        assert!(FieldStream::new(&broken, true).is_err());
    }
}
