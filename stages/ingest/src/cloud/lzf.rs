//! Decompresses LZF gradually, from any of many places. A compressed PCD holds all values of x,
//! then all of y and so on; with one stream a field its records are read in order, in bounded
//! memory.

use contract::{Error, Result};

/// Farthest that a copy reaches back, bytes.
const WINDOW: usize = 1 << 13;
/// Distance between the places from which decompression can start, bytes.
const APART: u64 = 4 << 20;
/// Number of bytes that are decompressed ahead.
pub(super) const AHEAD: usize = 1 << 16;

/// A place from which decompression can start.
#[derive(Debug, Clone)]
struct LzfStart {
    /// Place in the decompressed bytes, and in the compressed ones.
    out: u64,
    at: usize,
    /// Decompressed bytes before it, as far as a copy reaches.
    window: Vec<u8>,
}

/// The places from which a block can be decompressed.
#[derive(Debug, Clone)]
pub(super) struct LzfIndex {
    starts: Vec<LzfStart>,
}

impl LzfIndex {
    /// Decompresses a block of a stated length once, without keeping it.
    pub(super) fn of(packed: &[u8], n_bytes: u64) -> Result<Self> {
        let first = LzfStart { out: 0, at: 0, window: Vec::new() };
        let mut stream = LzfStream::from(packed, &first);
        let mut starts = vec![first];
        let mut next = APART;
        while stream.step()? {
            if stream.end() >= next {
                let n = stream.buffer.len().min(WINDOW);
                let window = stream.buffer[stream.buffer.len() - n..].to_vec();
                starts.push(LzfStart { out: stream.end(), at: stream.at, window });
                next = stream.end() + APART;
            }
            if stream.end() > n_bytes {
                break;
            }
            stream.used = stream.buffer.len();
            stream.forget();
        }
        if stream.end() != n_bytes {
            let n = stream.end();
            return Err(damaged(format!(
                "compressed points have another length than stated, \"{n_bytes}\" bytes, not {n}"
            )));
        }
        Ok(Self { starts })
    }

    /// A stream that begins at a place of the decompressed bytes.
    pub(super) fn stream<'a>(&self, packed: &'a [u8], place: u64) -> Result<LzfStream<'a>> {
        let i = self.starts.partition_point(|start| start.out <= place).saturating_sub(1);
        let start = &self.starts[i];
        let mut stream = LzfStream::from(packed, start);
        let mut left = place - start.out;
        while left > 0 {
            let n = left.min(AHEAD as u64) as usize;
            stream.take(n)?;
            left -= n as u64;
        }
        Ok(stream)
    }
}

/// Decompressed bytes, one after the other.
pub(super) struct LzfStream<'a> {
    packed: &'a [u8],
    /// Place in the compressed bytes.
    at: usize,
    /// Decompressed bytes: those that a copy may reach, and those that were not taken yet.
    buffer: Vec<u8>,
    /// Number of bytes of the buffer that were taken.
    used: usize,
    /// Place of the buffer's first byte in the decompressed bytes.
    first: u64,
}

impl<'a> LzfStream<'a> {
    fn from(packed: &'a [u8], start: &LzfStart) -> Self {
        let n = start.window.len();
        let first = start.out - n as u64;
        Self { packed, at: start.at, buffer: start.window.clone(), used: n, first }
    }

    /// Place of the end of the buffer in the decompressed bytes.
    fn end(&self) -> u64 {
        self.first + self.buffer.len() as u64
    }

    /// The next `n` bytes; at most [`AHEAD`].
    #[inline]
    pub(super) fn take(&mut self, n: usize) -> Result<&[u8]> {
        self.forget();
        while self.buffer.len() - self.used < n {
            if !self.step()? {
                return Err(damaged("compressed points end early".into()));
            }
        }
        let from = self.used;
        self.used += n;
        Ok(&self.buffer[from..self.used])
    }

    /// Drops bytes that were taken and that no copy reaches any more.
    fn forget(&mut self) {
        let n = self.used.min(self.buffer.len().saturating_sub(WINDOW));
        if n > AHEAD {
            self.buffer.drain(..n);
            self.used -= n;
            self.first += n as u64;
        }
    }

    /// Decompresses one literal or copy; returns false at the end.
    fn step(&mut self) -> Result<bool> {
        let Some(control) = self.packed.get(self.at).map(|b| usize::from(*b)) else {
            return Ok(false);
        };
        let cut = || damaged("compressed points end within a step".into());
        let byte = |at: usize| self.packed.get(at).map(|b| usize::from(*b)).ok_or_else(cut);
        if control < 32 {
            let end = self.at + 1 + control + 1;
            let literal = self.packed.get(self.at + 1..end).ok_or_else(cut)?;
            self.buffer.extend_from_slice(literal);
            self.at = end;
            return Ok(true);
        }
        let mut at = self.at + 1;
        let mut len = control >> 5;
        if len == 7 {
            len += byte(at)?;
            at += 1;
        }
        let back = ((control & 0x1f) << 8 | byte(at)?) + 1;
        let Some(from) = self.buffer.len().checked_sub(back) else {
            return Err(damaged(format!(
                "a copy of compressed points reaches before the first, \"{back}\""
            )));
        };
        let len = len + 2;
        if back >= len {
            self.buffer.extend_from_within(from..from + len);
        } else {
            // The copy reaches into itself.
            for i in from..from + len {
                self.buffer.push(self.buffer[i]);
            }
        }
        self.at = at + 1;
        Ok(true)
    }
}

fn damaged(what: String) -> Error {
    Error::bad_input(what).hint("the file is damaged; copy or export it again")
}

/// Compresses by literals and by copies of the last bytes, for tests.
#[cfg(test)]
pub(super) fn packed(bytes: &[u8]) -> Vec<u8> {
    let (mut out, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let reach = at.saturating_sub(WINDOW);
        let same = |from: usize| {
            (0..264.min(bytes.len() - at)).take_while(|i| bytes[from + i] == bytes[at + i]).count()
        };
        let froms = [at.checked_sub(1), at.checked_sub(4), at.checked_sub(8), Some(reach)];
        let froms = froms.into_iter().flatten().filter(|from| *from < at && *from >= reach);
        match froms.map(|from| (same(from), from)).max() {
            Some((n, from)) if n >= 3 => {
                let (len, back) = (n - 2, at - from - 1);
                if len < 7 {
                    out.push((len << 5 | back >> 8) as u8);
                } else {
                    out.extend([(7 << 5 | back >> 8) as u8, (len - 7) as u8]);
                }
                out.push(back as u8);
                at += n;
            }
            _ => {
                let n = 5.min(bytes.len() - at);
                out.push(n as u8 - 1);
                out.extend_from_slice(&bytes[at..at + n]);
                at += n;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::SplitMix64;

    #[test]
    fn streams_begin_anywhere() {
        let mut rng = SplitMix64::seed_from_u64(0x12f);
        let mut bytes: Vec<u8> = Vec::new();
        while bytes.len() < 11 << 20 {
            let byte = rng.random_range(0..4);
            let n = rng.random_range(1..400);
            bytes.extend(std::iter::repeat_n(byte, n));
        }
        let packed = packed(&bytes);
        let n = bytes.len();
        let index = LzfIndex::of(&packed, n as u64).expect("whole");
        assert_eq!(index.starts.len(), 3);
        assert!(packed.len() < n / 4);
        for _ in 0..50 {
            let from = rng.random_range(0..n);
            let mut stream = index.stream(&packed, from as u64).expect("whole");
            let mut at = from;
            for _ in 0..6 {
                let len = rng.random_range(1..AHEAD).min(n - at);
                assert!(stream.take(len).expect("whole") == &bytes[at..at + len], "{at}");
                at += len;
            }
            assert!(stream.buffer.len() < 4 * AHEAD);
        }
        assert!(LzfIndex::of(&packed, n as u64 + 1).is_err());
        assert!(LzfIndex::of(&packed, n as u64 - 1).is_err());
        assert!(LzfIndex::of(&packed[..packed.len() - 1], n as u64).is_err());
        assert!(LzfIndex::of(&[0x20, 0x05], 3).is_err(), "a copy from before the beginning");
    }
}
