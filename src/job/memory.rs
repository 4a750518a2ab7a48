//! A size as people write it in, bytes out, and back.

use contract::{Error, Kind, Result};

/// Units, largest first. Without the `i` they are decimal.
const UNITS: [(&str, u64); 9] = [
    ("TiB", 1 << 40),
    ("GiB", 1 << 30),
    ("MiB", 1 << 20),
    ("KiB", 1 << 10),
    ("TB", 1_000_000_000_000),
    ("GB", 1_000_000_000),
    ("MB", 1_000_000),
    ("KB", 1_000),
    ("B", 1),
];

/// Bytes of a size such as `4GiB`, `1.5 GB`, `512M` (binary, as most tools read it) or `1000000`.
pub fn memory_bytes(text: &str) -> Result<u64> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = (text[..split].trim(), text[split..].trim());
    let factor = match unit.to_ascii_lowercase().as_str() {
        "" => Some(1),
        "k" => Some(1 << 10),
        "m" => Some(1 << 20),
        "g" => Some(1 << 30),
        "t" => Some(1 << 40),
        _ => UNITS.iter().find(|(name, _)| name.eq_ignore_ascii_case(unit)).map(|(_, n)| *n),
    };
    let number: Option<f64> = number.parse().ok();
    let bytes = number.zip(factor).map(|(n, f)| n * f as f64);
    match bytes {
        Some(bytes) if (0.0..9e18).contains(&bytes) => Ok(bytes as u64),
        _ => Err(Error::new(Kind::Usage, format!("this is no size: \"{text}\""))
            .hint("write for example 4GiB")),
    }
}

/// A size for people, in binary units.
#[must_use]
pub fn memory_words(bytes: u64) -> String {
    let unit = UNITS[..4].iter().find(|(_, n)| bytes >= *n);
    match unit {
        None => format!("{bytes} B"),
        Some((name, n)) if bytes.is_multiple_of(*n) => format!("{} {name}", bytes / n),
        Some((name, n)) => format!("{:.2} {name}", bytes as f64 / *n as f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_as_people_write_them() {
        for (text, bytes) in [
            ("4GiB", 4 << 30),
            ("4 gib", 4 << 30),
            ("1.5GB", 1_500_000_000),
            ("512M", 512 << 20),
            ("1000000", 1_000_000),
        ] {
            assert_eq!(memory_bytes(text).expect(text), bytes);
        }
        for text in ["", "GiB", "4 GiBs", "-1GiB", "1e30TiB", "nanGiB", "4 4 GiB", "infGiB"] {
            assert!(memory_bytes(text).is_err(), "{text}");
        }
        assert_eq!(memory_words(4 << 30), "4 GiB");
        assert_eq!(memory_words(1_500_000_000), "1.40 GiB");
    }
}
