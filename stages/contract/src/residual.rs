//! What segmenting one tile leaves behind: labels that are certain, and the rest of the points near robots with
//! their voxels, from which merge tells attachments from fixed things.

use crate::{Label, MaskId, TileAt, Voxel, Weigh};

/// Edge of a residual voxel, metres: a welding hose is two of them thick. Voxel `[i, j, k]` spans
/// `[i·edge, (i+1)·edge)` along x, and so on, in the world.
pub const RESIDUAL_EDGE: f64 = 0.02;

/// A link of a robot of the result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LinkAt {
    /// Index into the result's robots (the fits).
    pub robot: u16,
    /// Index into that robot's links.
    pub link: u16,
}

/// A voxel with points near a robot, floor left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualVoxel {
    /// Which, by [`RESIDUAL_EDGE`].
    pub voxel: Voxel,
    /// Points in it that are not yet labelled.
    pub n_residual: u32,
    /// Points in it that belong to a link.
    pub n_link: u32,
    /// The link nearest to any of its points.
    pub nearest: LinkAt,
    /// Distance of the nearest point to that link's surface, metres; infinite beyond the field's reach.
    pub distance: f32,
    /// Lies at the border of the region: what is in it may go on outside.
    pub at_border: bool,
    /// Stands on the floor.
    pub grounded: bool,
}

impl ResidualVoxel {
    /// Adds what another tile or scan saw of the same voxel; the order of joining does not matter.
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
    }
}

/// What one tile's points are, as far as one tile can tell.
#[derive(Debug, Clone, PartialEq)]
pub struct TileLabels {
    /// Which tile.
    pub at: TileAt,
    /// The mask that its points belong to.
    pub mask: MaskId,
    /// Certain labels other than the default of the place: place in the mask and label, by place.
    pub labels: Vec<(u64, Label)>,
    /// Points to be settled by their voxel: place in the mask and voxel, by place.
    pub residuals: Vec<(u64, Voxel)>,
    /// The voxels of `residuals` and of points on links, sorted by voxel, each once.
    pub voxels: Vec<ResidualVoxel>,
}

impl TileLabels {
    /// Labels of all points that differ from fixed, by place, once the label of each residual voxel is known.
    #[must_use]
    pub fn settle(&self, label_of: impl Fn(Voxel) -> Label) -> Vec<(u64, Label)> {
        let mut out = self.labels.clone();
        let settled = self.residuals.iter().map(|&(place, voxel)| (place, label_of(voxel)));
        out.extend(settled.filter(|(_, label)| *label != Label::FIXED));
        out.sort_unstable_by_key(|entry| entry.0);
        out
    }
}

impl Weigh for TileLabels {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
            + self.labels.len() * size_of::<(u64, Label)>()
            + self.residuals.len() * size_of::<(u64, Voxel)>()
            + self.voxels.len() * size_of::<ResidualVoxel>()
    }
}
