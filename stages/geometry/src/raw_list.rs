//! Long lists of numbers, written as one string of bytes: a reader of pieces takes them in one go
//! instead of number by number. For `#[serde(with = "geometry::raw_list")]`; formats for people
//! would show bytes.

use serde::de::{Error, Visitor};
use serde::{Deserializer, Serializer};
use std::fmt::{Formatter, Result as Written};

/// Length of a number, bytes.
const NUMBER: usize = size_of::<f32>();

/// Writes a list.
///
/// # Errors
/// Those of the writer.
pub fn serialize<S: Serializer, const N: usize>(
    list: &[[f32; N]],
    to: S,
) -> Result<S::Ok, S::Error> {
    let mut bytes = Vec::with_capacity(list.len() * N * NUMBER);
    list.iter().flatten().for_each(|number| bytes.extend(number.to_le_bytes()));
    to.serialize_bytes(&bytes)
}

/// Reads a list.
///
/// # Errors
/// Those of the reader, and bytes that end within an entry.
pub fn deserialize<'de, D: Deserializer<'de>, const N: usize>(
    from: D,
) -> Result<Vec<[f32; N]>, D::Error> {
    from.deserialize_bytes(Bytes)
}

/// Takes a string of bytes for entries of so many numbers.
struct Bytes<const N: usize>;

impl<const N: usize> Visitor<'_> for Bytes<N> {
    type Value = Vec<[f32; N]>;

    fn expecting(&self, to: &mut Formatter<'_>) -> Written {
        write!(to, "a string of bytes, {} for each entry", N * NUMBER)
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Self::Value, E> {
        let entries = bytes.chunks_exact(N * NUMBER);
        if !entries.remainder().is_empty() {
            return Err(E::invalid_length(bytes.len(), &self));
        }
        let number = |entry: &[u8], i: usize| {
            let at = i * NUMBER;
            f32::from_le_bytes([entry[at], entry[at + 1], entry[at + 2], entry[at + 3]])
        };
        Ok(entries.map(|entry| std::array::from_fn(|i| number(entry, i))).collect())
    }
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Holder {
        #[serde(with = "super")]
        list: Vec<[f32; 3]>,
        after: u8,
    }

    #[test]
    fn lists_come_back_bit_for_bit_and_half_an_entry_is_refused() {
        let list = vec![[1.5, -0.0, f32::MIN_POSITIVE], [f32::INFINITY, 3e-39, -7.25]];
        let before = Holder { list, after: 7 };
        let mut bytes = postcard::to_stdvec(&before).expect("writes");
        let after: Holder = postcard::from_bytes(&bytes).expect("reads");
        assert_eq!(format!("{after:?}"), format!("{before:?}"));
        // The length of the bytes comes first, as one byte.
        assert_eq!(bytes[0], 24);
        bytes[0] = 23;
        assert!(postcard::from_bytes::<Holder>(&bytes).is_err());
    }
}
