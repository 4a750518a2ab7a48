//! An input in, what a step makes of its strips out, in the order of the file: some threads read
//! pieces of it, and sum them up where nobody knows its digest; others make points of them.

use super::direct::{DirectFile, LentBytes};
use super::hash_tree::{HashTree, Subtree};
use crate::engine::{Amount, Engine, Task};
use contract::{Error, Input, Kind, Map, Result, Strip, Weigh};
use ingest::{Extent, InputPiece, Sources, Want};

/// Inputs that are larger than this in all are read past the system's cache, bytes: smaller ones it
/// may still hold when they are read once more, and a disk or share may be slow.
const CACHED: u64 = 1 << 30;

/// How an input is read.
#[derive(Clone, Copy)]
pub(crate) struct InputReader<'a> {
    pub(crate) sources: &'a Sources,
    pub(crate) input: &'a Input,
    pub(crate) want: Want,
}

impl InputReader<'_> {
    /// Points that the input states, for progress; 0 where it states none.
    pub(crate) fn amount(&self) -> Amount {
        let own = self.sources.masks.iter().filter(|m| m.input == self.input.id);
        let stated = own.map(|m| m.n_points.unwrap_or(0));
        Amount { items: 0, points: stated.sum(), bytes: 0 }
    }

    /// Does `step` to each strip; hands what it makes of them to `sink`, in order. Digests the file
    /// up on the way where `tree` wants it and it is read in pieces.
    pub(crate) fn each<M: Map<In = Strip>>(
        &self,
        task: Task,
        step: &M,
        mut tree: Option<&mut HashTree>,
        engine: &Engine,
        mut sink: impl FnMut(M::Out) -> Result<()>,
    ) -> Result<()>
    where
        M::Out: Weigh,
    {
        let file = self.file()?;
        let n_bytes = tree.as_ref().map(|tree| tree.n_bytes());
        let load = Load { input: self.input, file: file.as_ref(), n_bytes };
        let of_strips = OfStrips { reading: *self, step };
        let pieces = self.sources.pieces(self.input.id, self.want)?;
        engine.pass(task, pieces, |flow| {
            flow.map(&load).map(&of_strips).for_each(|(made, parts)| {
                if let Some(tree) = &mut tree {
                    tree.add(parts.0);
                }
                made.0.into_iter().try_for_each(&mut sink)
            })
        })
    }

    /// The file, where it is read in pieces: the one that was opened, whatever has its name by now.
    fn file(&self) -> Result<Option<DirectFile>> {
        let Some(file) = self.sources.file(self.input.id) else { return Ok(None) };
        let file = file.try_clone().map_err(|e| Error::from(e).at(self.input.path.display()))?;
        let n_bytes: u64 = self.sources.opened().iter().map(|input| input.n_bytes).sum();
        let is_large = n_bytes > CACHED;
        Ok(Some(if is_large {
            DirectFile::past_cache(file)
        } else {
            DirectFile::through_cache(file)
        }))
    }
}

/// Several items as one.
pub(crate) struct Many<T>(Vec<T>);

impl<T: Weigh> Weigh for Many<T> {
    fn weight_bytes(&self) -> usize {
        self.0.iter().map(Weigh::weight_bytes).sum()
    }

    fn n_points(&self) -> u64 {
        self.0.iter().map(Weigh::n_points).sum()
    }
}

/// Reads the bytes of pieces.
struct Load<'a> {
    input: &'a Input,
    file: Option<&'a DirectFile>,
    /// Length of the file, where it is to be summed up.
    n_bytes: Option<u64>,
}

/// A piece whose bytes are there.
enum Loaded<'a> {
    Strip(Strip),
    Extent(Extent, LentBytes<'a>, Vec<Subtree>),
    /// Bytes without points that nobody asked for.
    Nothing,
}

impl<'a> Map for Load<'a> {
    type In = InputPiece;
    type Out = Loaded<'a>;
    type Scratch = ();

    fn apply(&self, piece: InputPiece, (): &mut ()) -> Result<Loaded<'a>> {
        let is_asked = |extent: &Extent| extent.n_points > 0 || self.n_bytes.is_some();
        let (extent, file) = match (piece, self.file) {
            (InputPiece::Strip(strip), _) => return Ok(Loaded::Strip(strip)),
            (InputPiece::Extent(extent), _) if !is_asked(&extent) => return Ok(Loaded::Nothing),
            (InputPiece::Extent(extent), Some(file)) => (extent, file),
            (InputPiece::Extent(_), None) => {
                return Err(Error::new(Kind::Bug, "there is no file to read a piece from"));
            }
        };
        let start = extent.bytes.start;
        let own = self.n_bytes.map(|n_bytes| HashTree::own(&extent.bytes, n_bytes));
        let end = own.as_ref().map_or(extent.bytes.end, |own| own.end.max(extent.bytes.end));
        let read = file.read(start, (end - start) as usize);
        let bytes = read.map_err(|e| Error::from(e).at(self.input.path.display()))?;
        if (bytes.len() as u64) < end - start {
            let error =
                Error::bad_input("the file was cut short or became unreadable while it was read");
            let error = error.at(self.input.path.display());
            return Err(error.hint("start again when it is complete"));
        }
        let parts = own.zip(self.n_bytes).map_or_else(Vec::new, |(own, n_bytes)| {
            let (from, to) = (own.start - start, own.end.max(own.start) - start);
            HashTree::parts(own.start, &bytes[from as usize..to as usize], n_bytes)
        });
        Ok(Loaded::Extent(extent, bytes, parts))
    }
}

impl Weigh for Loaded<'_> {
    fn weight_bytes(&self) -> usize {
        match self {
            Self::Strip(strip) => strip.weight_bytes(),
            Self::Extent(_, bytes, _) => bytes.len(),
            Self::Nothing => 0,
        }
    }

    fn n_points(&self) -> u64 {
        match self {
            Self::Strip(strip) => strip.n_points(),
            Self::Extent(extent, ..) => extent.n_points,
            Self::Nothing => 0,
        }
    }
}

/// Decodes pieces, and does a step to each of their strips.
struct OfStrips<'a, M> {
    reading: InputReader<'a>,
    step: &'a M,
}

impl<'a, M: Map<In = Strip>> Map for OfStrips<'a, M> {
    type In = Loaded<'a>;
    type Out = (Many<M::Out>, Many<Subtree>);
    type Scratch = M::Scratch;

    fn apply(&self, loaded: Loaded<'a>, scratch: &mut M::Scratch) -> Result<Self::Out> {
        let InputReader { sources, input, want, .. } = self.reading;
        let (strips, parts) = match loaded {
            Loaded::Strip(strip) => (vec![strip], Vec::new()),
            Loaded::Extent(extent, bytes, parts) => {
                let n = (extent.bytes.end - extent.bytes.start) as usize;
                (sources.decode(input.id, &extent, &bytes[..n], want)?, parts)
            }
            Loaded::Nothing => (Vec::new(), Vec::new()),
        };
        let made = strips.into_iter().map(|strip| self.step.apply(strip, scratch));
        Ok((Many(made.collect::<Result<_>>()?), Many(parts)))
    }
}
