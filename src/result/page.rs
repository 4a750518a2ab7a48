//! Makes the page of a published result: reads its files, each compared with the list of files, and
//! hands them to the stage that writes pages.

use super::plant_state::PlantState;
use super::run_record::RunRecord;
use crate::cache::{PAGE, RESULT, VerifiedFiles};
use crate::detect::library;
use crate::detect::robots::RobotList;
use crate::engine::{Amount, Engine};
use crate::io::own_paths::without_links;
use crate::job::{Job, Means};
use crate::label::page_parts::{self, TileReader};
use contract::{Error, Fit, Kind, Result, Verdict};
use export::{BasePose, InputEntry, ResultFile, RobotEntry, WrittenBodies};
use geometry::Pose;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use report_page::{PageLoop, PagePoints, PageRobot, PageScanner, PageTexts, ReportPage};
use robot::Model;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// A published result of which a page is made.
pub(crate) struct ReportedResult<'a> {
    out: &'a Path,
    files: &'a VerifiedFiles,
    result: ResultFile,
    state: PlantState,
    means: &'a Means,
    engine: &'a Engine,
    /// Times, rates and memory of the run, where they are to stand on the page.
    run: Vec<(String, String)>,
    /// Files with the points of parts, where other processes have read the tiles.
    parts: &'a [PathBuf],
}

impl<'a> ReportedResult<'a> {
    /// Opens a result.
    ///
    /// # Errors
    /// A file that is missing or was changed.
    pub(crate) fn open(
        out: &'a Path,
        files: &'a VerifiedFiles,
        means: &'a Means,
        engine: &'a Engine,
    ) -> Result<Self> {
        let (result, state) = (files.result()?, PlantState::read(files)?);
        Ok(Self { out, files, result, state, means, engine, run: Vec::new(), parts: &[] })
    }

    /// The same with times, rates and memory of its run, as far as their record is there.
    fn with_run(mut self) -> Self {
        let record = RunRecord::of_result(self.out, self.files.digest());
        self.run = record.map(|record| record.words()).unwrap_or_default();
        self
    }

    /// The data of the page as JSON, without points.
    ///
    /// # Errors
    /// A file that is missing or was changed.
    pub(crate) fn data(&self) -> Result<String> {
        ReportPage::new(self.texts()?, self.scanners()).data(None)
    }

    /// Writes the page beside the result and returns its path.
    ///
    /// # Errors
    /// A file that is missing or was changed, or the page cannot be written.
    pub(crate) fn write(&self) -> Result<PathBuf> {
        let to = without_links(self.out, PAGE)?;
        export::atomic::write(&to, self.html()?.as_bytes())?;
        Ok(to)
    }

    fn html(&self) -> Result<String> {
        let mut page = ReportPage::new(self.texts()?, self.scanners());
        let loops = self.loops();
        for entry in &self.result.robots {
            self.engine.cancel.check()?;
            page.add_robot(self.robot(entry, &loops)?);
        }
        self.add_pictures(&mut page)?;
        let mut points = page.points(page_parts::middle(&self.state.fits));
        self.add_points(&mut points)?;
        self.add_spaces(&mut points)?;
        page.html(&points)
    }

    fn texts(&self) -> Result<PageTexts> {
        let text = |name: &str| -> Result<String> {
            String::from_utf8(self.files.bytes(name)?)
                .map_err(|e| Error::bad_input("file is not text").because(e).at(name))
        };
        let changes = self.result.rescan.as_ref().map(|rescan| text(&rescan.changes));
        let manifest = self.files.manifest();
        Ok(PageTexts {
            title: title(&self.result.inputs),
            program: env!("CARGO_PKG_VERSION").into(),
            result: text(RESULT)?,
            changes: changes.transpose()?,
            summary: manifest.summary.clone(),
            is_partial: manifest.partial,
            run: self.run.clone(),
        })
    }

    /// The positions of scanners that are known.
    fn scanners(&self) -> Vec<PageScanner> {
        let known = self.state.scans.iter().filter(|scan| scan.has_beams());
        let of = |scan: &contract::Scan| PageScanner {
            name: scan.name.clone(),
            at: scan.world_from_scan.translation.vector.into(),
        };
        known.map(of).collect()
    }

    /// The closed loops of each robot by its index, as far as the library of the run is still
    /// there: a URDF cannot state them.
    fn loops(&self) -> HashMap<usize, Vec<PageLoop>> {
        let stands = |(_, fit): &(usize, Fit)| fit.verdict != Verdict::Refused;
        let fits = self.state.fits.iter().cloned().enumerate().filter(stands);
        let (numbers, fits): (Vec<usize>, Vec<Fit>) = fits.unzip();
        let is_wanted = |name: &str| {
            let is_it = |fit: &Fit| {
                fit.model_name == name || fit.tool.as_ref().is_some_and(|tool| tool.model == name)
            };
            fits.iter().any(is_it)
        };
        let settings = robot::Settings { clouds: false, ..self.means.settings.robot };
        let library =
            library::load_those(&self.state.robots, is_wanted, &settings, None, self.engine);
        let list = library.and_then(|library| library::robots_of(fits.clone(), &library));
        let Ok(RobotList { fits, models }) = list else { return HashMap::new() };
        let loops = fits.iter().map(|fit| PageLoop::of(&models[fit.model]));
        numbers.into_iter().zip(loops).collect()
    }

    /// A robot as the result holds it; `None` for one without a model.
    fn robot(
        &self,
        entry: &RobotEntry,
        loops: &HashMap<usize, Vec<PageLoop>>,
    ) -> Result<Option<PageRobot>> {
        let folder = format!("robots/{}/", entry.id);
        let urdf = format!("{folder}robot.urdf");
        if !self.files.has(&urdf) || entry.link_poses.0.is_empty() {
            return Ok(None);
        }
        let own = self.files.manifest().files.iter().map(|file| file.path.as_str());
        let meshes = own.filter(|path| path.starts_with(&format!("{folder}meshes/")));
        let meshes: Vec<PathBuf> =
            meshes.map(|path| self.files.compared(path)).collect::<Result<_>>()?;
        let settings = robot::Settings { clouds: false, ..self.means.settings.robot };
        let (model, _) = Model::load_urdf(&self.files.compared(&urdf)?, &entry.model, &settings)?;
        let WrittenBodies { links: bodies, hanging } = WrittenBodies::read(&meshes)?;
        let poses: HashMap<&str, Pose> =
            entry.link_poses.0.iter().map(|(name, at)| (&**name, pose(at))).collect();
        let world_from_link = model.links.iter().map(|link| poses.get(&*link.name).copied());
        let Some(world_from_link) = world_from_link.collect::<Option<Vec<Pose>>>() else {
            return Ok(None);
        };
        let number = self.result.robots.iter().position(|own| own.id == entry.id);
        let loops = number.and_then(|at| loops.get(&at)).cloned().unwrap_or_default();
        Ok(Some(PageRobot { model, world_from_link, loops, bodies, hanging }))
    }

    /// Adds the pictures of residuals, first those of robots that a person should look at.
    fn add_pictures(&self, page: &mut ReportPage) -> Result<()> {
        let mut robots: Vec<&RobotEntry> = self.result.robots.iter().collect();
        robots.sort_by_key(|robot| robot.verdict == Verdict::Trusted.word());
        for robot in robots {
            let name = format!("pictures/{}_evidence.png", robot.id);
            if self.files.has(&name) {
                page.add_picture(&robot.id, self.files.bytes(&name)?);
            }
        }
        Ok(())
    }

    /// Adds the points of all tiles, or of the parts that other processes have read.
    fn add_points(&self, points: &mut PagePoints) -> Result<()> {
        if !self.parts.is_empty() {
            return page_parts::join(self.parts, points);
        }
        let names = self.files.manifest().files.iter().map(|file| file.path.as_str());
        let names: Vec<&str> = names.filter(|path| path.starts_with("tiles/")).collect();
        let las = self.state.records.las();
        let stage = self.engine.progress.stage("page", Amount::items(names.len() as u64));
        let reader = TileReader { las: &las, engine: self.engine, stage: Some(&stage) };
        let tiles = names.iter().map(|name| self.files.stated(name)).collect::<Result<_>>()?;
        reader.read(tiles, points)?;
        stage.finish();
        Ok(())
    }

    fn add_spaces(&self, points: &mut PagePoints) -> Result<()> {
        for space in self.result.robots.iter().filter_map(|robot| robot.space.as_ref()) {
            self.engine.cancel.check()?;
            self.files.compared(&space.grid)?;
            points.add_space(&space.read(self.out)?);
        }
        Ok(())
    }
}

/// The title of a page: its inputs, so that the same result gives the same bytes in any folder.
fn title(inputs: &[InputEntry]) -> String {
    let name = |input: &InputEntry| {
        let path = Path::new(&input.path);
        path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    };
    match inputs {
        [] => "Stillpoint".into(),
        [only] => name(only),
        [first, others @ ..] => format!("{} and {} more", name(first), others.len()),
    }
}

/// Makes the page of a result that is about to be published, unless the settings leave it out.
/// `parts` are files with its points, where there are such ([`page_parts`]). Returns a message
/// where it cannot be made of the result: that does not make the run fail.
///
/// # Errors
/// The run was interrupted, or the page cannot be written.
pub(crate) fn of_run(
    next: &Path,
    files: &VerifiedFiles,
    parts: &[PathBuf],
    (means, engine): (&Means, &Engine),
) -> Result<Vec<String>> {
    if !means.settings.export.page {
        return Ok(Vec::new());
    }
    let page = ReportedResult::open(next, files, means, engine);
    let page = page.and_then(|result| ReportedResult { parts, ..result }.write());
    match page {
        Ok(_) => Ok(Vec::new()),
        // On a full disk the next run would find a result without its page, and leave it so.
        Err(e) if matches!(e.kind(), Kind::Cancelled | Kind::Io) || e.is_full_disk() => Err(e),
        Err(e) => Ok(vec![format!("the result has no page: {e}")]),
    }
}

/// Makes the page of the result in `out`, unless its run has made it, and returns its path.
///
/// # Errors
/// There is no result, a file of it was changed, another run uses the folder, or the page cannot
/// be written.
pub(crate) fn write_page(out: &Path, means: &Means, engine: &Engine) -> Result<PathBuf> {
    let files = VerifiedFiles::open(out)?;
    if files.has(PAGE) {
        return files.compared(PAGE);
    }
    // No run can use a result that was copied without its store.
    let _lock = out.join("store").is_dir().then(|| Job::hold_shared(out)).transpose()?;
    ReportedResult::open(out, &files, means, engine)?.write()
}

/// Writes a page of the result in `out` to any file, with times, rates and memory of its run.
///
/// # Errors
/// There is no result, a file of it was changed, or the page cannot be written.
pub(crate) fn write_page_with_run(
    out: &Path,
    to: &Path,
    means: &Means,
    engine: &Engine,
) -> Result<()> {
    let files = VerifiedFiles::open(out)?;
    let _lock = out.join("store").is_dir().then(|| Job::hold_shared(out)).transpose()?;
    let html = ReportedResult::open(out, &files, means, engine)?.with_run().html()?;
    export::atomic::write(to, html.as_bytes())
}

/// The data of the page of the result in `out`, as JSON.
///
/// # Errors
/// There is no result, or a file of it was changed.
pub(crate) fn page_data(out: &Path, means: &Means, engine: &Engine) -> Result<String> {
    let files = VerifiedFiles::open(out)?;
    ReportedResult::open(out, &files, means, engine)?.with_run().data()
}

fn pose(at: &BasePose) -> Pose {
    let [w, i, j, k] = at.quat_wxyz;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Pose::from_parts(Translation3::from(at.xyz), turn)
}
