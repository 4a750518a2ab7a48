//! Decodes the bytes of an XML file by its byte order mark or its declared encoding: UTF-8, UTF-16,
//! ASCII or ISO-8859-1. Any other encoding is refused by name, since a wrong guess would change the
//! names of links and files.

use std::borrow::Cow;

/// Number of bytes at the beginning of a file in which the XML declaration must end.
const DECLARATION: usize = 256;

/// The text of an XML file without its byte order mark, or why its bytes cannot be decoded.
pub(crate) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    match bytes {
        // A byte order mark, or else the first character, which is `<` in every XML file.
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [b'<', 0, second, 0, ..] if *second != 0 => utf16(bytes, u16::from_le_bytes),
        [0, b'<', 0, second, ..] if *second != 0 => utf16(bytes, u16::from_be_bytes),
        [0xEF, 0xBB, 0xBF, rest @ ..] => utf8(rest),
        _ => by_declaration(bytes),
    }
}

/// Decodes text without a mark by its declaration. If that names UTF-16, the text is UTF-8 all the
/// same, since the declaration could be read as such.
fn by_declaration(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let Some(name) = declared(bytes) else {
        return utf8(bytes);
    };
    match name.to_ascii_lowercase().as_str() {
        "utf-8" | "utf8" | "utf-16" | "us-ascii" | "ascii" => utf8(bytes),
        "iso-8859-1" | "iso8859-1" | "iso_8859-1" | "latin1" | "latin-1" => {
            Ok(bytes.iter().map(|&b| char::from(b)).collect::<String>().into())
        }
        _ => {
            let name: String = name.chars().take(40).collect();
            Err(format!("is in an encoding that is not read (save it as UTF-8) \"{name}\""))
        }
    }
}

/// The name of the encoding in the XML declaration, if there is one.
pub(crate) fn declared(bytes: &[u8]) -> Option<&str> {
    let name = encoding(bytes)?;
    std::str::from_utf8(&bytes[name]).ok()
}

/// The position of that name in the file.
fn encoding(bytes: &[u8]) -> Option<std::ops::Range<usize>> {
    let head = &bytes[..bytes.len().min(DECLARATION)];
    let end = head.windows(2).position(|w| w == b"?>")?;
    let head = head[..end].strip_prefix(b"<?xml").map(|_| &head[..end])?;
    let word = b"encoding";
    let mut at = head.windows(word.len()).position(|w| w == word)? + word.len();
    let blank = |at: &mut usize| {
        while head.get(*at).is_some_and(u8::is_ascii_whitespace) {
            *at += 1;
        }
    };
    blank(&mut at);
    if head.get(at) != Some(&b'=') {
        return None;
    }
    at += 1;
    blank(&mut at);
    let quote = *head.get(at).filter(|q| matches!(q, b'"' | b'\''))?;
    let from = at + 1;
    let n = head[from..].iter().position(|b| *b == quote)?;
    Some(from..from + n)
}

/// The text with UTF-8 as its declared encoding, for writing it as UTF-8.
pub(crate) fn declare_utf8(text: &str) -> Cow<'_, str> {
    match encoding(text.as_bytes()) {
        Some(name) if !text[name.clone()].eq_ignore_ascii_case("utf-8") => {
            format!("{}UTF-8{}", &text[..name.start], &text[name.end..]).into()
        }
        _ => text.into(),
    }
}

fn utf8(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let wrong = |e: std::str::Utf8Error| {
        format!("is not UTF-8 from byte {} on, and declares no other encoding", e.valid_up_to())
    };
    std::str::from_utf8(bytes).map(Cow::Borrowed).map_err(wrong)
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<Cow<'_, str>, String> {
    let (units, rest) = bytes.as_chunks::<2>();
    if !rest.is_empty() {
        return Err("is UTF-16 and ends in the middle of a character".to_owned());
    }
    char::decode_utf16(units.iter().map(|&pair| unit(pair)))
        .collect::<Result<String, _>>()
        .map(Cow::Owned)
        .map_err(|_| "is UTF-16 with half of a pair of characters".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wide(text: &str, unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
        text.encode_utf16().flat_map(unit).collect()
    }

    #[test]
    fn every_encoding_that_is_read_gives_the_same_text() {
        let text =
            |name: &str| format!("<?xml version=\"1.0\" encoding='{name}'?><a b=\"M\u{fc}\"/>");
        let latin: Vec<u8> = text("ISO-8859-1").chars().map(|c| c as u8).collect();
        assert_eq!(decode(&latin).expect("is ISO-8859-1"), text("ISO-8859-1"));
        let t = text("UTF-16");
        for (mark, unit) in [
            (vec![0xFF, 0xFE], u16::to_le_bytes as fn(u16) -> [u8; 2]),
            (vec![0xFE, 0xFF], u16::to_be_bytes),
        ] {
            let bytes = wide(&t, unit);
            assert_eq!(decode(&bytes).expect("is UTF-16 without a mark"), t);
            assert_eq!(decode(&[mark, bytes].concat()).expect("is UTF-16"), t);
        }
        assert_eq!(decode(&[b"\xEF\xBB\xBF", t.as_bytes()].concat()).expect("is UTF-8"), t);
        assert_eq!(decode(t.as_bytes()).expect("is UTF-8 whatever it declares"), t);
    }

    #[test]
    fn what_is_not_read_is_named() {
        let says = |bytes: &[u8], words: &str| {
            let what = decode(bytes).expect_err("is no text that is read");
            assert!(what.contains(words), "{what}");
        };
        says(b"<?xml version='1.0' encoding='Shift_JIS'?><a/>", "Shift_JIS");
        says(b"<?xml version='1.0' encoding='windows-1252'?><a/>", "windows-1252");
        says(b"<a b='\xFC'/>", "from byte 6");
        says(b"<?xml version='1.0' encoding='utf-8'?><a b='\xFC'/>", "not UTF-8");
        says(b"\xFF\xFE<\0a", "middle of a character");
        says(b"\xFF\xFE<\0\x00\xD8a\0", "half of a pair");
    }

    #[test]
    fn the_declaration_follows_the_bytes() {
        let text =
            "<?xml version=\"1.0\" encoding = \"latin1\" standalone='yes'?><a encoding='x'/>";
        let told = declare_utf8(text);
        assert_eq!(told, text.replace("latin1", "UTF-8"));
        for same in ["<a encoding='x'/>", "<?xml version='1.0'?><a/>", &told] {
            assert_eq!(declare_utf8(same), same);
        }
    }
}
