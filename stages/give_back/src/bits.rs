//! Runs of bits, lowest bit first, as E57 packs numbers: appended from anywhere, packed and
//! unpacked.

/// Number of bits that a word brings in at once: with up to seven that wait they fit 64.
const AT_ONCE: u64 = 56;

/// Bits that are appended at the end.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct BitBuffer {
    bytes: Vec<u8>,
    n_bits: u64,
}

impl BitBuffer {
    /// The bits of some bytes.
    pub(crate) fn of(bytes: Vec<u8>, n_bits: u64) -> Self {
        Self { bytes, n_bits }
    }

    /// Number of bits.
    pub(crate) fn n_bits(&self) -> u64 {
        self.n_bits
    }

    /// The bytes; bits of the last one behind the end are zero.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Appends `n` bits of `from`, from bit `first` on.
    pub(crate) fn append(&mut self, from: &[u8], first: u64, n: u64) {
        let waiting = self.n_bits % 8;
        if waiting == 0 && first.is_multiple_of(8) {
            let (start, len) = ((first / 8) as usize, n.div_ceil(8) as usize);
            self.bytes.extend_from_slice(&from[start..start + len]);
            if let (true, Some(last)) = (!n.is_multiple_of(8), self.bytes.last_mut()) {
                *last &= u8::MAX >> (8 - n % 8);
            }
            self.n_bits += n;
            return;
        }
        let mut word = if waiting > 0 { u64::from(self.bytes.pop().unwrap_or(0)) } else { 0 };
        let (mut held, mut at, end) = (waiting, first, first + n);
        self.bytes.reserve((n / 8 + 2) as usize);
        while at < end {
            let take = (end - at).min(AT_ONCE);
            word |= (load(from, at) & (u64::MAX >> (64 - take))) << held;
            (held, at) = (held + take, at + take);
            let whole = held / 8;
            self.bytes.extend_from_slice(&word.to_le_bytes()[..whole as usize]);
            word = word.checked_shr(8 * whole as u32).unwrap_or(0);
            held %= 8;
        }
        if held > 0 {
            self.bytes.push(word as u8);
        }
        self.n_bits += n;
    }

    /// Removes whole bytes from the front.
    pub(crate) fn take_front(&mut self, n_bytes: usize) {
        self.bytes.drain(..n_bytes);
        self.n_bits -= 8 * n_bytes as u64;
    }
}

/// At least 57 bits from bit `at` on; zeros behind the end.
#[inline]
fn load(from: &[u8], at: u64) -> u64 {
    let rest = from.get((at / 8) as usize..).unwrap_or_default();
    let word = match rest.first_chunk::<8>() {
        Some(bytes) => u64::from_le_bytes(*bytes),
        None => {
            let mut bytes = [0; 8];
            bytes[..rest.len()].copy_from_slice(rest);
            u64::from_le_bytes(bytes)
        }
    };
    word >> (at % 8)
}

/// Calls `each` for the first `n` numbers of `bits` bits.
#[inline]
pub(crate) fn unpack(from: &[u8], bits: u32, n: usize, mut each: impl FnMut(usize, u64)) {
    if bits == 0 {
        (0..n).for_each(|i| each(i, 0));
        return;
    }
    let mask = u64::MAX >> (64 - bits);
    for i in 0..n {
        let at = i as u64 * u64::from(bits);
        let low = load(from, at);
        // Of a long number some bits lie behind those of one load.
        let value = if bits <= 57 { low } else { low & HALF | (load(from, at + 32) & HALF) << 32 };
        each(i, value & mask);
    }
}

/// The lower half of a word.
const HALF: u64 = u32::MAX as u64;

/// Packs numbers of up to 64 bits.
#[derive(Debug, Default)]
pub(crate) struct BitPacker {
    bytes: Vec<u8>,
    n_bits: u64,
    word: u64,
    held: u32,
}

impl BitPacker {
    /// Room for `n` numbers of `bits` bits.
    pub(crate) fn with_room(n: usize, bits: u32) -> Self {
        Self { bytes: Vec::with_capacity(n * bits as usize / 8 + 16), ..Self::default() }
    }

    /// Appends the lowest `bits` bits of a number; the others must be zero.
    #[inline]
    pub(crate) fn push(&mut self, value: u64, bits: u32) {
        if bits > 32 {
            self.push(value & HALF, 32);
            return self.push(value >> 32, bits - 32);
        }
        self.word |= value << self.held;
        self.held += bits;
        self.n_bits += u64::from(bits);
        if self.held >= 32 {
            self.bytes.extend_from_slice(&(self.word as u32).to_le_bytes());
            self.word >>= 32;
            self.held -= 32;
        }
    }

    /// All bits.
    pub(crate) fn finish(mut self) -> BitBuffer {
        let left = self.held.div_ceil(8) as usize;
        self.bytes.extend_from_slice(&self.word.to_le_bytes()[..left]);
        BitBuffer::of(self.bytes, self.n_bits)
    }
}

/// Number of bits of a field with values from `min` to `max`.
pub(crate) fn width(min: i64, max: i64) -> u32 {
    64 - max.wrapping_sub(min).cast_unsigned().leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packed(values: &[u64], bits: u32) -> BitBuffer {
        let mut packer = BitPacker::with_room(values.len(), bits);
        values.iter().for_each(|v| packer.push(*v, bits));
        packer.finish()
    }

    proptest! {
        #[test]
        fn numbers_come_back_and_any_run_can_be_moved(
            raw in prop::collection::vec(any::<u64>(), 1..200),
            bits in 1_u32..=64,
            cuts in prop::collection::vec(0_usize..200, 0..6),
        ) {
            let values: Vec<u64> = raw.iter().map(|v| v & (u64::MAX >> (64 - bits))).collect();
            let whole = packed(&values, bits);
            prop_assert_eq!(whole.n_bits(), values.len() as u64 * u64::from(bits));
            let mut back = vec![0; values.len()];
            unpack(whole.bytes(), bits, values.len(), |i, v| back[i] = v);
            prop_assert_eq!(&back, &values);
            // Cut anywhere and put together again.
            let mut cuts: Vec<usize> = cuts.into_iter().map(|c| c.min(values.len())).collect();
            cuts.extend([0, values.len()]);
            cuts.sort_unstable();
            let mut joined = BitBuffer::default();
            for pair in cuts.windows(2) {
                let [from, n] = [pair[0], pair[1] - pair[0]].map(|v| v as u64 * u64::from(bits));
                joined.append(whole.bytes(), from, n);
            }
            prop_assert_eq!(&joined, &whole);
            // Every second number alone, behind an odd bit.
            let mut some = BitBuffer::default();
            some.append(&[1], 0, 1);
            for i in (0..values.len()).step_by(2) {
                some.append(whole.bytes(), i as u64 * u64::from(bits), u64::from(bits));
            }
            let mut moved = BitBuffer::default();
            moved.append(some.bytes(), 1, some.n_bits() - 1);
            let every_second: Vec<u64> = values.iter().step_by(2).copied().collect();
            prop_assert_eq!(moved, packed(&every_second, bits));
        }
    }

    #[test]
    fn constants_take_no_bits() {
        assert_eq!((width(7, 7), width(0, 2), width(-1, 6)), (0, 2, 3));
        assert_eq!(width(i64::MIN, i64::MAX), 64);
        let mut n = 0;
        unpack(&[], 0, 5, |_, v| n += 1 + v);
        assert_eq!(n, 5);
    }
}
