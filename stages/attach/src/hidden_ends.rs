//! Hoses whose ends at a robot no scan saw: the last of a hose lies in the shadow of a post or of
//! the robot itself, so that nothing of it touches a link. It still belongs to the robot if it
//! points at a link that is near, and does not come out on the other side.

use crate::near_voxels::NearVoxels;
use crate::thin::{LocalShape, ThinPart, is_line, reached, shapes, spreads_of};
use crate::voxel_graph::Graph;
use contract::{LinkAt, RESIDUAL_EDGE, ResidualVoxel, Voxel};
use std::collections::BTreeSet;

/// Least length of such a hose, hundredths of a voxel's edge (60 cm): shorter things may point at a
/// robot by chance.
const LEAST_LENGTH: u32 = 3000;
/// Longest hidden end, voxels: 10 cm where nothing is seen of it, and 36 cm where a bit of it is
/// seen at the link.
const GAP: f64 = 5.0;
const GAP_TO_BIT: f64 = 18.0;
/// Least cosine of the angle at which a link lies ahead of a hose that points at it (45°).
const AHEAD: f64 = 0.7;
/// How far beside the straight continuation something lies at most, voxels, and by how much more
/// for each voxel along it: hoses bend.
const BESIDE: f64 = 1.5;
const BEND: f64 = 0.1;
/// Way from the end of a hose within which it is thin, hundredths of a voxel's edge (8 cm).
const ENDS: u32 = 400;
/// Largest extent of a bit, voxels (20 cm), and least number of its voxels: fewer are mixed pixels.
const BIT_EXTENT: f64 = 10.0;
const LEAST_BIT: usize = 3;
/// What passes is a line again within so many voxels (1 m), of stretches of so many (32 cm).
const PASSES_WITHIN: f64 = 50.0;
const STRETCH: usize = 16;
/// Least number of voxels in such a stretch, and least ratio of its spreads.
const LEAST_STRETCH: usize = 8;
const LINE_RATIO: f64 = 3.0;
/// Edge of the cells that tell whether a link is near, voxels: at least the longest hidden end.
const CELL: i32 = 20;

/// What is known of ends that are hidden.
#[derive(Default)]
pub(crate) struct HiddenEnds {
    /// Voxels that belong to a link although they do not touch it.
    pub(crate) ends: Vec<usize>,
    /// Edges between a hose and bits of its hidden end, as of [`Graph::with_edges`].
    pub(crate) edges: Vec<(usize, usize, u32)>,
}

/// The residual voxels and links between which hidden ends are looked for.
pub(crate) struct EndsOf<'a> {
    pub(crate) graph: &'a Graph,
    pub(crate) voxels: &'a [ResidualVoxel],
    pub(crate) links: &'a [ResidualVoxel],
    /// Largest circumference of a thin part, metres.
    pub(crate) thin: f64,
    pub(crate) is_moving: &'a dyn Fn(LinkAt) -> bool,
    pub(crate) in_contact: &'a dyn Fn(&ResidualVoxel) -> bool,
}

/// The straight continuation of a hose beyond its visible end.
struct Continuation {
    from: [f64; 3],
    along: [f64; 3],
}

impl Continuation {
    /// The way along it to a place and the distance from its beginning, voxels.
    fn to(&self, place: Voxel) -> (f64, f64) {
        let by: [f64; 3] = std::array::from_fn(|i| f64::from(place[i]) - self.from[i]);
        let way: f64 = (0..3).map(|i| by[i] * self.along[i]).sum();
        (way, by.iter().map(|v| v * v).sum::<f64>().sqrt())
    }

    /// The way along it to a place, voxels, where that lies beside it no farther than a hose may.
    fn way_to(&self, place: Voxel) -> Option<f64> {
        let (way, distance) = self.to(place);
        let beside = (distance * distance - way * way).max(0.0).sqrt();
        (way > 0.0 && beside <= BESIDE + BEND * way).then_some(way)
    }

    /// Whether a place is right ahead.
    fn is_ahead(&self, place: Voxel) -> bool {
        let (way, distance) = self.to(place);
        distance <= GAP && way >= AHEAD * distance
    }
}

impl EndsOf<'_> {
    /// Finds the hidden ends of all hoses.
    pub(crate) fn find(&self, components: &[Vec<usize>]) -> HiddenEnds {
        let mut links = NearVoxels::default();
        let mut cells = BTreeSet::new();
        for link in self.links.iter().filter(|link| (self.is_moving)(link.nearest)) {
            links.add(link.voxel, 0);
            let cell = link.voxel.map(|v| v.div_euclid(CELL));
            cells.extend((0..27).map(|k| {
                let by = [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1];
                [0, 1, 2].map(|i| cell[i].saturating_add(by[i]))
            }));
        }
        let is_near =
            |at: &usize| cells.contains(&self.voxels[*at].voxel.map(|v| v.div_euclid(CELL)));
        let mut out = HiddenEnds::default();
        for (which, members) in components.iter().enumerate().filter(|(_, m)| self.may_be(m)) {
            let mut nearest: Option<(f64, usize)> = None;
            for &at in members.iter().filter(|at| is_near(at)) {
                let place = std::iter::once(self.voxels[at].voxel);
                let found = links.nearest(place, GAP_TO_BIT * RESIDUAL_EDGE).map(|f| (f.0, at));
                nearest = found.filter(|f| nearest.is_none_or(|n| *f < n)).or(nearest);
            }
            if let Some((_, end)) = nearest
                && let Some(beyond) = self.continuation(members, end)
            {
                self.follow(&beyond, end, which, components, &mut out);
            }
        }
        out
    }

    /// Whether a component may be a long hose that touches no robot.
    fn may_be(&self, members: &[usize]) -> bool {
        let extent = self.extents(members).into_iter().max().unwrap_or(0);
        // Along a diagonal a way is longer than its extent, by 3 at most.
        300 * extent.unsigned_abs() >= LEAST_LENGTH
            && !members.iter().any(|at| (self.in_contact)(&self.voxels[*at]))
    }

    fn extents(&self, members: &[usize]) -> [i32; 3] {
        [0, 1, 2].map(|i| {
            let places = || members.iter().map(|at| self.voxels[*at].voxel[i]);
            places().max().unwrap_or(0) - places().min().unwrap_or(0)
        })
    }

    /// How the hose that ends at a voxel of a component goes on there; `None` where that is no end
    /// of a long one.
    fn continuation(&self, members: &[usize], end: usize) -> Option<Continuation> {
        let graph = self.graph.part(members);
        let at = members.binary_search(&end).ok()?;
        let mut paths = vec![(u32::MAX, 0); members.len()];
        graph.shortest_paths(&[(at, 0)], &mut paths);
        let length: Vec<u32> = paths.iter().map(|path| path.0).collect();
        let shape = shapes(&graph, &length, self.thin);
        let mut is_left: Vec<bool> = shape.iter().map(|s| *s == LocalShape::Hose).collect();
        let first = (0..members.len()).filter(|k| is_left[*k]).min_by_key(|k| length[*k])?;
        let voxels = reached(&graph, vec![first], &mut is_left);
        let longest = voxels.iter().map(|k| length[*k]).max()?;
        if length[first] > ENDS || longest < LEAST_LENGTH {
            return None;
        }
        let (from, along) = ThinPart::of(&graph, &length, voxels)?.begin_and_way();
        let norm = along.iter().map(|v| v * v).sum::<f64>().sqrt();
        Some(Continuation { from, along: along.map(|v| -v / norm) })
    }

    /// Follows a hose beyond its visible end to a link.
    fn follow(
        &self,
        beyond: &Continuation,
        end: usize,
        own: usize,
        components: &[Vec<usize>],
        out: &mut HiddenEnds,
    ) {
        let others = || (0..components.len()).filter(move |which| *which != own);
        if self.passes(beyond, others().map(|k| &components[k])) {
            return;
        }
        let mut moving = self.links.iter().filter(|link| (self.is_moving)(link.nearest));
        if moving.any(|link| beyond.is_ahead(link.voxel)) {
            out.ends.push(end);
            return;
        }
        let bits: Vec<&Vec<usize>> =
            others().map(|k| &components[k]).filter(|bit| self.is_bit(beyond, bit)).collect();
        let touches =
            |bit: &&&Vec<usize>| bit.iter().any(|at| (self.in_contact)(&self.voxels[*at]));
        if bits.iter().filter(touches).any(|bit| bit.len() >= LEAST_BIT) {
            out.ends.push(end);
            for bit in bits {
                let way = |at: &usize| beyond.way_to(self.voxels[*at].voxel).unwrap_or(0.0);
                let nearest = bit.iter().min_by(|a, b| way(a).total_cmp(&way(b)));
                out.edges.extend(nearest.map(|at| (end, *at, (100.0 * way(at)) as u32)));
            }
        }
    }

    /// Whether a component is small and lies where a hose goes on.
    fn is_bit(&self, beyond: &Continuation, members: &[usize]) -> bool {
        let is_on = |at: &usize| {
            beyond.way_to(self.voxels[*at].voxel).is_some_and(|way| way <= GAP_TO_BIT + BIT_EXTENT)
        };
        members.first().is_some_and(is_on)
            && members.iter().all(is_on)
            && self.extents(members).iter().all(|e| f64::from(*e) <= BIT_EXTENT)
    }

    /// Whether a line goes on behind the link, as what passes does.
    fn passes<'a>(
        &self,
        beyond: &Continuation,
        others: impl Iterator<Item = &'a Vec<usize>>,
    ) -> bool {
        let mut at_way: Vec<Vec<Voxel>> = vec![Vec::new(); PASSES_WITHIN as usize];
        for &at in others.flatten() {
            let voxel = &self.voxels[at];
            let way = beyond.way_to(voxel.voxel).filter(|_| !(self.in_contact)(voxel));
            if let Some(at_way) = way.and_then(|way| at_way.get_mut(way as usize)) {
                at_way.push(voxel.voxel);
            }
        }
        at_way.windows(STRETCH).any(|stretch| {
            let places = stretch.concat();
            places.len() >= LEAST_STRETCH
                && is_line(&spreads_of(&places, places[0]), self.thin, LINE_RATIO)
        })
    }
}
