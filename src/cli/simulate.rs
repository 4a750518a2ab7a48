//! The command `simulate`: scans a scene and writes scans and truth.

use super::common::Common;
use super::exit;
use super::flags::SimulateFlags;
use super::say::Say;
use crate::eval::virtual_scan::{Formats, read_scene, scan_scene};
use contract::words::count;
use contract::{Error, Kind, Result};
use robot::Library;

pub(super) fn simulate(flags: &SimulateFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let scene = read_scene(&flags.scene, means.settings.ingest.max_text_bytes)?;
    let models = match &flags.robots {
        Some(dir) => {
            let mut settings = means.settings.robot;
            settings.clouds = false;
            Library::load(dir, &settings)?.models
        }
        None if scene.robots.is_empty() => Vec::new(),
        None => {
            return Err(Error::new(Kind::Usage, "the scene has robots, but no library was given")
                .hint("add --robots DIR"));
        }
    };
    let truth = scan_scene(&scene, &models, &flags.out, Formats::ALL, &engine)?;
    let n_points: u64 = truth.scans.iter().map(|s| s.n_points).sum();
    say.result(&format!(
        "{}, {}, {}, written to {}",
        count(truth.scans.len() as u64, "scan"),
        count(n_points, "point"),
        count(truth.robots.len() as u64, "robot"),
        flags.out.display()
    ));
    Ok(exit::OK)
}
