//! Flags of the command `scanners`.

use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct ScannersFlags {
    /// Scan files: E57, PTX, LAS, LAZ, PTS, XYZ, PLY, PCD
    #[arg(required = true, value_name = "INPUT")]
    pub(super) inputs: Vec<PathBuf>,
    /// Write the positions that were found to this file (TOML), for --scanners
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
}
