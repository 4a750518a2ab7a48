//! Fitted robots prepared for labelling: posed links with distance fields, gates and bounds.

use crate::field::{DistanceField, FIELD_REACH};
use crate::settings::Settings;
use contract::{Fan, Fit, ScanId};
use geometry::{Aabb, Point, Pose, Vector};
use nalgebra::{DMatrix, DVector};
use robot::{Kinematics, Model};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Number of samples of a link from which its uncertainty is computed.
const N_SPREAD: usize = 64;
/// Standard deviation that is assumed for a joint that the points do not determine, radians or
/// metres: its link was placed by the search.
const OPEN_SIGMA: f64 = 0.01;

/// One link of a fitted robot.
pub(crate) struct StandingLink {
    /// Index of the link in the model.
    pub(crate) index: u16,
    pub(crate) world_from_link: Pose,
    pub(crate) field: Arc<DistanceField>,
    /// Bounds of the mesh in the link's frame, metres.
    pub(crate) bounds: Aabb,
    /// Distance around its bounds up to which points are examined, metres.
    pub(crate) reach: f64,
    /// Gate: largest distance of a point that belongs to the link, metres.
    pub(crate) gate: f32,
    /// For the link that the robot stands on, the plane of its underside in the link's frame: unit
    /// normal and offset (metres).
    foot: Option<([f32; 3], f32)>,
}

impl StandingLink {
    /// Height of a point (link frame) above the underside of the robot, metres; `None` for links on
    /// which the robot does not stand.
    pub(crate) fn above_foot(&self, p: [f32; 3]) -> Option<f32> {
        self.foot.map(|(n, offset)| n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - offset)
    }
}

/// One fitted robot.
pub(crate) struct StandingRobot {
    /// Index of its fit.
    pub(crate) robot: u16,
    /// Scans in which it has this posture; empty if it has it in all.
    stands_in: Vec<ScanId>,
    /// World bounds of all points that are examined, metres.
    pub(crate) region: Aabb,
    pub(crate) links: Vec<StandingLink>,
}

impl StandingRobot {
    /// Whether it has this posture in a scan.
    pub(crate) fn is_in(&self, scan: ScanId) -> bool {
        self.stands_in.is_empty() || self.stands_in.contains(&scan)
    }
}

/// The fits that give labels; fits of one model share their distance fields.
pub(crate) fn bodies(
    fits: &[Fit],
    models: &[Model],
    settings: &Settings,
    fan: &dyn Fan,
) -> Vec<StandingRobot> {
    let all = fits.iter().enumerate().flat_map(|(robot, fit)| {
        std::iter::once(fit).chain(&fit.stays).map(move |fit| (robot, fit))
    });
    let used = all.filter_map(|(robot, fit)| {
        // Labels store the index of a robot as i16.
        let (robot, model) = (i16::try_from(robot).ok()?, models.get(fit.model)?);
        let is_used = fit.gives_labels() && fit.joints.len() == model.free.len();
        is_used.then_some((robot.unsigned_abs(), fit, model))
    });
    let used: Vec<(u16, &Fit, &Model)> = used.collect();
    let fields = fields(&used, fan);
    let body = |(robot, fit, model): &(u16, &Fit, &Model)| {
        let links = posed(fit, model, &fields[&fit.model], settings);
        let region = links.iter().fold(Aabb::EMPTY, |all, link| all.union(&link.region()));
        let stands_in = fit.stands_in.clone();
        (!region.is_empty()).then_some(StandingRobot { robot: *robot, stands_in, region, links })
    };
    used.iter().filter_map(body).collect()
}

/// For each model in use: the fields of its links that have a surface.
fn fields(
    used: &[(u16, &Fit, &Model)],
    fan: &dyn Fan,
) -> BTreeMap<usize, Vec<Option<Arc<DistanceField>>>> {
    let models: BTreeMap<usize, &Model> = used.iter().map(|(_, fit, m)| (fit.model, *m)).collect();
    let links = models.iter().flat_map(|(at, model)| model.links.iter().map(move |l| (*at, l)));
    let made =
        |(at, link): (usize, &robot::Link)| (at, DistanceField::new(&link.cad).map(Arc::new));
    let mut out: BTreeMap<usize, Vec<Option<Arc<DistanceField>>>> = BTreeMap::new();
    for (at, field) in fan.fan(links.collect(), made) {
        out.entry(at).or_default().push(field);
    }
    out
}

fn posed(
    fit: &Fit,
    model: &Model,
    fields: &[Option<Arc<DistanceField>>],
    settings: &Settings,
) -> Vec<StandingLink> {
    let posture: Vec<f64> = fit.joints.iter().map(|joint| joint.value).collect();
    let Kinematics { base_from_link, twists } = model.kinematics(&posture);
    let covariance = covariance(fit);
    let hands = hands(model);
    let mut out = Vec::new();
    for (index, field) in fields.iter().enumerate() {
        let (Some(field), Ok(at)) = (field, u16::try_from(index)) else {
            continue;
        };
        let spread = spread(fit, field, &base_from_link[index], &twists[index], &covariance);
        let stated = model.mesh_sigmas.iter().find(|entry| entry.0 == index).map(|entry| entry.1);
        let mesh = stated.unwrap_or(settings.sigma_cad);
        let sigma = (settings.sigma_range.powi(2) + mesh * mesh + spread * spread).sqrt();
        // The robot stands on its first link with a body, unless joints move that link.
        let stands = out.is_empty() && twists[index].iter().flatten().all(|v| *v == 0.0);
        out.push(StandingLink {
            index: at,
            world_from_link: fit.world_from_base * base_from_link[index],
            field: Arc::clone(field),
            bounds: model.links[index].bounds,
            reach: if hands[index] { settings.hand_reach } else { settings.reach },
            gate: (3.0 * sigma).clamp(settings.min_gate, settings.max_gate) as f32,
            foot: stands.then(|| foot(&model.links[index], &base_from_link[index])),
        });
    }
    out
}

/// The plane below a link, perpendicular to the axis of the base, in the link's frame.
fn foot(link: &robot::Link, base_from_link: &Pose) -> ([f32; 3], f32) {
    let up = (base_from_link.rotation.inverse() * Vector::z()).cast::<f32>();
    let heights = link
        .mesh
        .vertices
        .iter()
        .chain(&link.cad.points)
        .map(|v| up.x * v[0] + up.y * v[1] + up.z * v[2]);
    (up.into(), heights.fold(f32::INFINITY, f32::min))
}

/// For each link, whether no other link with a body comes after it, so that it may carry a tool or
/// a workpiece.
fn hands(model: &Model) -> Vec<bool> {
    let mut hands: Vec<bool> = model.links.iter().map(|link| !link.cad.points.is_empty()).collect();
    for joint in model.joints.iter().rev() {
        let mut beyond = Some(joint.child);
        // A body further along the chain excludes all links that carry it.
        if !model.links[joint.child].cad.points.is_empty() {
            while let Some(carrier) = beyond.and_then(|link| model.links[link].parent_joint) {
                let parent = model.joints[carrier].parent;
                hands[parent] = false;
                beyond = Some(parent);
            }
        }
    }
    // The root never counts, since what does not move carries nothing.
    if let Some(root) = hands.first_mut() {
        *root = false;
    }
    hands
}

/// RMS over the samples of a link of their standard deviation across the surface, metres.
fn spread(
    fit: &Fit,
    field: &DistanceField,
    base_from_link: &Pose,
    twists: &[[f64; 6]],
    covariance: &DMatrix<f64>,
) -> f64 {
    let step = field.len() / N_SPREAD + 1;
    let (mut sum, mut n) = (0.0, 0.0);
    for (p, normal) in field.samples(step) {
        let p = base_from_link * Point::from(p.map(f64::from));
        let normal = base_from_link * Vector::from(normal.map(f64::from));
        // The base rotates about its own origin, in world axes.
        let (arm, across) =
            (fit.world_from_base.rotation * p.coords, fit.world_from_base.rotation * normal);
        let turn = arm.cross(&across);
        let mut lever = vec![across.x, across.y, across.z, turn.x, turn.y, turn.z];
        lever.extend(twists.iter().map(|t| {
            let (v, w) = (Vector::new(t[0], t[1], t[2]), Vector::new(t[3], t[4], t[5]));
            normal.dot(&(v + w.cross(&p.coords)))
        }));
        let lever = DVector::from_vec(lever);
        sum += lever.dot(&(covariance * &lever)).max(0.0);
        n += 1.0;
    }
    if n > 0.0 { (sum / n).sqrt() } else { 0.0 }
}

/// Covariance of base and joints. If the fit has no full one or a joint is undetermined, it is made
/// of the standard deviations, which overestimates; the upper limit of the gate bounds that.
fn covariance(fit: &Fit) -> DMatrix<f64> {
    let n = 6 + fit.joints.len();
    let is_whole = fit.covariance.len() == n * n && fit.covariance.iter().all(|v| v.is_finite());
    if is_whole && fit.joints.iter().all(contract::JointFit::is_determined) {
        return DMatrix::from_row_slice(n, n, &fit.covariance);
    }
    let sigmas = fit.base_sigma.iter().copied().chain(fit.joints.iter().map(|joint| joint.sigma));
    let variances =
        sigmas.map(|s| if s.is_finite() { s.min(OPEN_SIGMA) } else { OPEN_SIGMA }.powi(2));
    DMatrix::from_diagonal(&DVector::from_iterator(n, variances))
}

impl StandingLink {
    /// World bounds of the points that are examined, metres.
    pub(crate) fn region(&self) -> Aabb {
        let corners = self.bounds.grown(self.reach.max(f64::from(FIELD_REACH))).corners();
        Aabb::of(corners.map(|c| {
            let p = self.world_from_link * Point::from(c);
            [p.x, p.y, p.z]
        }))
    }
}

/// Distance of a point from a box in the box's frame, metres; zero inside.
#[inline]
pub(crate) fn box_distance(min: [f32; 3], max: [f32; 3], p: [f32; 3]) -> f32 {
    let mut square = 0.0;
    for i in 0..3 {
        let d = (min[i] - p[i]).max(p[i] - max[i]).max(0.0);
        square += d * d;
    }
    square.sqrt()
}
