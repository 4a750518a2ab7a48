//! Loads the models of a robot library in parallel.

use super::robots::RobotList;
use crate::cache::Cache;
use crate::engine::{AllThreads, Engine};
use contract::{Error, Fit, Result};
use robot::{Library, Model, Settings};
use std::path::Path;

/// Number of models in a library, loadable or not.
pub(crate) fn count(dir: &Path) -> Result<usize> {
    Ok(Library::open(dir)?.0.len())
}

/// Total size of the files of all models, bytes. Unreadable files count as zero, and links are not
/// followed.
pub(crate) fn bytes(dir: &Path) -> u64 {
    let (mut sum, mut folders) = (0, Library::open(dir).map(|opened| opened.0).unwrap_or_default());
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            match entry.metadata() {
                Ok(meta) if meta.is_dir() => folders.push(entry.path()),
                Ok(meta) if meta.is_file() => sum += meta.len(),
                _ => {}
            }
        }
    }
    sum
}

/// Loads all models, from the cache `kept` where they are in it. Models that cannot be loaded are
/// explained in the library's findings.
pub(crate) fn load(
    dir: &Path,
    settings: &Settings,
    kept: Option<&Cache>,
    engine: &Engine,
) -> Result<Library> {
    load_those(dir, |_| true, settings, kept, engine)?.checked(dir)
}

/// Like [`load`], for models with these names only; none of them may exist.
pub(crate) fn load_those(
    dir: &Path,
    is_wanted: impl Fn(&str) -> bool,
    settings: &Settings,
    kept: Option<&Cache>,
    engine: &Engine,
) -> Result<Library> {
    let (mut folders, mut library) = Library::open(dir)?;
    folders.retain(|folder| is_wanted(&folder.file_name().unwrap_or_default().to_string_lossy()));
    let loaded = engine.fan_out("robots", folders, |folder| {
        let load = || {
            let bare = Settings { clouds: false, ..*settings };
            let (mut model, findings) = Library::load_folder(dir, &folder, &bare);
            // A library has few models, and one is the largest: its links are sampled in parallel.
            if let (Some(model), true) = (&mut model, settings.clouds) {
                model.sample(settings, &AllThreads);
            }
            Ok((model, findings))
        };
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        kept.map_or_else(load, |kept| kept.get_or_compute(&name, load))
    })?;
    for (model, findings) in loaded {
        library.add(model, findings);
    }
    Ok(library)
}

/// The robots of an earlier result, with their models rebuilt from a library: those with tools,
/// with loops in another solution, or calibrated.
///
/// # Errors
/// The library no longer has a model of the result.
pub(crate) fn robots_of(mut fits: Vec<Fit>, library: &Library) -> Result<RobotList> {
    let mut models = library.models.clone();
    fits.iter_mut().try_for_each(|fit| own_model(fit, library, &mut models))?;
    Ok(RobotList { fits, models })
}

/// Sets the model of a fit and of the same robot in other scans; a model that is not in the library
/// is appended to `models`.
fn own_model(fit: &mut Fit, library: &Library, models: &mut Vec<Model>) -> Result<()> {
    let missing = |name: &str| {
        let what =
            format!("the library has no model \"{name}\", which the earlier result refers to");
        Error::bad_input(what).hint("give the library of the earlier run with --robots")
    };
    let known = |name: &str| library.model(name).ok_or_else(|| missing(name));
    fit.model = known(&fit.model_name)?;
    let mut own = (!fit.other_branches.is_empty())
        .then(|| models[fit.model].with_other_branches(&fit.other_branches));
    if let Some(tool) = &fit.tool {
        let arm = own.as_ref().unwrap_or(&models[fit.model]);
        let flange = arm.links.iter().position(|l| l.name == tool.link).ok_or_else(|| {
            let what = format!("model \"{}\" has no link \"{}\"", arm.name, tool.link);
            Error::bad_input(what).hint("give the library of the earlier run with --robots")
        })?;
        own = Some(arm.with_tool(&models[known(&tool.model)?], flange, tool.mount));
    }
    if let Some(found) = &fit.calibration {
        let own = own.get_or_insert_with(|| models[fit.model].clone());
        for joint in &mut own.joints {
            if let Some(frame) = found.frames.iter().find(|f| f.name == joint.name) {
                joint.parent_from_joint *= frame.moved();
            }
        }
    }
    if let Some(own) = own {
        fit.model = models.len();
        models.push(own);
    }
    fit.stays.iter_mut().try_for_each(|stay| own_model(stay, library, models))
}
