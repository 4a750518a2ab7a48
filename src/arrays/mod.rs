//! Points in memory to fits: the search of a run over arrays of another program. Nothing is
//! labelled or written but tiles in a temporary folder. Steps and their order are those of
//! `plan.rs` up to the fits.

use crate::detect::ground::Ground;
use crate::detect::library;
use crate::detect::robots::RobotList;
use crate::detect::search::{PreparedLibrary, Search};
use crate::detect::{calibrate, tools};
use crate::engine::{AllThreads, Engine, Task};
use crate::io::read_parts::InputReader;
use crate::job::{Means, units};
use crate::result::report::robot_entry;
use crate::store::{Scatter, Store, TileSink};
use contract::{Error, Fit, Input, Kind, Result};
use export::RobotEntry;
use geometry::{Aabb, Point};
pub use ingest::ArrayScan;
use ingest::{Sources, Want, open_arrays};
use robot::{Library, Model};
use std::path::{Path, PathBuf};

/// Which robots are searched in which points.
#[derive(Debug)]
pub struct ArraysRequest {
    /// Points of each scanner.
    pub scans: Vec<ArrayScan>,
    /// Folders of the models, each with `robot.urdf`.
    pub models: Vec<PathBuf>,
    /// A place in the world, metres, and the greatest distance of a base from it, metres; without
    /// it all that stands in the points is searched.
    pub about: Option<([f64; 3], f64)>,
    /// Folder for tiles; the system's temporary folder without it.
    pub scratch: Option<PathBuf>,
    /// Memory, threads and settings.
    pub means: Means,
}

/// Finds robots in points in memory: the fits that a run would report for the same points and
/// models, without the known space around them.
///
/// # Errors
/// Points, positions or models that cannot be used; the error of a stage; cancelled.
pub fn fit(request: ArraysRequest, engine: &Engine) -> Result<Vec<RobotEntry>> {
    let ArraysRequest { scans, models, about, scratch, means } = request;
    let settings = &means.settings;
    let library = load(&models, &settings.robot, engine)?;
    let open = || open_arrays(scans, &settings.ingest, &AllThreads);
    let sources = engine.pool()?.install(open)?;
    units::check_sizes(&library, &sources)?;
    sources.check_steps()?;
    let folder = match &scratch {
        Some(folder) => tempfile::tempdir_in(folder),
        None => tempfile::tempdir(),
    };
    let folder = folder.map_err(|e| {
        let place = scratch.clone().unwrap_or_else(std::env::temp_dir);
        Error::of_file("the folder for tiles cannot be made", &place, e)
    })?;
    let store = tiles(&sources, folder.path(), &means, engine)?;
    let ground = Ground::of_tiles(&sources.scans, &store, settings, engine)?;
    let found = ArraysSearch { sources: &sources, store: &store, ground: &ground, means: &means };
    let robots = found.robots(&library, about, engine)?;
    let entry = |(i, fit): (usize, &Fit)| robot_entry(i, fit, &robots.models, None);
    Ok(robots.fits.iter().enumerate().map(entry).collect())
}

/// The scanned arrays, before anything is searched in them.
struct ArraysSearch<'a> {
    sources: &'a Sources,
    store: &'a Store,
    ground: &'a Ground,
    means: &'a Means,
}

impl ArraysSearch<'_> {
    /// Fits of all regions, or of those about a place, with their tools.
    fn robots(
        &self,
        library: &Library,
        about: Option<([f64; 3], f64)>,
        engine: &Engine,
    ) -> Result<RobotList> {
        let (settings, scans) = (&self.means.settings, &self.sources.scans);
        let surfaces = &self.ground.surfaces;
        let clusters = cluster::split(&surfaces.occupancy, &surfaces.floor, &settings.cluster);
        let mut regions = base_search::regions(&clusters, &settings.region);
        let place = about.map(|(at, radius)| (Point::from(at), radius));
        let is_near = |(at, radius): (Point, f64)| {
            let near = Aabb { min: at.into(), max: at.into() }.grown(radius);
            move |bounds: &Aabb| bounds.touches(&near)
        };
        if let Some(is_near) = place.map(is_near) {
            regions.retain(|region| is_near(&region.world_bounds()));
        }
        let prepared = PreparedLibrary::new(&library.models);
        let search = Search::new(&prepared, scans, self.store, self.ground, settings);
        let search = search.over(&regions);
        let task = Task::new("fit").large().showing(search.pieces());
        let find = |region| search.region_about(&region, place);
        let found = engine.fan_out(task, regions.clone(), find)?;
        let mut models = library.models.clone();
        let fits = fit::choose(found.concat(), &models, |_| false);
        let mut fits = tools::attach_tools(fits, &mut models, &search, engine)?;
        if settings.fit.calibrate {
            fits = calibrate::calibrate(fits, &mut models, &search, engine)?;
        }
        if settings.fit.together {
            fit::together(&mut fits, &models, scans, &surfaces.overlaps, &settings.fit);
        }
        Ok(RobotList { fits, models })
    }
}

/// Loads these models; one that cannot be loaded ends the search, since it was asked for by name.
fn load(folders: &[PathBuf], settings: &robot::Settings, engine: &Engine) -> Result<Library> {
    let mut library = Library::default();
    for folder in folders {
        library.models.push(model(folder, settings, engine)?);
    }
    library.models.sort_by(|a, b| a.name.cmp(&b.name));
    if let Some(twice) = library.models.windows(2).find(|two| two[0].name == two[1].name) {
        let what = format!("two models have the name \"{}\"", twice[0].name);
        return Err(Error::new(Kind::Usage, what).hint("a model has the name of its folder"));
    }
    if library.models.iter().all(Model::is_tool) {
        let what = "no robot was given to search for";
        return Err(Error::new(Kind::Usage, what).hint("give the folder of a model"));
    }
    Ok(library)
}

fn model(folder: &Path, settings: &robot::Settings, engine: &Engine) -> Result<Model> {
    let above = folder.parent().unwrap_or(folder);
    let bad = |what: &str| {
        let hint = "give a folder of a robot library, which holds robot.urdf and its meshes";
        Error::bad_input(what.to_owned()).at(folder.display()).hint(hint)
    };
    if !folder.is_dir() {
        return Err(bad("there is no such folder"));
    }
    let name = folder.file_name().map(|name| name.to_string_lossy().into_owned());
    let Some(name) = name else { return Err(bad("the folder has no name")) };
    let loaded = library::load_those(above, |own| own == name, settings, None, engine)?;
    let error = loaded.findings.iter().find(|f| f.severity == robot::Severity::Error);
    if let Some(finding) = error {
        return Err(bad(&format!("{}: {}", finding.place, finding.what)));
    }
    loaded.models.into_iter().next().ok_or_else(|| bad("there is no model in it"))
}

/// Tiles of all arrays, in one store for each.
fn tiles(sources: &Sources, folder: &Path, means: &Means, engine: &Engine) -> Result<Store> {
    let resident_bytes = means.store_bytes() / sources.inputs.len().max(1);
    let fill = |input: &Input| {
        let scans = &sources.scans;
        let first = scans.iter().find(|s| s.input == input.id).map_or(0, |s| s.id.0);
        let dir = folder.join(input.id.0.to_string());
        let mut sink = TileSink::create(&dir, scans, first, means.ingest_bytes())?;
        let reading = InputReader { sources, input, want: Want::Coordinates };
        let task = Task::new("ingest").of(reading.amount());
        reading.each(task, &Scatter::new(scans), None, engine, |strip| sink.add(&strip))?;
        sink.finish(engine, resident_bytes)
    };
    Ok(Store::join(sources.inputs.iter().map(fill).collect::<Result<_>>()?))
}
