//! The fold: residual voxels of tiles in, the label of each voxel that hangs on a robot out.

use crate::Settings;
use crate::voxel_graph::Graph;
use contract::{Fit, Fold, Label, LinkAt, PointKind, RESIDUAL_EDGE, ResidualVoxel, Result, Voxel};
use robot::Model;

/// Decides what hangs on which link.
pub struct Attach {
    /// For each fit, for each link: whether any free joint moves it.
    moving: Vec<Vec<bool>>,
    settings: Settings,
}

/// Voxels gathered so far; sorted and joined now and then so that memory follows the plant, not the
/// scans.
#[derive(Debug, Default)]
pub struct ResidualSum {
    voxels: Vec<ResidualVoxel>,
    /// Length after the last joining.
    joined: usize,
}

/// Below this many voxels joining early gains nothing.
const MIN_JOINING: usize = 1 << 16;

/// A component of residual voxels that touches a robot, for the report.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// The moving link that it touches most.
    pub link: LinkAt,
    /// Its voxels that count as attached.
    pub n_attached: usize,
    /// Its voxels that are left uncertain.
    pub n_uncertain: usize,
    /// Points in the attached voxels.
    pub n_points: u64,
    /// Whether it also reaches something fixed and was cut.
    pub is_cut: bool,
}

/// The labels of residual voxels.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Attached {
    /// Voxels whose label is not fixed, sorted.
    pub voxels: Vec<(Voxel, Label)>,
    /// What was attached, by first voxel.
    pub groups: Vec<Group>,
}

impl Attached {
    /// The label of residual points in a voxel.
    #[must_use]
    pub fn label(&self, voxel: Voxel) -> Label {
        self.voxels
            .binary_search_by_key(&voxel, |entry| entry.0)
            .map_or(Label::FIXED, |i| self.voxels[i].1)
    }
}

impl Attach {
    /// For these fits (the robots of the result, in its order) of these models.
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

    /// Labels one component; `voxels` are those of the graph.
    fn decide(
        &self,
        graph: &Graph,
        voxels: &[ResidualVoxel],
        members: &[usize],
        ways: &mut Ways,
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
        let Some(link) = most(&mut marks) else { return };
        let mut group =
            Group { link, n_attached: 0, n_uncertain: 0, n_points: 0, is_cut: !fixed.is_empty() };
        graph.ways(&robot, &mut ways.robot);
        graph.ways(&fixed, &mut ways.fixed);
        let ours: Vec<usize> = members
            .iter()
            .copied()
            .filter(|&at| self.is_ours(&voxels[at], at, &group, ways))
            .collect();
        let in_doubt = members.len() < self.settings.min_voxels
            || (group.is_cut && self.is_wide(graph, &ours, ways));
        for at in ours {
            let mark = ways.robot[at].1;
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

    /// Whether a voxel is nearer to the robot than to anything fixed, along the component.
    fn is_ours(&self, voxel: &ResidualVoxel, at: usize, group: &Group, ways: &Ways) -> bool {
        !group.is_cut
            || (ways.robot[at].0 < ways.fixed[at].0 && voxel.distance <= self.settings.hold)
    }

    /// Whether the border between ours and the rest is too wide for a hose.
    fn is_wide(&self, graph: &Graph, ours: &[usize], ways: &mut Ways) -> bool {
        for &at in ours {
            ways.ours[at] = true;
        }
        let n =
            ours.iter().filter(|at| graph.beside(**at).any(|(other, _)| !ways.ours[other])).count();
        n as f64 * RESIDUAL_EDGE > self.settings.cut
    }
}

/// Ways from the robot and from fixed things to each voxel, and which voxels are the robot's.
struct Ways {
    robot: Vec<(u32, u32)>,
    fixed: Vec<(u32, u32)>,
    ours: Vec<bool>,
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
        if sum.voxels.len() > 2 * sum.joined.max(MIN_JOINING) {
            sum.settle();
        }
        Ok(())
    }

    fn join(&self, earlier: &mut ResidualSum, later: ResidualSum) -> Result<()> {
        self.add(earlier, later.voxels)
    }

    fn finish(&self, mut sum: ResidualSum) -> Result<Attached> {
        sum.settle();
        // Where a link fills a voxel, what is left in it is the link's roughness, and connects
        // nothing.
        let rest: Vec<ResidualVoxel> =
            sum.voxels.into_iter().filter(|v| v.n_residual > 0).collect();
        let places: Vec<Voxel> = rest.iter().map(|v| v.voxel).collect();
        let graph = Graph::new(&places);
        let far = (u32::MAX, u32::MAX);
        let n = rest.len();
        let mut ways = Ways { robot: vec![far; n], fixed: vec![far; n], ours: vec![false; n] };
        let mut out = Attached::default();
        for members in graph.components() {
            self.decide(&graph, &rest, &members, &mut ways, &mut out);
        }
        out.voxels.sort_unstable_by_key(|entry| entry.0);
        Ok(out)
    }
}

impl ResidualSum {
    /// Sorts, and joins what is in one voxel. Joining does not depend on order, so neither does the
    /// answer on when this happens.
    fn settle(&mut self) {
        self.voxels.sort_by_key(|entry| entry.voxel);
        self.voxels.dedup_by(|later, kept| {
            let same = later.voxel == kept.voxel;
            if same {
                kept.join(later);
            }
            same
        });
        self.joined = self.voxels.len();
    }
}

/// The mark that occurs most, the smaller of equals; `None` for none.
fn most(marks: &mut [u32]) -> Option<LinkAt> {
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
