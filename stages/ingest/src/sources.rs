//! Opens inputs by their paths and numbers their masks and scans across all inputs. Gives the
//! lattice of each scan, and the strips of each input on request.

use crate::file::OpenFile;
use crate::format::detect;
use crate::las::Las;
use crate::looked::{InputLooks, KeepLooks, KeepNone};
use crate::new_scan::new_scan;
use crate::poses::Poses;
use crate::raster::StepSource;
use crate::reader::{self, Extent, FileReading, Reader, Want};
use crate::regular::regular;
use crate::scanners::{KnownScanner, KnownScanners};
use crate::settings::Settings;
use crate::units::{Choice, ReferenceSystem, Units};
use contract::{
    Error, Fan, Format, Input, InputId, Kind, Mask, MaskId, Result, Scan, ScannerPosition, Strip,
    Weigh,
};
use std::path::{Path, PathBuf};

/// Iterator over the strips of one input, in file order.
pub type Strips<'a> = Box<dyn Iterator<Item = Result<Strip>> + Send + 'a>;

/// A part of an input.
#[derive(Debug)]
pub enum InputPiece {
    /// Points, of a format that is read from beginning to end.
    Strip(Strip),
    /// A range of bytes, which the reader of the bytes passes to [`Sources::decode`].
    Extent(Extent),
}

/// Iterator over the pieces of one input, in file order.
pub type InputPieces<'a> = Box<dyn Iterator<Item = Result<InputPiece>> + Send + 'a>;

/// Open inputs, with headers read and checked and no points read yet.
pub struct Sources {
    /// Inputs, in the order of the command line.
    pub inputs: Vec<Input>,
    /// Masks, in the order of the inputs.
    pub masks: Vec<Mask>,
    /// Scans, in the order of the inputs.
    pub scans: Vec<Scan>,
    /// Warnings about inputs and scanners.
    pub warnings: Vec<String>,
    pub(crate) files: Vec<OpenFile>,
    n_before: [usize; 2],
}

/// Inputs, masks and scans of an earlier run, which are known but not open. Inputs that are opened
/// now are numbered after them.
#[derive(Debug, Clone, Default)]
pub struct Before {
    /// Inputs, in their order.
    pub inputs: Vec<Input>,
    /// Masks, in the order of the inputs.
    pub masks: Vec<Mask>,
    /// Scans, in the order of the inputs.
    pub scans: Vec<Scan>,
}

/// Opens inputs: detects their formats, reads and checks their headers, and estimates the lattices
/// of scans with known scanner from a sample of their points.
///
/// # Errors
/// For the first input, in their order, that is broken or unsupported; the place begins with its
/// path.
pub fn open(
    paths: &[PathBuf],
    scanners: Option<&KnownScanners>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Result<Sources> {
    open_after(Before::default(), paths, scanners, settings, fan)
}

/// Opens inputs as [`open_after`] does. Scans are sampled only where `looks` knows nothing of them.
///
/// # Errors
/// As [`open`].
pub fn open_known(
    before: Before,
    paths: &[PathBuf],
    scanners: Option<&KnownScanners>,
    settings: &Settings,
    looks: &dyn KeepLooks,
    fan: &dyn Fan,
) -> Result<Sources> {
    open_all(before, paths, scanners, settings, looks, fan)
}

/// Opens inputs as [`open`] does, numbered after the inputs of an earlier run.
///
/// # Errors
/// As [`open`].
pub fn open_after(
    before: Before,
    paths: &[PathBuf],
    scanners: Option<&KnownScanners>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Result<Sources> {
    open_all(before, paths, scanners, settings, &KeepNone, fan)
}

fn open_all(
    before: Before,
    paths: &[PathBuf],
    scanners: Option<&KnownScanners>,
    settings: &Settings,
    looks: &dyn KeepLooks,
    fan: &dyn Fan,
) -> Result<Sources> {
    let n_before = [before.inputs.len(), before.masks.len()];
    let Before { inputs, masks, scans } = before;
    let (warnings, files) = (Vec::new(), Vec::new());
    let mut sources = Sources { inputs, masks, scans, warnings, files, n_before };
    if paths.is_empty() {
        return Err(
            Error::new(Kind::Usage, "no input was given").hint("name at least one scan file")
        );
    }
    let none = KnownScanners::default();
    let mut poses = Poses::new(scanners.unwrap_or(&none), paths);
    for (at, path) in paths.iter().enumerate() {
        let added = sources.add(path, looks.known(at), &mut poses, settings);
        added.map_err(|e| e.at(path.display()))?;
    }
    sources.find_lattices(settings, looks, fan)?;
    sources.warnings.extend(poses.unused());
    let choice = Choice::read(&settings.units)?;
    let unknown = choice.unknown(paths);
    sources.warnings.extend(unknown.map(|name| format!("--units names no input: '{name}'")));
    sources.warn_of_sizes();
    Ok(sources)
}

impl Sources {
    /// The points of an input in file order, read on the calling thread, with all attributes or
    /// coordinates only.
    ///
    /// # Errors
    /// If there is no such input. Errors of the iterator name file and place; it ends after the
    /// first one.
    pub fn strips(&self, input: InputId, want: Want) -> Result<Strips<'_>> {
        let (file, path) = self.open(input)?;
        let strips = reader::strips(&*file.reader, want).map_err(|e| e.at(path.display()))?;
        Ok(Box::new(strips.map(move |strip| {
            file.whole(strip).map(|raw| file.number(raw)).map_err(|e| e.at(path.display()))
        })))
    }

    /// The points of an input in file order, in pieces that several threads may read and decode.
    ///
    /// # Errors
    /// As [`Sources::strips`].
    pub fn pieces(&self, input: InputId, want: Want) -> Result<InputPieces<'_>> {
        let (file, path) = self.open(input)?;
        Ok(match file.reader.read(want).map_err(|e| e.at(path.display()))? {
            FileReading::ByExtent(extents) => Box::new(extents.map(InputPiece::Extent).map(Ok)),
            FileReading::Straight(strips) => Box::new(strips.map(move |strip| {
                let strip = file.whole(strip).map(|raw| InputPiece::Strip(file.number(raw)));
                strip.map_err(|e| e.at(path.display()))
            })),
        })
    }

    /// The points of an extent of an input, from its bytes.
    ///
    /// # Errors
    /// If the bytes are damaged; the error names file and place.
    pub fn decode(
        &self,
        input: InputId,
        extent: &Extent,
        bytes: &[u8],
        want: Want,
    ) -> Result<Vec<Strip>> {
        let (file, path) = self.open(input)?;
        let strips = file.reader.decode(extent, bytes, want).map_err(|e| e.at(path.display()))?;
        Ok(strips.into_iter().map(|raw| file.number(raw)).collect())
    }

    /// The open file of an input whose pieces are extents, even if another file has its name by
    /// now.
    #[must_use]
    pub fn file(&self, input: InputId) -> Option<&std::fs::File> {
        let (file, _) = self.open(input).ok()?;
        let by_extent = matches!(file.reader.read(Want::Coordinates), Ok(FileReading::ByExtent(_)));
        file.reader.mapped().filter(|_| by_extent).map(crate::map::Mapped::file)
    }

    /// An open input and its path.
    pub(crate) fn open(&self, input: InputId) -> Result<(&OpenFile, &Path)> {
        let at = input.0 as usize;
        let open = at.checked_sub(self.n_before[0]).and_then(|at| self.files.get(at));
        let known = open.zip(self.inputs.get(at)).map(|(file, known)| (file, &*known.path));
        known.ok_or_else(|| Error::new(Kind::Bug, format!("there is no input \"{at}\"")))
    }

    /// Units of an opened input's coordinates in the file; all points are returned in metres.
    #[must_use]
    pub fn units(&self, input: InputId) -> Option<&Units> {
        self.open(input).ok().map(|(file, _)| file.reader.units())
    }

    /// The inputs that are open.
    #[must_use]
    pub fn opened(&self) -> &[Input] {
        &self.inputs[self.n_before[0]..]
    }

    /// The masks of the inputs that are open.
    #[must_use]
    pub fn opened_masks(&self) -> &[Mask] {
        &self.masks[self.n_before[1]..]
    }

    /// Scale and offset (metres) of the LAS input with the finest steps; `None` where an input of
    /// another format is finer.
    #[must_use]
    pub fn las_quantum(&self) -> Option<([f64; 3], [f64; 3])> {
        /// Step that is assumed for formats without a scale, metres.
        const OTHERS: f64 = 1e-4;
        let coarsest = |(scale, _): &([f64; 3], _)| scale.iter().fold(0.0, |a, s| s.abs().max(a));
        let all = self.files.iter().map(|file| file.reader.quantum());
        let is_mixed = all.clone().any(|quantum| quantum.is_none());
        let finest = all.flatten().min_by(|a, b| coarsest(a).total_cmp(&coarsest(b)));
        finest.filter(|quantum| !is_mixed || coarsest(quantum) <= OTHERS)
    }

    /// The coordinate reference system of all LAS inputs, for clouds in metres; `None` where they
    /// state none, different ones, or one in another unit.
    #[must_use]
    pub fn system(&self) -> Option<&ReferenceSystem> {
        let all = self.files.iter().map(|file| &file.reader);
        let mut stated = all.clone().filter_map(|reader| reader.system());
        let first = stated.next()?;
        let is_one = stated.all(|other| other == first);
        (is_one && all.into_iter().all(|reader| reader.units().is_metres())).then_some(first)
    }

    /// Whether any input has colour.
    #[must_use]
    pub fn has_color(&self) -> bool {
        self.files.iter().any(|file| file.reader.has_color())
    }

    /// Number of points that an opened input states, including invalid ones; `None` where it states
    /// none.
    #[must_use]
    pub fn n_stated(&self, input: InputId) -> Option<u64> {
        let first = self.inputs.len() - self.files.len();
        let file = self.files.get((input.0 as usize).checked_sub(first)?)?;
        file.reader.masks().iter().map(|mask| mask.n_stated).sum()
    }

    /// Messages about odd points of the open inputs, from the last full read.
    #[must_use]
    pub fn oddities(&self) -> Vec<String> {
        self.opened().iter().flat_map(|input| self.oddities_of(input.id)).collect()
    }

    /// Like [`Sources::oddities`], of one of the open inputs.
    #[must_use]
    pub fn oddities_of(&self, input: InputId) -> Vec<String> {
        let first = self.inputs.len() - self.files.len();
        let file = (input.0 as usize).checked_sub(first).and_then(|at| self.files.get(at));
        let Some(file) = file else { return Vec::new() };
        let scans = file.reader.scans().iter().enumerate();
        let said = scans.flat_map(|(i, scan)| {
            file.reader.oddities(i).map(|odd| odd.said(&scan.name)).unwrap_or_default()
        });
        said.collect()
    }

    /// Refuses inputs whose coordinates are too coarse to recognise a robot.
    ///
    /// # Errors
    /// For the first such input, with path and scan.
    pub fn check_steps(&self) -> Result<()> {
        for (file, input) in self.files.iter().zip(self.opened()) {
            for scan in file.reader.scans() {
                let checked = scan.step.map_or(Ok(()), crate::steps::refuse);
                checked.map_err(|e| {
                    e.at(format!("scan \"{}\"", scan.name)).at(input.path.display())
                })?;
            }
        }
        Ok(())
    }

    fn add(
        &mut self,
        path: &Path,
        known: Option<InputLooks>,
        poses: &mut Poses<'_>,
        settings: &Settings,
    ) -> Result<()> {
        // The caller adds the path to the error.
        if let Err(e) = regular(path) {
            return Err(e.without_place());
        }
        let meta = std::fs::metadata(path)?;
        let reader = open_file(path, known, poses, settings)?;
        let file = self.take(path.to_owned(), meta.len(), reader, |name| poses.by_scan_name(name));
        self.files.push(file);
        Ok(())
    }

    /// No inputs yet.
    pub(crate) fn empty() -> Self {
        let (inputs, masks, scans) = (Vec::new(), Vec::new(), Vec::new());
        let (warnings, files, n_before) = (Vec::new(), Vec::new(), [0, 0]);
        Self { inputs, masks, scans, warnings, files, n_before }
    }

    /// Adds an input whose reader states all that is known of its scans.
    pub(crate) fn add_reader(&mut self, name: PathBuf, n_bytes: u64, reader: Box<dyn Reader>) {
        let file = self.take(name, n_bytes, reader, |_| None);
        self.files.push(file);
    }

    /// Numbers masks and scans of an input; `scanner` gives the scanner that the user states for a
    /// scan.
    fn take<'a>(
        &mut self,
        path: PathBuf,
        n_bytes: u64,
        reader: Box<dyn Reader>,
        mut scanner: impl FnMut(&str) -> Option<&'a KnownScanner>,
    ) -> OpenFile {
        let id = InputId(self.inputs.len() as u32);
        let (first_scan, first_mask) = (self.scans.len() as u32, self.masks.len() as u32);
        self.inputs.push(Input { id, path, format: reader.format(), n_bytes });
        for (i, mask) in reader.masks().iter().enumerate() {
            self.masks.push(Mask {
                id: MaskId(first_mask + i as u32),
                input: id,
                name: mask.name.clone(),
                n_points: mask.n_points,
            });
        }
        let (moved, known, steps) = (Vec::new(), Vec::new(), Vec::new());
        let spreads = Vec::new();
        let mut file = OpenFile { reader, first_scan, first_mask, moved, known, steps, spreads };
        for i in 0..file.reader.scans().len() {
            let scan = new_scan(id, &mut file, i, &mut scanner);
            self.scans.push(scan);
        }
        file
    }

    /// Samples each scan to estimate its raster and to check whether the scanner can have stood at
    /// its stated position.
    pub(crate) fn find_lattices(
        &mut self,
        settings: &Settings,
        looks: &dyn KeepLooks,
        fan: &dyn Fan,
    ) -> Result<()> {
        let n_scans = |file: &OpenFile| file.reader.scans().len();
        let known = |(f, file): (usize, &OpenFile)| {
            looks.known(f).filter(|known| known.scans.len() == n_scans(file))
        };
        let known: Vec<Option<InputLooks>> = self.files.iter().enumerate().map(known).collect();
        let all = (self.files.iter().enumerate())
            .filter(|(f, _)| known[*f].is_none())
            .flat_map(|(f, file)| (0..n_scans(file)).map(move |i| (f, i)))
            .collect();
        let scan_of = |file: &OpenFile, i: usize| file.first_scan as usize + i;
        let found = fan.fan(all, |(f, i): (usize, usize)| {
            let file = &self.files[f];
            let found = file.look(i, &self.scans[scan_of(file, i)], settings);
            let whole = file.reader.check().and(found);
            whole.map_err(|e| e.at(self.inputs[self.n_before[0] + f].path.display()))
        });
        let mut found = found.into_iter();
        for (f, (file, known)) in self.files.iter_mut().zip(known).enumerate() {
            let is_new = known.is_none();
            let own = match known {
                Some(known) => known,
                None => InputLooks {
                    scans: found.by_ref().take(n_scans(file)).collect::<Result<_>>()?,
                    census: file.reader.census().cloned(),
                },
            };
            if is_new {
                looks.keep(f, &own);
            }
            for (i, looked) in own.scans.into_iter().enumerate() {
                let at = scan_of(file, i);
                self.scans[at].notes.extend(looked.note);
                self.scans[at].lattice = looked.raster.as_ref().map(|r| r.lattice);
                file.steps.push(looked.raster.map_or(StepSource::None, |r| r.steps));
                file.spreads.push(looked.spread);
                file.known[i] &= !looked.is_misplaced;
                if looked.is_misplaced {
                    self.scans[at].scanner = ScannerPosition::Unknown;
                }
            }
        }
        Ok(())
    }
}

impl Weigh for InputPiece {
    fn weight_bytes(&self) -> usize {
        match self {
            Self::Strip(strip) => strip.weight_bytes(),
            Self::Extent(extent) => (extent.bytes.end - extent.bytes.start) as usize,
        }
    }

    fn n_points(&self) -> u64 {
        match self {
            Self::Strip(strip) => strip.n_points(),
            Self::Extent(extent) => extent.n_points,
        }
    }
}

fn open_file(
    path: &Path,
    known: Option<InputLooks>,
    poses: &mut Poses<'_>,
    settings: &Settings,
) -> Result<Box<dyn Reader>> {
    match detect(path)? {
        Format::E57 => crate::e57::open(path, settings),
        Format::Ptx => crate::ptx::open(path, settings),
        Format::Las | Format::Laz => {
            let census = known.and_then(|known| known.census);
            Ok(Box::new(Las::open(path, &poses.of_las(path), census, settings)?))
        }
        format @ (Format::Pts | Format::Xyz | Format::Ply | Format::Pcd) => {
            crate::cloud::open(path, format, settings)
        }
        Format::Memory => Err(Error::new(Kind::Bug, "a file was taken for memory")),
    }
}
