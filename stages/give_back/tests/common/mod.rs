//! Gives files in memory back, with labels by a rule, and reads them with the crate `e57`.

#![allow(dead_code, reason = "each test takes what it needs")]

use contract::{Label, Map, PointKind, Result, XmlLimits};
use e57::{E57Reader, RecordName, RecordValue};
use give_back::{
    DescriptionLimits, E57Copy, E57Layout, E57Records, GiveBack, GivenBack, LineMarker, PointFate,
    PtxPieces, RecordMarker, RobotNames, ScanFates, ScanPlan, SectionBody,
};
use std::io::Cursor;
use std::path::PathBuf;

/// Labels of all points by a rule of their place.
pub(crate) struct ByRule;

impl ByRule {
    /// Runs of moving points of all lengths, and a bit of everything else.
    pub(crate) fn fate(place: u64) -> PointFate {
        let label = |kind, robot, link| Label { kind, robot, link };
        let of = match place % 23 {
            0..=6 => Label::FIXED,
            7..=9 => label(PointKind::Link, (place % 2) as i16, (place % 3) as i16),
            10 => Label::FLOOR,
            11 => label(PointKind::Attachment, 1, -1),
            12..=20 if (place / 23).is_multiple_of(40) => label(PointKind::Link, 0, 2),
            21 => Label::UNCERTAIN,
            _ => Label::FIXED,
        };
        PointFate::of(of, place % 997 == 5)
    }
}

impl ScanFates for ByRule {
    fn range(&self, first: u64, n: usize) -> Result<Vec<PointFate>> {
        Ok((first..first + n as u64).map(Self::fate).collect())
    }
}

/// Two robots.
pub(crate) fn robots() -> Vec<RobotNames> {
    let links = ["base", "arm", "tool"].map(str::to_owned).to_vec();
    ["R1", "R2"]
        .map(|id| RobotNames { id: id.into(), model: "m".into(), links: links.clone() })
        .into()
}

pub(crate) const FLAGGED: GiveBack = GiveBack { drops: false, says_labels: true };
pub(crate) const PLAIN: GiveBack = GiveBack { drops: false, says_labels: false };
pub(crate) const DROPPED: GiveBack = GiveBack { drops: true, says_labels: true };

/// An E57 file given back.
pub(crate) fn give(bytes: &[u8], how: GiveBack) -> Result<(Vec<u8>, Vec<GivenBack>)> {
    let xml = XmlLimits { max_nodes: 1_000_000, max_attributes: 256, room: "ingest" };
    let limits = DescriptionLimits { max_bytes: 16 << 20, xml };
    let (layout, mut pages) = E57Layout::open(Cursor::new(bytes), &limits)?;
    let robots = robots();
    let mut copy = E57Copy::begin(Cursor::new(Vec::new()), &layout, how, &robots)?;
    let mut counts = vec![GivenBack::default(); layout.scans.len()];
    for section in &layout.sections {
        let SectionBody::Points(at) = section.body else {
            copy.copy(&mut pages, section)?;
            continue;
        };
        let plan = ScanPlan::of(&layout.scans[at], how, &robots);
        let marker = RecordMarker::new(&layout.scans[at], &plan, &ByRule);
        let records = E57Records::open(&mut pages, &layout.scans[at])?;
        let mut written = copy.scan(at, &plan)?;
        for piece in records {
            written.add(&marker.apply(piece?, &mut ())?)?;
        }
        counts[at] = written.finish()?;
    }
    Ok((copy.finish()?.into_inner(), counts))
}

/// A PTX file of `n_scans` scans given back.
pub(crate) fn give_ptx(bytes: &[u8], n_scans: usize) -> Result<(Vec<u8>, Vec<GivenBack>)> {
    let fates: Vec<&dyn ScanFates> = vec![&ByRule; n_scans];
    let (marker, mut out) = (LineMarker::new(&fates), Vec::new());
    let mut counts = vec![GivenBack::default(); n_scans];
    for piece in PtxPieces::new(bytes) {
        let lines = marker.apply(piece?, &mut ())?;
        out.extend_from_slice(&lines.bytes);
        if let Some(sum) = counts.get_mut(lines.scan) {
            sum.n_valid += lines.counts.n_valid;
            sum.n_out += lines.counts.n_out;
        }
    }
    Ok((out, counts))
}

/// A value with its bits, so that equal numbers are equal and NaN is itself.
fn bits(value: &RecordValue) -> i64 {
    match value {
        RecordValue::Single(v) => i64::from(v.to_bits()),
        RecordValue::Double(v) => v.to_bits() as i64,
        RecordValue::ScaledInteger(v) | RecordValue::Integer(v) => *v,
    }
}

/// Fields and records of a scan.
pub(crate) struct ReadScan {
    pub(crate) names: Vec<RecordName>,
    pub(crate) records: Vec<Vec<i64>>,
    /// Everything that the crate reads of the scan's description, in words, without what may
    /// differ.
    pub(crate) words: String,
}

/// All scans of a file, and the names and bytes of all its blobs.
pub(crate) fn read(bytes: &[u8]) -> (Vec<ReadScan>, Vec<(String, Vec<u8>)>) {
    E57Reader::validate_crc(Cursor::new(bytes)).expect("right checksums");
    let mut reader = E57Reader::new(Cursor::new(bytes)).expect("an E57 file");
    let mut scans = Vec::new();
    for mut cloud in reader.pointclouds() {
        let records = reader.pointcloud_raw(&cloud).expect("points");
        let records: Vec<Vec<i64>> =
            records.map(|r| r.expect("a record").iter().map(bits).collect()).collect();
        assert_eq!(records.len() as u64, cloud.records);
        let names = cloud.prototype.iter().map(|r| r.name.clone()).collect();
        (cloud.records, cloud.file_offset, cloud.prototype) = (0, 0, Vec::new());
        scans.push(ReadScan { names, records, words: format!("{cloud:?}") });
    }
    let text = reader.xml().to_owned();
    let document = roxmltree::Document::parse(&text).expect("XML");
    let mut blobs = Vec::new();
    for node in document.descendants().filter(|n| n.attribute("type") == Some("Blob")) {
        let [offset, len] = ["fileOffset", "length"]
            .map(|name| node.attribute(name).expect("a blob").parse().expect("a number"));
        let mut bytes = Vec::new();
        reader.blob(&e57::Blob::new(offset, len), &mut bytes).expect("a blob");
        blobs.push((node.tag_name().name().to_owned(), bytes));
    }
    (scans, blobs)
}

/// A folder of the real and odd scans; says so where there is none.
#[allow(clippy::print_stdout, reason = "the test says that it did not run")]
pub(crate) fn shared(folder: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scans").join(folder);
    if !path.is_dir() {
        println!("skipped: no shared scans '{folder}'");
        return None;
    }
    Some(path)
}
