//! The command `config print`: settings as they would be used, and where each comes from.

use super::common::Common;
use super::exit;
use super::program_flags::ConfigPrintFlags;
use super::say::Say;
use contract::Result;

pub(super) fn print(flags: &ConfigPrintFlags, common: &Common, say: &Say) -> Result<u8> {
    say.result(&common.means()?.as_toml(flags.origin, flags.changed));
    Ok(exit::OK)
}
