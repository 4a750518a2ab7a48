//! A whole result beside its output folder in; the same in its place, listed and remembered, out.

use super::digests::Digests;
use super::manifest::{Manifest, OutputFile};
use super::output::OutputDir;
use crate::engine::Engine;
use crate::job::{Job, Outcome};
use contract::Result;

/// A result that is whole; its files lie beside the output folder.
pub(crate) struct WholeResult<'a> {
    pub(crate) job: &'a Job,
    pub(crate) output: &'a OutputDir,
    pub(crate) digests: &'a Digests,
    pub(crate) outcome: &'a Outcome,
    /// Files whose digests are known already.
    pub(crate) files: Vec<OutputFile>,
}

impl WholeResult<'_> {
    /// Gives it its place, and remembers what was read for it; what was taken away beside it, in
    /// words.
    ///
    /// # Errors
    /// An input that was never read to its end; what the disk refuses.
    pub(crate) fn publish(self, engine: &Engine) -> Result<Vec<String>> {
        let Self { job, output, digests, outcome, files } = self;
        Manifest::write(output.next(), digests.whole(job), outcome, files, engine)?;
        let (manifest, told) = Manifest::publish(output.next(), output.out())?;
        digests.remember(&manifest, output.out())?;
        Ok(told)
    }
}
