//! Finds places of the model's surface that beams went through, each with the place where its beam
//! ended. These matches go from the model to the scans (METHOD.md §11), those of points the other
//! way; they use what the beams saw.

use geometry::Vector;
use geometry::depth::{rotate, rows, transform};
use geometry::probe::MIN_FACING;

use super::matching::Match;
use crate::problem::Problem;
use crate::state::Hypothesis;

/// Samples of a link that are asked: as many as tell a hypothesis in the search.
const N_SAMPLES: usize = 100;
/// How deep a beam must have gone through a surface for it to count as pierced.
struct PiercedDepth {
    /// In gates: points tell what is nearer.
    gates: f64,
    /// No less than so many standard deviations of the scans' noise.
    sigmas: f64,
    /// Gates below this hold only what is on the surface already, metres.
    least_gate: f64,
}

const DEEP: PiercedDepth = PiercedDepth { gates: 0.25, sigmas: 4.0, least_gate: 0.03 };

/// Surface that stands before what a beam measured, by less than the gate: it has to give way
/// along the beam.
pub(crate) fn pierced(problem: &Problem<'_>, h: &Hypothesis, gate: f64) -> Vec<Match> {
    let mut out = Vec::new();
    if gate < DEEP.least_gate {
        return out;
    }
    let tolerance = (DEEP.gates * gate).max(DEEP.sigmas * problem.scene.noise) as f32;
    let base_from_local = h.local_from_base.inverse();
    for (link, pose) in problem.prepared.local_from_links(h).iter().enumerate() {
        let to_local = rows(pose);
        let (points, normals) = problem.prepared.samples(link, N_SAMPLES);
        for (p, n) in points.iter().zip(normals) {
            let (p, n) = (transform(&to_local, *p), rotate(&to_local, *n));
            let Some((ray, ahead)) = farthest(problem, p, n, tolerance) else { continue };
            if f64::from(ahead) < gate {
                let at = geometry::Point::from(p.map(f64::from));
                let n = base_from_local.rotation * ray;
                let q = (base_from_local * at).coords + n * f64::from(ahead);
                out.push(Match { link, q, n, r: f64::from(ahead) });
            }
        }
    }
    out
}

/// The beam that went farthest beyond a place of the surface (local frame), and how far; `None`
/// where none went through.
fn farthest(
    problem: &Problem<'_>,
    p: [f32; 3],
    n: [f32; 3],
    tolerance: f32,
) -> Option<(Vector, f32)> {
    let mut best: Option<(Vector, f32)> = None;
    for eye in problem.scene.scouts.eyes() {
        let at = eye.at();
        let ray = Vector::from_fn(|i, _| f64::from(p[i] - at[i])).normalize();
        let facing = -(0..3).map(|i| f64::from(n[i]) * ray[i]).sum::<f64>();
        if facing < f64::from(MIN_FACING) {
            continue;
        }
        let Some(look) = eye.look(p, 0.5 * tolerance) else { continue };
        let ahead = look.around - look.range;
        if ahead > tolerance && best.as_ref().is_none_or(|b| ahead > b.1) {
            best = Some((ray, ahead));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::pierced as pierced_at;
    use super::*;
    use crate::{MeasuredScene, Prepared, Settings};
    use contract::{MaskId, OneByOne, Region, ScanId, View};
    use geometry::depth::Empty;
    use geometry::{Aabb, DepthImage, Point, Pose};

    /// What a scanner at the origin sees of a wall 5 m ahead of it, along z.
    fn wall() -> View {
        let mut image = DepthImage::new(Pose::identity(), 0.5, 200.0);
        for (i, j) in (-250..250).flat_map(|i| (-250..250).map(move |j| (i, j))) {
            image.splat([i as f32 * 0.01, j as f32 * 0.01, 5.0]);
        }
        image.finish(2, |_| Empty::Unknown);
        let (scan, mask, scanner) = (ScanId(0), MaskId(0), Some(Point::origin()));
        let (beam_step, is_camera, points) = (0.002, false, Vec::new());
        View { scan, mask, scanner, beam_step, is_camera, images: vec![image], points }
    }

    #[test]
    fn surface_before_what_beams_measured_gives_way_along_them() {
        let urdf = "<robot name='block'><link name='block'><visual><geometry><box size='0.2 0.2 0.2'/></geometry></visual></link></robot>";
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("block.urdf");
        std::fs::write(&path, urdf).expect("is written");
        let settings = robot::Settings::default();
        let model = robot::Model::load_urdf(&path, "block", &settings).expect("loads").0;
        let prepared = Prepared::new(0, &model, &OneByOne);
        let region = Region { origin: Point::origin(), bounds: Aabb::EMPTY };
        let (views, settings) = ([wall()], Settings::default());
        let scene = MeasuredScene::new(&region, &views, &[], &settings, &OneByOne);
        let problem = Problem::new(&prepared, &scene, &settings, &OneByOne);
        let pierced = |front: f64, gate: f64| {
            let local_from_base = Pose::translation(0.0, 0.0, front + 0.1);
            pierced_at(&problem, &Hypothesis::at(local_from_base, Vec::new()), gate)
        };
        let before = pierced(4.95, 0.12);
        assert!(before.len() > 10, "only {} samples of the front", before.len());
        for m in &before {
            // A beam 0.4 m aside is longer by a part in 300.
            assert!((m.r - 0.05).abs() < 0.003 && m.n.z > 0.99, "{} along {}", m.r, m.n);
        }
        assert!(pierced(4.99, 0.12).is_empty(), "as near as the points tell");
        assert!(pierced(5.05, 0.12).is_empty(), "behind what was measured");
        assert!(pierced(4.5, 0.12).is_empty(), "too far to say where it belongs");
        assert!(pierced(4.95, 0.02).is_empty(), "the last rounds go by the points");
    }
}
