//! Numbers and XML as text.

use contract::quote;
use std::fmt::Write as _;

/// Magnitude below which a number is written as zero: rounding of metres and radians.
const ZERO: f64 = 1e-14;

/// A number in as many digits as give it back.
pub(crate) fn num(value: f64) -> String {
    if value.abs() < ZERO { "0".into() } else { format!("{value}") }
}

/// Numbers with a separator between them.
pub(crate) fn nums(values: &[f64], between: &str) -> String {
    values.iter().map(|v| num(*v)).collect::<Vec<_>>().join(between)
}

/// Writes XML with one element a line.
pub(crate) struct XmlText {
    text: String,
    open: Vec<&'static str>,
}

/// Attributes of an element: names and values.
pub(crate) type XmlAttributes<'a> = &'a [(&'a str, &'a str)];

impl XmlText {
    pub(crate) fn new() -> Self {
        Self { text: "<?xml version=\"1.0\"?>\n".into(), open: Vec::new() }
    }

    fn start(&mut self, tag: &str, attributes: XmlAttributes<'_>) {
        let _ = write!(self.text, "{:1$}<{tag}", "", 2 * self.open.len());
        for (name, value) in attributes {
            let _ = write!(self.text, " {name}=\"{}\"", quote::xml(value));
        }
    }

    /// Begins an element that holds others.
    pub(crate) fn open(&mut self, tag: &'static str, attributes: XmlAttributes<'_>) {
        self.start(tag, attributes);
        self.text.push_str(">\n");
        self.open.push(tag);
    }

    /// Ends the innermost element.
    pub(crate) fn close(&mut self) {
        if let Some(tag) = self.open.pop() {
            let _ = writeln!(self.text, "{:1$}</{tag}>", "", 2 * self.open.len());
        }
    }

    /// An element without content.
    pub(crate) fn empty(&mut self, tag: &str, attributes: XmlAttributes<'_>) {
        self.start(tag, attributes);
        self.text.push_str("/>\n");
    }

    /// An element that holds text.
    pub(crate) fn value(&mut self, tag: &str, attributes: XmlAttributes<'_>, value: &str) {
        self.start(tag, attributes);
        let _ = writeln!(self.text, ">{}</{tag}>", quote::xml(value));
    }

    /// A comment; what may not stand in one is replaced.
    pub(crate) fn comment(&mut self, words: &str) {
        let words = quote::shown(words).replace("--", "- -");
        let _ = writeln!(self.text, "{:1$}<!-- {words} -->", "", 2 * self.open.len());
    }

    /// A whole element as XML text.
    pub(crate) fn raw(&mut self, element: &str) {
        let _ = writeln!(self.text, "{:1$}{element}", "", 2 * self.open.len());
    }

    /// Ends what is open and returns the text.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        while !self.open.is_empty() {
            self.close();
        }
        self.text.into_bytes()
    }
}
