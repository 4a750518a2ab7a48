//! The commands `robots lint`, which reports faults of a library, and `robots calibrate`, which
//! writes a corrected model.

use super::common::Common;
use super::exit;
use super::flags::{CalibrateFlags, LintFlags};
use super::say::Say;
use crate::detect::calibrate::{WantedRobots, combine};
use contract::words::count;
use contract::{Kind, Result, quote};
use robot::{Finding, Library, Severity};

/// Exit code 4 where a model cannot be used, else 0.
pub(super) fn lint(flags: &LintFlags, common: &Common, say: &Say) -> Result<u8> {
    let findings = Library::lint(&flags.dir, &common.means()?.settings.robot);
    let of = |s: Severity| findings.iter().filter(|f| f.severity == s).count();
    let [errors, warnings, notes] = [Severity::Error, Severity::Warning, Severity::Note].map(of);
    if flags.json {
        let list: Vec<_> = findings.iter().map(json).collect();
        let all = serde_json::json!({
            "schema": "stillpoint.lint/1",
            "library": flags.dir.display().to_string(),
            "errors": errors, "warnings": warnings, "notes": notes,
            "findings": list,
        });
        say.result(&super::say::json(&all)?);
    } else {
        let mut text: String = findings.iter().map(|f| words(f) + "\n").collect();
        let counts = [(errors, "error"), (warnings, "warning"), (notes, "note")];
        text += &counts.map(|(n, noun)| count(n as u64, noun)).join(", ");
        say.result(&text);
    }
    Ok(if errors > 0 { exit::code(Kind::BadInput) } else { exit::OK })
}

/// Combines the calibrations of some results.
pub(super) fn calibrate(flags: &CalibrateFlags, common: &Common, say: &Say) -> Result<u8> {
    let wanted = WantedRobots { model: flags.model.as_deref(), robots: &flags.robot };
    let most = common.means()?.settings.ingest.max_text_bytes;
    let readings = flags.readings.as_deref().map(|file| (file, most));
    let found = combine(&flags.results, &wanted, readings)?;
    found.write(&flags.robots, &flags.out)?;
    say.result(&found.words(&flags.out));
    Ok(exit::OK)
}

fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Note => "note",
    }
}

fn words(finding: &Finding) -> String {
    let mut text = word(finding.severity).to_owned();
    for part in [&finding.model, &finding.place, &finding.what] {
        if !part.is_empty() {
            text += &format!(": {}", quote::shown(part));
        }
    }
    if !finding.way_out.is_empty() {
        text += &format!("; {}", finding.way_out);
    }
    text
}

fn json(finding: &Finding) -> serde_json::Value {
    serde_json::json!({
        "model": finding.model,
        "severity": word(finding.severity),
        "what": finding.what,
        "place": finding.place,
        "way_out": finding.way_out,
    })
}
