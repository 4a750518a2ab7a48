//! Quotes text that people or files chose (names of scans, models, links and joints; paths) for
//! the medium that it is written to.
//!
//! Such text may hold anything: an escape sequence that clears a terminal, a character that
//! reverses the writing direction, a line break, a zero. Inside the program it stays unchanged,
//! since it identifies something. Where it leaves the program it is quoted by one of these
//! functions and by no other means.
//!
//! | medium | function | what it does |
//! | --- | --- | --- |
//! | a name within a line for people | [`shown`] | odd characters and line breaks become `\u{…}` |
//! | text on a terminal | [`printed`] | odd characters become `\u{…}`; line breaks and tabs stay |
//! | JSON text | [`json`] | odd characters within its strings become `\u…`; the value is the same |
//! | a string of YAML | [`yaml`] | in double quotes, odd characters become `\u…` or `\U…` |
//! | text and attributes of XML | [`xml`] | references; what XML cannot hold becomes `\u{…}` |
//! | a cell of CSV | [`csv`] | in double quotes; no spreadsheet takes it for a formula |
//! | a part of a file's name | [`file_name`] | letters and digits of ASCII; all else becomes `_` |

use std::borrow::Cow;
use std::fmt::Write as _;

/// Whether a character is invisible or changes how others are shown: control characters, marks of
/// writing direction, line separators, spaces without width, tags, and Unicode non-characters.
#[must_use]
pub fn is_odd(c: char) -> bool {
    c.is_control()
        || matches!(u32::from(c),
            0xad | 0x61c | 0x180e | 0x200b..=0x200f | 0x2028..=0x202e | 0x2060..=0x206f
            | 0xfeff | 0xfff9..=0xfffb | 0x1_3430..=0x1_343f | 0x1_bca0..=0x1_bca3
            | 0x1_d173..=0x1_d17a | 0xe_0000..=0xe_0fff)
        || u32::from(c) & 0xfffe == 0xfffe
}

/// The text with each character for which `is_meant` holds replaced by what `write` appends.
fn replaced(
    text: &str,
    is_meant: impl Fn(char) -> bool,
    write: impl Fn(&mut String, char),
) -> Cow<'_, str> {
    if !text.contains(&is_meant) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_meant(c) { write(&mut out, c) } else { out.push(c) }
    }
    Cow::Owned(out)
}

fn escape(out: &mut String, c: char) {
    out.extend(c.escape_unicode());
}

/// Quotes a name that stands within a line for people.
#[must_use]
pub fn shown(text: &str) -> Cow<'_, str> {
    replaced(text, is_odd, escape)
}

/// Quotes text for a terminal or a log; its line breaks and tabs stay.
#[must_use]
pub fn printed(text: &str) -> Cow<'_, str> {
    replaced(text, |c| is_odd(c) && !matches!(c, '\n' | '\t'), escape)
}

/// Escapes odd characters in JSON text, which keeps its value. Outside of strings JSON holds no odd
/// characters but line breaks and tabs, which stay.
#[must_use]
pub fn json(text: &str) -> Cow<'_, str> {
    replaced(
        text,
        |c| is_odd(c) && !matches!(c, '\n' | '\t' | '\r'),
        |out, c| {
            for unit in c.encode_utf16(&mut [0; 2]) {
                let _ = write!(out, "\\u{unit:04x}");
            }
        },
    )
}

/// Writes a string of YAML, in double quotes.
#[must_use]
pub fn yaml(text: &str) -> String {
    let is_meant = |c: char| is_odd(c) || matches!(c, '"' | '\\');
    let inner = replaced(text, is_meant, |out, c| {
        let _ = match c {
            '"' | '\\' => write!(out, "\\{c}"),
            _ if u32::from(c) <= 0xffff => write!(out, "\\u{:04x}", u32::from(c)),
            _ => write!(out, "\\U{:08x}", u32::from(c)),
        };
    });
    format!("\"{inner}\"")
}

/// Quotes text of XML or the value of an attribute. A reader gets back the same text, except for
/// characters that no XML 1.0 document may hold, not even by reference: these become `\u{…}`. Where
/// people read the value, quote the text with [`shown`] first.
#[must_use]
pub fn xml(text: &str) -> Cow<'_, str> {
    let is_meant = |c: char| is_odd(c) || matches!(c, '&' | '<' | '>' | '"' | '\'');
    replaced(text, is_meant, |out, c| {
        let is_in_xml = !c.is_control() || matches!(u32::from(c), 0x9 | 0xa | 0xd | 0x7f..=0x9f);
        let is_in_xml = is_in_xml && !matches!(u32::from(c), 0xfffe | 0xffff);
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            _ if is_in_xml => drop(write!(out, "&#x{:x};", u32::from(c))),
            _ => escape(out, c),
        }
    })
}

/// Writes a cell of CSV, in double quotes. Text that a spreadsheet would evaluate as a formula gets
/// an apostrophe in front, which marks it as text; a number stays a number.
#[must_use]
pub fn cell(text: &str) -> String {
    let is_formula = text
        .starts_with(['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－', '＠'])
        && text.parse::<f64>().is_err();
    let mark = if is_formula { "'" } else { "" };
    format!("{mark}{}", shown(text))
}

/// A cell of CSV, in double quotes; see [`cell`].
#[must_use]
pub fn csv(text: &str) -> String {
    format!("\"{}\"", cell(text).replace('"', "\"\""))
}

/// Turns a name into a part of a file name that is valid on every file system.
#[must_use]
pub fn file_name(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Arbitrary text with many of the characters that are quoted.
    fn text() -> impl Strategy<Value = String> {
        let odd = "\u{1b}\u{0}\r\n\t\u{202e}\u{85}\u{e0041}\u{feff}\u{fffe}\"'<>&=@+-\\{}]".chars();
        let odd = prop::sample::select(odd.collect::<Vec<_>>());
        let c = prop_oneof![odd, any::<char>(), prop::char::range('a', 'z')];
        prop::collection::vec(c, 0..30).prop_map(|all| all.into_iter().collect())
    }

    proptest! {
        #[test]
        fn each_medium_reads_back_what_was_meant(text in text()) {
            prop_assert!(!shown(&text).contains(is_odd));
            prop_assert!(!printed(&text).contains(|c| is_odd(c) && c != '\n' && c != '\t'));
            // JSON: the value must stay the same.
            let json_text = serde_json::to_string(&text).expect("a string is JSON");
            let quoted = json(&json_text);
            prop_assert!(!quoted.contains(is_odd), "{}", quoted);
            prop_assert_eq!(&serde_json::from_str::<String>(&quoted).expect("JSON"), &text);
            // XML: the text must stay the same, except for characters that XML cannot hold.
            let file = format!("<a b=\"{0}\">{0}</a>", xml(&text));
            prop_assert!(!file.contains(is_odd), "{}", file);
            let document = roxmltree::Document::parse(&file).expect("well-formed XML");
            let is_in_xml = |c: char| {
                matches!(c, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..)
            };
            let expected: String = text
                .chars()
                .map(|c| if is_in_xml(c) { c.to_string() } else { c.escape_unicode().to_string() })
                .collect();
            prop_assert_eq!(document.root_element().attribute("b"), Some(&*expected));
            prop_assert_eq!(document.root_element().text().unwrap_or(""), &*expected);
            // CSV: the result must be one cell that is not a formula.
            let cell = csv(&text);
            let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"')).expect("in quotes");
            prop_assert!(!inner.replace("\"\"", "").contains('"') && !inner.contains(is_odd));
            prop_assert!(!inner.starts_with(['=', '+', '-', '@']) || inner.parse::<f64>().is_ok());
            // File name: only ASCII letters, digits and underscores may be left.
            prop_assert!(file_name(&text).bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_'));
        }
    }

    /// ESC with a sequence that clears the screen, CR, a direction mark, NEL, a tag, a line break.
    const ODD: &str = "a\u{1b}[2Jb\rc\u{202e}d\u{85}e\u{e0041}f\ng";

    #[test]
    fn what_is_shown_holds_no_odd_character() {
        assert_eq!(shown(ODD), "a\\u{1b}[2Jb\\u{d}c\\u{202e}d\\u{85}e\\u{e0041}f\\u{a}g");
        assert_eq!(printed("a\nb\tc\r"), "a\nb\tc\\u{d}");
        assert!(matches!(shown("Roboter 3 – Größe, 机器人"), Cow::Borrowed(_)));
        for c in (0..=u32::from(char::MAX)).filter_map(char::from_u32) {
            let text = shown(c.encode_utf8(&mut [0; 4])).into_owned();
            assert!(!text.chars().any(is_odd), "{c:?} is shown as {text:?}");
        }
    }

    #[test]
    fn csv_cells_are_text_or_numbers_and_no_formulas() {
        for (text, cell) in [
            ("joint_1", "\"joint_1\""),
            ("=1+1", "\"'=1+1\""),
            ("@SUM(A1)", "\"'@SUM(A1)\""),
            ("+cmd", "\"'+cmd\""),
            ("-x", "\"'-x\""),
            ("-1.5", "\"-1.5\""),
            ("\tx", "\"'\\u{9}x\""),
            ("a\"b", "\"a\"\"b\""),
            ("a\nb", "\"a\\u{a}b\""),
        ] {
            assert_eq!(csv(text), cell);
        }
    }

    #[test]
    fn yaml_and_file_names() {
        assert_eq!(yaml(ODD), "\"a\\u001b[2Jb\\u000dc\\u202ed\\u0085e\\U000e0041f\\u000ag\"");
        assert_eq!(yaml("a\"\\"), "\"a\\\"\\\\\"");
        assert_eq!(file_name("../a b\u{202e}"), "___a_b_");
        assert_eq!(
            json("{\"a\": \"\u{202e}\u{e0041}\"}\n"),
            "{\"a\": \"\\u202e\\udb40\\udc41\"}\n"
        );
    }
}
