//! The commands `verify`, `report`, `export`, `check`, `diff` and `history`, which read results of
//! earlier runs.

use super::common::Common;
use super::exit;
use super::flags::{
    CheckFlags, DiffFlags, ExportFlags, HistoryFlags, MeshFlags, OutFlags, ReportFlags,
};
use super::say::Say;
use crate::cache::{Manifest, VerifiedFiles, result_of};
use crate::check::{CheckRequest, PathOutcome as Clear};
use crate::job::Outcome;
use crate::result::changed_things::ThingEntry;
use crate::result::changes::{changes, words};
use crate::result::conversion::{ExportFormat, convert};
use crate::result::history;
use crate::result::mesh_build::BOUNDS;
use crate::result::mesh_export::{MeshFormat, MeshRequest, Published, export_mesh};
use crate::result::page::{page_data, write_page, write_page_with_run};
use crate::result::scans_back::{ScansBack, give_scans_back};
use crate::result::scene_export::{SceneFormat, SceneRequest, export_scene};
use crate::result::text_report::text_report;
use crate::{cache, check};
use contract::words::count;
use contract::{Error, Format, Kind, Result};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

pub(super) fn verify(flags: &OutFlags, common: &Common, say: &Say) -> Result<u8> {
    let engine = common.engine(&common.means()?)?;
    let checked = cache::check(&flags.out, &engine)?;
    let n_files = checked.manifest.files.len();
    let n_bytes: u64 = checked.manifest.files.iter().map(|f| f.n_bytes).sum();
    match checked.wrong.split_first() {
        None => {
            let (files, list) = (count(n_files as u64, "file"), &checked.digest);
            let bytes = count(n_bytes, "byte");
            say.result(&format!("{files}, {bytes}: as they were written\nlist of them: {list}"));
            Ok(exit::OK)
        }
        Some((first, others)) => {
            others.iter().for_each(|wrong| say.warning(wrong));
            let wrong = others.len() + 1;
            let verb = if wrong == 1 { "is" } else { "are" };
            let files = count(n_files as u64, "file");
            Err(Error::bad_input(first.clone())
                .because(format!("{wrong} of {files} {verb} wrong"))
                .hint("run the same job again: what is whole is used again, the rest made anew"))
        }
    }
}

pub(super) fn report(flags: &ReportFlags, common: &Common, say: &Say) -> Result<u8> {
    let files = VerifiedFiles::open(&flags.out)?;
    if let Some(path) = &flags.junit {
        export::write_junit(path, &files.result()?, files.manifest().partial)?;
    }
    let Manifest { warnings, partial, .. } = files.manifest().clone();
    let mut summary = text_report(&flags.out, &files)?;
    if flags.html {
        let means = common.means()?;
        let page = write_page(&flags.out, &means, &common.engine(&means)?)?;
        summary = format!("{}\npage in {}", summary.trim_end(), page.display());
    }
    if let Some(to) = &flags.page {
        refuse_own_files(&files, &flags.out, to)?;
        let means = common.means()?;
        write_page_with_run(&flags.out, to, &means, &common.engine(&means)?)?;
        summary = format!("{}\npage in {}", summary.trim_end(), to.display());
    }
    if flags.json {
        let means = common.means()?;
        say.result(&page_data(&flags.out, &means, &common.engine(&means)?)?);
    } else {
        say.outcome(&Outcome { summary, warnings, partial, ..Outcome::default() });
    }
    Ok(if partial { exit::PARTIAL } else { exit::OK })
}

/// Refuses a file of the result as the place of a page: `verify` would find it changed.
fn refuse_own_files(files: &VerifiedFiles, out: &Path, to: &Path) -> Result<()> {
    let whole = |path: &Path| path.canonicalize().ok();
    let is_own = |file: &str| whole(to).is_some_and(|to| whole(&out.join(file)) == Some(to));
    match files.manifest().files.iter().find(|file| is_own(&file.path)) {
        None => Ok(()),
        Some(own) => Err(Error::new(Kind::Usage, "this is a file of the result")
            .at(format!("{}, {}", to.display(), own.path))
            .hint("give --page another name, for example page.html")),
    }
}

pub(super) fn export(flags: &ExportFlags, common: &Common, say: &Say) -> Result<u8> {
    let scene = flags.to.scene();
    flags_fit(flags, scene)?;
    let means = common.means()?;
    let engine = common.engine(&means)?;
    if let Some(format) = flags.to.scans() {
        let request = ScansBack {
            out: flags.out.clone(),
            format,
            inputs: flags.inputs.clone(),
            drops: flags.drop_moving,
            says_labels: !flags.without_labels,
        };
        let (written, notes) = give_scans_back(&request, &means, &engine)?;
        notes.iter().for_each(|note| engine.progress.say(note));
        return Ok(say_paths(&written, "", say));
    }
    let mut words = String::new();
    let written = match scene {
        Some(format) => {
            let request = SceneRequest {
                out: flags.out.clone(),
                format,
                robots: flags.robots.clone(),
                package: flags.package.clone(),
            };
            let (written, notes) = export_scene(&request, &means, &engine)?;
            notes.iter().for_each(|note| say.warning(note));
            written
        }
        None if flags.to == ExportFormat::Mesh => {
            let find_robots = |published: Published<'_>| {
                check::robot_surfaces(published, flags.robots.as_deref(), &means, &engine)
            };
            let mesh = export_mesh(&mesh_request(flags)?, find_robots, &engine)?;
            mesh.warnings.iter().for_each(|warning| say.warning(warning));
            words = mesh.words;
            mesh.paths
        }
        None => convert(&flags.out, flags.to, &engine)?,
    };
    Ok(say_paths(&written, &words, say))
}

/// Says which files were written, with a word on what is in them.
fn say_paths(written: &[PathBuf], words: &str, say: &Say) -> u8 {
    let names = written.iter().map(|path| path.display().to_string());
    let lines: Vec<String> = names.chain((!words.is_empty()).then(|| words.to_owned())).collect();
    say.result(&lines.join("\n"));
    exit::OK
}

/// The mesh that flags ask for.
fn mesh_request(flags: &ExportFlags) -> Result<MeshRequest> {
    let MeshFlags { bound, triangles, mesh_format, robot, unknown, convex } = &flags.mesh;
    let bound = bound.unwrap_or(BOUND);
    let [low, high] = BOUNDS;
    if !(low..=high).contains(&bound) {
        let what = format!("a bound of {bound} m is not possible");
        return Err(Error::new(Kind::Usage, what).hint(format!("give metres, {low} to {high}")));
    }
    if *triangles == Some(0) {
        let what = "a mesh of no triangles covers nothing";
        return Err(Error::new(Kind::Usage, what).hint("give a number from 1 on"));
    }
    Ok(MeshRequest {
        out: flags.out.clone(),
        bound,
        triangles: *triangles,
        format: mesh_format.unwrap_or(MeshFormat::Stl),
        robot: robot.clone(),
        with_unknown: *unknown,
        with_convex: *convex,
    })
}

/// Bound of a mesh where none is given, metres: about the noise of a scan and its registration.
const BOUND: f64 = 0.01;

/// Refuses flags of scenes and meshes where none of them is written, and names that no ROS package
/// has.
fn flags_fit(flags: &ExportFlags, scene: Option<SceneFormat>) -> Result<()> {
    let usage = |what: String, hint: &str| Err(Error::new(Kind::Usage, what).hint(hint));
    let scans = flags.to.scans();
    if scans.is_none() && flags.inputs.is_some() {
        return usage("--inputs is for e57 and ptx".into(), "leave it out for this format");
    }
    if scans != Some(Format::E57) && (flags.drop_moving || flags.without_labels) {
        let what = "--drop-moving and --without-labels are for e57";
        return usage(
            what.into(),
            "leave them out for this format: a PTX has a line for each beam",
        );
    }
    if scene.is_none() && flags.to != ExportFormat::Mesh && flags.robots.is_some() {
        return usage("--robots is for scenes and meshes".into(), "leave it out for this format");
    }
    let MeshFlags { bound, triangles, mesh_format, robot, unknown, convex } = &flags.mesh;
    let has_any = bound.is_some() || triangles.is_some() || mesh_format.is_some();
    if flags.to != ExportFormat::Mesh && (has_any || robot.is_some() || *unknown || *convex) {
        let what = "--bound, --triangles, --mesh-format, --robot, --unknown and --convex are for \
                    meshes";
        return usage(what.into(), "leave them out for this format, or give --to mesh");
    }
    let Some(name) = &flags.package else { return Ok(()) };
    if !scene.is_some_and(SceneFormat::has_urdfs) {
        let what = "--package is for formats with URDFs: urdf, srdf, moveit";
        return usage(what.into(), "leave it out for this format");
    }
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(fits) {
        return Ok(());
    }
    let what = format!("\"{name}\" is no name of a ROS package");
    usage(what, "a letter, then letters, digits, _ and -, as in cell_description")
}

/// Checks paths. The exit code is 0 for paths that are free apart from allowed doubts, 1 where one
/// has an obstacle, and 3 where that of one is not known and none has an obstacle.
pub(super) fn check_paths(flags: &CheckFlags, common: &Common, say: &Say) -> Result<u8> {
    if !(flags.margin.is_finite() && (0.0..=MAX_MARGIN).contains(&flags.margin)) {
        return Err(Error::new(
            Kind::Usage,
            format!("a margin of {} m is not possible", flags.margin),
        )
        .hint(format!("give metres, 0 to {MAX_MARGIN}")));
    }
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let request = CheckRequest {
        out: flags.out.clone(),
        trajectories: [&flags.trajectory[..], &flags.more[..]].concat(),
        robot: flags.robot.clone(),
        robots: flags.robots.clone(),
        margin: flags.margin,
        degrees: flags.degrees,
    };
    let reports = check::check(&request, &means, &engine)?;
    let mut told = BTreeSet::new();
    let warnings = reports.iter().flat_map(|report| &report.warnings);
    warnings.filter(|warning| told.insert(*warning)).for_each(|warning| say.warning(warning));
    let (all, allowed) = (&reports[..], &flags.allow[..]);
    say.result(&if flags.json {
        json(&check::json(all, allowed))?
    } else {
        check::words(all, allowed)
    });
    let (passing, failing): (Vec<_>, Vec<_>) = all.iter().partition(|r| r.passes(allowed));
    let is_blocked = failing.iter().any(|r| r.outcome > Clear::Unknown);
    Ok(match (passing.len() == all.len(), is_blocked) {
        (true, _) => exit::OK,
        (false, true) => exit::NO,
        (false, false) => exit::PARTIAL,
    })
}

/// Largest margin, metres.
const MAX_MARGIN: f64 = 1.0;

pub(super) fn history(flags: &HistoryFlags, say: &Say) -> Result<u8> {
    for name in &flags.remove {
        history::remove(&flags.folder, name)?;
    }
    let found = history::sessions(&flags.folder)?;
    // A folder whose last session was just removed may be empty.
    if found.sessions.is_empty() && found.damaged.is_empty() && flags.remove.is_empty() {
        return Err(history::no_results(&flags.folder));
    }
    found.damaged.iter().for_each(|damaged| say.warning(damaged));
    let sessions = &found.sessions;
    say.result(&if flags.json { json(sessions)? } else { history::words(sessions) });
    Ok(if found.damaged.is_empty() { exit::OK } else { exit::PARTIAL })
}

pub(super) fn diff(flags: &DiffFlags, say: &Say) -> Result<u8> {
    let (then, now) = (result_of(&flags.then)?, result_of(&flags.now)?);
    let changes = changes(&then, &now);
    // If one result started from the other, its list of changes has more than robots.
    let digest = VerifiedFiles::open(&flags.then).ok().map(|files| files.digest().to_owned());
    let goes_on = digest.is_some() && now.rescan.as_ref().map(|r| &r.base) == digest.as_ref();
    let things = if goes_on { things(&flags.now)? } else { Vec::new() };
    if flags.json {
        let all = serde_json::json!({
            "schema": "stillpoint.diff/1", "robots": changes, "things": things,
        });
        say.result(&json(&all)?);
    } else {
        let lines = things.iter().enumerate().map(|(k, thing)| thing.words(k) + "\n");
        say.result(&(words(&changes) + &lines.collect::<String>()));
    }
    Ok(exit::OK)
}

/// Bodies that changed, as a rescan has listed them.
fn things(out: &Path) -> Result<Vec<ThingEntry>> {
    #[derive(serde::Deserialize)]
    struct Changes {
        things: Vec<ThingEntry>,
    }
    const NAME: &str = "changes.json";

    let text = VerifiedFiles::open(out)?.bytes(NAME)?;
    let all: Changes = serde_json::from_slice(&text).map_err(|e| {
        let bad = Error::bad_input("the list of changes cannot be read").because(e);
        bad.at(out.join(NAME).display())
    })?;
    Ok(all.things)
}

fn json(value: &impl serde::Serialize) -> Result<String> {
    super::say::json(value)
}
