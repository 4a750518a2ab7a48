//! The command `inspect`: prints the contents of inputs, and which missing data make results worse.

use super::common::Common;
use super::exit;
use super::flags::{InspectFlags, present};
use super::say::Say;
use crate::engine::AllThreads;
use contract::Result;
use ingest::KnownScanners;

pub(super) fn inspect(flags: &InspectFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    present(&flags.inputs)?;
    let scanners =
        common.scanners(&means).map(|path| KnownScanners::read(&path, &means.settings.ingest));
    let sources = ingest::open(
        &flags.inputs,
        scanners.transpose()?.as_ref(),
        &means.settings.ingest,
        &AllThreads,
    )?;
    let descriptions = ingest::describe(&sources, &AllThreads);
    if flags.json {
        let all = serde_json::json!({
            "schema": "stillpoint.inspect/1",
            "inputs": descriptions,
            "warnings": sources.warnings,
        });
        say.result(&super::say::json(&all)?);
    } else {
        let texts: Vec<String> = descriptions.iter().map(ToString::to_string).collect();
        say.result(&texts.join("\n"));
        for warning in &sources.warnings {
            say.warning(warning);
        }
    }
    sources.check_sizes()?;
    Ok(exit::OK)
}
