//! Finds installation planes among horizontal patches: planes that are no floor, but large enough
//! for a robot to stand on.

use crate::Settings;
use crate::levels::{PieceLevel, ScannerPlaces, scanner, seen_through};
use crate::pieces::upward;
use crate::union::Union;
use contract::{FloorLevel, InstallationPlane, PlanePatch, ScanId};
use geometry::{Aabb, Moments, Plane, Vector};

/// Distance between patches below which they always belong to one plane, metres: two scans of one
/// plate.
const SAME_HEIGHT: f64 = 0.005;
/// Error of the tilt of a small patch, radians: 1°.
const TILT_ERROR: f64 = 0.0175;

/// Joins patches that face up to planes and returns the largest ones, largest first.
pub(crate) fn stands(
    patches: &[PlanePatch],
    found: &[PieceLevel],
    levels: &[FloorLevel],
    scanners: &ScannerPlaces,
    settings: &Settings,
) -> Vec<InstallationPlane> {
    let mut chosen: Vec<&PlanePatch> = patches
        .iter()
        .filter(|p| !is_floor(p, levels, settings) && !is_ghost(p, found, scanners, settings))
        .collect();
    chosen.sort_by(|a, b| a.bounds.min[0].total_cmp(&b.bounds.min[0]));
    let mut union = Union::new(chosen.len());
    for (i, a) in chosen.iter().enumerate() {
        for (j, b) in chosen.iter().enumerate().skip(i + 1) {
            if b.bounds.min[0] > a.bounds.max[0] + settings.stand_gap {
                break;
            }
            if one_plane(a, b, settings) {
                union.join(i, j);
            }
        }
    }
    let mut groups: Vec<(usize, usize)> = (0..chosen.len()).map(|i| (union.find(i), i)).collect();
    groups.sort_unstable();
    let mut out: Vec<InstallationPlane> = groups
        .chunk_by(|a, b| a.0 == b.0)
        .filter_map(|group| {
            let members: Vec<&PlanePatch> = group.iter().map(|g| chosen[g.1]).collect();
            plane_of(&members, settings)
        })
        .collect();
    out.sort_by(|a, b| b.area.total_cmp(&a.area));
    out.truncate(settings.max_stands);
    out
}

/// Whether a patch lies on a floor level.
fn is_floor(patch: &PlanePatch, levels: &[FloorLevel], settings: &Settings) -> bool {
    let p = patch.moments.mean();
    levels.iter().any(|level| {
        level.height(p.x, p.y).is_some_and(|h| {
            // A large patch close to the floor is the floor of a scan that is registered slightly
            // higher.
            let band =
                if patch.area > 1.0 { 2.5 * settings.floor_band } else { settings.floor_band };
            (p.z - h).abs() <= band.max(1.5 * patch.rms)
        })
    })
}

/// Whether a patch was seen through a floor level and is therefore a mirror image.
fn is_ghost(
    patch: &PlanePatch,
    levels: &[PieceLevel],
    scanners: &ScannerPlaces,
    settings: &Settings,
) -> bool {
    scanner(scanners, patch.scan).is_some_and(|from| {
        levels.iter().any(|level| seen_through(patch, from, level) > settings.ghost_share)
    })
}

/// Whether two patches belong to one plane.
fn one_plane(a: &PlanePatch, b: &PlanePatch, settings: &Settings) -> bool {
    // Heights differ little, so that only the horizontal gap matters.
    let gap = |i: usize| (a.bounds.min[i] - b.bounds.max[i]).max(b.bounds.min[i] - a.bounds.max[i]);
    if gap(0).max(gap(1)) > settings.stand_gap {
        return false;
    }
    let (p, q) = (a.moments.mean(), b.moments.mean());
    let step = |plane: &Plane, at: Vector| plane.distance(&at).abs();
    let far = (p - q).norm();
    let limit = SAME_HEIGHT + 1.5 * (a.rms + b.rms) / 2.0;
    // The larger patch determines its tilt better, so that its plane is tested and must hold.
    let (large, small) = if a.area >= b.area { (a, q) } else { (b, p) };
    let reach = large.area.sqrt().max(0.05);
    step(&large.plane, small) <= limit + TILT_ERROR * (far - reach).max(0.0) * 0.25
}

/// The joined plane of patches, each weighted by its area; `None` if it is too small or tilted.
fn plane_of(members: &[&PlanePatch], settings: &Settings) -> Option<InstallationPlane> {
    let mut moments = Moments::new(members.first()?.moments.mean());
    let mut bounds = Aabb::EMPTY;
    for patch in members {
        let mut part = patch.moments;
        let weight = patch.area / part.n.max(1.0);
        part.n *= weight;
        part.sum *= weight;
        part.outer *= weight;
        moments.join(&part);
        bounds = bounds.union(&patch.bounds);
    }
    let area = best_scan(members);
    // `plane()` requires three points; the weights are areas, which are scaled to count as points.
    let scale = 1e4;
    moments.n *= scale;
    moments.sum *= scale;
    moments.outer *= scale;
    let plane = match moments.plane() {
        Some(fit) if fit.spread[1] >= 4.0 * fit.rms => {
            if fit.plane.normal.z < 0.0 {
                fit.plane.flipped()
            } else {
                fit.plane
            }
        }
        _ => upward(&moments),
    };
    let level = plane.normal.z >= settings.max_tilt.cos();
    (level && area >= settings.min_stand_area).then_some(InstallationPlane {
        plane,
        bounds,
        area,
        is_floor: false,
    })
}

/// Largest area that a single scan sees; areas of several scans would count the same surface twice.
fn best_scan(members: &[&PlanePatch]) -> f64 {
    let mut areas: Vec<(ScanId, f64)> = members.iter().map(|p| (p.scan, p.area)).collect();
    areas.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    areas
        .chunk_by(|a, b| a.0 == b.0)
        .map(|scan| scan.iter().map(|a| a.1).sum::<f64>())
        .fold(0.0, f64::max)
}
