//! Checks a value against a JSON schema, as far as our schemas go: types, enums, constants,
//! properties, items, limits and references. A word of a schema that is not known here fails.

use serde_json::{Map, Value};

/// Faults of a value. Fields that the schema does not name are faults, also where a schema leaves
/// its objects open for later versions: this version is to name all that it writes.
pub(crate) fn faults(schema: &Value, value: &Value) -> Vec<String> {
    let mut out = Vec::new();
    Check { root: schema, out: &mut out }.value(schema, value, "");
    out
}

struct Check<'a> {
    root: &'a Value,
    out: &'a mut Vec<String>,
}

impl Check<'_> {
    fn value(&mut self, schema: &Value, value: &Value, at: &str) {
        let Some(words) = schema.as_object() else {
            return self.out.push(format!("{at}: the schema is no object"));
        };
        let n_before = self.out.len();
        for (word, rule) in words {
            self.word(word, rule, value, at);
        }
        // Only of what is an object at all can fields be missing.
        if let (Value::Object(fields), true) = (value, self.out.len() == n_before) {
            self.fields(words, fields, at);
        }
    }

    fn word(&mut self, word: &str, rule: &Value, value: &Value, at: &str) {
        let is_right = match word {
            "$schema" | "$id" | "$defs" | "title" | "description" => true,
            // These are looked at together, in `fields`.
            "properties" | "required" | "additionalProperties" => true,
            "type" => match rule {
                Value::Array(kinds) => kinds.iter().any(|kind| is_kind(kind, value)),
                kind => is_kind(kind, value),
            },
            "const" => rule == value,
            "enum" => rule.as_array().is_some_and(|words| words.contains(value)),
            "minimum" => value.as_f64() >= rule.as_f64() || !value.is_number(),
            "maximum" => value.as_f64() <= rule.as_f64() || !value.is_number(),
            "minItems" => n_items(value) >= rule.as_u64() || !value.is_array(),
            "maxItems" => n_items(value) <= rule.as_u64() || !value.is_array(),
            "items" => {
                for (k, item) in value.as_array().into_iter().flatten().enumerate() {
                    self.value(rule, item, &format!("{at}/{k}"));
                }
                true
            }
            "$ref" => {
                let name = rule.as_str().and_then(|text| text.strip_prefix("#/$defs/"));
                match name.and_then(|name| self.root["$defs"].get(name)) {
                    Some(schema) => self.value(schema, value, at),
                    None => self.out.push(format!("{at}: there is no definition {rule}")),
                }
                true
            }
            "anyOf" | "oneOf" => {
                let root = self.root;
                let fits = |schema: &Value| {
                    let mut out = Vec::new();
                    Check { root, out: &mut out }.value(schema, value, at);
                    out.is_empty()
                };
                rule.as_array().is_some_and(|all| all.iter().any(fits))
            }
            _ => return self.out.push(format!("{at}: the checker does not know {word}")),
        };
        if !is_right {
            self.out.push(format!("{at}: {value} is against {word} {rule}"));
        }
    }

    fn fields(&mut self, words: &Map<String, Value>, fields: &Map<String, Value>, at: &str) {
        for name in words.get("required").and_then(Value::as_array).into_iter().flatten() {
            if name.as_str().is_none_or(|name| !fields.contains_key(name)) {
                self.out.push(format!("{at}: {name} is missing"));
            }
        }
        let open = words.get("additionalProperties");
        let named = words.get("properties").and_then(Value::as_object);
        if named.is_none() && !open.is_some_and(Value::is_object) {
            return;
        }
        for (name, value) in fields {
            let at = format!("{at}/{name}");
            match (named.and_then(|named| named.get(name)), open) {
                (Some(schema), _) => self.value(schema, value, &at),
                (None, Some(schema)) if schema.is_object() => self.value(schema, value, &at),
                (None, _) => self.out.push(format!("{at} is not in the schema")),
            }
        }
    }
}

fn n_items(value: &Value) -> Option<u64> {
    value.as_array().map(|items| items.len() as u64)
}

fn is_kind(kind: &Value, value: &Value) -> bool {
    match kind.as_str() {
        Some("object") => value.is_object(),
        Some("array") => value.is_array(),
        Some("string") => value.is_string(),
        Some("boolean") => value.is_boolean(),
        Some("null") => value.is_null(),
        Some("number") => value.is_number(),
        Some("integer") => value.is_i64() || value.is_u64(),
        _ => false,
    }
}

#[test]
fn what_is_wrong_is_named() {
    let schema: Value = serde_json::from_str(
        r##"{"type": "object", "required": ["a"], "properties": {
            "a": {"type": ["integer", "null"], "minimum": 0},
            "b": {"type": "array", "items": {"$ref": "#/$defs/b"}, "maxItems": 2}},
            "$defs": {"b": {"anyOf": [{"const": "x"}, {"type": "number"}]}}}"##,
    )
    .expect("JSON");
    let cases = [
        (r#"{"a": 1, "b": ["x", 2.5]}"#, ""),
        (r#"{"a": null}"#, ""),
        (r#"{"b": []}"#, "\"a\" is missing"),
        (r#"{"a": -1}"#, "minimum"),
        (r#"{"a": 1.5}"#, "type"),
        (r#"{"a": 1, "b": ["y"]}"#, "/b/0"),
        (r#"{"a": 1, "b": [1, 2, 3]}"#, "maxItems"),
        (r#"{"a": 1, "c": 1}"#, "/c is not in the schema"),
        ("[]", "type"),
    ];
    for (text, says) in cases {
        let found = faults(&schema, &serde_json::from_str(text).expect("JSON"));
        assert_eq!(found.is_empty(), says.is_empty(), "{text}: {found:?}");
        assert!(found.iter().all(|fault| fault.contains(says)), "{text}: {found:?}");
    }
}
