//! The command `scanners`: finds where the scanners stood that measured clouds without positions.

use super::common::Common;
use super::exit;
use super::flags::present;
use super::say::Say;
use super::scanners_flags::ScannersFlags;
use crate::job::Job;
use crate::positions::{self, CloudOrder, CloudSetups, SetupOfCloud};
use contract::words::{count, fixed};
use contract::{Error, Kind, Result, ScannerPosition, quote};
use export::atomic;
use ingest::Sources;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Exit code 3 where a cloud has points whose scanner stays unknown.
pub(super) fn scanners(flags: &ScannersFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    present(&flags.inputs)?;
    let engine = common.engine(&means)?;
    let nowhere = PathBuf::new();
    let job = Job::new(flags.inputs.clone(), nowhere.clone(), nowhere, means);
    let opened = positions::open(
        &Job { scanners: None, find_scanners: true, ..job },
        ingest::Before::default(),
        None,
        CloudOrder::Any,
        &engine,
    )?;
    let clouds = &opened.clouds;
    if let Some(out) = &flags.out {
        refuse_inputs(out, &flags.inputs)?;
        let written = atomic::write(out, file(clouds).as_bytes());
        written.map_err(|e: Error| e.at(out.display()))?;
    }
    if flags.json {
        let all = serde_json::json!({ "schema": "stillpoint.scanners/1", "clouds": clouds });
        say.result(&super::say::json(&all)?);
    } else {
        say.result(&text(&opened.sources, clouds));
    }
    let is_partial = |cloud: &CloudSetups| cloud.unknown.is_some() || cloud.entries().count() == 0;
    Ok(if clouds.iter().any(is_partial) { exit::PARTIAL } else { exit::OK })
}

/// Refuses to write over an input.
fn refuse_inputs(out: &Path, inputs: &[PathBuf]) -> Result<()> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    if inputs.iter().any(|input| real(input) == real(out)) {
        return Err(Error::new(Kind::Usage, "the file of positions would replace an input")
            .at(out.display())
            .hint("give another --out"));
    }
    Ok(())
}

/// The scanners file.
fn file(clouds: &[CloudSetups]) -> String {
    let mut text = String::from(
        "# Scanner positions that `stillpoint scanners` found in points, for --scanners. Entries may be\n\
         # edited and removed; without `sigma` a position counts as given.\n",
    );
    for cloud in clouds {
        let _ = writeln!(text, "\n# {}", quote::shown(&cloud.input));
        for setup in &cloud.setups {
            let remarks = [said(setup), setup.evidence.clone(), setup.ownership.words()];
            if setup.is_usable {
                let _ = writeln!(text, "\n{}", setup.entry.to_toml(&remarks).trim_end());
            } else {
                let _ = writeln!(text, "\n# not usable: {}", remarks.join("; "));
            }
        }
        if let Some(cause) = &cloud.unknown {
            let _ = writeln!(text, "\n# unknown: {cause}");
        }
    }
    // A file without entries is one that says so.
    if clouds.iter().all(|cloud| cloud.entries().count() == 0) {
        text.push_str("\nscanner = []\n");
    }
    text
}

/// Position with deviation, and tilt, of a setup.
fn said(setup: &SetupOfCloud) -> String {
    let at: Vec<String> = (setup.position.iter().zip(&setup.sigma))
        .map(|(at, sigma)| format!("{} ± {}", fixed(*at, 5), fixed(sigma.max(1e-5), 5)))
        .collect();
    format!("at {} m, axis {}° off the vertical", at.join(", "), fixed(setup.tilt_deg, 3))
}

fn text(sources: &Sources, clouds: &[CloudSetups]) -> String {
    let mut text = String::new();
    let stated = sources.scans.iter().filter(|s| s.scanner == ScannerPosition::Stated).count();
    if stated > 0 {
        let _ = writeln!(text, "{} with a stated position", count(stated as u64, "scan"));
    }
    for cloud in clouds {
        let n = count(cloud.setups.len() as u64, "scanner position");
        let _ = writeln!(text, "{}: {n} found", quote::shown(&cloud.input));
        for setup in &cloud.setups {
            let _ = writeln!(text, "  {}", said(setup));
            let _ = writeln!(text, "    {}", setup.evidence);
            let _ = writeln!(text, "    {}", setup.ownership.words());
        }
        if let Some(cause) = &cloud.unknown {
            let share = fixed(100.0 * (1.0 - cloud.explained), 0);
            let is_part = cloud.explained < 0.995;
            let what = format!("unknown for about {share} % of the points");
            let what = if is_part { what } else { "not for a run".to_owned() };
            let _ = writeln!(text, "  {what}: {cause}");
        }
    }
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ingest::KnownScanners;

    #[test]
    fn a_file_without_entries_reads_back() {
        assert!(KnownScanners::parse(&file(&[])).expect("reads").entries.is_empty());
    }
}
