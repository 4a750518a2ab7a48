//! Elements of a URDF beside links and joints, kept so that they can be written again with other
//! names of links and joints.

use crate::model::Model;
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

/// The value of an attribute of a kept element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ExtraValue {
    /// Any text.
    Text(String),
    /// The name of a link of the model, by its index.
    Link(usize),
    /// The name of a joint of the model, by its index.
    Joint(usize),
}

/// An element of a URDF, such as `transmission` or `gazebo`.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfExtra {
    /// Name of the element, with its prefix.
    pub tag: String,
    /// Its attributes, and the address of its prefix.
    pub attributes: Vec<(String, ExtraValue)>,
    /// What is in it, without comments and blanks between elements.
    pub children: Vec<ExtraNode>,
}

impl UrdfExtra {
    /// Whether it has an attribute of this name.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.attributes.iter().any(|(own, _)| own == name)
    }

    /// The text of the element as XML, with the names under which links and joints are written.
    #[must_use]
    pub fn text<'a>(
        &'a self,
        link: &dyn Fn(usize) -> &'a str,
        joint: &dyn Fn(usize) -> &'a str,
    ) -> String {
        let mut out = format!("<{}", self.tag);
        for (name, value) in &self.attributes {
            let value = match value {
                ExtraValue::Text(text) => text,
                ExtraValue::Link(at) => link(*at),
                ExtraValue::Joint(at) => joint(*at),
            };
            let _ = write!(out, " {name}=\"{}\"", quote::xml(value));
        }
        if self.children.is_empty() {
            return out + "/>";
        }
        out.push('>');
        for child in &self.children {
            match child {
                ExtraNode::Text(text) => out.push_str(&quote::xml(text)),
                ExtraNode::Element(element) => out.push_str(&element.text(link, joint)),
            }
        }
        let _ = write!(out, "</{}>", self.tag);
        out
    }

    /// The element where its links and joints stand behind others.
    pub(crate) fn behind(&self, links: usize, joints: usize) -> Self {
        let value = |value: &ExtraValue| match value {
            ExtraValue::Text(text) => ExtraValue::Text(text.clone()),
            ExtraValue::Link(at) => ExtraValue::Link(at + links),
            ExtraValue::Joint(at) => ExtraValue::Joint(at + joints),
        };
        let child = |child: &ExtraNode| match child {
            ExtraNode::Text(text) => ExtraNode::Text(text.clone()),
            ExtraNode::Element(element) => ExtraNode::Element(element.behind(links, joints)),
        };
        Self {
            tag: self.tag.clone(),
            attributes: self.attributes.iter().map(|(n, v)| (n.clone(), value(v))).collect(),
            children: self.children.iter().map(child).collect(),
        }
    }
}

/// The kept elements of a URDF of the model, in the order of the file.
pub(crate) fn of(root: Node, model: &Model) -> Vec<UrdfExtra> {
    let kept = |n: &Node<'_, '_>| n.is_element() && KEPT.contains(&n.tag_name().name());
    root.children().filter(kept).map(|node| element(node, model)).collect()
}

/// One element; how deep elements may be nested was checked before.
fn element(node: Node, model: &Model) -> UrdfExtra {
    let tag = node.tag_name();
    let mut attributes: Vec<(String, ExtraValue)> = (node.attributes())
        .map(|a| (a.name().to_owned(), value(tag.name(), a.name(), a.value(), model)))
        .collect();
    let mut name = tag.name().to_owned();
    if let Some(address) = tag.namespace() {
        let prefix = node.lookup_prefix(address).filter(|prefix| !prefix.is_empty());
        let key = prefix.map_or_else(|| "xmlns".to_owned(), |prefix| format!("xmlns:{prefix}"));
        name = prefix.map_or(name.clone(), |prefix| format!("{prefix}:{name}"));
        attributes.push((key, ExtraValue::Text(address.to_owned())));
    }
    let children = node.children().filter_map(|child| {
        if child.is_element() {
            return Some(ExtraNode::Element(element(child, model)));
        }
        let text = child.text().filter(|text| child.is_text() && !text.trim().is_empty())?;
        Some(ExtraNode::Text(text.trim().to_owned()))
    });
    UrdfExtra { tag: name, attributes, children: children.collect() }
}

/// What an attribute says: of some it is the name of a link or joint.
fn value(tag: &str, name: &str, text: &str, model: &Model) -> ExtraValue {
    let joint = || model.joints.iter().position(|joint| joint.name == text.trim());
    let link = || model.link(text.trim());
    let found = match (tag, name) {
        ("joint", "name") => joint().map(ExtraValue::Joint),
        ("gazebo", "reference") => {
            link().map(ExtraValue::Link).or_else(|| joint().map(ExtraValue::Joint))
        }
        _ => None,
    };
    found.unwrap_or_else(|| ExtraValue::Text(text.to_owned()))
}
