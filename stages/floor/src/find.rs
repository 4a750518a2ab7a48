//! The step that reduces the summaries of all tiles to floor and occupied space.

use crate::Settings;
use crate::column::GroundColumns;
use crate::levels::{describe, levels};
use crate::mounts::MIN_PATCH;
use crate::overlap::Overlaps;
use crate::pieces::pieces;
use crate::stands::stands;
use contract::{
    Floor, Fold, InstallationPlane, Occupancy, Overlap, PlanePatch, Result, Scan, ScanId,
    TileSummary,
};
use geometry::{Aabb, Vector};
use serde::{Deserialize, Serialize};

/// Finds floor and installation planes in the summaries of all tiles.
#[derive(Debug, Clone)]
pub struct Find {
    scanners: Vec<(ScanId, Option<Vector>)>,
    settings: Settings,
}

/// State that is kept while summaries come in.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct FloorSum {
    n_points: u64,
    n_veils: u64,
    patches: Vec<PlanePatch>,
    /// Patches that do not face up.
    sides: Vec<PlanePatch>,
    overlaps: Overlaps,
    /// Partial occupancies, each at least twice the size of the next, so that merging all of them
    /// takes O(n log n).
    occupancies: Vec<Occupancy>,
}

/// Floor, occupied space and other planar surfaces of a plant.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FloorFindings {
    /// Floor levels and installation planes.
    pub floor: Floor,
    /// Occupied space over all scans, floor and walls included.
    pub occupancy: Occupancy,
    /// Patches of walls, ceilings and slopes, in the order of their tiles, as input of
    /// [`mounts`](fn@crate::mounts).
    pub sides: Vec<PlanePatch>,
    /// Pieces of floor, walls and other flat surfaces that several scans saw.
    pub overlaps: Vec<Overlap>,
    /// Number of points.
    pub n_points: u64,
    /// Number of points that were classified as veil points.
    pub n_veils: u64,
}

impl Find {
    /// A step for the tiles of these scans.
    #[must_use]
    pub fn new(scans: &[Scan], settings: &Settings) -> Self {
        let mut scanners: Vec<_> = scans
            .iter()
            .map(|s| (s.id, s.has_beams().then_some(s.world_from_scan.translation.vector)))
            .collect();
        scanners.sort_by_key(|s| s.0);
        Self { scanners, settings: *settings }
    }
}

impl FloorSum {
    fn push(&mut self, occupancy: Occupancy) {
        if occupancy.voxels.is_empty() {
            return;
        }
        self.occupancies.push(occupancy);
        while let [.., earlier, later] = self.occupancies.as_slice() {
            if earlier.voxels.len() >= 2 * later.voxels.len() {
                break;
            }
            self.fuse();
        }
    }

    /// Merges the last two partial occupancies.
    fn fuse(&mut self) {
        if let (Some(later), Some(earlier)) = (self.occupancies.pop(), self.occupancies.last_mut())
        {
            earlier.merge(later);
        }
    }
}

impl Fold for Find {
    type In = TileSummary;
    type Sum = FloorSum;
    type Out = FloorFindings;

    fn empty(&self) -> FloorSum {
        FloorSum::default()
    }

    fn add(&self, sum: &mut FloorSum, item: TileSummary) -> Result<()> {
        sum.n_points += item.n_points;
        sum.n_veils += item.n_veils;
        for patch in item.patches {
            sum.overlaps.add(&patch);
            if faces_up(&patch, &self.settings) {
                sum.patches.push(patch);
            } else if patch.area >= MIN_PATCH {
                sum.sides.push(PlanePatch { ground: Vec::new(), ..patch });
            }
        }
        sum.push(item.occupancy);
        Ok(())
    }

    fn join(&self, earlier: &mut FloorSum, later: FloorSum) -> Result<()> {
        earlier.n_points += later.n_points;
        earlier.n_veils += later.n_veils;
        earlier.patches.extend(later.patches);
        earlier.sides.extend(later.sides);
        earlier.overlaps.join(later.overlaps);
        for occupancy in later.occupancies {
            earlier.push(occupancy);
        }
        Ok(())
    }

    fn finish(&self, mut sum: FloorSum) -> Result<FloorFindings> {
        while sum.occupancies.len() > 1 {
            sum.fuse();
        }
        let occupancy = sum.occupancies.pop().unwrap_or_default();
        let floor = search(&sum.patches, &occupancy, &self.scanners, &self.settings);
        let FloorSum { sides, overlaps, n_points, n_veils, .. } = sum;
        let overlaps = overlaps.finish();
        Ok(FloorFindings { floor, occupancy, sides, overlaps, n_points, n_veils })
    }
}

/// Whether a patch is nearly horizontal and was seen from above. Where the scanner is unknown all
/// normals point up, and a ceiling is recognised later by what lies around it.
fn faces_up(patch: &PlanePatch, settings: &Settings) -> bool {
    patch.plane.normal.z >= settings.max_patch_tilt.cos()
}

/// Finds floor and installation planes in patches (in the order of their tiles) and occupied space.
#[must_use]
pub fn find(
    patches: &[PlanePatch],
    occupancy: &Occupancy,
    scans: &[Scan],
    settings: &Settings,
) -> Floor {
    search(patches, occupancy, &Find::new(scans, settings).scanners, settings)
}

fn search(
    patches: &[PlanePatch],
    occupancy: &Occupancy,
    scanners: &[(ScanId, Option<Vector>)],
    settings: &Settings,
) -> Floor {
    let wanted = |p: &PlanePatch| faces_up(p, settings);
    let columns = GroundColumns::new(occupancy);
    let pieces = pieces(patches, wanted, settings);
    let crate::levels::Levels { floor: found, ceilings } =
        levels(pieces, patches, &columns, scanners, settings);
    let levels: Vec<_> = found.iter().map(|level| describe(level, patches, settings)).collect();
    let may_carry: Vec<PlanePatch> = patches
        .iter()
        .enumerate()
        .filter(|(i, p)| wanted(p) && ceilings.binary_search(i).is_err())
        .map(|(_, p)| p.clone())
        .collect();
    let mut planes = stands(&may_carry, &found, &levels, scanners, settings);
    planes.extend(found.iter().map(|level| InstallationPlane {
        plane: level.plane,
        bounds: Aabb::of(level.nodes.iter().map(|n| n.place().into())),
        area: level.area(),
        is_floor: true,
    }));
    let middle = |p: &InstallationPlane| {
        let at = p.bounds.center();
        crate::pieces::height(&p.plane, at.x, at.y)
    };
    planes.sort_by(|a, b| middle(a).total_cmp(&middle(b)).then(b.area.total_cmp(&a.area)));
    Floor { levels, planes }
}
