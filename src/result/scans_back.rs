//! Gives the scans of a published result back without their moving points: each E57 or PTX input as
//! a file of the same format in `OUT/export/FORMAT`, with everything else as it was.

use crate::cache::{EXPORT, GivenInput, VerifiedFiles};
use crate::engine::{Amount, Engine, Task};
use crate::io::own_paths::without_links;
use crate::job::{Job, Means};
use contract::words::count;
use contract::{Error, Format, Kind, Result, XmlLimits, quote};
use export::{AtomicFile, InputEntry, MaskReader, ResultFile, ScanLabels, read_places};
use give_back::{
    DescriptionLimits, E57Copy, E57Layout, E57Records, GiveBack, GivenBack, LineMarker, PointFate,
    PtxPieces, RecordMarker, RobotNames, ScanFates, ScanPlan, SectionBody,
};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Which scans are given back, and how.
#[derive(Debug, Clone)]
pub struct ScansBack {
    /// Output folder of the result.
    pub out: PathBuf,
    /// Format of the inputs that are given back: E57 or PTX.
    pub format: Format,
    /// Folder in which the inputs lie now, if not where the run found them.
    pub inputs: Option<PathBuf>,
    /// Whether moving points are left out; else they are flagged as invalid.
    pub drops: bool,
    /// Whether classes, robots and links are written.
    pub says_labels: bool,
}

/// Writes the scans; returns the paths of the files, and a message about each scan and about inputs
/// of other formats.
///
/// # Errors
/// There is no result, an input is missing or was changed, or files cannot be written.
pub fn give_scans_back(
    request: &ScansBack,
    means: &Means,
    engine: &Engine,
) -> Result<(Vec<PathBuf>, Vec<String>)> {
    let files = VerifiedFiles::open(&request.out)?;
    // No run can use a result that was copied without its store.
    let _lock = request.out.join("store").is_dir().then(|| Job::hold(&request.out)).transpose()?;
    let result = files.result()?;
    let job = GivingBack { request, files: &files, result: &result, means, engine };
    let word = job.word();
    let (own, others): (Vec<_>, Vec<_>) =
        result.inputs.iter().enumerate().partition(|(_, input)| input.format == word);
    if own.is_empty() {
        let formats: BTreeSet<&str> = result.inputs.iter().map(|i| &*i.format).collect();
        let formats: Vec<&str> = formats.into_iter().collect();
        let what = format!("the result has no {word} input, but \"{}\"", formats.join(", "));
        return Err(Error::bad_input(what).at(request.out.display()).hint(
            "scans are given back in the format in which they were read; for LAS the README has a \
             few lines of Python",
        ));
    }
    // All inputs are looked for before the first is written.
    let given = own.iter().map(|(_, entry)| job.given(entry)).collect::<Result<Vec<_>>>()?;
    let (mut written, mut notes) = (Vec::new(), Vec::new());
    let mut taken = BTreeSet::new();
    for ((at, _), given) in own.iter().zip(&given) {
        let name = free_name(given.path(), &mut taken);
        let to = without_links(&request.out, &format!("{EXPORT}/{word}/{name}"))?;
        notes.extend(job.give(*at, given, &to)?);
        written.push(to);
    }
    notes.extend(others.iter().map(|(_, other)| {
        let (path, format) = (quote::shown(&other.path), &other.format);
        format!("{path}: is {format} and not given back as {word}")
    }));
    Ok((written, notes))
}

/// A file name that no earlier input has taken.
fn free_name(path: &Path, taken: &mut BTreeSet<String>) -> String {
    let own = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let more = (2..).map(|n| format!("{n}-{own}"));
    let free = std::iter::once(own.clone()).chain(more).find(|name| taken.insert(name.clone()));
    free.unwrap_or(own)
}

/// Scans that are given back.
struct GivingBack<'a> {
    request: &'a ScansBack,
    files: &'a VerifiedFiles,
    result: &'a ResultFile,
    means: &'a Means,
    engine: &'a Engine,
}

impl GivingBack<'_> {
    fn word(&self) -> &'static str {
        if self.request.format == Format::Ptx { "ptx" } else { "e57" }
    }

    /// The input of this entry where it lies now.
    fn given(&self, entry: &InputEntry) -> Result<GivenInput> {
        let path = Path::new(&entry.path);
        let moved = self.request.inputs.as_ref().zip(path.file_name());
        let path = moved.map_or(path.to_path_buf(), |(folder, name)| folder.join(name));
        GivenInput::open(&path, entry, &self.request.out)
    }

    /// Writes one input and returns a message for each of its scans.
    fn give(&self, input: usize, given: &GivenInput, to: &Path) -> Result<Vec<String>> {
        let scans = self.result.labels.scans.iter().filter(|scan| scan.input as usize == input);
        let scans: Vec<&ScanLabels> = scans.collect();
        let labels = scans.iter().map(|scan| self.labels(scan)).collect::<Result<Vec<_>>>()?;
        let counts = match self.request.format {
            Format::Ptx => self.ptx(given.path(), &labels, to)?,
            _ => self.e57(given.path(), &labels, to)?,
        };
        given.check()?;
        let file = to.file_name().unwrap_or_default().to_string_lossy();
        let what = if self.request.drops { "left out" } else { "flagged as invalid" };
        let say = |(scan, counts): (&&ScanLabels, &GivenBack)| {
            let (name, all) = (quote::shown(&scan.scan), count(counts.n_valid, "point"));
            format!("{}: '{name}': {} of {all} {what}", quote::shown(&file), counts.n_out)
        };
        Ok(scans.iter().zip(&counts).map(say).collect())
    }

    fn labels(&self, scan: &ScanLabels) -> Result<MaskFates> {
        let names = [&scan.kind, &scan.robot, &scan.link];
        for name in names {
            self.files.compared(name)?;
        }
        let superseded = match &scan.superseded {
            Some(name) => read_places(&self.files.compared(name)?, scan.n_points)?,
            None => Vec::new(),
        };
        let reader = MaskReader::new(&self.request.out, names.map(String::as_str));
        Ok(MaskFates { reader, n_points: scan.n_points, superseded })
    }

    fn robots(&self) -> Vec<RobotNames> {
        let names = self.result.robots.iter().map(|robot| RobotNames {
            id: robot.id.clone(),
            model: robot.model.clone(),
            links: robot.links.clone(),
        });
        names.collect()
    }

    fn e57(&self, from: &Path, labels: &[MaskFates], to: &Path) -> Result<Vec<GivenBack>> {
        let (of_input, of_output) =
            (|e: Error| e.at(from.display()), |e: Error| e.at(to.display()));
        let settings = &self.means.settings.ingest;
        let xml = XmlLimits {
            max_nodes: settings.max_xml_nodes,
            max_attributes: settings.max_xml_attributes,
            room: "ingest",
        };
        let limits = DescriptionLimits { max_bytes: settings.max_xml_bytes, xml };
        let open = || E57Layout::open(File::open(from)?, &limits);
        let (layout, mut pages) = open().map_err(of_input)?;
        if layout.scans.len() != labels.len() {
            let (now, then) = (layout.scans.len(), labels.len());
            return Err(of_input(other_scans(now, then)));
        }
        let how = GiveBack { drops: self.request.drops, says_labels: self.request.says_labels };
        let robots = self.robots();
        let file = AtomicFile::create(to)?;
        let mut copy = E57Copy::begin(file, &layout, how, &robots).map_err(of_output)?;
        let mut counts = vec![GivenBack::default(); labels.len()];
        for section in &layout.sections {
            self.engine.cancel.check()?;
            let SectionBody::Points(at) = section.body else {
                copy.copy(&mut pages, section).map_err(|e| match e.kind() {
                    Kind::Io | Kind::OverBudget => of_output(e),
                    _ => of_input(e),
                })?;
                continue;
            };
            let scan = &layout.scans[at];
            let plan = ScanPlan::of(scan, how, &robots);
            let marker = RecordMarker::new(scan, &plan, &labels[at]);
            let records = E57Records::open(&mut pages, scan).map_err(of_input)?;
            let records = records.map(|piece| piece.map_err(of_input));
            let mut written = copy.scan(at, &plan).map_err(of_output)?;
            let task = Task::new("e57").of(Amount::points(scan.n_records));
            self.engine.pass(task, records, |flow| {
                flow.map(&marker).for_each(|piece| written.add(&piece).map_err(of_output))
            })?;
            counts[at] = written.finish().map_err(of_output)?;
            labels[at].check(&counts[at]).map_err(of_input)?;
        }
        copy.finish().map_err(of_output)?.commit()?;
        Ok(counts)
    }

    fn ptx(&self, from: &Path, labels: &[MaskFates], to: &Path) -> Result<Vec<GivenBack>> {
        let of_input = |e: Error| e.at(from.display());
        let fates: Vec<&dyn ScanFates> = labels.iter().map(|l| l as &dyn ScanFates).collect();
        let mut counts = vec![GivenBack::default(); labels.len()];
        let mut file = AtomicFile::create(to)?;
        let marker = LineMarker::new(&fates);
        let pieces = PtxPieces::new(File::open(from).map_err(|e| of_input(e.into()))?);
        let pieces = pieces.map(|piece| piece.map_err(of_input));
        let task = Task::new("ptx").of(Amount::points(labels.iter().map(|l| l.n_points).sum()));
        self.engine.pass(task, pieces, |flow| {
            flow.map(&marker).for_each(|lines| {
                if let Some(sum) = counts.get_mut(lines.scan) {
                    sum.n_valid += lines.counts.n_valid;
                    sum.n_out += lines.counts.n_out;
                }
                let written = file.write_all(&lines.bytes);
                written.map_err(|e| Error::of_file("scans cannot be written", to, e))
            })
        })?;
        for (labels, counts) in labels.iter().zip(&counts) {
            labels.check(counts).map_err(of_input)?;
        }
        file.commit()?;
        Ok(counts)
    }
}

fn other_scans(now: usize, then: usize) -> Error {
    let what = "the file holds another number of scans than were labelled";
    Error::bad_input(format!("{what}: {now}, then \"{then}\"")).hint("run the same job again")
}

/// The labels of one scan, from the masks of the result.
struct MaskFates {
    reader: MaskReader,
    n_points: u64,
    /// Places of points that a later scan supersedes, ascending.
    superseded: Vec<u64>,
}

impl MaskFates {
    /// Refuses a scan of which another number of points was labelled.
    fn check(&self, counts: &GivenBack) -> Result<()> {
        if counts.n_valid == self.n_points {
            return Ok(());
        }
        let what = "a scan holds another number of points than were labelled";
        let (now, then) = (counts.n_valid, self.n_points);
        Err(Error::bad_input(format!("{what}: {now}, then \"{then}\""))
            .hint("run the same job again"))
    }
}

impl ScanFates for MaskFates {
    fn range(&self, first: u64, n: usize) -> Result<Vec<PointFate>> {
        let end = first + n as u64;
        if end > self.n_points {
            self.check(&GivenBack { n_valid: end, n_out: 0 })?;
        }
        let labels = self.reader.range(first, n)?;
        let from = self.superseded.partition_point(|place| *place < first);
        let mut gone = self.superseded[from..].iter().copied().peekable();
        let fate = |i: usize| {
            let is_gone = gone.next_if_eq(&(first + i as u64)).is_some();
            Ok(PointFate::of(labels.label(i)?, is_gone))
        };
        (0..n).map(fate).collect()
    }
}
