//! Elements of a URDF beside links and joints, kept so that they can be written again with other
//! names of links and joints.

use contract::quote;
use roxmltree::Node;
use std::fmt::Write as _;

/// Elements that are kept.
const KEPT: [&str; 3] = ["transmission", "gazebo", "ros2_control"];

/// A node of a kept element.
#[derive(Debug, Clone, PartialEq)]
pub enum ExtraNode {
    /// Text between elements.
    Text(String),
    /// An element inside of it.
    Element(UrdfExtra),
}

/// An element of a URDF, such as `transmission` or `gazebo`.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfExtra {
    /// Name of the element, with its prefix.
    pub tag: String,
    /// Its attributes, and the address of its prefix.
    pub attributes: Vec<(String, String)>,
    /// What is in it, without comments and blanks between elements.
    pub children: Vec<ExtraNode>,
}

impl UrdfExtra {
    /// The value of an attribute.
    #[must_use]
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str())
    }

    /// The elements in it.
    pub fn elements(&self) -> impl Iterator<Item = &Self> {
        self.children.iter().filter_map(|child| match child {
            ExtraNode::Element(element) => Some(element),
            ExtraNode::Text(_) => None,
        })
    }

    /// The text of the element as XML. `renamed` gives the name under which a link (`false`) or a
    /// joint (`true`) is written.
    #[must_use]
    pub fn text(&self, renamed: &dyn Fn(bool, &str) -> String) -> String {
        let mut out = format!("<{}", self.tag);
        for (name, value) in &self.attributes {
            let value = match (self.tag.as_str(), name.as_str()) {
                ("joint", "name") => renamed(true, value),
                ("gazebo", "reference") => {
                    let link = renamed(false, value);
                    if link == *value { renamed(true, value) } else { link }
                }
                _ => value.clone(),
            };
            let _ = write!(out, " {name}=\"{}\"", quote::xml(&value));
        }
        if self.children.is_empty() {
            return out + "/>";
        }
        out.push('>');
        for child in &self.children {
            match child {
                ExtraNode::Text(text) => out.push_str(&quote::xml(text)),
                ExtraNode::Element(element) => out.push_str(&element.text(renamed)),
            }
        }
        let _ = write!(out, "</{}>", self.tag);
        out
    }
}

/// The kept elements of a URDF, in the order of the file.
pub(crate) fn of(root: Node) -> Vec<UrdfExtra> {
    let kept = |n: &Node<'_, '_>| n.is_element() && KEPT.contains(&n.tag_name().name());
    root.children().filter(kept).map(element).collect()
}

/// One element; how deep elements may be nested was checked before.
fn element(node: Node) -> UrdfExtra {
    let tag = node.tag_name();
    let mut attributes: Vec<(String, String)> =
        node.attributes().map(|a| (a.name().to_owned(), a.value().to_owned())).collect();
    let mut name = tag.name().to_owned();
    if let Some(address) = tag.namespace() {
        let prefix = node.lookup_prefix(address).filter(|prefix| !prefix.is_empty());
        let key = prefix.map_or_else(|| "xmlns".to_owned(), |prefix| format!("xmlns:{prefix}"));
        name = prefix.map_or(name.clone(), |prefix| format!("{prefix}:{name}"));
        attributes.push((key, address.to_owned()));
    }
    let children = node.children().filter_map(|child| {
        if child.is_element() {
            return Some(ExtraNode::Element(element(child)));
        }
        let text = child.text().filter(|text| child.is_text() && !text.trim().is_empty())?;
        Some(ExtraNode::Text(text.trim().to_owned()))
    });
    UrdfExtra { tag: name, attributes, children: children.collect() }
}
