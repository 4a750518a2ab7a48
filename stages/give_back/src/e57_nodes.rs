//! Elements of the description of an E57 file: children, numbers in attributes, and places in the
//! text.

use crate::legend::NAMESPACE;
use contract::{Error, Result};
use roxmltree::Node;
use std::ops::Range;

/// The child element of this name among those of the standard.
pub(crate) fn standard_child<'a, 'i>(node: &Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    let home = node.document().root_element().tag_name().namespace();
    node.children().find(|n| n.tag_name().name() == name && n.tag_name().namespace() == home)
}

/// The number in an attribute.
pub(crate) fn count(node: &Node, name: &str) -> Result<u64> {
    let text = node.attribute(name).unwrap_or_default();
    text.trim().parse().map_err(|e: std::num::ParseIntError| {
        let what = format!("element '{}' has no {name}, \"{text}\"", node.tag_name().name());
        Error::bad_input(what).because(e)
    })
}

/// Place of the value of an attribute in the text.
pub(crate) fn value_at(node: &Node, name: &str) -> Result<Range<usize>> {
    let attribute = node.attribute_node(name);
    attribute.map(|a| a.range_value()).ok_or_else(|| {
        Error::bad_input(format!("element '{}' has no {name}", node.tag_name().name()))
    })
}

/// Place of the end tag of an element; `None` where it has none.
pub(crate) fn end_tag(text: &str, node: &Node) -> Option<usize> {
    let range = node.range();
    let own = &text[range.clone()];
    if own.ends_with("/>") {
        return None;
    }
    own.rfind("</").map(|at| range.start + at)
}

/// Place of what stands between the tags of an element without child elements.
pub(crate) fn inside(text: &str, node: &Node) -> Option<Range<usize>> {
    let end = end_tag(text, node)?;
    let start = node.first_child()?.range().start;
    Some(start..end)
}

/// Whether an element belongs to our extension.
pub(crate) fn is_ours(node: &Node) -> bool {
    node.tag_name().namespace() == Some(NAMESPACE)
}
