//! Derivatives of a point-to-plane residual by base twist, joints and the places of joints
//! (METHOD.md §11.1).
//!
//! Residual of a point q (base frame) at the facet (x, n) of a link: `r = n·(q − x)`. A joint moves
//! the facet with the twist (v, w), so `∂r/∂θ = −(n·v + w·(q × n))`: exact, since x and n both
//! move. The base moves the point's image the other way.

use geometry::Vector;
use robot::{Kinematics, Model};

/// Derivatives by base twist (translation, rotation about the base's origin; base axes) and by
/// each joint, for a point and a facet's normal in the base frame. `twists` are those of the
/// facet's link; `out` holds 6 values and one a joint.
pub(crate) fn residual_row(q: &Vector, n: &Vector, twists: &[[f64; 6]], out: &mut [f64]) {
    let qxn = q.cross(n);
    for i in 0..3 {
        out[i] = -n[i];
        out[3 + i] = -qxn[i];
    }
    for (j, t) in twists.iter().enumerate() {
        let v = n.x * t[0] + n.y * t[1] + n.z * t[2];
        let w = qxn.x * t[3] + qxn.y * t[4] + qxn.z * t[5];
        out[6 + j] = -(v + w);
    }
}

/// How links move with the places of joints on their parents.
pub(crate) struct JointPlaces {
    /// For each joint: twists `[v, w]` in the base frame for unit shifts and turns along its
    /// frame's axes.
    twists: Vec<[[f64; 6]; 6]>,
    /// For each link, for each joint: whether the joint carries it.
    carries: Vec<Vec<bool>>,
}

impl JointPlaces {
    /// For some joints of a model, by their index among all joints.
    pub(crate) fn new(model: &Model, kinematics: &Kinematics, joints: &[usize]) -> Self {
        let twists = joints.iter().map(|&j| {
            let joint = &model.joints[j];
            let frame = kinematics.base_from_link[joint.parent] * joint.parent_from_joint;
            let at = frame.translation.vector;
            std::array::from_fn(|i| {
                let axis = frame.rotation * Vector::ith(i % 3, 1.0);
                let v = if i < 3 { axis } else { at.cross(&axis) };
                let w = if i < 3 { Vector::zeros() } else { axis };
                [v.x, v.y, v.z, w.x, w.y, w.z]
            })
        });
        let twists = twists.collect();
        let carries = (0..if joints.is_empty() { 0 } else { model.links.len() })
            .map(|l| joints.iter().map(|&j| model.hangs_on(l, j)).collect())
            .collect();
        Self { twists, carries }
    }

    /// Derivatives of a residual at a point of a link with a facet's normal (base frame): six
    /// values a joint.
    pub(crate) fn row(&self, link: usize, q: &Vector, n: &Vector, out: &mut [f64]) {
        let qxn = q.cross(n);
        for (f, twists) in self.twists.iter().enumerate() {
            for (i, t) in twists.iter().enumerate() {
                out[6 * f + i] = if self.carries[link][f] {
                    -(n.x * t[0]
                        + n.y * t[1]
                        + n.z * t[2]
                        + qxn.x * t[3]
                        + qxn.y * t[4]
                        + qxn.z * t[5])
                } else {
                    0.0
                };
            }
        }
    }
}
