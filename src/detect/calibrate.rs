//! Calibration of joint axes for robots that their models fit poorly, on request: each such fit
//! gets a corrected model of its own. Results of several runs can be combined to one corrected
//! model.

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

/// Calibrates each fit. A calibrated fit refers to a corrected model, which is appended to
/// `models`.
pub(crate) fn calibrate(
    fits: Vec<Fit>,
    models: &mut Vec<Model>,
    search: &Search<'_, '_>,
    engine: &Engine,
) -> Result<Vec<Fit>> {
    let known: &[Model] = models;
    let done = engine.fan_out(Task::new("calibrate").large(), fits, |fit| {
        // Calibration uses all scans, and a robot that moved stands at this posture only in some of
        // them.
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

/// Which robots of the results are combined.
pub struct WantedRobots<'a> {
    /// Name of the model; `None` for the only calibrated model.
    pub model: Option<&'a str>,
    /// Ids of the robots; all robots of the model where empty.
    pub robots: &'a [String],
}

/// Joint corrections of one robot, combined from several postures.
pub struct CombinedCalibration {
    model: String,
    n_postures: usize,
    calibration: Calibration,
    /// Offset of each joint's zero from the controller's, and its standard deviation, radians or
    /// metres, where readings were given.
    zeros: BTreeMap<String, [f64; 2]>,
}

/// Joint values that a controller has shown for one posture.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PostureReading {
    /// Output folder of the result, as on the command line.
    result: PathBuf,
    /// Id of the robot in that result.
    robot: String,
    /// Joint values by name, radians or metres.
    joints: BTreeMap<String, f64>,
}

/// What a controller has shown, posture by posture.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PostureReadings {
    /// The postures.
    #[serde(default)]
    posture: Vec<PostureReading>,
}

/// Combines the corrections that the results contain for the wanted robots. `readings` is a file
/// and the most bytes that it may have.
///
/// # Errors
/// A result that cannot be read, robots of several models, or none that was calibrated.
pub fn combine(
    results: &[PathBuf],
    wanted: &WantedRobots<'_>,
    readings: Option<(&Path, u64)>,
) -> Result<CombinedCalibration> {
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
        return usage(
            "no result has a calibrated robot as wanted".into(),
            "run with --calibrate first",
        );
    };
    let model = first.model.clone();
    if let Some((_, other)) = robots.iter().find(|r| r.1.model != model) {
        return usage(
            format!("the results have calibrated robots of {model} and of {}", other.model),
            "name one with --model",
        );
    }
    let own = robots.iter().filter_map(|(_, r)| r.calibration.as_ref().map(|c| c.calibration()));
    let own: Vec<Calibration> = own.collect();
    let Some(calibration) = fit::combine(&own.iter().collect::<Vec<_>>()) else {
        return usage(
            format!("the models of {model} differ in their joints between the results"),
            "make all results with the same robot library",
        );
    };
    let zeros =
        readings.map(|(file, most)| zeros(file, most, &robots)).transpose()?.unwrap_or_default();
    Ok(CombinedCalibration { model, n_postures: own.len(), calibration, zeros })
}

/// Offsets of the joints' zeros: weighted means of fitted value less reading.
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
            let what =
                format!("there is no robot {} in {}", reading.robot, reading.result.display());
            return Err(bad(what).hint("name the results in the readings as on the command line"));
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

impl CombinedCalibration {
    /// Writes the corrected model to a library: a copy of the model's folder, with the joints of
    /// its URDF corrected, under its own name in `out`.
    ///
    /// # Errors
    /// The library has no such model, the folder exists already or cannot be written, or the URDF
    /// lies outside of its folder.
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
            let what =
                format!("the URDF of the model lies outside of its folder {}", from.display());
            return Err(at(Error::bad_input(what).hint("copy it there and name it in robot.toml")));
        };
        copy_folder::copy_as_new(&from, &out.join(&self.model), |made| {
            atomic::write(&made.join(inside), corrected.as_bytes())
        })
    }

    /// The corrections as text for people.
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
