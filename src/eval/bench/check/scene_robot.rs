//! A robot of a scene, in the posture in which it is scanned.

use geometry::Pose;
use robot::Model;
use simulate::Scene;

/// A robot of a scene, as it stands.
pub(super) struct SceneRobot<'a> {
    pub(super) scene: &'a Scene,
    pub(super) number: usize,
    pub(super) model: &'a Model,
    pub(super) posture: Vec<f64>,
    pub(super) world_from_base: Pose,
}

impl<'a> SceneRobot<'a> {
    /// The robot of this number; none where its model is not among these.
    pub(super) fn of(scene: &'a Scene, models: &'a [Model], number: usize) -> Option<Self> {
        let place = &scene.robots[number];
        let model = models.iter().find(|m| m.name == place.model)?;
        let home = model.home().into_iter().zip(&model.free);
        let value = |(home, joint): (f64, &usize)| {
            place.posture.get(&model.joints[*joint].name).copied().unwrap_or(home)
        };
        let (posture, world_from_base) = (home.map(value).collect(), place.world_from_base());
        Some(Self { scene, number, model, posture, world_from_base })
    }
}
