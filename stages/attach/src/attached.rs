//! The labels of residual voxels, while they are decided and as a result.

use contract::{Label, LinkAt, PointKind, Voxel};

/// A component of residual voxels that touches a robot, for the report.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// The moving link that most of its voxels touch.
    pub link: LinkAt,
    /// Number of voxels that are labelled as attached.
    pub n_attached: usize,
    /// Number of voxels that are labelled as uncertain.
    pub n_uncertain: usize,
    /// Number of residual points in the attached voxels.
    pub n_points: u64,
    /// Whether the component also reaches something fixed, so that it was cut.
    pub is_cut: bool,
}

/// The labels of residual voxels.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Attached {
    /// Voxels whose label is not fixed, sorted.
    pub voxels: Vec<(Voxel, Label)>,
    /// The components that touch a robot, sorted by their first voxel.
    pub groups: Vec<Group>,
}

impl Attached {
    /// The label of the residual points in a voxel: fixed where the voxel is not listed.
    #[must_use]
    pub fn label(&self, voxel: Voxel) -> Label {
        self.voxels
            .binary_search_by_key(&voxel, |entry| entry.0)
            .map_or(Label::FIXED, |i| self.voxels[i].1)
    }
}

/// The labels that are decided so far.
pub(crate) struct Decided {
    /// The label of each residual voxel that is not fixed.
    pub(crate) labels: Vec<Option<Label>>,
    pub(crate) groups: Vec<Group>,
}

/// A link as a mark of shortest paths.
pub(crate) fn mark(link: LinkAt) -> u32 {
    u32::from(link.robot) << 16 | u32::from(link.link)
}

/// The label of what is attached to the link of a mark.
pub(crate) fn attached_to(mark: u32) -> Label {
    Label { kind: PointKind::Attachment, robot: (mark >> 16) as i16, link: (mark & 0xffff) as i16 }
}
