//! What a run is made from in, names for its pieces out: a piece whose name is there already need
//! not be made again.
//!
//! A key is a digest of all that a piece depends on: contents of files, settings, the program
//! itself. Places, times and the number of threads are no part of it. A piece is looked at before
//! it is believed: a store has its catalogue, kept fits their checksum, outputs their length and
//! time.

mod digests;
mod file_digests;
pub(crate) mod input_tiles;
mod key;
mod manifest;
mod output;
mod pieces;
mod publish;
mod verified;

pub(crate) use digests::Digests;
pub(crate) use key::Key;
#[cfg(fuzzing)]
pub(crate) use manifest::sealed;
pub use manifest::{Checked, Manifest, OutputFile, check};
pub(crate) use manifest::{EXPORT, copc_name, tiles_of};
pub use output::OutputDir;
pub(crate) use pieces::{Cache, read, reused_in_words, written};
pub(crate) use publish::WholeResult;
pub(crate) use verified::{VerifiedFiles, result_of};
