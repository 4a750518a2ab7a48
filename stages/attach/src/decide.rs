//! The step that reduces the residual voxels of all tiles to the labels of those that are attached
//! to a robot.

use crate::settings::Settings;
use crate::voxel_graph::Graph;
use contract::{Fit, Fold, Label, LinkAt, PointKind, RESIDUAL_EDGE, ResidualVoxel, Result, Voxel};
use robot::Model;

/// Decides which residual voxels are attached to which link.
pub struct Attach {
    /// For each fit and each of its links: whether a free joint moves the link.
    moving: Vec<Vec<bool>>,
    settings: Settings,
}

/// The voxels gathered so far. They are sorted and merged from time to time, so that memory grows
/// with the plant and not with the number of scans.
#[derive(Debug, Default)]
pub struct ResidualSum {
    voxels: Vec<ResidualVoxel>,
    /// Number of voxels after the last merge.
    n_merged: usize,
}

/// Number of voxels below which an early merge saves no memory worth its time.
const MIN_MERGE: usize = 1 << 16;

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

impl Attach {
    /// Makes the step for the robots of a result, in the order of the result. `models` are those of
    /// the library, by [`Fit::model`].
    #[must_use]
    pub fn new(fits: &[Fit], models: &[Model], settings: Settings) -> Self {
        let moving = fits.iter().map(|fit| match models.get(fit.model) {
            Some(model) if fit.gives_labels() => model.moving(),
            _ => Vec::new(),
        });
        Self { moving: moving.collect(), settings }
    }

    fn is_moving(&self, at: LinkAt) -> bool {
        self.moving.get(usize::from(at.robot)).and_then(|links| links.get(usize::from(at.link)))
            == Some(&true)
    }

    /// Labels one component. `members` are indices into `voxels`, which are the nodes of `graph`.
    fn decide(
        &self,
        graph: &Graph,
        voxels: &[ResidualVoxel],
        members: &[usize],
        paths: &mut ShortestPaths,
        out: &mut Attached,
    ) {
        let (mut robot, mut fixed, mut marks) = (Vec::new(), Vec::new(), Vec::new());
        for &at in members {
            let voxel = &voxels[at];
            if voxel.distance <= self.settings.contact {
                if self.is_moving(voxel.nearest) {
                    let mark = u32::from(voxel.nearest.robot) << 16 | u32::from(voxel.nearest.link);
                    robot.push((at, mark));
                    marks.push(mark);
                    continue;
                }
                fixed.push((at, 0));
            } else if voxel.at_border || voxel.grounded {
                fixed.push((at, 0));
            }
        }
        let Some(link) = most_frequent(&mut marks) else { return };
        let mut group =
            Group { link, n_attached: 0, n_uncertain: 0, n_points: 0, is_cut: !fixed.is_empty() };
        graph.shortest_paths(&robot, &mut paths.robot);
        graph.shortest_paths(&fixed, &mut paths.fixed);
        let of_robot: Vec<usize> = members
            .iter()
            .copied()
            .filter(|&at| self.belongs_to_robot(&voxels[at], at, &group, paths))
            .collect();
        let in_doubt = members.len() < self.settings.min_voxels
            || (group.is_cut && self.is_wide(graph, &of_robot, paths));
        for at in of_robot {
            let mark = paths.robot[at].1;
            let label = if in_doubt {
                group.n_uncertain += 1;
                Label::UNCERTAIN
            } else {
                group.n_attached += 1;
                group.n_points += u64::from(voxels[at].n_residual);
                Label {
                    kind: PointKind::Attachment,
                    robot: (mark >> 16) as i16,
                    link: (mark & 0xffff) as i16,
                }
            };
            out.voxels.push((voxels[at].voxel, label));
        }
        out.groups.push(group);
    }

    /// Whether a voxel belongs to the robot: the path along the component to the robot is shorter
    /// than that to anything fixed.
    fn belongs_to_robot(
        &self,
        voxel: &ResidualVoxel,
        at: usize,
        group: &Group,
        paths: &ShortestPaths,
    ) -> bool {
        !group.is_cut
            || (paths.robot[at].0 < paths.fixed[at].0 && voxel.distance <= self.settings.hold)
    }

    /// Whether the border between the robot's voxels and the rest of the component is too wide for
    /// a hose.
    fn is_wide(&self, graph: &Graph, of_robot: &[usize], paths: &mut ShortestPaths) -> bool {
        for &at in of_robot {
            paths.of_robot[at] = true;
        }
        let n = of_robot
            .iter()
            .filter(|at| graph.neighbours(**at).any(|(other, _)| !paths.of_robot[other]))
            .count();
        n as f64 * RESIDUAL_EDGE > self.settings.cut
    }
}

/// For each voxel the shortest path from the robot and from fixed objects, as length and mark, and
/// whether the voxel belongs to the robot.
struct ShortestPaths {
    robot: Vec<(u32, u32)>,
    fixed: Vec<(u32, u32)>,
    of_robot: Vec<bool>,
}

impl Fold for Attach {
    type In = Vec<ResidualVoxel>;
    type Sum = ResidualSum;
    type Out = Attached;

    fn empty(&self) -> ResidualSum {
        ResidualSum::default()
    }

    fn add(&self, sum: &mut ResidualSum, voxels: Vec<ResidualVoxel>) -> Result<()> {
        sum.voxels.extend(voxels);
        if sum.voxels.len() > 2 * sum.n_merged.max(MIN_MERGE) {
            sum.merge();
        }
        Ok(())
    }

    fn join(&self, earlier: &mut ResidualSum, later: ResidualSum) -> Result<()> {
        self.add(earlier, later.voxels)
    }

    fn finish(&self, mut sum: ResidualSum) -> Result<Attached> {
        sum.merge();
        // Voxels without residual points are filled by a link. They show the roughness of the link
        // and must not connect components.
        let residual: Vec<ResidualVoxel> =
            sum.voxels.into_iter().filter(|v| v.n_residual > 0).collect();
        let places: Vec<Voxel> = residual.iter().map(|v| v.voxel).collect();
        let graph = Graph::new(&places);
        let unreached = (u32::MAX, u32::MAX);
        let n = residual.len();
        let mut paths = ShortestPaths {
            robot: vec![unreached; n],
            fixed: vec![unreached; n],
            of_robot: vec![false; n],
        };
        let mut out = Attached::default();
        for members in graph.components() {
            self.decide(&graph, &residual, &members, &mut paths, &mut out);
        }
        out.voxels.sort_unstable_by_key(|entry| entry.0);
        Ok(out)
    }
}

impl ResidualSum {
    /// Sorts the voxels and merges entries of the same voxel. Merging does not depend on the order,
    /// so the result does not depend on when this is called.
    fn merge(&mut self) {
        self.voxels.sort_by_key(|entry| entry.voxel);
        self.voxels.dedup_by(|later, kept| {
            let same = later.voxel == kept.voxel;
            if same {
                kept.join(later);
            }
            same
        });
        self.n_merged = self.voxels.len();
    }
}

/// The link of the mark that occurs most often, the smaller of equals; `None` without marks.
fn most_frequent(marks: &mut [u32]) -> Option<LinkAt> {
    marks.sort_unstable();
    let mut best: Option<(usize, u32)> = None;
    for run in marks.chunk_by(|a, b| a == b) {
        if best.is_none_or(|b| run.len() > b.0) {
            best = Some((run.len(), run[0]));
        }
    }
    best.map(|(_, mark)| LinkAt { robot: (mark >> 16) as u16, link: (mark & 0xffff) as u16 })
}

#[cfg(test)]
mod tests;
