//! Numbers as bytes, bytes as text: differences in few bytes, deflate, base64, and the digest that
//! a page states of its own script.

use miniz_oxide::deflate::compress_to_vec;
use sha2::{Digest, Sha256};

/// How hard deflate tries, 0..10; beyond this nothing gets smaller that matters.
const EFFORT: u8 = 7;

/// Appends a number in groups of seven bits, lowest first.
pub(crate) fn push_varint(out: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        out.push((value & 0x7f) as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// A difference as a number without sign: 0, −1, 1, −2 … become 0, 1, 2, 3 …
pub(crate) fn unsigned(difference: i32) -> u32 {
    ((difference << 1) ^ (difference >> 31)) as u32
}

/// The bytes as the browser's `deflate-raw` reads them, as base64.
pub(crate) fn packed(bytes: &[u8]) -> String {
    base64(&compress_to_vec(bytes, EFFORT))
}

/// Bytes as base64.
pub(crate) fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= three.len() { char::from(letter) } else { '=' });
        }
    }
    out
}

/// The digest by which a content security policy names a script or a style.
pub(crate) fn policy_digest(text: &str) -> String {
    format!("'sha256-{}'", base64(&Sha256::digest(text.as_bytes())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        let said = ["", "f", "fo", "foo", "foob", "fooba", "foobar"].map(|t| base64(t.as_bytes()));
        assert_eq!(said, ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"]);
    }

    #[test]
    fn digests_are_those_of_the_standard() {
        let known = "'sha256-ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0='";
        assert_eq!(policy_digest("abc"), known);
    }

    #[test]
    fn numbers_take_as_few_bytes_as_they_need() {
        let mut out = Vec::new();
        [0, 127, 128, u32::MAX].into_iter().for_each(|v| push_varint(&mut out, v));
        assert_eq!(out, [0, 0x7f, 0x80, 1, 0xff, 0xff, 0xff, 0xff, 0x0f]);
        assert_eq!([0, -1, 1, -2, 2].map(unsigned), [0, 1, 2, 3, 4]);
    }
}
