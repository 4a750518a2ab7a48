//! A posture in; its links with a surface where they stand, and for any point the nearest facet of them, out.
//!
//! Most links are far from most points: the boxes of their fields tell, eight at a time, before the fields are asked.

use geometry::depth::{Rows, transform};
use geometry::{NearestField, Pose};

use crate::Prepared;
use crate::beam::Hypothesis;
use crate::facets::Fields;
use crate::refine::FINE_REACH;

/// Links that are asked together.
const N_LANES: usize = 8;

/// A facet of a link next to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Near {
    pub(crate) link: usize,
    /// Its number among the link's.
    pub(crate) facet: usize,
    /// Metres.
    pub(crate) distance: f64,
}

/// Links of a posture, for points in the local frame.
pub(crate) struct Placed<'a> {
    prepared: &'a Prepared<'a>,
    links: Vec<(usize, Rows)>,
    boxes: Vec<Boxes>,
    is_fine: bool,
}

/// The grids of eight links' fields: a point's place in them, in voxels, and how many they have on each axis; none in lanes
/// that hold none.
#[derive(Debug, Clone, Copy)]
struct Boxes {
    voxel_from_local: [[[f32; N_LANES]; 4]; 3],
    size: [[f32; N_LANES]; 3],
}

/// Places in eight grids, axis by axis, in voxels.
type Places = [[f32; N_LANES]; 3];

impl Boxes {
    const NONE: Self =
        Self { voxel_from_local: [[[0.0; N_LANES]; 4]; 3], size: [[-1.0; N_LANES]; 3] };

    /// Puts a field, whose link stands so, into a lane.
    fn set(&mut self, lane: usize, field: &NearestField, link_from_local: &Pose) {
        let (origin, inverse_edge) = field.grid();
        let rows = geometry::depth::rows(link_from_local);
        for axis in 0..3 {
            let [x, y, z, t] = rows[axis];
            let row = [x, y, z, t - origin[axis]].map(|v| v * inverse_edge);
            (0..4).for_each(|i| self.voxel_from_local[axis][i][lane] = row[i]);
            self.size[axis][lane] = field.size()[axis] as f32;
        }
    }

    /// Where a point is in each grid; bit by bit, in which of them it is.
    #[inline]
    fn hold(&self, p: [f32; 3]) -> (u8, Places) {
        let mut places = [[0.0_f32; N_LANES]; 3];
        let mut is_in = [true; N_LANES];
        for axis in 0..3 {
            let [x, y, z, t] = &self.voxel_from_local[axis];
            for k in 0..N_LANES {
                let v = x[k] * p[0] + y[k] * p[1] + z[k] * p[2] + t[k];
                places[axis][k] = v;
                is_in[k] &= v >= 0.0 && v < self.size[axis][k];
            }
        }
        ((0..N_LANES).fold(0, |bits, k| bits | u8::from(is_in[k]) << k), places)
    }
}

/// The field that serves a gate.
fn field(fields: &Fields, is_fine: bool) -> &NearestField {
    if is_fine { &fields.fine } else { &fields.coarse }
}

impl<'a> Placed<'a> {
    /// The links that are chosen, for samples within `gate` metres.
    pub(crate) fn new(
        prepared: &'a Prepared<'_>,
        h: &Hypothesis,
        gate: f64,
        chosen: impl Fn(usize) -> bool,
    ) -> Self {
        let is_fine = gate < FINE_REACH;
        let mut links = prepared.frames(h);
        links.retain(|(l, _)| chosen(*l));
        let poses = prepared.model.poses(&h.posture);
        let eight = |links: &[(usize, Rows)]| {
            let mut out = Boxes::NONE;
            for (lane, (l, _)) in links.iter().enumerate() {
                let link_from_local = (h.local_from_base * poses[*l]).inverse();
                out.set(lane, field(&prepared.links[*l].fields, is_fine), &link_from_local);
            }
            out
        };
        let boxes = links.chunks(N_LANES).map(eight).collect();
        Self { prepared, links, boxes, is_fine }
    }

    /// All links with a surface.
    pub(crate) fn all(prepared: &'a Prepared<'_>, h: &Hypothesis, gate: f64) -> Self {
        Self::new(prepared, h, gate, |_| true)
    }

    /// For each link whose field knows a facet near a point: the link, the facet, and the point in the link's frame.
    #[inline]
    pub(crate) fn each(&self, point: [f32; 3], mut take: impl FnMut(usize, usize, [f32; 3])) {
        for (boxes, links) in self.boxes.iter().zip(self.links.chunks(N_LANES)) {
            let (mut bits, [x, y, z]) = boxes.hold(point);
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize;
                let (link, link_from_local) = &links[lane];
                bits &= bits - 1;
                let field = field(&self.prepared.links[*link].fields, self.is_fine);
                if let Some(facet) = field.in_voxel([x[lane], y[lane], z[lane]].map(|v| v as u32)) {
                    take(*link, facet, transform(link_from_local, point));
                }
            }
        }
    }

    /// The nearest facet over all links to a point.
    #[inline]
    pub(crate) fn nearest(&self, point: [f32; 3]) -> Option<Near> {
        let mut best: Option<(usize, usize, f32)> = None;
        self.each(point, |link, facet, p| {
            let s = self.prepared.links[link].fields.facets[facet].x;
            let d2 = (0..3).map(|i| (s[i] - p[i]) * (s[i] - p[i])).sum::<f32>();
            if best.is_none_or(|b| d2 < b.2) {
                best = Some((link, facet, d2));
            }
        });
        let (link, facet, d2) = best?;
        Some(Near { link, facet, distance: f64::from(d2).sqrt() })
    }
}
