//! Reads the units of coordinates from well-known text (WKT 1, WKT 2, and ESRI's dialect).

use super::declared::{Declaration, StatedUnit, System};
use super::known;

/// Longest text that is read, bytes; real ones have a few thousand.
const MAX_BYTES: usize = 1 << 20;
/// Deepest nesting that is read; real texts have about ten levels.
const MAX_DEPTH: usize = 40;

/// Keywords of horizontal systems whose coordinates are lengths.
const PROJECTED: [&str; 9] = [
    "PROJCS",
    "PROJCRS",
    "PROJECTEDCRS",
    "DERIVEDPROJCRS",
    "LOCAL_CS",
    "ENGCRS",
    "ENGINEERINGCRS",
    "BASEENGCRS",
    "BASEPROJCRS",
];
/// Keywords of systems in degrees, unless these say that they are Cartesian.
const GEODETIC: [&str; 6] =
    ["GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS", "GEOCCS"];
const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];

/// A keyword with the content of its brackets.
#[derive(Debug, Default)]
struct WktNode {
    keyword: String,
    /// Words and numbers in the brackets, as text.
    values: Vec<String>,
    children: Vec<WktNode>,
}

/// The declaration of a text; `None` where it is no WKT.
pub(crate) fn read(bytes: &[u8]) -> Option<Declaration> {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    let text = String::from_utf8_lossy(&bytes[..end.min(MAX_BYTES)]);
    let mut reader = WktReader { rest: text.trim() };
    let mut top = WktNode::default();
    // ESRI writes the vertical system after the horizontal one.
    while let Some(node) = reader.node(0) {
        top.children.push(node);
        reader.skip(',');
    }
    let mut found = Declaration::new("WKT");
    look(&top, &mut found);
    (found.system != System::Unknown || found.vertical.is_some()).then_some(found)
}

/// Reads the first horizontal and the first vertical system of a tree.
fn look(node: &WktNode, found: &mut Declaration) {
    for child in &node.children {
        let word = child.keyword.as_str();
        if PROJECTED.contains(&word) {
            horizontal(child, found);
            // Some writers nest the vertical system in the projected one.
            child.children.iter().for_each(|inner| vertical(inner, found));
        } else if GEODETIC.contains(&word) {
            geodetic(child, found);
        } else if VERTICAL.contains(&word) {
            vertical(child, found);
        } else if word != "TARGETCRS" && word != "ABRIDGEDTRANSFORMATION" {
            // A compound or bound system, or anything else that contains them.
            look(child, found);
        }
    }
}

fn horizontal(node: &WktNode, found: &mut Declaration) {
    if found.system != System::Unknown {
        return;
    }
    found.system = System::Lengths;
    let of_registry = || node.code().and_then(|code| known::of_system("projected", code));
    found.horizontal = node.unit(0).or_else(|| of_registry().map(StatedUnit::from));
    // A projected system with three axes includes the heights.
    if node.axes().count() > 2 {
        found.vertical = node.unit(2);
    }
}

fn geodetic(node: &WktNode, found: &mut Declaration) {
    if found.system != System::Unknown {
        return;
    }
    let cartesian = |child: &WktNode| {
        child.keyword == "CS" && child.values.iter().any(|v| v.eq_ignore_ascii_case("cartesian"))
    };
    let is_cartesian = node.keyword == "GEOCCS" || node.children.iter().any(cartesian);
    found.system = if is_cartesian { System::EarthCentred } else { System::Degrees };
}

fn vertical(node: &WktNode, found: &mut Declaration) {
    if !VERTICAL.contains(&node.keyword.as_str()) || found.vertical.is_some() {
        return;
    }
    let of_registry = || node.code().and_then(|code| known::of_system("vertical", code));
    found.vertical = node.unit(0).or_else(|| of_registry().map(StatedUnit::from));
}

impl WktNode {
    fn axes(&self) -> impl Iterator<Item = &WktNode> {
        self.children.iter().filter(|child| child.keyword == "AXIS")
    }

    /// The unit of axis number `axis`, else the unit of the whole system.
    fn unit(&self, axis: usize) -> Option<StatedUnit> {
        let is_unit = |child: &&WktNode| ["UNIT", "LENGTHUNIT"].contains(&child.keyword.as_str());
        let own = |node: &WktNode| node.children.iter().find(is_unit).map(WktNode::stated);
        self.axes().nth(axis).and_then(own).or_else(|| own(self))
    }

    fn stated(&self) -> StatedUnit {
        let metres = self.values.get(1).and_then(|text| text.parse().ok());
        StatedUnit { name: self.values.first().cloned(), metres }
    }

    /// The code in the EPSG registry.
    fn code(&self) -> Option<u32> {
        let is_id = |child: &&WktNode| ["ID", "AUTHORITY"].contains(&child.keyword.as_str());
        let id = self.children.iter().find(is_id)?;
        let is_epsg = id.values.first()?.eq_ignore_ascii_case("EPSG");
        is_epsg.then(|| id.values.get(1)?.parse().ok())?
    }
}

/// Parser of a text.
struct WktReader<'a> {
    rest: &'a str,
}

impl<'a> WktReader<'a> {
    /// The keyword and brackets at the beginning of the text; a truncated text gives what it holds.
    fn node(&mut self, depth: usize) -> Option<WktNode> {
        let keyword = self.word();
        if keyword.is_empty() || !(self.skip('[') || self.skip('(')) || depth > MAX_DEPTH {
            return None;
        }
        let mut node = WktNode { keyword: keyword.to_ascii_uppercase(), ..WktNode::default() };
        loop {
            self.rest = self.rest.trim_start();
            if self.skip(']') || self.skip(')') || self.rest.is_empty() {
                return Some(node);
            }
            if self.skip(',') {
                continue;
            }
            if self.rest.starts_with('"') {
                node.values.push(self.quoted());
                continue;
            }
            let before = self.rest;
            match self.node(depth + 1) {
                Some(child) => node.children.push(child),
                None => {
                    self.rest = before;
                    let word = self.word();
                    if word.is_empty() {
                        return Some(node);
                    }
                    node.values.push(word.to_owned());
                }
            }
        }
    }

    /// A quoted text; quotes in it are doubled.
    fn quoted(&mut self) -> String {
        let mut out = String::new();
        self.rest = &self.rest[1..];
        loop {
            let Some(end) = self.rest.find('"') else {
                out.push_str(self.rest);
                self.rest = "";
                return out;
            };
            out.push_str(&self.rest[..end]);
            self.rest = &self.rest[end + 1..];
            if !self.rest.starts_with('"') {
                return out;
            }
            out.push('"');
            self.rest = &self.rest[1..];
        }
    }

    /// The text up to the next bracket, comma or white space.
    fn word(&mut self) -> &'a str {
        self.rest = self.rest.trim_start();
        let ends = |c: char| "[](),\"".contains(c) || c.is_whitespace();
        let (word, rest) = self.rest.split_at(self.rest.find(ends).unwrap_or(self.rest.len()));
        self.rest = rest;
        word
    }

    fn skip(&mut self, wanted: char) -> bool {
        let rest = self.rest.trim_start().strip_prefix(wanted);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The name of a unit and its length, metres.
    type Named = (String, f64);

    /// System, horizontal and vertical unit as stated.
    fn read_text(text: &str) -> (System, Option<Named>, Option<Named>) {
        let found = super::read(text.as_bytes()).expect("WKT");
        let pair =
            |s: StatedUnit| (s.name.unwrap_or_default(), s.metres.expect("a number of metres"));
        (found.system, found.horizontal.map(pair), found.vertical.map(pair))
    }

    #[test]
    fn the_unit_is_that_of_the_map_and_not_of_its_degrees() {
        let (system, horizontal, vertical) = read_text(
            r#"PROJCS["a ""quoted"" name",GEOGCS["NAD83",DATUM["D",SPHEROID["GRS 1980",6378137,298.2]],
               PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["LCC"],
               UNIT["US survey foot",0.3048006096012192],AXIS["X",EAST],AXIS["Y",NORTH]]"#,
        );
        assert_eq!(system, System::Lengths);
        assert_eq!(horizontal, Some(("US survey foot".into(), 0.304_800_609_601_219_2)));
        assert_eq!(vertical, None);
    }

    #[test]
    fn heights_may_have_their_own_unit() {
        for text in [
            r#"COMPD_CS["m + ft",PROJCS["m",GEOGCS["G",UNIT["degree",0.01745]],UNIT["metre",1]],
               VERT_CS["ft",VERT_DATUM["N",2005],UNIT["foot",0.3048],AXIS["up",UP]]]"#,
            r#"PROJCS["m",GEOGCS["G",UNIT["Degree",0.01745]],UNIT["Meter",1.0]],
               VERTCS["ft",VDATUM["N"],PARAMETER["Vertical_Shift",0.0],UNIT["Foot",0.3048]]"#,
            r#"PROJCS["m",UNIT["metre",1],VERTCS["in it",UNIT["foot",0.3048]]]"#,
            r#"COMPOUNDCRS["m + ft",PROJCRS["m",BASEGEOGCRS["G",DATUM["D",ELLIPSOID["E",1,2,
               LENGTHUNIT["foot",0.3048]]]],CS[Cartesian,2],AXIS["(E)",east,ORDER[1]],
               AXIS["(N)",north,ORDER[2]],LENGTHUNIT["metre",1]],
               VERTCRS["h",VDATUM["N"],CS[vertical,1],AXIS["H",up,LENGTHUNIT["foot",0.3048]]]]"#,
            r#"PROJCRS["three axes",CS[Cartesian,3],AXIS["E",east,LENGTHUNIT["metre",1]],
               AXIS["N",north,LENGTHUNIT["metre",1]],AXIS["h",up,LENGTHUNIT["foot",0.3048]]]"#,
        ] {
            let (system, horizontal, vertical) = read_text(text);
            assert_eq!(system, System::Lengths, "{text}");
            assert_eq!(horizontal.map(|u| u.1), Some(1.0), "{text}");
            assert_eq!(vertical.map(|u| u.1), Some(0.3048), "{text}");
        }
    }

    #[test]
    fn a_system_without_a_unit_has_that_of_the_registry() {
        let (_, horizontal, _) =
            read_text(r#"PROJCS["California zone 5",AUTHORITY["EPSG","2229"]]"#);
        assert_eq!(horizontal.map(|u| u.0), Some("US survey foot".into()));
        let (_, horizontal, _) =
            read_text(r#"LOCAL_CS["cell",LOCAL_DATUM["D",0],UNIT["mm",1e-3]]"#);
        assert_eq!(horizontal, Some(("mm".into(), 0.001)));
    }

    #[test]
    fn degrees_and_geocentric_coordinates_are_recognised() {
        for (text, system) in [
            (r#"GEOGCS["WGS 84",UNIT["degree",0.01745]]"#, System::Degrees),
            (r#"GEOGCRS["WGS 84",CS[ellipsoidal,2],ANGLEUNIT["degree",0.01745]]"#, System::Degrees),
            (r#"COMPD_CS["c",GEOGCS["G"],VERT_CS["h",UNIT["metre",1]]]"#, System::Degrees),
            (r#"GEOCCS["WGS 84",UNIT["metre",1]]"#, System::EarthCentred),
            (r#"GEODCRS["WGS 84",CS[Cartesian,3],LENGTHUNIT["metre",1]]"#, System::EarthCentred),
            (
                r#"BOUNDCRS[SOURCECRS[PROJCRS["m",LENGTHUNIT["metre",1]]],TARGETCRS[GEOGCRS["G"]]]"#,
                System::Lengths,
            ),
        ] {
            assert_eq!(super::read(text.as_bytes()).expect("WKT").system, system, "{text}");
        }
    }

    #[test]
    fn what_is_no_text_declares_nothing() {
        let deep = "A[".repeat(100_000);
        for text in ["", "\0", "EPSG:2229", "[", "\"", "PROJ", &deep, "A(\u{fffd}", "UNIT[\"m\",1]"]
        {
            assert!(super::read(text.as_bytes()).is_none(), "{}", &text[..text.len().min(20)]);
        }
        // A truncated text gives what it holds.
        let cut = super::read(br#"PROJCS["a",UNIT["foot",0.3048"#).expect("WKT");
        assert_eq!(cut.horizontal.and_then(|u| u.metres), Some(0.3048));
    }
}
