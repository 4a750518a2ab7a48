//! Checks the bytes of an XML file before an XML reader may parse them. Readers keep each element
//! and attribute in memory, at many times its size in the file, and compare each attribute of an
//! element with all its others, so that a small file could exhaust memory or time.

/// Limits on the content of an XML file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct XmlLimits {
    /// Largest number of elements, attributes and texts together; a reader keeps about 80 bytes of
    /// each.
    pub max_nodes: u64,
    /// Largest number of attributes of one element.
    pub max_attributes: u64,
    /// Name of the group of settings that holds `max_xml_nodes` and `max_xml_attributes`, for
    /// messages.
    pub room: &'static str,
}

/// Largest depth of nested elements. The formats that are read have below 40, and readers may
/// recurse once for each.
const MAX_DEPTH: u64 = 256;
/// Largest number of namespace declarations in a file. Real files have below 20, and readers pass
/// each on to every nested element that declares one.
const MAX_NAMESPACES: u64 = 256;

/// Counts the nodes of an XML file without checking that it is well-formed, which is the reader's
/// task.
///
/// # Errors
/// The limit that is exceeded, in words, with the line and the setting that raises it.
pub fn check_xml(bytes: &[u8], limits: &XmlLimits) -> Result<(), String> {
    let mut count = XmlCount { bytes, limits, at: 0, n_nodes: 0, n_namespaces: 0, depth: 0 };
    while let Some(n) = bytes[count.at..].iter().position(|b| *b == b'<') {
        // The text before the tag counts as a node; white space is text, too.
        count.nodes(u64::from(n > 0))?;
        count.at += n + 1;
        let rest = &bytes[count.at..];
        if rest.starts_with(b"!--") {
            count.nodes(1)?;
            count.skip(3, b"-->");
        } else if rest.starts_with(b"![CDATA[") {
            count.nodes(1)?;
            count.skip(8, b"]]>");
        } else if rest.starts_with(b"?") {
            count.nodes(1)?;
            count.skip(1, b"?>");
        } else if rest.starts_with(b"/") {
            count.depth = count.depth.saturating_sub(1);
            count.skip(1, b">");
        } else if rest.starts_with(b"!") {
            count.skip(1, b">");
        } else {
            count.element()?;
        }
    }
    Ok(())
}

struct XmlCount<'a> {
    bytes: &'a [u8],
    limits: &'a XmlLimits,
    at: usize,
    n_nodes: u64,
    n_namespaces: u64,
    depth: u64,
}

impl XmlCount<'_> {
    /// Moves behind the next `end` that begins at least `from` bytes further on, or to the end of
    /// the file if there is none.
    fn skip(&mut self, from: usize, end: &[u8]) {
        let rest = self.bytes.get(self.at + from..).unwrap_or_default();
        let found = rest.windows(end.len()).position(|w| w == end);
        self.at = found.map_or(self.bytes.len(), |n| self.at + from + n + end.len());
    }

    /// Reads the start tag that begins here, behind its `<`.
    fn element(&mut self) -> Result<(), String> {
        let (mut quote, mut n_attributes, mut word) = (None, 0, self.at);
        let mut last = b' ';
        self.nodes(1)?;
        while let Some(byte) = self.bytes.get(self.at).copied() {
            self.at += 1;
            match (quote, byte) {
                (Some(open), _) => quote = Some(open).filter(|open| *open != byte),
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'=') => {
                    n_attributes += 1;
                    self.nodes(1)?;
                    self.attribute(n_attributes, word)?;
                }
                (None, b'>') => {
                    self.depth += u64::from(last != b'/');
                    if self.depth > MAX_DEPTH {
                        return Err(self.more(MAX_DEPTH, "elements in one another", None));
                    }
                    return Ok(());
                }
                (None, _) if last.is_ascii_whitespace() || matches!(last, b'"' | b'\'') => {
                    word = self.at - 1;
                }
                _ => {}
            }
            last = byte;
        }
        Ok(())
    }

    /// Checks the `n`-th attribute of an element, whose name begins at `word`.
    fn attribute(&mut self, n: u64, word: usize) -> Result<(), String> {
        if n > self.limits.max_attributes {
            let (what, most) = ("attributes of one element", self.limits.max_attributes);
            return Err(self.more(most, what, Some("max_xml_attributes")));
        }
        if self.bytes[word..].starts_with(b"xmlns") {
            self.n_namespaces += 1;
            if self.n_namespaces > MAX_NAMESPACES {
                return Err(self.more(MAX_NAMESPACES, "declared namespaces", None));
            }
        }
        Ok(())
    }

    fn nodes(&mut self, n: u64) -> Result<(), String> {
        self.n_nodes += n;
        if self.n_nodes <= self.limits.max_nodes {
            return Ok(());
        }
        let (what, most) = ("elements, attributes and texts", self.limits.max_nodes);
        Err(self.more(most, what, Some("max_xml_nodes")))
    }

    fn more(&self, most: u64, what: &str, setting: Option<&str>) -> String {
        let line = self.bytes[..self.at].iter().filter(|b| **b == b'\n').count() + 1;
        let way = setting.map_or(String::new(), |setting| {
            format!("; if the file is right, raise --set {}.{setting}", self.limits.room)
        });
        format!("its XML has more than {most} {what} by line {line}{way}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, max_nodes: u64, max_attributes: u64) -> Result<(), String> {
        let limits = XmlLimits { max_nodes, max_attributes, room: "robot" };
        check_xml(text.as_bytes(), &limits)
    }

    #[test]
    fn what_is_in_a_file_is_counted() {
        // Two elements, four attributes, a comment, character data, an instruction, and two texts
        // between them.
        let text = "<?xml version='1.0'?>\n<a x=\"1>=2\" y='=' >\n<!-- <b c='d'> --><b xmlns='u' z\n= '/'/>\
                    <![CDATA[ <c d='e'> ]]></a>";
        assert_eq!(check(text, 11, 2), Ok(()));
        let few = check(text, 10, 2).expect_err("more");
        assert!(few.contains("more than 10") && few.contains("robot.max_xml_nodes"), "{few}");
        let wide = check(text, 100, 1).expect_err("more");
        assert!(wide.contains("by line 2") && wide.contains("robot.max_xml_attributes"), "{wide}");
        // Files that are not well-formed pass; the reader refuses them.
        for torn in
            ["<", "<a", "<a b='", "<!--", "<![CDATA[", "<?", "</", "<!", "no tag", "<a b=>=>"]
        {
            assert_eq!(check(torn, 100, 100), Ok(()), "{torn}");
        }
    }

    #[test]
    fn what_lies_deep_or_declares_much_is_refused() {
        let deep = |n: usize| "<a>".repeat(n) + &"</a>".repeat(n);
        assert_eq!(check(&deep(256), 10_000, 10), Ok(()));
        assert!(check(&deep(257), 10_000, 10).expect_err("deep").contains("in one another"));
        // Elements that follow one another are not nested.
        assert_eq!(check(&"<a></a><b/>".repeat(1000), 10_000, 10), Ok(()));
        let names = |n: usize| (0..n).map(|i| format!("<a xmlns:n{i}='u'/>")).collect::<String>();
        assert_eq!(check(&names(256), 10_000, 10), Ok(()));
        assert!(check(&names(257), 10_000, 10).expect_err("many").contains("namespaces"));
    }
}
