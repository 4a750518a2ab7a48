//! Publishes a complete result: lists its files, moves them to the output folder and records their
//! digests.

use super::digests::Digests;
use super::manifest::{Manifest, OutputFile};
use super::output::OutputDir;
use crate::engine::Engine;
use crate::job::{Job, Outcome};
use contract::Result;

/// A complete result whose files lie beside the output folder.
pub(crate) struct WholeResult<'a> {
    pub(crate) job: &'a Job,
    pub(crate) output: &'a OutputDir,
    pub(crate) digests: &'a Digests,
    pub(crate) outcome: &'a Outcome,
    /// Entries of files whose checksums were computed while they were written.
    pub(crate) files: Vec<OutputFile>,
}

impl WholeResult<'_> {
    /// Moves the result to the output folder and records the digests of its inputs and outputs.
    /// Returns messages about files that were removed beside it.
    ///
    /// # Errors
    /// An input without a digest; an error of the file system.
    pub(crate) fn publish(self, engine: &Engine) -> Result<Vec<String>> {
        let Self { job, output, digests, outcome, files } = self;
        Manifest::write(output.next(), digests.result_key(job), outcome, files, engine)?;
        let (manifest, told) = Manifest::publish(output.next(), output.out())?;
        digests.remember(&manifest, output.out())?;
        Ok(told)
    }
}
