//! The pictures of robots before points are drawn in them.

use super::labelling::Labelling;
use crate::cache::Cache;
use crate::detect::robots::poses;
use crate::engine::{AllThreads, Engine};
use contract::Result;
use export::RobotPicture;

impl<'a> Labelling<'a> {
    /// Takes the outlines of robots from the store, where another process has drawn them, or keeps
    /// them there.
    #[must_use]
    pub(crate) fn keeping(mut self, outlines: &'a Cache) -> Self {
        self.outlines = Some(outlines);
        self
    }

    pub(super) fn robot_pictures(
        &self,
        chosen: &[usize],
        engine: &Engine,
    ) -> Result<Vec<RobotPicture>> {
        engine.each(chosen.to_vec(), |i| {
            let (fit, robot) = (&self.fits[i], i as i16);
            let model = &self.models[fit.model];
            let poses = poses(fit, model);
            let new = || RobotPicture::new(robot, model, &poses, &AllThreads);
            let Some(kept) = self.outlines else { return Ok(new()) };
            let known = kept.get_or_compute(&format!("outline {i}"), || Ok(new().outlines()))?;
            RobotPicture::outlined(robot, model, &poses, &known)
        })
    }
}
