//! The picture of what changed: the cell with its things, and its robots in both postures.

use super::found::RescanFindings;
use crate::detect::robot_id::robot_id;
use crate::detect::robots::poses;
use crate::result::changed_things::word;
use crate::result::changes::{Change, RobotChange};
use contract::{Fit, Verdict};
use export::{ChangedThing, ComparedCell, ComparedRobot, draw_changes};
use geometry::Point;

/// Draws the cell of a rescan with the changes of its robots.
pub(super) fn draw(found: &RescanFindings<'_, '_>, changes: &[RobotChange]) -> export::Canvas {
    let things = found.labels.things.iter().enumerate().map(|(k, thing)| ChangedThing {
        name: format!("T{} {}", k + 1, word(thing.change)),
        gone: change::SessionOccupancy::centres(&thing.gone),
        filled: change::SessionOccupancy::centres(&thing.filled),
        at: thing.now.or(thing.then).map(|b| b.center().into()).unwrap_or_default(),
    });
    let robots = found.robots.compared().into_iter().map(|i| compared(found, i, changes));
    let unseen = found.labels.unseen.iter().flat_map(|region| &region.cells);
    let unseen: Vec<_> = unseen.copied().collect();
    draw_changes(&ComparedCell {
        bounds: &found.session.past.cell,
        stands: &found.labels.now.solid(),
        unseen: &change::SessionOccupancy::centres(&unseen),
        things: &things.collect::<Vec<_>>(),
        robots: &robots.collect::<Vec<_>>(),
    })
}

/// A robot as it stood and as it stands.
fn compared(found: &RescanFindings<'_, '_>, i: usize, changes: &[RobotChange]) -> ComparedRobot {
    let (fit, own) = (&found.fits[i], Some(robot_id(i)));
    let change = changes.iter().find(|c| c.now == own || c.now.is_none() && c.then == own);
    let kind = change.map(|c| &c.change).filter(|kind| **kind != Change::Same);
    let word = kind.map_or_else(String::new, |kind| format!(" {}", kind.word()));
    let missed = found.robots.missed.iter().find(|(at, _)| *at == i).map(|(_, stood)| stood);
    let earlier = missed.or_else(|| found.base.state.fits.get(i));
    let then = earlier.filter(|_| kind.is_some() && change.is_some_and(|c| c.then.is_some()));
    let now = change.is_none_or(|c| c.now.is_some()).then_some(fit);
    let surface = |fit: Option<&Fit>| fit.map_or_else(Vec::new, |fit| body(found, fit));
    ComparedRobot {
        name: format!("{}{word}", robot_id(i)),
        at: fit.world_from_base.translation.vector.into(),
        then: surface(then),
        now: surface(now),
    }
}

/// Points of a robot's surface in its posture; none of one that was refused.
fn body(found: &RescanFindings<'_, '_>, fit: &Fit) -> Vec<[f64; 3]> {
    let is_own = |model: &&robot::Model| {
        model.name == fit.model_name && model.free.len() == fit.joints.len()
    };
    let model = found.models.iter().find(is_own).filter(|_| fit.verdict != Verdict::Refused);
    let Some(model) = model else { return Vec::new() };
    let links = poses(fit, model);
    let points = links.iter().zip(&model.links).flat_map(|(pose, link)| {
        let world = move |p: &[f32; 3]| (pose * Point::from(p.map(f64::from))).into();
        link.cad.points.iter().map(world)
    });
    points.collect()
}
