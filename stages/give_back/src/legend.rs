//! Our extension of E57: fields of classes, robots and links, and their legend.
//!
//! | field | value |
//! | --- | --- |
//! | `class` | 0 fixed, 1 robot link, 2 attachment, 3 floor, 254 superseded, 255 uncertain, or flagged as invalid by the original |
//! | `robot` | index into the robots of the legend; −1 for none |
//! | `link` | index into the links of that robot; −1 for none |

use crate::fate::{RobotNames, SUPERSEDED};
use contract::PointKind;
use std::fmt::Write as _;

/// Name of the extension. It is an identifier and no address.
pub(crate) const NAMESPACE: &str = "urn:x-stillpoint:e57:labels:1";

/// Names of the fields, in their order.
pub(crate) const FIELDS: [&str; 3] = ["class", "robot", "link"];

/// The words for classes.
const CLASSES: [(u8, &str); 6] = [
    (PointKind::Fixed as u8, "fixed"),
    (PointKind::Link as u8, "robot link"),
    (PointKind::Attachment as u8, "attachment"),
    (PointKind::Floor as u8, "floor"),
    (SUPERSEDED, "superseded"),
    (PointKind::Uncertain as u8, "uncertain"),
];

/// Least and largest value of each field.
pub(crate) fn field_limits(robots: &[RobotNames]) -> [[i64; 2]; 3] {
    let n_links = robots.iter().map(|robot| robot.links.len()).max().unwrap_or(0);
    // Some readers do not know fields that take no bits.
    let last = |n: usize| (n.min(i16::MAX as usize) as i64 - 1).max(0);
    [[0, 255], [-1, last(robots.len())], [-1, last(n_links)]]
}

/// The elements of the fields; `qualifier` stands before their names.
pub(crate) fn field_elements(prefix: &str, robots: &[RobotNames]) -> String {
    let mut text = String::new();
    for (name, [min, max]) in FIELDS.into_iter().zip(field_limits(robots)) {
        let _ =
            write!(text, "<{prefix}:{name} type=\"Integer\" minimum=\"{min}\" maximum=\"{max}\"/>");
    }
    text
}

/// The legend of all fields; `qualifier` stands before names of the standard.
pub(crate) fn legend(prefix: &str, qualifier: &str, robots: &[RobotNames], drops: bool) -> String {
    let string = |name: &str, value: &str| {
        format!("<{prefix}:{name} type=\"String\"><![CDATA[{}]]></{prefix}:{name}>", cdata(value))
    };
    let child = |content: String| {
        format!("<{qualifier}vectorChild type=\"Structure\">{content}</{qualifier}vectorChild>\n")
    };
    let list = |name: &str, content: String| {
        format!(
            "<{prefix}:{name} type=\"Vector\" allowHeterogeneousChildren=\"1\">\n\
             {content}</{prefix}:{name}>"
        )
    };
    let classes = CLASSES.map(|(value, name)| {
        let value = format!(
            "<{prefix}:value type=\"Integer\" minimum=\"0\" maximum=\"255\">{value}</{prefix}:value>"
        );
        child(value + &string("name", name))
    });
    let robots = robots.iter().map(|robot| {
        let links = robot.links.iter().map(|link| child(string("name", link))).collect();
        let names = string("id", &robot.id) + &string("model", &robot.model);
        child(names + &list("links", links))
    });
    let moving = if drops { "left out" } else { "flagged as invalid, state 2" };
    format!(
        "<{prefix}:labels type=\"Structure\">\n{}\n{}\n{}\n</{prefix}:labels>\n",
        string("moving", moving),
        list("classes", classes.concat()),
        list("robots", robots.collect())
    )
}

/// Text for a CDATA section: without its end, and without characters that XML cannot hold.
fn cdata(text: &str) -> String {
    let is_held = |c: char| c >= ' ' && c != '\u{fffe}' && c != '\u{ffff}';
    let clean: String = text.chars().map(|c| if is_held(c) { c } else { ' ' }).collect();
    clean.replace("]]>", "]] >")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_stands_in_the_legend() {
        let odd = "a]]>b\u{1}<&\"ü".to_owned();
        let robots = [RobotNames { id: "R1".into(), model: odd.clone(), links: vec![odd] }];
        let text = legend("sp", "", &robots, false);
        let text = format!("<root xmlns:sp=\"{NAMESPACE}\">{text}</root>");
        let document = roxmltree::Document::parse(&text).expect("well-formed");
        let texts: Vec<&str> = document.descendants().filter_map(|n| n.text()).collect();
        assert!(texts.contains(&"a]] >b <&\"ü"), "{texts:?}");
        assert_eq!(field_limits(&robots), [[0, 255], [-1, 0], [-1, 0]]);
        assert_eq!(field_limits(&[]), [[0, 255], [-1, 0], [-1, 0]]);
    }
}
