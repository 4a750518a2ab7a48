//! Shadows of robots from scanners: which points may be artefacts of beams that hit an edge of a
//! robot. They are the same for all robots of a plant, so that those of one are kept for the next.

use super::CheckedRobot;
use crate::detect::robots::poses;
use crate::engine::{Engine, Task};
use crate::result::plant_state::PlantState;
use clearance::Shadow;
use contract::{Fit, Result, Scan};
use geometry::{Point, Pose};
use robot::Model;
use std::sync::{Arc, Mutex, PoisonError};

/// Distance beyond which scanners contribute few points about a robot, metres.
const SCANNED_FROM: f64 = 30.0;

/// A scan, by index, and the shadow of the robots as seen from its scanner.
pub(super) type ScanShadow = (usize, Arc<Shadow>);

/// Shadows around the robot that was looked at last. Those of robots elsewhere are dropped, so that
/// a plant of many scanners takes no more memory than the surroundings of one robot.
#[derive(Default)]
pub(super) struct Outlines(Mutex<(Option<usize>, Vec<ScanShadow>)>);

impl Outlines {
    /// Shadows of all robots from each known scanner near `robot`, world frame.
    pub(super) fn near(
        &self,
        robot: &CheckedRobot<'_>,
        others: &[(usize, &Fit)],
        models: &[Model],
        state: &PlantState,
        engine: &Engine,
    ) -> Result<Vec<ScanShadow>> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A robot that moved between scans casts no shadow on its own surroundings from where it
        // stood in others, which is so for its own surroundings only.
        let of = (!robot.fit.stays.is_empty()).then_some(robot.number);
        let known = if kept.0 == of { std::mem::take(&mut kept.1) } else { Vec::new() };
        let mut standing = vec![(robot.fit, robot.model)];
        for (_, fit) in others {
            // The robot may have stood there in other scans.
            let model = &models[fit.model];
            standing.extend(std::iter::once(*fit).chain(&fit.stays).map(|fit| (fit, model)));
        }
        let placed: Vec<(&Model, Vec<Pose>)> =
            standing.into_iter().map(|(fit, model)| (model, poses(fit, model))).collect();
        let all: Vec<(&Model, &[Pose])> =
            placed.iter().map(|(model, poses)| (*model, &poses[..])).collect();
        let base = robot.fit.world_from_base.translation.vector;
        let is_near =
            |scan: &Scan| (scan.world_from_scan.translation.vector - base).norm() < SCANNED_FROM;
        let scans = state.scans.iter().enumerate();
        let wanted = scans.filter(|(_, scan)| scan.lattice.is_some() && is_near(scan)).collect();
        let found = engine.fan_out(Task::new("outlines"), wanted, |(at, scan)| {
            let made = known.iter().find(|(own, _)| *own == at).map(|(_, shadow)| shadow.clone());
            let eye = || Point::from(scan.world_from_scan.translation.vector);
            Ok((at, made.unwrap_or_else(|| Arc::new(Shadow::new(&all, eye())))))
        })?;
        *kept = (of, found.clone());
        Ok(found)
    }
}
