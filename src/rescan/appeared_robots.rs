//! Finds robots among the bodies that appeared in a cell. Each is also searched in the earlier
//! scans, since a robot that the earlier result only missed did not appear.

use super::robots::{Observed, RobotState, compare_robot};
use super::session::{CellComparison, CellLabels, ComparedRobots, ground};
use crate::detect::robots::{FittedRobots, RobotList};
use crate::detect::robots::{region, standing};
use crate::detect::search::Search;
use crate::detect::tools;
use crate::engine::{Engine, Task};
use crate::label::labelling::{Labelling, ScansToLabel};
use crate::label::near_robots::NearRobots;
use change::Thing;
use contract::{Fit, Region, Result, Verdict};
use freespace::VisibilityQuery;
use geometry::Aabb;
use robot::Model;

/// Least height, and least longest edge, of a new body that may be a robot, metres.
const ROBOT_LIKE: [f64; 2] = [0.4, 0.5];
/// Margin around such a body, metres; and around one that does not stand on the floor, since the
/// arm of a robot whose foot did not move is a body by itself.
const ABOUT: [f64; 2] = [0.3, 1.0];
/// Change of height, metres, beyond which a pair of bodies may be an arm in place of another object
/// rather than an object that was moved.
const LIFTED: f64 = 0.2;
/// Height above the floor below which a body stands on it, metres.
const STANDS: f64 = 0.2;

impl CellComparison<'_> {
    /// Robots among the bodies that appeared.
    pub(crate) fn new_robots(
        &self,
        labels: &CellLabels,
        plant: &mut RobotList,
        engine: &Engine,
    ) -> Result<Vec<Fit>> {
        let RobotList { fits, models } = plant;
        let like =
            |size: [f64; 3]| size[2] >= ROBOT_LIKE[0] && size.iter().any(|s| *s >= ROBOT_LIKE[1]);
        // A body that stood elsewhere before, with the same shape and height, is no robot.
        let is_lifted = |thing: &&Thing| match (thing.then, thing.now) {
            (Some(then), Some(now)) => (then.min[2] - now.min[2]).abs() > LIFTED,
            (then, _) => then.is_none(),
        };
        let bounds = labels.things.iter().filter(is_lifted).filter_map(|thing| thing.now);
        let regions: Vec<Region> = bounds
            .filter(|bounds| like(bounds.size()))
            .map(|bounds| region(&bounds.center(), &self.about(&bounds)))
            .collect();
        if regions.is_empty() {
            return Ok(Vec::new());
        }
        // A new robot may be mounted on a wall.
        let walls = ground(self.floor, true, self.sources, self.store, self.settings, engine)?;
        let (scans, settings) = (&self.sources.scans, self.settings);
        let search = Search::new(self.library, scans, self.store, &walls, settings).over(&regions);
        let found = engine.fan_out(
            Task::new("search").large().showing(search.pieces()),
            regions.clone(),
            |region| search.region(&region),
        )?;
        let found = found.into_iter().flatten().collect();
        let is_new = |fit: &Fit| {
            let at = fit.world_from_base.translation.vector;
            let known = fits.iter().filter(|f| f.verdict != Verdict::Refused);
            known.into_iter().all(|f| (f.world_from_base.translation.vector - at).norm() > 0.5)
        };
        let mut chosen = fit::choose(found, models, |_| false);
        chosen.retain(is_new);
        tools::attach_tools(chosen, models, &search, engine)
    }

    /// Bounds of the robot that a new body may be part of, world frame, metres.
    fn about(&self, thing: &Aabb) -> Aabb {
        let [x, y, z] = [0, 1, 2].map(|i| 0.5 * (thing.min[i] + thing.max[i]));
        let height = self.floor.height_above([x, y, z], 0.0);
        let bottom = height.map_or(thing.min[2], |height| z - height);
        let stands = thing.min[2] - bottom < STANDS;
        let mut about = thing.grown(if stands { ABOUT[0] } else { ABOUT[1] });
        about.min[2] = about.min[2].min(bottom - ABOUT[0]);
        about
    }

    /// Adds new robots to the robots of the cell.
    pub(crate) fn join(
        &self,
        appeared: Vec<Fit>,
        plant: &mut RobotList,
        robots: &mut ComparedRobots,
        engine: &Engine,
    ) -> Result<()> {
        let RobotList { fits, models } = plant;
        let stood = engine.fan_out(Task::new("fit").large(), appeared.clone(), |fit| {
            self.earlier_fit(&fit, models)
        })?;
        for (fit, stood) in appeared.into_iter().zip(stood) {
            robots.in_cell.push(fits.len());
            robots.changed.push(fits.len());
            if let Some((mut stood, own)) = stood {
                if let Some(own) = own {
                    stood.model = models.len();
                    models.push(own);
                }
                robots.left.push(standing(&stood, &models[stood.model]));
                robots.missed.push((fits.len(), stood));
            }
            fits.push(fit);
        }
        Ok(())
    }

    /// The earlier posture of a robot that the earlier result does not have, if its scans show it;
    /// such a robot did not appear.
    fn earlier_fit(&self, now: &Fit, models: &[Model]) -> Result<Option<(Fit, Option<Model>)>> {
        let search = Search::new(
            self.library,
            &self.sources.scans,
            self.past.store,
            &self.old_ground,
            self.settings,
        );
        let (watch, other) = (VisibilityQuery::new(&self.cell, &self.old_views), self.watch());
        let seen = Observed { search: &search, watch: &watch, other_session: &other, regions: &[] };
        let (then, own) = compare_robot(now, models, &seen)?;
        Ok(match then {
            RobotState::Found(fit) | RobotState::Anew(fit, _) => Some((*fit, own)),
            RobotState::Gone | RobotState::Unseen | RobotState::Open | RobotState::Lost => None,
        })
    }

    /// Labels of points of the earlier scans on robots that their result missed; `None` where it
    /// missed none.
    pub(crate) fn missed(
        &self,
        plant: FittedRobots<'_>,
        robots: &ComparedRobots,
        engine: &Engine,
    ) -> Result<Option<NearRobots>> {
        let FittedRobots { fits, models } = plant;
        if robots.missed.is_empty() {
            return Ok(None);
        }
        let mut then: Vec<Fit> =
            fits.iter().map(|fit| Fit { is_without_labels: true, ..fit.clone() }).collect();
        robots.missed.iter().for_each(|(i, fit)| then[*i].clone_from(fit));
        let (sources, store, floor) = (self.sources, self.past.store, self.floor);
        let scans = ScansToLabel { sources, store, floor, clusters: &[] };
        let robots = FittedRobots { fits: &then, models };
        let labelling = Labelling::new(robots, &scans, self.settings);
        labelling.near_robots(self.past.store, engine).map(Some)
    }
}
