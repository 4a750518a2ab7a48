//! Keys of cached pieces: a digest of everything that a piece depends on, which becomes the name of
//! its file.

use serde::{Deserialize, Serialize};

/// A digest of everything that a piece is computed from, as 32 hexadecimal digits: the name of its
/// file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Key(String);

/// Number of hexadecimal digits of a key.
const KEY_DIGITS: usize = 32;

impl TryFrom<String> for Key {
    type Error = String;

    /// A key that is read from a file becomes the name of a folder, so its form is checked.
    fn try_from(name: String) -> std::result::Result<Self, String> {
        let is_key = name.len() == KEY_DIGITS && name.bytes().all(|b| b.is_ascii_hexdigit());
        if is_key {
            Ok(Self(name))
        } else {
            Err("the key of a piece must have 32 hexadecimal digits".into())
        }
    }
}

impl Key {
    /// The key of a piece of this kind with all parts that it depends on.
    pub(crate) fn of(kind: &str, parts: &[&str]) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in [kind, env!("STILLPOINT_CODE")].iter().chain(parts) {
            // Each part is preceded by its length, so that two different lists never give the same
            // bytes.
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
        Self(hasher.finalize().to_hex()[..KEY_DIGITS].into())
    }

    pub(crate) fn name(&self) -> &str {
        &self.0
    }
}
