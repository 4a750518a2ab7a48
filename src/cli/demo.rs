//! The command `demo`: prints what was found in a virtual cell and how it compares with the truth.

use super::common::Common;
use super::exit;
use super::flags::DemoFlags;
use super::say::Say;
use crate::eval::demo;
use contract::Result;

pub(super) fn demo(flags: &DemoFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let outcome = demo::run(flags.out.as_deref(), flags.beams, &means, &engine)?;
    say.outcome(&outcome);
    Ok(if outcome.partial { exit::PARTIAL } else { exit::OK })
}
