//! `run`: flags in, the main job done.

use super::flags::{Common, RunFlags, present};
use super::say::Say;
use crate::{exit, job::Job, plan};
use contract::Result;

pub(super) fn run(flags: &RunFlags, common: &Common, say: &Say) -> Result<u8> {
    let mut means = common.means()?;
    means.settings.fit.calibrate |= flags.calibrate;
    present(&flags.inputs)?;
    let engine = common.engine(&means)?;
    let job = Job {
        inputs: flags.inputs.clone(),
        robots: flags.robots.clone(),
        scanners: common.scanners(&means),
        out: flags.out.clone(),
        review: flags.review.clone(),
        means,
    };
    let outcome = plan::run(&job, &engine)?;
    for warning in &outcome.warnings {
        say.warning(warning);
    }
    say.result(&outcome.summary);
    Ok(if outcome.partial { exit::PARTIAL } else { exit::OK })
}
