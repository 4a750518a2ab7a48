//! The result of segmenting one tile: labels that are certain, and the remaining points near robots
//! with their voxels, from which `attach` tells attachments from fixed things.

use crate::{Label, MaskId, TileAt, Voxel, Weigh};

/// Edge of a residual voxel, metres: a welding hose is two of them thick. Voxel `[i, j, k]` spans
/// `[i·edge, (i+1)·edge)` along world x, and likewise along y and z.
pub const RESIDUAL_EDGE: f64 = 0.02;

/// A link of a robot of the result, by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LinkAt {
    /// Index into the robots (fits) of the result.
    pub robot: u16,
    /// Index into the links of that robot.
    pub link: u16,
}

/// A voxel with points near a robot; floor points are not counted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualVoxel {
    /// Index of the voxel, of edge [`RESIDUAL_EDGE`].
    pub voxel: Voxel,
    /// Number of points in it that have no label yet.
    pub n_residual: u32,
    /// Number of points in it that belong to a link.
    pub n_link: u32,
    /// The link nearest to any of its points.
    pub nearest: LinkAt,
    /// Distance of the nearest point from that link's surface, metres; infinite beyond the reach
    /// of the link's distance field.
    pub distance: f32,
    /// Whether it lies at the border of the region, so that its body may continue outside.
    pub at_border: bool,
    /// Whether the voxel stands on the floor.
    pub grounded: bool,
    /// What is known of the surface in it.
    pub surface: SurfaceSums,
}

/// Sums over the points without a label in a voxel, in whole numbers, so that the order of adding
/// has no effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SurfaceSums {
    /// Sum of the places within the voxel, 1/256 of its edge along world x, y and z.
    pub places: [u32; 3],
    /// Sum of the unit normals that point to the scanner, 1/256 along world x, y and z; of points
    /// near edges none is known.
    pub normals: [i32; 3],
}

impl SurfaceSums {
    /// That of one point at these places in its voxel (0 to 1), with its unit normal in the world.
    #[must_use]
    pub fn of(within: [f64; 3], normal: Option<[f64; 3]>) -> Self {
        Self {
            places: within.map(|v| (256.0 * v).clamp(0.0, 255.0) as u32),
            normals: normal.map_or([0; 3], |n| n.map(|v| (256.0 * v.clamp(-1.0, 1.0)) as i32)),
        }
    }

    /// Adds the sums. Those of more than eight million points in a voxel wrap, in any order alike.
    fn join(&mut self, other: &Self) {
        for i in 0..3 {
            self.places[i] = self.places[i].wrapping_add(other.places[i]);
            self.normals[i] = self.normals[i].wrapping_add(other.normals[i]);
        }
    }
}

impl ResidualVoxel {
    /// Adds what another tile or scan saw of the same voxel; the order of joining has no effect.
    pub fn join(&mut self, other: &Self) {
        self.n_residual = self.n_residual.saturating_add(other.n_residual);
        self.n_link = self.n_link.saturating_add(other.n_link);
        let closer =
            other.distance.total_cmp(&self.distance).then(other.nearest.cmp(&self.nearest));
        if closer.is_lt() {
            self.distance = other.distance;
            self.nearest = other.nearest;
        }
        self.at_border |= other.at_border;
        self.grounded |= other.grounded;
        self.surface.join(&other.surface);
    }

    /// Sorts voxels and joins entries of the same one. The result does not depend on their order.
    pub fn merge(voxels: &mut Vec<Self>) {
        voxels.sort_by_key(|entry| entry.voxel);
        voxels.dedup_by(|later, kept| {
            let same = later.voxel == kept.voxel;
            if same {
                kept.join(later);
            }
            same
        });
    }
}

/// The labels of one tile's points, as far as one tile alone determines them.
#[derive(Debug, Clone, PartialEq)]
pub struct TileLabels {
    /// The tile.
    pub at: TileAt,
    /// The mask that its points belong to.
    pub mask: MaskId,
    /// Certain labels that differ from the default, by place in the mask.
    pub labels: Vec<PlaceRun<Label>>,
    /// Points whose label depends on their voxel, by place in the mask.
    pub residuals: Vec<PlaceRun<Voxel>>,
    /// The voxels of `residuals` and of points on links, sorted by voxel, without duplicates.
    pub voxels: Vec<ResidualVoxel>,
}

impl TileLabels {
    /// Labels of all points that are not plain fixed points, by place in the mask, once `label_of`
    /// gives the label of each residual voxel.
    #[must_use]
    pub fn settle(&self, label_of: impl Fn(Voxel) -> Label) -> Vec<PlaceRun<Label>> {
        let mut out = self.labels.clone();
        let settled = self.residuals.iter().map(|run| run.of(label_of(run.what)));
        out.extend(settled.filter(|run| run.what != Label::FIXED));
        PlaceRun::join(&mut out);
        out
    }
}

/// A run of consecutive places of a mask with one value. Neighbouring points of a scan mostly have
/// the same label, so runs are much shorter than one value a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PlaceRun<T> {
    /// First place of the run.
    pub first: u64,
    /// Number of places.
    pub n: u32,
    /// The value at each of these places.
    pub what: T,
}

impl<T: Copy + PartialEq> PlaceRun<T> {
    /// A run of a single place.
    #[must_use]
    pub fn one(place: u64, what: T) -> Self {
        Self { first: place, n: 1, what }
    }

    /// A run of the same places with another value.
    pub fn of<U>(&self, what: U) -> PlaceRun<U> {
        PlaceRun { first: self.first, n: self.n, what }
    }

    /// The place after the last one.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.first + u64::from(self.n)
    }

    /// Sorts runs that do not overlap, and joins those that follow one another with equal values.
    pub fn join(runs: &mut Vec<Self>) {
        runs.sort_unstable_by_key(|run| run.first);
        runs.dedup_by(|later, kept| {
            let joins = kept.end() == later.first && kept.what == later.what;
            let n = kept.n.checked_add(later.n).filter(|_| joins);
            if let Some(n) = n {
                kept.n = n;
            }
            n.is_some()
        });
        runs.shrink_to_fit();
    }
}

impl Weigh for TileLabels {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
            + self.labels.len() * size_of::<PlaceRun<Label>>()
            + self.residuals.len() * size_of::<PlaceRun<Voxel>>()
            + self.voxels.len() * size_of::<ResidualVoxel>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn runs_say_the_same_of_each_place_in_any_order(
            labels in prop::collection::vec(prop::option::of(0_u8..3), 0..300),
            first in prop::sample::select(vec![0_u64, 7, u64::from(u32::MAX) - 3]),
            keys in prop::collection::vec(any::<u32>(), 300),
        ) {
            let place = |at: usize| first + at as u64;
            let known = labels.iter().enumerate().filter_map(|(at, l)| Some((place(at), (*l)?)));
            let known: Vec<(u64, u8)> = known.collect();
            let mut shuffled: Vec<(u32, PlaceRun<u8>)> =
                keys.into_iter().zip(known.iter().map(|(p, l)| PlaceRun::one(*p, *l))).collect();
            shuffled.sort_by_key(|(key, _)| *key);
            let mut runs: Vec<PlaceRun<u8>> = shuffled.into_iter().map(|(_, run)| run).collect();
            PlaceRun::join(&mut runs);
            let places = |run: &PlaceRun<u8>| (run.first..run.end()).map(|p| (p, run.what)).collect::<Vec<_>>();
            prop_assert_eq!(runs.iter().flat_map(places).collect::<Vec<_>>(), known);
            // No two neighbouring runs may be left that could be joined.
            let differ = |w: &[PlaceRun<u8>]| w[0].end() < w[1].first || w[0].what != w[1].what;
            prop_assert!(runs.windows(2).all(differ));
            let mut again = runs.clone();
            PlaceRun::join(&mut again);
            prop_assert_eq!(again, runs);
        }

        #[test]
        fn joining_voxels_does_not_depend_on_order(
            parts in prop::collection::vec((0_u32..9, 0_u32..9, 0_u16..3, 0_u16..3, 0.0_f32..1.0, any::<bool>(), any::<bool>(), prop::array::uniform3(any::<u32>()), prop::array::uniform3(any::<i32>())), 1..6),
            turn in 0_usize..6,
        ) {
            let voxel = |(n_residual, n_link, robot, link, distance, at_border, grounded, places, normals)| ResidualVoxel {
                voxel: [0; 3],
                n_residual,
                n_link,
                nearest: LinkAt { robot, link },
                distance,
                at_border,
                grounded,
                surface: SurfaceSums { places, normals },
            };
            let voxels: Vec<ResidualVoxel> = parts.into_iter().map(voxel).collect();
            let join = |all: &[ResidualVoxel]| {
                let mut sum = all[0];
                all[1..].iter().for_each(|v| sum.join(v));
                sum
            };
            let mut turned = voxels.clone();
            turned.rotate_left(turn % voxels.len());
            prop_assert_eq!(join(&turned), join(&voxels));
        }
    }

    #[test]
    fn runs_join_where_they_follow_and_share() {
        let mut runs: Vec<PlaceRun<u8>> = [(7, 1), (3, 0), (4, 0), (6, 1), (5, 0), (9, 1)]
            .map(|(p, w)| PlaceRun::one(p, w))
            .into();
        PlaceRun::join(&mut runs);
        let run = |first, n, what| PlaceRun { first, n, what };
        assert_eq!(runs, [run(3, 3, 0), run(6, 2, 1), run(9, 1, 1)]);
        assert_eq!(runs[1].end(), 8);
    }
}
