//! Finds in the XML description of an E57 file where its binary sections lie, which fields its
//! scans have, and where the text is edited. Nothing else of the description is interpreted, so
//! that everything else stays as it is.

use crate::checked_pages::{CheckedPages, MOST, PAGE};
use crate::e57_nodes::{count, end_tag, inside, is_ours, standard_child, value_at};
use crate::e57_scan::ScanNode;
use crate::legend::NAMESPACE;
use contract::{Error, Kind, Result, XmlLimits, check_xml};
use roxmltree::{Document, Node};
use std::io::{Read, Seek};
use std::ops::Range;

/// Length of the file header, bytes.
pub(crate) const HEADER: usize = 48;

/// Limits on the description of a file.
#[derive(Debug, Clone, Copy)]
pub struct DescriptionLimits {
    /// Most bytes.
    pub max_bytes: u64,
    /// Most elements and attributes.
    pub xml: XmlLimits,
}

/// A binary section that the description refers to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct E57Section {
    /// Offset in the file.
    pub(crate) offset: u64,
    /// Place of the offset in the description.
    pub(crate) offset_at: Range<usize>,
    /// What it holds.
    pub body: SectionBody,
}

/// The content of a binary section.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SectionBody {
    /// Bytes of a picture or of an extension.
    Blob {
        /// Number of bytes.
        n_bytes: u64,
    },
    /// A table that is no scan.
    Table {
        /// Number of records.
        n_records: u64,
    },
    /// The points of the scan with this index.
    Points(usize),
}

/// The description of an E57 file.
#[derive(Debug)]
pub struct E57Layout {
    /// First bytes of the file: signature and version.
    pub(crate) signature: [u8; 16],
    pub(crate) text: String,
    /// Behind the name of the root element, where attributes can be added.
    pub(crate) root_name_end: usize,
    /// Before the end tag of the root element.
    pub(crate) root_end: usize,
    /// Place and value of the identifier of this version of the file.
    pub(crate) guid: Option<(Range<usize>, String)>,
    /// What stands before names of the standard's elements, such as `e57:`; usually nothing.
    pub(crate) qualifier: String,
    /// Prefix of our own elements, and whether the file declares it.
    pub(crate) prefix: String,
    pub(crate) has_namespace: bool,
    /// Our own elements of an earlier export, which are replaced.
    pub(crate) earlier: Vec<Range<usize>>,
    /// All sections in the order of the file.
    pub sections: Vec<E57Section>,
    /// All scans in the order of the description.
    pub scans: Vec<ScanNode>,
}

impl E57Layout {
    /// Reads header and description.
    ///
    /// # Errors
    /// If the file is no E57 file, is damaged, or exceeds a limit.
    pub fn open<R: Read + Seek>(
        from: R,
        limits: &DescriptionLimits,
    ) -> Result<(Self, CheckedPages<R>)> {
        let mut pages = CheckedPages::new(from)?;
        let header: [u8; HEADER] = pages.read(0, HEADER)?.try_into().expect("as long as asked");
        let number = |at: usize| u64::from_le_bytes(*header[at..].first_chunk().expect("within"));
        let is_known = header.starts_with(b"ASTM-E57") && header[8..12] == [1, 0, 0, 0];
        if !is_known || number(40) != PAGE {
            let what = "this is no E57 file of version 1 with pages of 1024 bytes";
            return Err(Error::new(Kind::Unsupported, what).at("page 0"));
        }
        let (start, len) = (pages.logical(number(24))?, number(32));
        let is_within = start.checked_add(len).is_some_and(|end| end <= pages.len());
        if len > limits.max_bytes || !is_within {
            let what = format!("description of the file is too long, bytes \"{len}\"");
            return Err(Error::bad_input(what).at("page 0"));
        }
        let mut bytes = Vec::new();
        while (bytes.len() as u64) < len {
            let n = (len as usize - bytes.len()).min(MOST);
            bytes.extend_from_slice(pages.read(start + bytes.len() as u64, n)?);
        }
        check_xml(&bytes, &limits.xml).map_err(|what| Error::bad_input(what).at(PLACE))?;
        let text = String::from_utf8(bytes)
            .map_err(|e| Error::bad_input("it is no UTF-8 text").because(e).at(PLACE))?;
        let signature = *header.first_chunk().expect("within the header");
        Self::parse(text, signature).map(|layout| (layout, pages)).map_err(|e| e.at(PLACE))
    }

    fn parse(text: String, signature: [u8; 16]) -> Result<Self> {
        let broken =
            |e: roxmltree::Error| Error::bad_input("it cannot be parsed").because(e.to_string());
        let document = Document::parse(&text).map_err(broken)?;
        let root = document.root_element();
        let tag = &text[root.range()];
        let name_end = tag.find(|c: char| c.is_whitespace() || ">/".contains(c)).unwrap_or(1);
        let qualifier = match tag[1..name_end].split_once(':') {
            Some((prefix, _)) => format!("{prefix}:"),
            None => String::new(),
        };
        let (prefix, has_namespace) = prefix_of(&root);
        let mut found = Found { root, scans: Vec::new(), sections: Vec::new() };
        found.look()?;
        let Found { scans, mut sections, .. } = found;
        sections.sort_by_key(|s| (s.offset, s.offset_at.start));
        let ours = document.descendants().filter(|n| {
            n.is_element()
                && is_ours(n)
                && n.parent().is_some_and(|p| !is_ours(&p) && p.tag_name().name() != "prototype")
        });
        let earlier = ours.map(|n| n.range()).collect();
        let end = end_tag(&text, &root);
        let guid = standard_child(&root, "guid");
        let guid = guid.and_then(|g| Some((inside(&text, &g)?, g.text().unwrap_or("").to_owned())));
        let (root_name_end, root_end) = (root.range().start + name_end, end.unwrap_or(text.len()));
        if end.is_none() && !sections.is_empty() {
            return Err(Error::new(Kind::Bug, "a root element without an end has sections"));
        }
        drop(document);
        Ok(Self {
            signature,
            root_name_end,
            root_end,
            guid,
            qualifier,
            prefix,
            has_namespace,
            earlier,
            sections,
            scans,
            text,
        })
    }
}

/// Place of errors in the description.
const PLACE: &str = "description";

/// The sections and scans that were found so far.
struct Found<'a, 'input> {
    root: Node<'a, 'input>,
    scans: Vec<ScanNode>,
    sections: Vec<E57Section>,
}

impl Found<'_, '_> {
    fn look(&mut self) -> Result<()> {
        let root = self.root;
        let list = standard_child(&root, "data3D");
        let scans = list.iter().flat_map(|list| list.children().filter(Node::is_element));
        let points: Vec<Node> = scans.filter_map(|scan| standard_child(&scan, "points")).collect();
        for node in root.descendants().filter(Node::is_element) {
            let body = match node.attribute("type") {
                Some("Blob") => SectionBody::Blob { n_bytes: count(&node, "length")? },
                Some("CompressedVector") if points.contains(&node) => {
                    let index = self.scans.len();
                    let place = format!("scan {}", index + 1);
                    self.scans.push(ScanNode::read(&node).map_err(|e| e.at(place))?);
                    SectionBody::Points(index)
                }
                Some("CompressedVector") => {
                    SectionBody::Table { n_records: count(&node, "recordCount")? }
                }
                _ => continue,
            };
            let (offset, offset_at) = (count(&node, "fileOffset")?, value_at(&node, "fileOffset")?);
            self.sections.push(E57Section { offset, offset_at, body });
        }
        Ok(())
    }
}

/// The prefix of our extension in a file, and whether the file declares it.
fn prefix_of(root: &Node) -> (String, bool) {
    let declared = root.namespaces().find(|n| n.uri() == NAMESPACE).and_then(|n| n.name());
    if let Some(prefix) = declared {
        return (prefix.to_owned(), true);
    }
    let is_free = |prefix: &String| root.lookup_namespace_uri(Some(prefix)).is_none();
    let more = (2..).map(|n| format!("sp{n}"));
    let prefix = std::iter::once("sp".to_owned()).chain(more).find(is_free);
    (prefix.expect("some of endless many is free"), false)
}
