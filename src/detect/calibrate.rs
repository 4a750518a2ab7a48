//! Fits in; the same with the places of their joints estimated, and the models so corrected, out:
//! for robots that their models fit poorly, where it is asked for. And results of several such runs
//! in; one corrected model out.

use super::search::Search;
use super::tools::take_models;
use crate::cache::result_of;
use crate::engine::{AllThreads, Engine, Task};
use crate::io::copy_folder;
use crate::job::MAX_TEXT;
use contract::words::count;
use contract::{Calibration, Error, Fit, Kind, Result, Verdict};
use export::RobotEntry;
use export::atomic;
use fit::Prepared;
use geometry::Pose;
use robot::Model;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The fits, each of its own model, which are added to `models`.
pub(crate) fn calibrate(
    fits: Vec<Fit>,
    models: &mut Vec<Model>,
    search: &Search<'_, '_>,
    engine: &Engine,
) -> Result<Vec<Fit>> {
    let known: &[Model] = models;
    let done = engine.fan_out(Task::new("calibrate").large(), fits, |fit| {
        // All scans are asked here, of which a robot that moved stands only in some.
        if fit.verdict == Verdict::Refused || !fit.stands_in.is_empty() {
            return Ok((fit, None));
        }
        let found = search.with_scene(&fit, |scene, settings| {
            let prepared = Prepared::new(fit.model, &known[fit.model], &AllThreads);
            fit::calibrate(&fit, &prepared, scene, settings, &AllThreads)
        })?;
        Ok(found.map_or((fit, None), |(model, fit)| (fit, Some(model))))
    })?;
    Ok(take_models(done, models))
}

/// Which robots of the results are put together.
pub struct Wanted<'a> {
    /// Name of the model; the only calibrated one where left out.
    pub model: Option<&'a str>,
    /// Ids; all of the model where empty.
    pub robots: &'a [String],
}

/// What several postures say of one robot.
pub struct Together {
    model: String,
    n_postures: usize,
    calibration: Calibration,
    /// Of each joint's zero against the controller's, and standard deviation, where readings were
    /// given.
    zeros: BTreeMap<String, [f64; 2]>,
}

/// A reading of a controller.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PostureReading {
    /// Output folder, as on the command line.
    result: PathBuf,
    /// Id of the robot in it.
    robot: String,
    /// Values, radians or metres.
    joints: BTreeMap<String, f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PostureReadings {
    #[serde(default)]
    posture: Vec<PostureReading>,
}

/// Puts together what the results say of the wanted robots; readings are a file and how many bytes
/// it may have.
///
/// # Errors
/// A result that cannot be read, robots of several models, or none that was calibrated.
pub fn together(
    results: &[PathBuf],
    wanted: &Wanted<'_>,
    readings: Option<(&Path, u64)>,
) -> Result<Together> {
    let mut robots: Vec<(PathBuf, RobotEntry)> = Vec::new();
    for path in results {
        let result = result_of(path)?;
        let is_wanted = |r: &RobotEntry| {
            r.calibration.is_some()
                && wanted.model.is_none_or(|m| m == r.model)
                && (wanted.robots.is_empty() || wanted.robots.contains(&r.id))
        };
        robots.extend(result.robots.into_iter().filter(is_wanted).map(|r| (path.clone(), r)));
    }
    let usage = |what: String, hint: &str| Err(Error::new(Kind::Usage, what).hint(hint));
    let Some((_, first)) = robots.first() else {
        return usage("no such robot was calibrated".into(), "run with --calibrate first");
    };
    let model = first.model.clone();
    if let Some((_, other)) = robots.iter().find(|r| r.1.model != model) {
        return usage(format!("robots of {model} and of {}", other.model), "name one with --model");
    }
    let own = robots.iter().filter_map(|(_, r)| r.calibration.as_ref().map(|c| c.calibration()));
    let own: Vec<Calibration> = own.collect();
    let Some(calibration) = fit::combine(&own.iter().collect::<Vec<_>>()) else {
        return usage(format!("the models of {model} have other joints"), "use one library");
    };
    let zeros =
        readings.map(|(file, most)| zeros(file, most, &robots)).transpose()?.unwrap_or_default();
    Ok(Together { model, n_postures: own.len(), calibration, zeros })
}

/// Offsets of joints' zeros: weighted means of what was found less what was read.
fn zeros(
    file: &Path,
    most: u64,
    robots: &[(PathBuf, RobotEntry)],
) -> Result<BTreeMap<String, [f64; 2]>> {
    let bad = |e: String| Error::bad_input(e).at(file.display());
    let text = ingest::read_text(file, most, MAX_TEXT)?;
    let readings: PostureReadings = toml::from_str(&text).map_err(|e| bad(e.to_string()))?;
    let mut sums: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for reading in &readings.posture {
        let is_it = |r: &&(PathBuf, RobotEntry)| r.0 == reading.result && r.1.id == reading.robot;
        let Some((_, robot)) = robots.iter().find(is_it) else {
            let what = format!("there is no {} in {}", reading.robot, reading.result.display());
            return Err(bad(what).hint("name results as on the command line"));
        };
        for ((name, value), (_, sigma)) in robot.joints.0.iter().zip(&robot.sigma.0) {
            let Some(read) = reading.joints.get(name) else { continue };
            let weight = sigma.powi(-2);
            let sum = sums.entry(name.clone()).or_default();
            sum[0] += weight * (value - read);
            sum[1] += weight;
        }
    }
    Ok(sums.into_iter().map(|(name, [s, w])| (name, [s / w, w.sqrt().recip()])).collect())
}

impl Together {
    /// Writes the corrected model into a library: the folder of the given library's model, with the
    /// joints of its URDF moved, under its own name in `out`.
    ///
    /// # Errors
    /// No such model in the library, a folder that is there already or cannot be written, or a URDF
    /// outside its folder.
    pub fn write(&self, library: &Path, out: &Path) -> Result<()> {
        let from = library.join(&self.model);
        let from = from.canonicalize().map_err(|e| Error::from(e).at(from.display()))?;
        let urdf = robot::urdf_of(&from)?;
        let moves: Vec<(String, Pose)> =
            self.calibration.frames.iter().map(|f| (f.name.clone(), f.moved())).collect();
        let at = |e: Error| e.at(urdf.display());
        let text = robot::urdf_text(&urdf)?;
        let corrected = robot::correct(&text, &moves).map_err(at)?;
        let Ok(inside) = urdf.strip_prefix(&from) else {
            let what = format!("the model's URDF is not in its folder {}", from.display());
            return Err(at(Error::bad_input(what).hint("copy it there and name it in robot.toml")));
        };
        copy_folder::copy_as_new(&from, &out.join(&self.model), |made| {
            atomic::write(&made.join(inside), corrected.as_bytes())
        })
    }

    /// For people.
    #[must_use]
    pub fn words(&self, out: &Path) -> String {
        let mut text =
            format!("{} from {}\n", self.model, count(self.n_postures as u64, "posture"));
        for f in &self.calibration.frames {
            let ([offset, offset_sigma], [swing, swing_sigma]) = (f.offset(), f.swing());
            let _ = writeln!(
                text,
                "  {:<24} axis beside the model's {:>6.2} ± {:.2} mm, leans {:>6.3} ± {:.3}°",
                f.name,
                offset * 1e3,
                offset_sigma * 1e3,
                swing.to_degrees(),
                swing_sigma.to_degrees()
            );
        }
        for (name, [zero, sigma]) in &self.zeros {
            let slides = self.calibration.frames.iter().any(|f| f.name == *name && f.slides);
            let (factor, unit) = if slides { (1e3, " mm") } else { (1_f64.to_degrees(), "°") };
            let _ = writeln!(
                text,
                "  {name:<24} zero off by {:>7.3} ± {:.3}{unit}",
                zero * factor,
                sigma * factor
            );
        }
        let (folder, library) = (out.join(&self.model), out.display());
        let _ = writeln!(text, "corrected model in {}: give --robots {library}", folder.display());
        text
    }
}
