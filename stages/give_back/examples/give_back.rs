//! Gives an E57 or PTX file back with labels from NumPy arrays, as `stillpoint export` does with
//! those of a result: `give_back ORIGINAL OUT LABELS [--drop-moving] [--without-labels]`, where
//! LABELS holds `N.kind.npy`, `N.robot.npy` and `N.link.npy` of scan N. What comes out is compared
//! by other readers in `scripts/cross/scans_back.py`.

use contract::{Error, Label, Map, PointKind, Result, XmlLimits};
use give_back::{
    DescriptionLimits, E57Copy, E57Layout, E57Records, GiveBack, LineMarker, PointFate, PtxPieces,
    RecordMarker, RobotNames, ScanFates, ScanPlan, SectionBody,
};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Bytes before the first element of an array.
const NPY_HEADER: usize = 128;

/// Labels of one scan.
struct Arrays([Vec<u8>; 3]);

impl Arrays {
    fn read(folder: &Path, scan: usize) -> Result<Self> {
        let read = |name: &str| -> Result<Vec<u8>> {
            let path = folder.join(format!("{scan}.{name}.npy"));
            let bytes = std::fs::read(&path).map_err(|e| Error::of_read("no labels", &path, e))?;
            Ok(bytes[NPY_HEADER.min(bytes.len())..].to_vec())
        };
        Ok(Self([read("kind")?, read("robot")?, read("link")?]))
    }
}

impl ScanFates for Arrays {
    fn range(&self, first: u64, n: usize) -> Result<Vec<PointFate>> {
        let [kind, robot, link] = &self.0;
        let wide = |bytes: &[u8], i: usize| i16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]);
        let fate = |i: usize| {
            let bad = || Error::bad_input(format!("no label of point \"{i}\""));
            let kind = kind.get(i).and_then(|k| PointKind::of(*k)).ok_or_else(bad)?;
            let label = Label { kind, robot: wide(robot, i), link: wide(link, i) };
            Ok(PointFate::of(label, false))
        };
        (first as usize..first as usize + n).map(fate).collect()
    }
}

fn e57(original: &Path, out: &Path, labels: &Path, how: GiveBack) -> Result<()> {
    let xml = XmlLimits { max_nodes: 2_000_000, max_attributes: 256, room: "ingest" };
    let limits = DescriptionLimits { max_bytes: 16 << 20, xml };
    let (layout, mut pages) = E57Layout::open(File::open(original)?, &limits)?;
    let links: Vec<String> = (0..64).map(|n| format!("link {n}")).collect();
    let robot =
        |n: usize| RobotNames { id: format!("R{n}"), model: "m".into(), links: links.clone() };
    let robots: Vec<RobotNames> = (1..65).map(robot).collect();
    let file = File::options().read(true).write(true).create(true).truncate(true).open(out)?;
    let mut copy = E57Copy::begin(file, &layout, how, &robots)?;
    for section in &layout.sections {
        let SectionBody::Points(at) = section.body else {
            copy.copy(&mut pages, section)?;
            continue;
        };
        let (scan, fates) = (&layout.scans[at], Arrays::read(labels, at)?);
        let plan = ScanPlan::of(scan, how, &robots);
        let marker = RecordMarker::new(scan, &plan, &fates);
        let mut written = copy.scan(at, &plan)?;
        for piece in E57Records::open(&mut pages, scan)? {
            written.add(&marker.apply(piece?, &mut ())?)?;
        }
        written.finish()?;
    }
    copy.finish().map(drop)
}

fn ptx(original: &Path, out: &Path, labels: &Path) -> Result<()> {
    let arrays: Vec<Arrays> = (0..).map_while(|n| Arrays::read(labels, n).ok()).collect();
    let fates: Vec<&dyn ScanFates> = arrays.iter().map(|a| a as &dyn ScanFates).collect();
    let (marker, mut file) = (LineMarker::new(&fates), File::create(out)?);
    for piece in PtxPieces::new(File::open(original)?) {
        file.write_all(&marker.apply(piece?, &mut ())?.bytes)?;
    }
    Ok(())
}

fn main() -> Result<()> {
    let (flags, paths): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|arg| arg.starts_with("--"));
    let has = |flag: &str| flags.iter().any(|f| f == flag);
    let how = GiveBack { drops: has("--drop-moving"), says_labels: !has("--without-labels") };
    let [original, out, labels] = [0, 1, 2].map(|n| PathBuf::from(paths.get(n).map_or("", |p| p)));
    match original.extension().is_some_and(|e| e == "ptx") {
        true => ptx(&original, &out, &labels),
        false => e57(&original, &out, &labels, how),
    }
}
