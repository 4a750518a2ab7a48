//! The cache of a run: digests of its inputs, keys of the pieces that are computed from them, and
//! the list of its outputs. A piece whose key is in the cache is not computed again.
//!
//! A key is a digest of everything that a piece depends on: contents of files, settings and the
//! program itself, but not paths, times or the number of threads. Each piece is checked before it
//! is used: a store by its catalogue, fits by their checksum, outputs by length and time.

mod digests;
mod file_digests;
mod given_input;
pub(crate) mod input_tiles;
pub(crate) mod kept_looks;
mod key;
mod manifest;
mod output;
mod pieces;
mod publish;
mod verified;

pub(crate) use digests::Digests;
pub(crate) use given_input::GivenInput;
pub(crate) use key::Key;
#[cfg(fuzzing)]
pub(crate) use manifest::sealed;
pub(crate) use manifest::{EXPORT, PAGE, RESULT, copc_name, tiles_of};
pub use manifest::{Manifest, OutputFile, Verification, check};
pub use output::OutputDir;
pub(crate) use output::settle_folder;
pub(crate) use pieces::{Cache, read, reused_in_words, written};
pub(crate) use publish::WholeResult;
pub(crate) use verified::{VerifiedFiles, result_of};
