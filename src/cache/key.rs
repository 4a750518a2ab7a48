//! All that a piece depends on in; a digest of it, which names the piece's file, out.

use serde::{Deserialize, Serialize};

/// A digest of what a piece is made from, as 32 hexadecimal digits: the name of its file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Key(String);

/// Digits of a key.
const KEY_DIGITS: usize = 32;

impl TryFrom<String> for Key {
    type Error = String;

    /// A key that is read from a file becomes the name of a folder: it has to be one.
    fn try_from(name: String) -> std::result::Result<Self, String> {
        let is_key = name.len() == KEY_DIGITS && name.bytes().all(|b| b.is_ascii_hexdigit());
        if is_key {
            Ok(Self(name))
        } else {
            Err("a key of a piece has 32 hexadecimal digits".into())
        }
    }
}

impl Key {
    /// Of a kind of piece and all that it depends on, part by part.
    pub(crate) fn of(kind: &str, parts: &[&str]) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in [kind, env!("STILLPOINT_CODE")].iter().chain(parts) {
            // The length before each part: no two lists of parts run into the same bytes.
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
        Self(hasher.finalize().to_hex()[..KEY_DIGITS].into())
    }

    pub(crate) fn name(&self) -> &str {
        &self.0
    }
}
