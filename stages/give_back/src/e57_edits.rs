//! Edits of the description of an E57 file: texts that replace others, everything else byte for
//! byte.

use crate::e57_layout::E57Layout;
use crate::e57_marking::{ScanPlan, WrittenField};
use crate::e57_scan::{CoordinateKind, FieldRole, ScanNode};
use crate::fate::{GiveBack, RobotNames};
use crate::legend::{NAMESPACE, field_elements, legend};
use std::ops::Range;

/// Texts that replace ranges of a text.
#[derive(Debug, Default)]
pub(crate) struct Edits {
    edits: Vec<(Range<usize>, String)>,
    /// Ranges that go with all that is in them.
    removed: Vec<Range<usize>>,
}

impl Edits {
    /// Removes what would be wrong in the file that is given back: our elements of an earlier
    /// export, and lists that name records by their numbers where some are left out.
    pub(crate) fn new(layout: &E57Layout, how: GiveBack) -> Self {
        let mut removed = layout.earlier.clone();
        if how.drops {
            removed.extend(layout.scans.iter().flat_map(|scan| scan.groupings.iter().cloned()));
        }
        Self { edits: Vec::new(), removed }
    }

    /// Whether a place of the text goes. What is put in at the edge of a removed range stays.
    pub(crate) fn removes(&self, at: &Range<usize>) -> bool {
        let within = |gone: &&Range<usize>| gone.start <= at.start && at.end <= gone.end;
        let is_edge =
            |gone: &Range<usize>| at.is_empty() && [gone.start, gone.end].contains(&at.start);
        self.removed.iter().filter(within).any(|gone| !is_edge(gone))
    }

    /// Replaces a range, which may be empty.
    pub(crate) fn replace(&mut self, at: Range<usize>, text: String) {
        self.edits.push((at, text));
    }

    /// Adds and changes the fields of a scan.
    pub(crate) fn fields(
        &mut self,
        scan: &ScanNode,
        plan: &ScanPlan,
        layout: &E57Layout,
        robots: &[RobotNames],
    ) {
        if scan.n_records == 0 {
            return;
        }
        let ours = scan.fields.iter().filter(|field| field.role == FieldRole::Ours);
        self.removed.extend(ours.map(|field| field.at.clone()));
        let mut added = String::new();
        for field in &plan.fields {
            let WrittenField::State { of, from, limits } = *field else { continue };
            let element = state_element(&layout.qualifier, of, limits);
            match from.map(|at| &scan.fields[at]) {
                None => added += &element,
                Some(old) if old.limits != Some(limits) => self.replace(old.at.clone(), element),
                Some(_) => {}
            }
        }
        if plan.how.says_labels {
            added += &field_elements(&layout.prefix, robots);
        }
        if let Some(end) = scan.prototype_end.filter(|_| !added.is_empty()) {
            self.replace(end..end, added);
        }
    }

    /// Adds the legend, and makes the file one with an identifier of its own.
    pub(crate) fn whole(&mut self, layout: &E57Layout, how: GiveBack, robots: &[RobotNames]) {
        let E57Layout { root_name_end, root_end, prefix, .. } = layout;
        if how.says_labels {
            if !layout.has_namespace {
                let text = format!(" xmlns:{prefix}=\"{NAMESPACE}\"");
                self.replace(*root_name_end..*root_name_end, text);
            }
            let text = legend(prefix, &layout.qualifier, robots, how.drops);
            self.replace(*root_end..*root_end, text);
        }
        if let Some((at, old)) = &layout.guid {
            self.replace(at.clone(), format!("<![CDATA[{}]]>", derived_guid(old, how)));
        }
    }

    /// The edited text.
    pub(crate) fn apply(&self, text: &str) -> String {
        let gone = self.removed.iter().map(|at| (at.clone(), ""));
        let kept = self.edits.iter().filter(|(at, _)| !self.removes(at));
        let mut all: Vec<_> = kept.map(|(at, new)| (at.clone(), &**new)).chain(gone).collect();
        all.sort_by_key(|(at, _)| (at.start, at.end));
        let (mut out, mut done) = (String::with_capacity(text.len() + 4096), 0);
        for (at, new) in all {
            // A range within one that goes needs no edit of its own.
            if at.start >= done {
                out += &text[done..at.start];
                out += new;
                done = at.end;
            }
        }
        out + &text[done..]
    }
}

fn state_element(qualifier: &str, of: CoordinateKind, [min, max]: [i64; 2]) -> String {
    let name = of.state();
    format!("<{qualifier}{name} type=\"Integer\" minimum=\"{min}\" maximum=\"{max}\"/>")
}

/// An identifier that follows from that of the original (128 bits of FNV-1a).
fn derived_guid(old: &str, how: GiveBack) -> String {
    let mut hash = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d_u128;
    let salt = [u8::from(how.drops), u8::from(how.says_labels)];
    for byte in old.bytes().chain(salt) {
        hash = (hash ^ u128::from(byte)).wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b);
    }
    let h = format!("{hash:032X}");
    format!("{{{}-{}-{}-{}-{}}}", &h[..8], &h[8..12], &h[12..16], &h[16..20], &h[20..])
}
