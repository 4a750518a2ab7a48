//! Reads an input and applies a step to its strips, in the order of the file. Some threads read
//! pieces of the file and digest them where the digest is not known; others decode the points.

use super::direct::{DirectFile, LentBytes};
use super::hash_tree::{HashTree, Subtree};
use crate::engine::{Amount, Engine, Task};
use contract::{Error, Input, Kind, Map, Result, Strip, Weigh};
use ingest::{Extent, InputPiece, Sources, Want};

/// Total size above which inputs are read past the page cache, bytes. Smaller inputs may still be
/// cached when they are read again, which saves a slow disk or network share.
const CACHED: u64 = 1 << 30;

/// An input with the engine and settings that it is read with.
#[derive(Clone, Copy)]
pub(crate) struct InputReader<'a> {
    pub(crate) sources: &'a Sources,
    pub(crate) input: &'a Input,
    pub(crate) want: Want,
}

impl InputReader<'_> {
    /// Number of points that the input states, for progress; 0 where it states none.
    pub(crate) fn amount(&self) -> Amount {
        let own = self.sources.masks.iter().filter(|m| m.input == self.input.id);
        let stated = own.map(|m| m.n_points.unwrap_or(0));
        Amount { items: 0, points: stated.sum(), bytes: 0 }
    }

    /// Applies `step` to each strip and passes the results to `sink`, in the order of the file.
    /// Where `tree` is given and the input is read in pieces, the file is digested on the way.
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

    /// The file to read pieces from: the one that was opened, even if another file has its name by
    /// now. `None` where the input is not read in pieces.
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

/// Several items that travel through a pass as one.
pub(crate) struct Many<T>(Vec<T>);

impl<T: Weigh> Weigh for Many<T> {
    fn weight_bytes(&self) -> usize {
        self.0.iter().map(Weigh::weight_bytes).sum()
    }

    fn n_points(&self) -> u64 {
        self.0.iter().map(Weigh::n_points).sum()
    }
}

/// The map that reads the bytes of pieces.
struct Load<'a> {
    input: &'a Input,
    file: Option<&'a DirectFile>,
    /// Length of the file, bytes, where it is to be digested.
    n_bytes: Option<u64>,
}

/// A piece of an input whose bytes have been read.
enum Loaded<'a> {
    Strip(Strip),
    Extent(Extent, LentBytes<'a>, Vec<Subtree>),
    /// A piece without points that need not be digested.
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
                return Err(Error::new(
                    Kind::Bug,
                    "an input that is read in pieces has no open file",
                ));
            }
        };
        let start = extent.bytes.start;
        let own = self.n_bytes.map(|n_bytes| HashTree::leaves_of(&extent.bytes, n_bytes));
        let end = own.as_ref().map_or(extent.bytes.end, |own| own.end.max(extent.bytes.end));
        let read = file.read(start, (end - start) as usize);
        let bytes = read.map_err(|e| Error::from(e).at(self.input.path.display()))?;
        if (bytes.len() as u64) < end - start {
            let error = Error::bad_input("the file was truncated or removed while it was read");
            let error = error.at(self.input.path.display());
            return Err(error.hint("start the run again once the file is complete"));
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

/// The map that decodes pieces and applies a step to each of their strips.
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
