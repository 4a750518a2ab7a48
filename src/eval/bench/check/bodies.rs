//! Bodies of a scanned robot: meshes of what moves with a link, and the volume that it fills.

use contract::SpaceGrid;
use geometry::{Aabb, Point, Pose};
use glamx::Vec3;
use nalgebra::Point3;
use parry3d::shape::TriMesh;
use simulate::BodyShape;
use std::cell::Cell;
use std::collections::BTreeMap;

/// Greatest side of triangles of obstacles within reach, metres.
const SHORT: f32 = 0.2;
/// Spacing of positions that are examined for visibility, metres; finer than the eighths of voxels
/// of known space.
const SAMPLE: f64 = 0.02;
/// Edge of the voxels that mark the scanned robot's own volume, and spacing of the positions that
/// mark them, metres.
const OWN_EDGE: f64 = 0.02;
pub(super) const OWN_SAMPLE: f64 = 0.008;

/// A body that moves with a link, in its frame.
pub(super) struct MeshPart {
    pub(super) link: usize,
    pub(super) mesh: TriMesh,
    pub(super) bounds: Aabb,
    /// Places on its surface, and outward normals.
    pub(super) samples: Vec<(Point, geometry::Vector)>,
    /// The obstacle triangle that was nearest last: it is probably near in the next posture, too,
    /// which saves most others.
    pub(super) last: Cell<Option<u32>>,
    /// Lower bound of its distance at the last examination, and its bounds then.
    pub(super) kept: Cell<Option<(f64, [Point; 8])>>,
}

/// Voxels that a robot fills as it is scanned, as far as a result can know it.
pub(super) struct OwnVolume {
    pub(super) grid: SpaceGrid,
    pub(super) filled: Vec<bool>,
}

impl MeshPart {
    /// Lower bound of its distance with these bounds: no point of it has moved farther than the
    /// corners of its bounds.
    pub(super) fn keeps(&self, corners: &[Point; 8]) -> f64 {
        let Some((kept, before)) = self.kept.get() else { return 0.0 };
        let ways = before.iter().zip(corners).map(|(a, b)| (b - a).norm());
        kept - ways.fold(0.0, f64::max)
    }

    pub(super) fn of(link: usize, shape: &BodyShape, world_from_link: &Pose) -> Option<Self> {
        let link_from_world = world_from_link.inverse();
        let inner = |p: &[f32; 3]| {
            (link_from_world * Point::from(p.map(f64::from))).coords.map(|v| v as f32)
        };
        let corners: Vec<Vec3> =
            shape.triangles.iter().flatten().map(|p| Vec3::from_array(inner(p).into())).collect();
        let bounds = Aabb::of(corners.iter().map(|p| p.to_array().map(f64::from)));
        let triangles: Vec<[u32; 3]> =
            (0..shape.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let thin = |p: &Point| [p.x, p.y, p.z].map(|v| (v / SAMPLE).floor() as i32);
        let mut samples = BTreeMap::new();
        for t in corners.chunks_exact(3) {
            let normal = (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero().to_array();
            let normal = geometry::Vector::from(normal.map(f64::from));
            places(&[t[0], t[1], t[2]], 0.5 * SAMPLE, |p| {
                samples.entry(thin(&p)).or_insert((p, normal));
            });
        }
        let samples = samples.into_values().collect();
        let mesh = TriMesh::new(corners, triangles).ok()?;
        Some(Self { link, mesh, bounds, samples, last: Cell::new(None), kept: Cell::new(None) })
    }
}

impl OwnVolume {
    /// Surfaces and enclosed volumes of the links of a model, and of hoses, which are thinner than
    /// a voxel of known space. What else the robot carries lies within the bounds.
    pub(super) fn of_bodies<'s>(shapes: impl Iterator<Item = &'s BodyShape>) -> Self {
        let (mut all, mut surface) = (Vec::new(), Vec::new());
        for shape in shapes {
            let is_known = shape.is_of_model || shape.link.is_none();
            for t in &shape.triangles {
                places(&t.map(Vec3::from_array), OWN_SAMPLE, |p| {
                    all.push(p);
                    surface.extend(is_known.then_some(p));
                });
            }
        }
        let bounds = Aabb::of(all.iter().map(|p| p.coords.into()));
        let grid = SpaceGrid::over(&bounds.grown(2.0 * OWN_EDGE), OWN_EDGE);
        let mut filled = vec![false; grid.size.iter().product()];
        let surface: Vec<usize> =
            surface.iter().filter_map(|p| grid.index(p.coords.into())).collect();
        surface.iter().for_each(|at| filled[*at] = true);
        grid.enclosed(&bounds, &surface).into_iter().for_each(|at| filled[at] = true);
        Self { grid, filled }
    }
}

/// The triangles of a hose by the link that is nearest, with which they move, as bodies of these
/// links.
pub(super) fn hose_pieces(hose: &BodyShape, parts: &[MeshPart], poses: &[Pose]) -> Vec<MeshPart> {
    let samples: Vec<(usize, Point)> = parts
        .iter()
        .flat_map(|part| part.samples.iter().map(|(p, _)| (part.link, poses[part.link] * p)))
        .collect();
    let mut by_link: BTreeMap<usize, Vec<[[f32; 3]; 3]>> = BTreeMap::new();
    for t in &hose.triangles {
        let at = Point::from(t[0].map(f64::from));
        let off = |s: &&(usize, Point)| (s.1 - at).norm_squared();
        if let Some((link, _)) = samples.iter().min_by(|a, b| off(a).total_cmp(&off(b))) {
            by_link.entry(*link).or_default().push(*t);
        }
    }
    let piece = |(link, triangles): (usize, Vec<[[f32; 3]; 3]>)| {
        MeshPart::of(link, &BodyShape { triangles, ..hose.clone() }, &poses[link])
    };
    by_link.into_iter().filter_map(piece).collect()
}

/// Divides a triangle into pieces that are small within reach: bounding boxes of long oblique
/// triangles contain much that is far from them.
pub(super) fn pieces(
    [a, b, c]: [Vec3; 3],
    near: Vec3,
    within: f32,
    take: &mut impl FnMut([Vec3; 3]),
) {
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let off = (low - near).max(near - high).max(Vec3::ZERO).length();
    let lengths = [(b - a).length(), (c - b).length(), (a - c).length()];
    let longest = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j])).unwrap_or(0);
    if lengths[longest] <= SHORT || off > within {
        return take([a, b, c]);
    }
    // Across its longest side.
    let [a, b, c] = [[a, b, c], [b, c, a], [c, a, b]][longest];
    let middle = (a + b) * 0.5;
    pieces([a, middle, c], near, within, take);
    pieces([middle, b, c], near, within, take);
}

/// Places on a triangle, about so far apart, metres.
pub(super) fn places([a, b, c]: &[Vec3; 3], apart: f64, mut take: impl FnMut(Point)) {
    let longest = (*b - *a).length().max((*c - *a).length()).max((*c - *b).length());
    let n = (f64::from(longest) / apart).ceil().max(1.0) as usize;
    for i in 0..=n {
        for j in 0..=n - i {
            let (u, v) = (i as f32 / n as f32, j as f32 / n as f32);
            let p = *a + (*b - *a) * u + (*c - *a) * v;
            take(Point3::from(p.to_array().map(f64::from)));
        }
    }
}
