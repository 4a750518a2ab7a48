//! A model made ready for fitting: nearest-sample fields and meshes of its links, patches of its
//! surface, search samples, and which link is placed by which joint. Made once per model, shared by
//! all its fits.

mod face;
mod facets;
mod patches;
mod triangles;

use contract::Fan;
use geometry::depth::Rows;
use geometry::{Point, Pose};
use robot::Model;
use std::sync::Arc;

pub(crate) use face::Face;
pub use facets::Facet;
pub(crate) use facets::Fields;
#[cfg(test)]
pub(crate) use patches::HALF_PATCH;
pub(crate) use patches::{
    Kernel, N_SIDES, N_SMOOTH, PatchPlace, Patches, Shape, ShapeSquare, Smoothness,
};
pub(crate) use triangles::{BeamPlace, MeshHit};

use crate::state::Hypothesis;

/// A model made ready for fitting.
#[derive(Debug)]
pub struct Prepared<'a> {
    /// The model.
    pub model: &'a Model,
    /// Index in the library.
    pub index: usize,
    pub(crate) links: Arc<Vec<PreparedLink>>,
    /// For each free joint: the links that get their pose when it is set, later ones not yet.
    pub placed_by: Vec<Vec<usize>>,
    /// Links with a surface that no free joint moves.
    pub fixed: Vec<usize>,
    /// No part of the robot gets farther from the base's origin, metres.
    pub(crate) reach: f64,
    /// For each free joint: distance of the samples it places from its axis, 95th percentile,
    /// metres (1 for prismatic joints, so that steps are in metres).
    pub(crate) lever: Vec<f64>,
    /// For each free joint: whether it moves nothing but the links that it places and the tool.
    pub(crate) leaf: Vec<bool>,
    /// The face of a bare flange.
    pub(crate) face: Option<Face>,
    /// What errors of the model's shape are told by: patches of all links' surfaces.
    pub(crate) patches: Arc<Patches>,
}

/// What is kept for a link.
#[derive(Debug, Default)]
pub(crate) struct PreparedLink {
    /// Shared by all models that have the link.
    pub(crate) fields: Arc<Fields>,
    /// √area, m: weight of the link in a total score.
    pub(crate) weight: f64,
    /// Outer area, m².
    pub(crate) area: f64,
    /// Patches of the links before it.
    pub(crate) first_patch: usize,
}

impl PreparedLink {
    /// A patch of this link, counted over all links.
    #[inline]
    pub(crate) fn patch(&self, own: u32) -> usize {
        self.first_patch + own as usize
    }
}

impl<'a> Prepared<'a> {
    /// Prepares model `index` of the library.
    #[must_use]
    pub fn new(index: usize, model: &'a Model, fan: &dyn Fan) -> Self {
        let fields = fan.fan(model.links.iter().collect(), |link| Arc::new(Fields::new(link)));
        Self::of(index, model, fields.into_iter())
    }

    /// Prepares model `index`, whose links are those of others, one after the other (an arm, and a
    /// tool on it), from what is known of them.
    #[must_use]
    pub fn joined(parts: &[&Prepared<'_>], index: usize, model: &'a Model) -> Self {
        let links = parts.iter().flat_map(|part| part.links.iter());
        Self::of(index, model, links.map(|l| Arc::clone(&l.fields)))
    }

    fn of(index: usize, model: &'a Model, fields: impl Iterator<Item = Arc<Fields>>) -> Self {
        let mut patches = Patches::default();
        let links = model.links.iter().zip(fields).enumerate().map(|(l, (link, fields))| {
            let area = f64::from(link.cad.area);
            let (weight, first_patch) = (area.sqrt(), patches.len());
            patches.groups.extend(fields.sides().map(|side| l as u32 * N_SIDES + u32::from(side)));
            patches.places.extend(fields.places());
            PreparedLink { fields, weight, area, first_patch }
        });
        let links: Vec<_> = links.collect();
        let n_free = model.free.len();
        let depends = dependencies(model);
        let mut placed_by = vec![Vec::new(); n_free];
        let mut fixed = Vec::new();
        for (l, link) in model.links.iter().enumerate() {
            if link.cad.points.is_empty() {
                continue;
            }
            match (0..n_free).rev().find(|&j| depends[l][j]) {
                Some(j) => placed_by[j].push(l),
                None => fixed.push(l),
            }
        }
        let leaf = (0..n_free).map(|j| {
            let is_arm =
                |l: &usize| depends[*l][j] && model.links[*l].role != robot::Role::Effector;
            let carried = (0..depends.len()).filter(is_arm);
            carried
                .filter(|&l| !model.links[l].cad.points.is_empty())
                .all(|l| placed_by[j].contains(&l))
        });
        let leaf = leaf.collect();
        let face = placed_by.last().and_then(|placed| Face::of(model, placed));
        let lever = (0..n_free).map(|j| lever(model, j, &placed_by[j])).collect();
        Self {
            model,
            index,
            links: Arc::new(links),
            placed_by,
            fixed,
            reach: model.reach(),
            lever,
            leaf,
            face,
            patches: Arc::new(patches),
        }
    }

    /// Makes what tells where beams meet the links' meshes, where it is not there yet.
    pub fn make_triangles(&self, fan: &dyn Fan) {
        fan.fan((0..self.links.len()).collect(), |l| {
            self.links[l].fields.triangles(&self.model.links[l]);
        });
    }

    /// What is prepared for this model, for one with the same links and other places of joints.
    pub(crate) fn moved<'b>(&self, model: &'b Model) -> Prepared<'b> {
        Prepared {
            model,
            index: self.index,
            links: Arc::clone(&self.links),
            placed_by: self.placed_by.clone(),
            fixed: self.fixed.clone(),
            reach: self.reach,
            lever: self.lever.clone(),
            leaf: self.leaf.clone(),
            face: self.face,
            patches: Arc::clone(&self.patches),
        }
    }

    /// No part of the robot gets farther from the base's origin, metres.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Whether a free joint slides.
    pub(crate) fn slides(&self, joint: usize) -> bool {
        self.model.joints[self.model.free[joint]].kind == robot::JointKind::Prismatic
    }

    /// Links placed by a joint or a later one: what stands before it does not change with it.
    pub(crate) fn carried(&self, joint: usize) -> Vec<usize> {
        self.placed_by[joint..].iter().flatten().copied().collect()
    }

    /// Poses of all links in the local frame.
    pub(crate) fn local_from_links(&self, h: &Hypothesis) -> Vec<Pose> {
        self.model.poses(&h.posture).iter().map(|p| h.local_from_base * p).collect()
    }

    /// Links with a surface, and their frames from the local frame.
    pub(crate) fn frames(&self, h: &Hypothesis) -> Vec<(usize, Rows)> {
        let base_from_local = h.local_from_base.inverse();
        let poses = self.model.poses(&h.posture);
        (0..poses.len())
            .filter(|&l| self.links[l].weight > 0.0)
            .map(|l| (l, geometry::depth::rows(&(poses[l].inverse() * base_from_local))))
            .collect()
    }

    /// Whether a link has a surface.
    #[must_use]
    pub fn has_surface(&self, link: usize) -> bool {
        self.links[link].weight > 0.0
    }

    /// The facet of a link that is nearest to a place (link frame, metres), up to about 3 cm away.
    #[must_use]
    pub fn facet_near(&self, link: usize, place: [f32; 3]) -> Option<&Facet> {
        let fields = &self.links[link].fields;
        fields.fine.nearest(place).map(|at| &fields.facets[at])
    }

    /// The facet nearest to a place, up to 15 cm away; farther than about 3 cm it is the nearest of
    /// a few samples.
    #[must_use]
    pub fn facet_about(&self, link: usize, place: [f32; 3]) -> Option<&Facet> {
        let fields = &self.links[link].fields;
        let at = fields.fine.nearest(place).or_else(|| fields.coarse.nearest(place))?;
        Some(&fields.facets[at])
    }

    /// The first `n` samples of a link and their normals, link frame, metres.
    #[must_use]
    pub fn samples(&self, link: usize, n: usize) -> (&[[f32; 3]], &[[f32; 3]]) {
        let cad = &self.model.links[link].cad;
        let n = n.min(cad.points.len());
        (&cad.points[..n], &cad.normals[..n])
    }
}

/// For each link, for each free joint: whether it moves the link (at a posture where no two effects
/// cancel).
fn dependencies(model: &Model) -> Vec<Vec<bool>> {
    let mut posture = model.home();
    for (j, q) in posture.iter_mut().enumerate() {
        let [low, high] = model.limits(j);
        *q = low + (high - low) * (0.37 + 0.021 * j as f64);
    }
    let kinematics = model.kinematics(&posture);
    kinematics
        .twists
        .iter()
        .map(|link| link.iter().map(|t| t.iter().any(|v| v.abs() > 1e-9)).collect())
        .collect()
}

fn lever(model: &Model, free: usize, links: &[usize]) -> f64 {
    let joint = &model.joints[model.free[free]];
    if joint.kind == robot::JointKind::Prismatic {
        return 1.0;
    }
    let poses = model.poses(&model.home());
    let parent_from_joint = poses[joint.parent] * joint.parent_from_joint;
    let axis = parent_from_joint.rotation * joint.axis.into_inner();
    let origin = parent_from_joint.translation.vector;
    let mut distances: Vec<f64> = links
        .iter()
        .flat_map(|&l| {
            let cad = &model.links[l].cad;
            let pose = poses[l];
            cad.points.iter().take(400).map(move |p| {
                let d = (pose * Point::from(p.map(f64::from))).coords - origin;
                d.cross(&axis).norm()
            })
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() * 95 / 100).copied().unwrap_or(0.1).max(0.05)
}
