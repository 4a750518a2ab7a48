//! The command `inspect`: prints the contents of inputs, and which missing data make results worse.

use super::common::Common;
use super::exit;
use super::flags::{InspectFlags, present};
use super::say::Say;
use crate::engine::AllThreads;
use crate::job::Job;
use crate::positions::{self, CloudOrder};
use contract::Result;
use ingest::Before;
use std::path::PathBuf;

pub(super) fn inspect(flags: &InspectFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    present(&flags.inputs)?;
    let (scanners, nowhere) = (common.scanners(&means), PathBuf::new());
    let engine = common.engine(&means)?;
    let job = Job::new(flags.inputs.clone(), nowhere.clone(), nowhere, means);
    // A look at headers takes no time: only a person who asks for it waits for more.
    let job = Job { scanners, find_scanners: common.asks_for_scanners(), ..job };
    let sources =
        positions::open(&job, Before::default(), None, CloudOrder::Used, &engine)?.sources;
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
