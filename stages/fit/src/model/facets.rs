//! Samples of a link's surface, ordered so that neighbours in space are neighbours in memory, and
//! the nearest of them to any place near the surface.

use geometry::{NearestField, Vector};
use robot::{CadCloud, Link};
use std::sync::OnceLock;

use super::patches::{PATCH_EDGE, PatchPlace};
use super::triangles::Triangles;

/// A field of nearest samples.
struct FieldSize {
    /// Edge of a voxel, metres; of the fine field the largest that is used.
    voxel: f32,
    /// Farthest distance from a sample at which the field answers, metres.
    reach: f32,
}

/// The coarse field: its reach covers the first gate (120 mm, METHOD.md §11), a voxel is a fifth of
/// that.
const COARSE: FieldSize = FieldSize { voxel: 0.025, reach: 0.15 };
/// The first samples of a link, of which the coarse field is made.
const N_COARSE: usize = 2500;
/// The fine field: its reach covers the last gates.
const FINE: FieldSize = FieldSize { voxel: 0.007, reach: 0.032 };
/// Voxel of the fine field in spacings of the samples: in larger voxels the nearest sample is
/// missed.
const FINE_VOXEL_SPACINGS: f32 = 1.4;
/// Most voxels of a fine field, about.
const MAX_VOXELS: f64 = 5e5;
/// Samples within a cube of this edge, metres, are neighbours in memory: some twenty of them.
const NEAR: f32 = 0.016;

/// A sample of a surface, link frame.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    /// Metres.
    pub x: [f32; 3],
    /// Outward normal, unit length.
    pub n: [f32; 3],
}

/// Samples of a link's surface, and which of them is nearest to a place.
#[derive(Debug, Default)]
pub(crate) struct Fields {
    pub(crate) facets: Vec<Facet>,
    /// Patch of each facet.
    patches: Vec<u32>,
    /// The patches, sorted.
    keys: Vec<PatchKey>,
    /// Reaches far, from few samples: for the first iterations.
    pub(crate) coarse: NearestField,
    /// Exact, reaches 3 cm: for the last ones.
    pub(crate) fine: NearestField,
    /// The surface itself, made when it is first asked for.
    triangles: OnceLock<Triangles>,
}

/// What tells a patch: the side that it looks to (two for each axis of the link's frame), and its
/// cell.
type PatchKey = (u8, [i32; 3]);

impl Fields {
    pub(crate) fn new(link: &Link) -> Self {
        let cad = &link.cad;
        let order = order(cad);
        let facet = |&i: &u32| Facet { x: cad.points[i as usize], n: cad.normals[i as usize] };
        let facets: Vec<Facet> = order.iter().map(facet).collect();
        let all: Vec<[f32; 3]> = facets.iter().map(|f| f.x).collect();
        // The first samples of a model are spread evenly.
        let is_first = |at: &u32| (order[*at as usize] as usize) < N_COARSE;
        let first: Vec<u32> = (0..order.len() as u32).filter(is_first).collect();
        let few: Vec<[f32; 3]> = first.iter().map(|&at| all[at as usize]).collect();
        let coarse = NearestField::new(&few, COARSE.voxel, COARSE.reach).renumbered(&first);
        let fine = NearestField::new(&all, voxel(link), FINE.reach);
        let (patches, keys) = patches(&facets);
        Self { facets, patches, keys, coarse, fine, triangles: OnceLock::new() }
    }

    /// The side that each patch looks to.
    pub(crate) fn sides(&self) -> impl Iterator<Item = u8> {
        self.keys.iter().map(|key| key.0)
    }

    /// Where each patch lies.
    pub(crate) fn places(&self) -> Vec<PatchPlace> {
        let mut sums = vec![[Vector::zeros(); 2]; self.keys.len()];
        let mut counts = vec![0.0; self.keys.len()];
        for (facet, &patch) in self.facets.iter().zip(&self.patches) {
            let values = [facet.x, facet.n].map(|v| Vector::from(v.map(f64::from)));
            sums[patch as usize].iter_mut().zip(values).for_each(|(s, v)| *s += v);
            counts[patch as usize] += 1.0;
        }
        sums.iter()
            .zip(counts)
            .map(|([x, n], count)| PatchPlace::new(x / count, n / count))
            .collect()
    }

    /// The patch of a facet.
    pub(crate) fn patch(&self, facet: usize) -> u32 {
        self.patches[facet]
    }

    /// The patch of a place on the surface, with the normal there; `None` where no sample is on it.
    pub(crate) fn patch_at(&self, x: &Vector, n: &Vector) -> Option<u32> {
        let facet = Facet { x: x.map(|v| v as f32).into(), n: n.map(|v| v as f32).into() };
        self.keys.binary_search(&patch_key(&facet)).ok().map(|at| at as u32)
    }

    /// The triangles of the link's mesh.
    pub(crate) fn triangles(&self, link: &Link) -> &Triangles {
        self.triangles.get_or_init(|| Triangles::new(&link.mesh))
    }
}

/// Edge of a link's fine voxels, metres.
fn voxel(link: &Link) -> f32 {
    let volume: f64 = link.bounds.grown(2.0 * f64::from(FINE.reach)).size().iter().product();
    (FINE_VOXEL_SPACINGS * link.cad.spacing)
        .max((volume / MAX_VOXELS).cbrt() as f32)
        .min(FINE.voxel)
}

/// Cuts a surface into patches: cells of the link's frame, apart by the side they look to.
fn patches(facets: &[Facet]) -> (Vec<u32>, Vec<PatchKey>) {
    let each: Vec<_> = facets.iter().map(patch_key).collect();
    let mut keys = each.clone();
    keys.sort_unstable();
    keys.dedup();
    let at = |k| keys.partition_point(|other| other < k) as u32;
    (each.iter().map(at).collect(), keys)
}

fn patch_key(facet: &Facet) -> PatchKey {
    let n = facet.n;
    let side = (0..3).fold(0, |a, b| if n[b].abs() > n[a].abs() { b } else { a });
    let cell = facet.x.map(|v| (v / PATCH_EDGE).floor() as i32);
    (side as u8 * 2 + u8::from(n[side] < 0.0), cell)
}

/// The samples along a curve that fills space (Morton's).
fn order(cad: &CadCloud) -> Vec<u32> {
    let low =
        cad.points.iter().fold([f32::INFINITY; 3], |low, p| [0, 1, 2].map(|i| low[i].min(p[i])));
    let key = |p: &[f32; 3]| {
        (0..3).fold(0_u64, |key, i| key | spread(((p[i] - low[i]) / NEAR) as u32) << i)
    };
    let mut keyed: Vec<(u64, u32)> = cad.points.iter().map(key).zip(0..).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, i)| i).collect()
}

/// The low 21 bits of a number with two zeros between each.
fn spread(v: u32) -> u64 {
    let mut x = u64::from(v & 0x1f_ffff);
    for (shift, mask) in [
        (32, 0x1f_0000_0000_ffff),
        (16, 0x1f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}
