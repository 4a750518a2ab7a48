//! Turns the classes of a tile's points into lists of labels and of residual voxels.

use contract::{
    Label, LinkAt, PlaceRun, PointKind, RESIDUAL_EDGE, ResidualVoxel, SurfaceSums, Tile, TileLabels,
};
use geometry::narrow::floor_i32;
use geometry::{Point, Pose, Vector};

/// The class of a point before its neighbours are considered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum PointState {
    /// Away from robots, or on the floor.
    Default,
    /// Within the gate of a link.
    Link(NearestLink),
    /// Between one and two gates from a link.
    Doubt(NearestLink),
    /// Near a robot, but on none of its links.
    Residual(NearestLink),
    /// A mixed pixel between a link's edge and the surface behind it.
    Veil,
}

/// The nearest link of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NearestLink {
    pub(crate) link: LinkAt,
    /// Distance from its surface, metres; infinite beyond the field.
    pub(crate) distance: f32,
    pub(crate) at_border: bool,
    pub(crate) grounded: bool,
}

/// Turns what was found into lists sorted by place and by voxel.
pub(crate) fn gather(
    tile: &Tile,
    world_from_scan: &Pose,
    found: &[PointState],
    normal: impl Fn(usize) -> Option<[f32; 3]>,
    mut out: TileLabels,
) -> TileLabels {
    for (i, found) in found.iter().enumerate() {
        let place = tile.first_place + u64::from(tile.place[i]);
        let (touch, on_link) = match *found {
            PointState::Link(touch) => (touch, true),
            PointState::Residual(touch) | PointState::Doubt(touch) => (touch, false),
            PointState::Veil => {
                out.labels.push(PlaceRun::one(place, Label::UNCERTAIN));
                continue;
            }
            PointState::Default => continue,
        };
        let at = world(world_from_scan, tile.xyz[i]).map(|v| v / RESIDUAL_EDGE);
        let voxel = at.map(floor_i32);
        if on_link {
            let (robot, link) = (touch.link.robot as i16, touch.link.link as i16);
            out.labels.push(PlaceRun::one(place, Label { kind: PointKind::Link, robot, link }));
        } else {
            out.residuals.push(PlaceRun::one(place, voxel));
        }
        let entry = ResidualVoxel {
            voxel,
            n_residual: u32::from(!on_link),
            n_link: u32::from(on_link),
            nearest: touch.link,
            distance: touch.distance,
            at_border: touch.at_border && !on_link,
            grounded: touch.grounded && !on_link,
            surface: match on_link {
                true => SurfaceSums::default(),
                false => surface(world_from_scan, at, tile.xyz[i], normal(i)),
            },
        };
        match out.voxels.last_mut() {
            Some(last) if last.voxel == voxel => last.join(&entry),
            _ => out.voxels.push(entry),
        }
    }
    PlaceRun::join(&mut out.labels);
    PlaceRun::join(&mut out.residuals);
    ResidualVoxel::merge(&mut out.voxels);
    out
}

/// The surface at a point: `at` are its world coordinates in voxels, `p` its place and `normal` its
/// normal of any sign in the frame of the scan.
fn surface(
    world_from_scan: &Pose,
    at: [f64; 3],
    p: [f32; 3],
    normal: Option<[f32; 3]>,
) -> SurfaceSums {
    let to_scanner = |n: [f32; 3]| {
        let away = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] > 0.0;
        let n = n.map(|v| f64::from(if away { -v } else { v }));
        (world_from_scan.rotation * Vector::from(n)).into()
    };
    SurfaceSums::of(at.map(|v| v - v.floor()), normal.map(to_scanner))
}

#[inline]
pub(crate) fn world(world_from_scan: &Pose, p: [f32; 3]) -> [f64; 3] {
    let w = world_from_scan * Point::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
    [w.x, w.y, w.z]
}
