//! Sizes in bytes as people write them: parsing and formatting.

use bytesize::ByteSize;
use contract::{Error, Kind, Result};

/// Largest size that is accepted, bytes.
const MAX: u64 = 9_000_000_000_000_000_000;

/// Parses a size such as `4GiB`, `1.5 GB`, `512M` (binary, as most tools read it) or `1000000` to
/// bytes.
///
/// # Errors
/// `Usage` where the text is not a size.
pub fn memory_bytes(text: &str) -> Result<u64> {
    let text = text.trim();
    // The library reads `512M` as the decimal `512MB`.
    let is_short = text.ends_with(['k', 'K', 'm', 'M', 'g', 'G', 't', 'T']);
    let whole = if is_short { format!("{text}iB") } else { text.to_owned() };
    match whole.parse::<ByteSize>() {
        Ok(size) if size.as_u64() <= MAX => Ok(size.as_u64()),
        _ => Err(Error::new(Kind::Usage, format!("this is no size: \"{text}\""))
            .hint("write for example 4GiB")),
    }
}

/// Formats a size for people, in binary units.
#[must_use]
pub fn memory_words(bytes: u64) -> String {
    format!("{:.2}", ByteSize::b(bytes).display().iec()).replace(".00 ", " ")
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
            ("1.5 g", 3 << 29),
            ("700 kb", 700_000),
            ("8 B", 8),
            ("1000000", 1_000_000),
        ] {
            assert_eq!(memory_bytes(text).expect(text), bytes);
        }
        for text in
            ["", "GiB", "4 GiBs", "-1GiB", "1e30TiB", "nanGiB", "4 4 GiB", "infGiB", "9e9EiB"]
        {
            assert!(memory_bytes(text).is_err(), "{text}");
        }
        assert_eq!(memory_words(4 << 30), "4 GiB");
        assert_eq!(memory_words(1_500_000_000), "1.40 GiB");
        assert_eq!(memory_words(1023), "1023 B");
        assert_eq!(memory_words(3 << 40), "3 TiB");
    }
}
