//! Leaves out of an adjustment the points on an open flange whose beams ended on more than one
//! plane, since a beam has a width.
//!
//! What stands out from such a flange is in one place of many. Its points pull at the wrist
//! whichever way the flange is turned, and so do the points that a scanner makes of beams that end
//! half beside an edge.

use geometry::Vector;
use std::f64::consts::TAU;

use super::adjustment::Adjust;
use crate::correspond::{AdjustPoints, MetTriangle, Pairing, SurfacePair};
use crate::model::BeamPlace;
use crate::problem::{AdjustState, Problem};

/// The width of a scanner's beam.
struct BeamWidth {
    /// Radius at the scanner, metres.
    radius: f64,
    /// What the radius grows by on each metre.
    growth: f64,
}

/// Footprint of the mixed pixels that are measured (`simulate`).
const BEAM: BeamWidth = BeamWidth { radius: 0.0011, growth: 0.000_15 };
/// Places on a beam's rim that are looked at.
const N_RIM: usize = 6;
/// A beam ended on one plane where its rim is no farther from it, metres: what tessellation of the
/// model leaves (`correspond/pairs.rs`).
const FLAT: f64 = 3e-4;

/// All of the points but those on what these joints turn whose beams did not end on one plane; all
/// of them where without those another joint is not determined: a wrist of which little else is
/// seen.
pub(crate) fn on_whole_beams(
    problem: &Problem<'_>,
    state: &AdjustState,
    joints: &[usize],
    mut points: AdjustPoints,
) -> AdjustPoints {
    let links: Vec<usize> = joints.iter().flat_map(|&j| problem.prepared.carried(j)).collect();
    if links.is_empty() {
        return points;
    }
    let whole = on_one_plane(problem, state, &links, &mut points);
    let is_same = whole.points().len() == points.points().len();
    if is_same || is_held(problem, state, joints, &whole) { whole } else { points }
}

/// All of the points but those on these links whose beams did not end on one plane.
fn on_one_plane(
    problem: &Problem<'_>,
    state: &AdjustState,
    links: &[usize],
    points: &mut AdjustPoints,
) -> AdjustPoints {
    problem.prepared.make_triangles(problem.fan);
    let pairing = Pairing::new(problem, state, points.gate);
    let is_kept = |(point, known): (&u32, &mut Option<MetTriangle>)| {
        let pair = pairing.pair(*point, known).filter(|pair| links.contains(&pair.link));
        // Points without a beam, and those of cameras, met no triangle.
        known.is_none() || pair.is_none_or(|pair| is_whole(&pairing, &pair))
    };
    let is_kept = problem.fan.fan(points.chunks(), |(points, known)| {
        points.iter().zip(known).map(is_kept).collect::<Vec<bool>>()
    });
    points.kept(&is_kept.concat())
}

/// Whether some points determine all joints but these.
fn is_held(
    problem: &Problem<'_>,
    state: &AdjustState,
    joints: &[usize],
    points: &AdjustPoints,
) -> bool {
    // A part of them tells.
    let mut part = points.about(problem.settings.part());
    let share = part.points().len() as f64 / points.points().len().max(1) as f64;
    let normal = Adjust::new(problem).at(state, &mut part);
    let variance = normal.covariance(&problem.prepared.patches) * share;
    let limit = problem.settings.determined_sigma.powi(2);
    let mut others = (0..state.hypothesis.posture.len()).filter(|j| !joints.contains(j));
    others.all(|j| variance[(6 + j, 6 + j)] < limit)
}

/// Whether the rim of the beam that gave a point ended on the plane that its middle met.
fn is_whole(pairing: &Pairing<'_>, pair: &SurfacePair) -> bool {
    let range = pair.beam.norm();
    let radius = BEAM.radius + BEAM.growth * range;
    let u = pair.ray.cross(&Vector::z()).try_normalize(1e-6).unwrap_or_else(Vector::x);
    let v = pair.ray.cross(&u);
    (0..N_RIM).all(|k| {
        let (sin, cos) = (TAU * k as f64 / N_RIM as f64).sin_cos();
        let beside = (u * cos + v * sin) * radius;
        let ray = (pair.ray * range + beside) / range.hypot(radius);
        let met = pairing.meets(BeamPlace { at: &(pair.p + beside), ray: &ray });
        met.is_some_and(|(t, ..)| (pair.n.dot(&(beside + ray * t)) + pair.r).abs() <= FLAT)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::before_front;

    #[test]
    fn beams_that_end_half_beside_an_edge_are_left_out_on_the_links_asked_about() {
        // On the front of a cube, 3 m from the scanner: beams are 3 mm wide there.
        let from_edge = [0.0005, 0.001, 0.003, 0.02, 0.1];
        let places = from_edge.map(|from| [0.1 - from, 0.0]).to_vec();
        before_front(&places, |problem, state| {
            let mut points = AdjustPoints::new((0..5).collect(), 0.02);
            let mut left = |links: &[usize]| {
                on_one_plane(problem, state, links, &mut points).points().to_vec()
            };
            assert_eq!(left(&[0]), [2, 3, 4]);
            assert_eq!(left(&[1]), [0, 1, 2, 3, 4]);
        });
    }

    #[test]
    fn joints_that_nothing_holds_are_told() {
        // All points lie on the link before the only joint.
        let places: Vec<[f64; 2]> = (0..60).map(|i| [0.002 * f64::from(i % 10), 0.0]).collect();
        before_front(&places, |problem, state| {
            let points = AdjustPoints::new((0..60).collect(), 0.02);
            let is_held = |open: &[usize]| is_held(problem, state, open, &points);
            assert!(!is_held(&[]));
            assert!(is_held(&[0]));
        });
    }
}
