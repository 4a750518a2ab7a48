//! Publishes a complete result: lists its files, moves them to the output folder and records their
//! digests.

use super::digests::Digests;
use super::manifest::{Manifest, OutputFile};
use super::output::OutputDir;
use super::verified::VerifiedFiles;
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
    /// Lets `add` make further files of the listed ones, moves the result to the output folder and
    /// records the digests of its inputs and outputs. Returns messages of `add`, and about files
    /// that were removed beside the result.
    ///
    /// # Errors
    /// An input without a digest; an error of `add` or of the file system.
    pub(crate) fn publish(
        self,
        add: impl FnOnce(&VerifiedFiles) -> Result<Vec<String>>,
        engine: &Engine,
    ) -> Result<Vec<String>> {
        let Self { job, output, digests, outcome, files } = self;
        let (next, key) = (output.next(), digests.result_key(job));
        let listed = Manifest::list("list", next, key.clone(), outcome, files, engine)?;
        let known = listed.files.clone();
        let mut told = add(&VerifiedFiles::unpublished(next, listed))?;
        Manifest::list("list_page", next, key, outcome, known, engine)?.write(next)?;
        let (manifest, removed) = Manifest::publish(next, output.out())?;
        digests.remember(&manifest, output.out())?;
        told.extend(removed);
        Ok(told)
    }
}
