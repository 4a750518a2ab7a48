//! Texts of a result as they stand in a page: JSON without line breaks that no parser of HTML takes
//! for markup, and a template with its places filled.

use contract::{Error, Result, quote};
use serde::de::IgnoredAny;

/// JSON on one line that may stand within an element of HTML; its value is the same.
///
/// # Errors
/// If the text is no JSON; `name` is that of its file.
pub(crate) fn embedded(text: &str, name: &str) -> Result<String> {
    serde_json::from_str::<IgnoredAny>(text)
        .map_err(|e| Error::bad_input("the file is no JSON").because(e).at(name))?;
    let mut out = String::with_capacity(text.len());
    let (mut is_quoted, mut is_escaped) = (false, false);
    for c in text.chars() {
        if is_quoted {
            is_quoted = is_escaped || c != '"';
            is_escaped = c == '\\' && !is_escaped;
        } else if c.is_ascii_whitespace() {
            continue;
        } else {
            is_quoted = c == '"';
        }
        // Only strings of JSON hold any of these.
        match c {
            '<' => out.push_str("\\u003c"),
            '>' => out.push_str("\\u003e"),
            '&' => out.push_str("\\u0026"),
            c => out.push(c),
        }
    }
    Ok(quote::json(&out).into_owned())
}

/// The template with each `{{name}}` replaced by the text of that name; what is filled in is not
/// looked at again.
pub(crate) fn filled(template: &str, texts: &[(&str, &str)]) -> String {
    let n: usize = texts.iter().map(|(_, text)| text.len()).sum();
    let mut out = String::with_capacity(template.len() + n);
    let mut rest = template;
    while let Some((before, behind)) = rest.split_once("{{") {
        out.push_str(before);
        let (name, after) = behind.split_once("}}").unwrap_or((behind, ""));
        let text = texts.iter().find(|(own, _)| *own == name);
        out.push_str(text.map_or("", |(_, text)| text));
        rest = after;
    }
    out.push_str(rest);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_stays_the_same_value_and_is_no_markup() {
        let text = "{\n  \"a b\": \"</script> \\\" \\\\\",\n  \"c\": [1, 2.50]\n}\n";
        let one = embedded(text, "result.json").expect("is JSON");
        assert!(!one.contains(['<', '>', '&', '\n']), "{one}");
        assert!(one.starts_with("{\"a b\":\"") && one.ends_with("\"c\":[1,2.50]}"), "{one}");
        let value = |text: &str| -> serde_json::Value { serde_json::from_str(text).expect("JSON") };
        assert_eq!(value(text), value(&one));
        assert!(embedded("{", "result.json").is_err());
    }

    #[test]
    fn what_is_filled_in_is_no_template() {
        let page = filled("a {{x}} b {{y}} {{none}}c", &[("x", "{{y}}"), ("y", "Y")]);
        assert_eq!(page, "a {{y}} b Y c");
    }
}
