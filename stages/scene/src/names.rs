//! Names that a format accepts: each is mapped once, stays as it is where it can, and is unique.

use contract::quote;
use std::collections::{BTreeMap, BTreeSet};

/// Which names a format accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NameRule {
    /// URDF and SRDF: no blanks and no odd characters, since lists of names are split at blanks;
    /// `world` is ours.
    Urdf,
    /// MJCF: `world` is the format's.
    Mjcf,
    /// SDF: no `::`, not `world`, nothing between double underscores.
    Sdf,
    /// USD: letters, digits and underscores; no digit first.
    Usd,
    /// Any text.
    Free,
}

/// What is named: each kind has its own names, unless the format throws them together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Named {
    Robot,
    Link,
    Joint,
}

/// The names of a file.
#[derive(Debug, Clone)]
pub(crate) struct NameMap {
    rule: NameRule,
    taken: BTreeSet<(Named, String, String)>,
    /// What was written for the robot, kind and index.
    written: BTreeMap<(Named, usize, usize), String>,
}

impl NameMap {
    pub(crate) fn new(rule: NameRule) -> Self {
        Self { rule, taken: BTreeSet::new(), written: BTreeMap::new() }
    }

    /// Reserves a name within a robot, or in the whole file (`""`).
    pub(crate) fn reserve(&mut self, kind: Named, scope: &str, name: &str) {
        let kind = self.kind(kind);
        self.taken.insert((kind, scope.to_owned(), name.to_owned()));
    }

    /// Links and joints of SDF and USD are named in one space.
    fn kind(&self, kind: Named) -> Named {
        match (self.rule, kind) {
            (NameRule::Sdf | NameRule::Usd, Named::Joint) => Named::Link,
            _ => kind,
        }
    }

    /// The name of the thing of this kind with this number of a robot; `scope` tells within what it
    /// must be unique.
    pub(crate) fn add(
        &mut self,
        kind: Named,
        robot: usize,
        number: usize,
        scope: &str,
        name: &str,
    ) -> String {
        let valid = self.rule.valid(name);
        let space = self.kind(kind);
        let is_free = |n: &String| !self.taken.contains(&(space, scope.to_owned(), n.clone()));
        let more = (2..).map(|k| format!("{valid}_{k}"));
        let written = std::iter::once(valid.clone()).chain(more).find(is_free).unwrap_or(valid);
        self.taken.insert((space, scope.to_owned(), written.clone()));
        self.written.insert((kind, robot, number), written.clone());
        written
    }

    fn of(&self, kind: Named, robot: usize, number: usize) -> &str {
        self.written.get(&(kind, robot, number)).map_or("", String::as_str)
    }

    pub(crate) fn link(&self, robot: usize, link: usize) -> &str {
        self.of(Named::Link, robot, link)
    }

    pub(crate) fn joint(&self, robot: usize, joint: usize) -> &str {
        self.of(Named::Joint, robot, joint)
    }

    pub(crate) fn robot(&self, robot: usize) -> &str {
        self.of(Named::Robot, robot, 0)
    }
}

impl NameRule {
    /// The name as the format accepts it, which another name may become as well.
    fn valid(self, name: &str) -> String {
        let name = if name.is_empty() { "unnamed" } else { name };
        let shown = |c: char| if quote::is_odd(c) { '_' } else { c };
        match self {
            Self::Free => name.chars().map(shown).collect(),
            Self::Urdf => {
                name.chars().map(|c| if c.is_whitespace() { '_' } else { shown(c) }).collect()
            }
            Self::Mjcf => {
                let out: String = name.chars().map(shown).collect();
                if out == "world" { "world_".into() } else { out }
            }
            Self::Sdf => {
                let out: String = name.chars().map(shown).collect::<String>().replace("::", "__");
                let is_reserved = out.starts_with("__") && out.ends_with("__") || out == "world";
                if is_reserved { format!("n{out}") } else { out }
            }
            Self::Usd => {
                let out: String = name.chars().map(|c| if is_usd(c) { c } else { '_' }).collect();
                if out.starts_with(|c: char| c.is_ascii_digit()) { format!("_{out}") } else { out }
            }
        }
    }
}

/// Whether a USD name may hold a character: ASCII, and letters of the scripts that robots are named
/// in. Which others a reader accepts depends on the Unicode of its version.
fn is_usd(c: char) -> bool {
    match c {
        _ if c.is_ascii() => c.is_ascii_alphanumeric() || c == '_',
        '\u{c0}'..='\u{24f}' | '\u{388}'..='\u{481}' | '\u{48a}'..='\u{52f}' => c.is_alphabetic(),
        '\u{3041}'..='\u{3096}' | '\u{30a1}'..='\u{30fa}' => true,
        '\u{4e00}'..='\u{9fff}' | '\u{ac00}'..='\u{d7a3}' => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_where_they_can_and_never_meet() {
        let mut names = NameMap::new(NameRule::Usd);
        let mut add = |n, name: &str| names.add(Named::Link, 0, n, "R1", name);
        assert_eq!(add(0, "base_link"), "base_link");
        assert_eq!(add(1, "1a"), "_1a");
        assert_eq!(add(2, "2a"), "_2a", "digits are kept");
        assert_eq!(add(3, "Ünï-x"), "Ünï_x");
        assert_eq!(add(4, "Ünï.x"), "Ünï_x_2");
        assert_eq!(add(5, "手1"), "手1");
        assert_eq!(add(6, "ⓐb"), "_b", "letters in circles are none in USD");
        assert_eq!(names.add(Named::Joint, 0, 0, "R1", "base_link"), "base_link_2");
        assert_eq!(names.add(Named::Link, 1, 0, "R2", "base_link"), "base_link");
        let mut names = NameMap::new(NameRule::Sdf);
        assert_eq!(names.add(Named::Link, 0, 0, "R1", "a::b"), "a__b");
        assert_eq!(names.add(Named::Joint, 0, 0, "R1", "a__b"), "a__b_2");
        assert_eq!(names.add(Named::Link, 0, 1, "R1", "world"), "nworld");
        let mut names = NameMap::new(NameRule::Urdf);
        names.reserve(Named::Link, "R1", "world");
        assert_eq!(names.add(Named::Link, 0, 0, "R1", "world"), "world_2");
        assert_eq!(names.add(Named::Joint, 0, 0, "R1", "joint 1"), "joint_1");
        assert_eq!(names.add(Named::Joint, 0, 1, "R1", ""), "unnamed");
    }
}
