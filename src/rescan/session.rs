//! Compares the earlier and the new scans of a cell: the present state of its robots, and all other
//! bodies that changed.

use super::earlier_points::{ComparedPoints, EarlierPoints};
use super::earlier_result::EarlierResult;
use super::new_points;
use super::new_points::NewPoints;
use super::robots::{Observed, RobotState, compare_robot};
use crate::detect::ground::Ground;
use crate::detect::robots::{FittedRobots, RobotList};
use crate::detect::robots::{region, standing};
use crate::detect::search::{PreparedLibrary, Search};
use crate::engine::{AllThreads, Engine, Task};
use crate::job::Settings;
use crate::label::known_space::reach;
use crate::label::labelling::{Labelling, ScansToLabel};
use crate::label::near_robots::NearRobots;
use crate::store::Store;
use change::{SessionOccupancy, Thing, UnobservedRegion, things};
use contract::{
    Cluster, Error, Fit, Floor, Kind, Region, Result, ScanId, TILE_SIDE, Verdict, View,
};
use fit::verdict::{self, VerdictEvent};
use freespace::VisibilityQuery;
use geometry::{Aabb, Pose};
use ingest::Sources;
use lattice::ViewSettings;
use register::Registration;
use std::collections::BTreeSet;

/// The part of a plant that was scanned again.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// These bounds, world frame, metres.
    Box(Aabb),
    /// The reach of the robots with these ids.
    Robots(Vec<String>),
    /// Everything that the new scans see well.
    Seen,
}

/// Greatest distance of the cell from its scanner where the cell is not stated, metres: a robot
/// cell.
const CELL_RADIUS: f64 = 8.0;
/// Distance of neighbouring beams beyond which new scans are worse than the earlier ones, metres.
const CELL_SPACING: f64 = 0.025;
/// Smallest cell of depth images per unit of their plane, and the nearest distance with that
/// resolution, metres: 2.5 mm at 1 m, as fine as a common scan.
const LOOK_CELL: f64 = 0.3 / 400.0;
/// Most earlier scans that are looked up: those with most points in the cell.
const MAX_ASKED: usize = 6;
/// Scans of both sessions, robots and floor of the plant.
pub(crate) struct BothScans<'a> {
    /// Floor of the plant.
    pub(crate) floor: &'a Floor,
    /// Whether robots of the cell are mounted on walls or ceilings.
    pub(crate) hangs: bool,
    pub(crate) sources: &'a Sources,
    pub(crate) past: &'a EarlierPoints<'a>,
    /// Tiles of the new scans.
    pub(crate) store: &'a Store,
    pub(crate) library: &'a PreparedLibrary<'a>,
}

/// Views and ground of both sessions, with which a cell is compared.
pub(crate) struct CellComparison<'a> {
    pub(crate) sources: &'a Sources,
    pub(crate) past: &'a EarlierPoints<'a>,
    pub(crate) store: &'a Store,
    pub(crate) ground: Ground,
    pub(crate) floor: &'a Floor,
    pub(crate) clusters: Vec<Cluster>,
    pub(crate) settings: &'a Settings,
    pub(crate) cell: Region,
    pub(crate) library: &'a PreparedLibrary<'a>,
    /// Coverage of those earlier scans that are looked up.
    pub(crate) old_ground: Ground,
    /// Views of the cell from the new scans.
    pub(crate) new_views: Vec<View>,
    /// Views of the cell from the earlier scans.
    pub(crate) old_views: Vec<View>,
}

/// Robots of the plant after the comparison.
#[derive(Default)]
pub(crate) struct ComparedRobots {
    /// Indices of fits that the new scans have found.
    pub(crate) in_cell: Vec<usize>,
    /// Indices of fits that have moved, have another model, are new, or are lost.
    pub(crate) changed: Vec<usize>,
    /// Indices of those of them whose earlier posture the new scans contradict.
    pub(crate) contradicted: Vec<usize>,
    /// Indices of lost robots: the new scans contradict the earlier posture and show no other one.
    pub(crate) lost: Vec<usize>,
    /// Indices of robots that are gone.
    pub(crate) gone: Vec<usize>,
    /// Indices of robots of which the new scans see too little.
    pub(crate) unseen: Vec<usize>,
    /// Indices of those of them that label points by their earlier posture.
    pub(crate) as_it_stood: Vec<usize>,
    /// Bounds of the earlier postures of robots that no longer stand so, world frame, metres.
    pub(crate) left: Vec<Aabb>,
    /// Robots that the earlier result missed, though its scans show them, with their earlier fits.
    pub(crate) missed: Vec<(usize, Fit)>,
}

impl ComparedRobots {
    /// Indices of all compared robots.
    pub(crate) fn compared(&self) -> BTreeSet<usize> {
        self.in_cell.iter().chain(&self.changed).chain(&self.gone).copied().collect()
    }
}

/// Labels of the new points, and changed bodies.
pub(crate) struct CellLabels {
    pub(crate) near: NearRobots,
    pub(crate) compared: ComparedPoints,
    pub(crate) things: Vec<Thing>,
    /// Earlier surfaces of the cell that no new beam has reached.
    pub(crate) unseen: Vec<UnobservedRegion>,
    /// Occupancy of the cell in the new session.
    pub(crate) now: SessionOccupancy,
}

/// Bounds of the requested cell, world frame, metres.
pub(crate) fn bounds(
    wish: &Cell,
    base: &EarlierResult,
    robots: FittedRobots<'_>,
    sources: &Sources,
    new: &Store,
) -> Result<Aabb> {
    let FittedRobots { fits, models } = robots;
    let usage = |what: String| Err(Error::new(Kind::Usage, what));
    let all = new.entries().iter().fold(Aabb::EMPTY, |all, e| all.union(&e.bounds)).grown(0.1);
    let cell = match wish {
        Cell::Box(bounds) => *bounds,
        Cell::Robots(ids) => {
            let mut out = Aabb::EMPTY;
            for id in ids {
                let Some(at) = base.result.robots.iter().position(|r| r.id == *id) else {
                    return usage(format!("the earlier result has no robot \"{id}\""));
                };
                out = out.union(&reach(&fits[at], &models[fits[at].model]).world_bounds());
            }
            out
        }
        Cell::Seen => {
            let mut out = Aabb::EMPTY;
            for scan in &sources.scans[base.state.scans.len()..] {
                let Some(lattice) = &scan.lattice else { continue };
                let step = lattice.row_step.max(lattice.col_step);
                let radius = CELL_RADIUS.min(CELL_SPACING / step);
                let at = scan.world_from_scan.translation.vector;
                out.add(at.add_scalar(-radius).into());
                out.add(at.add_scalar(radius).into());
            }
            if out.is_empty() {
                return usage("the new scans have no known scanner position, so the cell must be given with --cell".into());
            }
            out
        }
    };
    let cell = cell.shared(&all);
    if cell.is_empty() {
        return usage("none of the new scans has a point in the cell".into());
    }
    Ok(cell)
}

/// Bounds of all robots in their earlier postures, world frame, metres.
pub(crate) fn earlier_bounds(robots: FittedRobots<'_>) -> Vec<Aabb> {
    let FittedRobots { fits, models } = robots;
    let all = fits.iter().filter(|fit| fit.verdict != Verdict::Refused);
    all.map(|fit| standing(fit, &models[fit.model])).collect()
}

/// Indices and bounds of robots that reach into the cell.
fn robots_in(robots: FittedRobots<'_>, cell: &Aabb) -> Vec<(usize, Aabb)> {
    let FittedRobots { fits, models } = robots;
    let bounds = |(i, fit): (usize, &Fit)| (i, standing(fit, &models[fit.model]));
    let all = fits.iter().enumerate().filter(|(_, fit)| fit.verdict != Verdict::Refused);
    all.map(bounds).filter(|(_, bounds)| bounds.touches(cell)).collect()
}

/// Names of the models of the robots in the cell, with their tools.
pub(crate) fn model_names<'f>(robots: FittedRobots<'f>, cell: &Aabb) -> BTreeSet<&'f str> {
    let here = robots_in(robots, cell).into_iter().map(|(i, _)| &robots.fits[i]);
    let names = here.flat_map(|fit| {
        let tool = fit.tool.as_ref().map(|tool| tool.model.as_str());
        [fit.model_name.as_str()].into_iter().chain(tool)
    });
    names.collect()
}

/// Registers the new scans to the earlier surfaces of the cell; returns the correction of each
/// scan.
pub(crate) fn register(
    past: &EarlierPoints<'_>,
    new: &Store,
    sources: &mut Sources,
    engine: &Engine,
) -> Result<Vec<Option<Registration>>> {
    let planes = past.surfaces(engine)?.planes();
    let first = past.scans.len();
    let found = new_points::register(&planes, &sources.scans[first..], new, &past.cell, engine)?;
    for (scan, found) in sources.scans[first..].iter_mut().zip(&found) {
        if let Some(found) = found {
            scan.world_from_scan = found.plant_from_stated * scan.world_from_scan;
        }
    }
    Ok(found)
}

impl<'a> CellComparison<'a> {
    /// Computes views and ground of the cell from earlier and new scans.
    pub(crate) fn new(
        both: BothScans<'a>,
        settings: &'a Settings,
        engine: &Engine,
    ) -> Result<Self> {
        let BothScans { floor, hangs, sources, past, store, library } = both;
        let scans = &sources.scans;
        let ground = ground(floor, hangs, sources, store, settings, engine)?;
        let clusters =
            cluster::split(&ground.surfaces.occupancy, &ground.surfaces.floor, &settings.cluster);
        let cell = region(&past.cell.center(), &past.cell);
        let fine = ViewSettings { min_cell: LOOK_CELL, ..settings.view.clone() };
        let old_ground = earlier_coverage(past, scans.len());
        let old = Search::new(library, scans, past.store, &old_ground, settings);
        let new = Search::new(library, scans, store, &ground, settings);
        let views = engine
            .fan_out(Task::new("views").large(), vec![&old, &new], |s| s.images(&cell, &fine))?;
        let [old_views, new_views] = views
            .try_into()
            .map_err(|_| Error::new(Kind::Bug, "two searches gave other than two views"))?;
        Ok(Self {
            sources,
            past,
            store,
            ground,
            floor,
            clusters,
            settings,
            cell,
            library,
            old_ground,
            new_views,
            old_views,
        })
    }

    /// Look-up in the new scans.
    pub(crate) fn watch(&self) -> VisibilityQuery<'_> {
        VisibilityQuery::new(&self.cell, &self.new_views)
    }

    /// The search in the new scans.
    pub(crate) fn search(&self) -> Search<'_, 'a> {
        Search::new(self.library, &self.sources.scans, self.store, &self.ground, self.settings)
    }

    /// Compares robots and other bodies of the cell; the fits in `plant` are brought up to date.
    pub(crate) fn compare(
        &self,
        plant: &mut RobotList,
        engine: &Engine,
    ) -> Result<(ComparedRobots, CellLabels)> {
        let mut robots = self.known_robots(plant, engine)?;
        let mut labels = self.labels(plant.view(), &robots, engine)?;
        let appeared = self.new_robots(&labels, plant, engine)?;
        if !appeared.is_empty() {
            self.join(appeared, plant, &mut robots, engine)?;
            labels = self.labels(plant.view(), &robots, engine)?;
        }
        self.find_motions(plant.view(), &robots, &mut labels, engine)?;
        Ok((robots, labels))
    }

    fn known_robots(&self, plant: &mut RobotList, engine: &Engine) -> Result<ComparedRobots> {
        let mut out = ComparedRobots::default();
        let (search, watch) = (self.search(), self.watch());
        let old_watch = VisibilityQuery::new(&self.cell, &self.old_views);
        let regions = base_search::regions(&self.clusters, &self.settings.region);
        let here = robots_in(plant.view(), &self.past.cell);
        let seen = Observed {
            search: &search,
            watch: &watch,
            other_session: &old_watch,
            regions: &regions,
        };
        let RobotList { fits, models } = plant;
        let looked = engine.fan_out(Task::new("fit").large(), here.clone(), |(i, _)| {
            compare_robot(&fits[i], models, &seen)
        })?;
        for ((i, bounds), (now, own)) in here.into_iter().zip(looked) {
            let is_anew = matches!(now, RobotState::Anew(..));
            if matches!(now, RobotState::Anew(_, true)) {
                out.contradicted.push(i);
            }
            match now {
                RobotState::Unseen => {
                    out.unseen.push(i);
                    out.as_it_stood.push(i);
                }
                RobotState::Open => out.unseen.push(i),
                RobotState::Found(mut fit) | RobotState::Anew(mut fit, _) => {
                    if let Some(own) = own {
                        fit.model = models.len();
                        models.push(own);
                    }
                    out.in_cell.push(i);
                    if is_anew || crate::result::changes::stands_otherwise(&fits[i], &fit) {
                        out.changed.push(i);
                        out.left.push(bounds);
                    }
                    fits[i] = *fit;
                }
                RobotState::Gone => {
                    out.gone.push(i);
                    out.left.push(bounds);
                    verdict::apply(&mut fits[i], &VerdictEvent::Gone);
                }
                // A lost robot gives no labels, since a wrong posture could label fixed points as
                // links.
                RobotState::Lost => {
                    out.changed.push(i);
                    out.lost.push(i);
                    out.left.push(bounds);
                    verdict::apply(&mut fits[i], &VerdictEvent::Contradicted);
                }
            }
        }
        Ok(out)
    }

    /// Labels of the new points, and bodies that have changed.
    fn labels(
        &self,
        plant: FittedRobots<'_>,
        robots: &ComparedRobots,
        engine: &Engine,
    ) -> Result<CellLabels> {
        let own = self.own_fits(plant.fits, robots);
        let labelling = self.labelling(FittedRobots { fits: &own, ..plant });
        let near = labelling.near_robots(self.store, engine)?;
        let (watch, old_watch) = (self.watch(), VisibilityQuery::new(&self.cell, &self.old_views));
        let missed = self.missed(plant, robots, engine)?;
        let compared = self.past.look_up([&watch, &old_watch], missed.as_ref(), engine)?;
        let then = &compared.then;
        let present = NewPoints {
            scans: &self.sources.scans,
            near: &near,
            ground: labelling.ground(),
            cell: self.past.cell,
            then,
            watch: &old_watch,
            own: &watch,
        };
        let now = present.tally(self.store, engine)?;
        let settings = &self.settings.things;
        let (things, unseen) = engine.pool()?.install(|| {
            rayon::join(
                || things(then, &now, settings, &AllThreads),
                || change::unobserved_regions(then, &now, settings),
            )
        });
        Ok(CellLabels { near, compared, things, unseen, now })
    }

    /// The fits for labelling; robots that the new scans do not see give no labels.
    pub(crate) fn own_fits(&self, fits: &[Fit], robots: &ComparedRobots) -> Vec<Fit> {
        let mut own = fits.to_vec();
        for (i, fit) in own.iter_mut().enumerate() {
            fit.is_without_labels =
                !robots.in_cell.contains(&i) && !robots.as_it_stood.contains(&i);
            fit.stands_in.clear();
            fit.stays.clear();
        }
        own
    }

    /// The labelling of the new points by these fits.
    pub(crate) fn labelling<'b>(&'b self, robots: FittedRobots<'b>) -> Labelling<'b> {
        let floor = &self.ground.surfaces.floor;
        let (sources, store, clusters) = (self.sources, self.store, &self.clusters[..]);
        let scans = ScansToLabel { sources, store, floor, clusters };
        Labelling::new(robots, &scans, self.settings)
    }

    /// For each scan whose file states world coordinates, the pose that carries it to the plant's
    /// frame and corrects its registration.
    pub(crate) fn moved(
        &self,
        registered: &[Option<Registration>],
        plant_from_new: Option<Pose>,
    ) -> Vec<Option<Pose>> {
        let first = self.past.scans.len();
        let moved = registered.iter().map(|r| match (r, plant_from_new) {
            (Some(r), Some(carried)) => Some(r.plant_from_stated * carried),
            (Some(r), None) => Some(r.plant_from_stated),
            (None, carried) => carried,
        });
        std::iter::repeat_n(None, first).chain(moved).collect()
    }
}

/// Coverage and occupancy of the new scans; on request with walls, and with all planes where the
/// plant has no floor.
pub(crate) fn ground(
    floor: &Floor,
    with_walls: bool,
    sources: &Sources,
    store: &Store,
    settings: &Settings,
    engine: &Engine,
) -> Result<Ground> {
    let is_known = !floor.levels.is_empty();
    let gather = if is_known && !with_walls { Ground::without_planes } else { Ground::of_tiles };
    let mut ground = gather(&sources.scans, store, settings, engine)?;
    if is_known {
        ground.surfaces.floor = floor.clone();
    }
    Ok(ground)
}

/// Coverage of those earlier scans that are looked up.
fn earlier_coverage(past: &EarlierPoints<'_>, n_scans: usize) -> Ground {
    let mut n_points = vec![0_u64; n_scans];
    for &i in &past.store.touching(&past.cell) {
        let entry = &past.store.entries()[i];
        n_points[entry.at.scan.0 as usize] += entry.n_points;
    }
    let mut order: Vec<usize> = (0..past.scans.len()).filter(|&s| n_points[s] > 0).collect();
    order.sort_by_key(|&s| (std::cmp::Reverse(n_points[s]), s));
    let mut extents = vec![None; n_scans];
    for &s in order.iter().take(MAX_ASKED) {
        let own = past.store.entries().iter().filter(|e| e.at.scan == ScanId(s as u32));
        extents[s] = own.fold(None, |sum: Option<[u32; 4]>, e| {
            let (row, col) = (e.at.row * TILE_SIDE, e.at.col * TILE_SIDE);
            let one = [row, row + TILE_SIDE - 1, col, col + TILE_SIDE - 1];
            Some(sum.map_or(one, |a| {
                [a[0].min(one[0]), a[1].max(one[1]), a[2].min(one[2]), a[3].max(one[3])]
            }))
        });
    }
    Ground { surfaces: floor::FloorFindings::default(), extents }
}
