//! The step that reduces the residual voxels of all tiles to the labels of those that are attached
//! to a robot.

use crate::attached::{Attached, Decided, Group, attached_to, mark};
use crate::body_cut::{Body, TouchesRobot};
use crate::bridges::bridges;
use crate::facets::VoxelFacet;
use crate::floating::{self, Bodies};
use crate::hands::{hands, wrists};
use crate::hidden_ends::EndsOf;
use crate::settings::Settings;
use crate::share::{Share, share};
use crate::structure::{LEAST_STRUCTURE, beyond_hoses};
use crate::thin::{self, LocalShape};
use crate::voxel_graph::Graph;
use contract::{Fit, Fold, Label, LinkAt, RESIDUAL_EDGE, ResidualVoxel, Result, Voxel};
use robot::Model;

/// Decides which residual voxels are attached to which link.
pub struct Attach {
    /// For each fit and each of its links: whether a free joint moves the link.
    moving: Vec<Vec<bool>>,
    /// For each fit and each of its links: whether it may carry a tool or a part.
    hands: Vec<Vec<bool>>,
    /// For each fit and each of its links: whether it is such a link or the one that turns it. Of a
    /// small flange behind a tool no scan sees anything.
    wrists: Vec<Vec<bool>>,
    /// For each fit the way along its longest tool, hundredths of a voxel's edge.
    tools: Vec<u32>,
    settings: Settings,
}

/// How a component reaches a robot.
#[derive(Clone, Copy)]
enum Reach {
    /// It touches a link that moves.
    Touching,
    /// It touches none; voxels that are no farther from a hand, metres, may hang on it.
    Hidden(f32),
}

/// A component that may have to be cut.
struct Component<'a> {
    /// The graph of its voxels alone.
    graph: Graph,
    voxels: &'a [ResidualVoxel],
    /// Its voxels, as indices.
    members: &'a [usize],
    reach: Reach,
    /// For each of them, the way along the body from the robot, hundredths of a voxel's edge.
    length: Vec<u32>,
    shape: Vec<LocalShape>,
    /// Way along the longest tool of the robot that it touches, same unit.
    longest_tool: u32,
    /// Whether each belongs to something large that only hoses lead to.
    beyond_hose: Vec<bool>,
}

/// The voxels gathered so far. They are sorted and merged from time to time, so that memory grows
/// with the plant and not with the number of scans.
#[derive(Debug, Default)]
pub struct ResidualSum {
    voxels: Vec<ResidualVoxel>,
    /// Number of voxels after the last merge.
    n_merged: usize,
}

/// Distance from a link up to which a voxel touches it and is not only near it, metres: the largest
/// gate of the segmentation.
const TOUCH: f32 = 0.012;
/// Distance from a hand up to which a body may hang on a flange that no scan sees, metres: as far
/// as a tool changer is thick.
const HIDDEN_MOUNT: f32 = 0.07;
/// Longest tool of a robot, as a share of the robot's reach, and at least so long, metres: a spot
/// welding gun of 1 m on an arm that reaches 3.1 m.
const LONGEST_TOOL: f64 = 0.33;
const LEAST_TOOL: f64 = 0.3;
/// Way along a body, in longest tools and at least, hundredths of a voxel's edge (1.5 m), beyond
/// which only hoses and legs are parts of what moves with a hand.
const FAR_TOOLS: u32 = 3;
const LEAST_FAR: u32 = 7500;
/// How much farther than the nearest link a hand may be from a voxel that may belong to its tool,
/// hundredths of a voxel's edge (10 cm).
const BESIDE_HAND: u32 = 500;
/// Fewer fixed voxels than this, and less than one in so many of a component, are mixed pixels:
/// they hang between the robot and what is behind it.
const MIN_FIXED: usize = 3;
const FEW: usize = 50;
/// Number of voxels below which an early merge saves no memory worth its time.
const MIN_MERGE: usize = 1 << 16;

impl Attach {
    /// Makes the step for the robots of a result, in the order of the result. `models` are those of
    /// the library, by [`Fit::model`].
    #[must_use]
    pub fn new(fits: &[Fit], models: &[Model], settings: Settings) -> Self {
        let moving = fits.iter().map(|fit| match models.get(fit.model) {
            Some(model) if fit.gives_labels() => model.moving(),
            _ => Vec::new(),
        });
        let hands = fits.iter().map(|fit| match models.get(fit.model) {
            Some(model) if fit.gives_labels() => hands(model),
            _ => Vec::new(),
        });
        let wrists = fits.iter().map(|fit| match models.get(fit.model) {
            Some(model) if fit.gives_labels() => wrists(model),
            _ => Vec::new(),
        });
        let tools = fits.iter().map(|fit| {
            let reach = models.get(fit.model).map_or(0.0, Model::reach);
            (100.0 * (LONGEST_TOOL * reach).max(LEAST_TOOL) / RESIDUAL_EDGE) as u32
        });
        Self {
            moving: moving.collect(),
            hands: hands.collect(),
            wrists: wrists.collect(),
            tools: tools.collect(),
            settings,
        }
    }

    fn is_moving(&self, at: LinkAt) -> bool {
        is_among(&self.moving, at)
    }

    /// Labels one component that touches a robot. `members` are indices into `voxels`, which are
    /// the nodes of `graph`.
    fn decide(
        &self,
        graph: &Graph,
        voxels: &[ResidualVoxel],
        members: &[usize],
        paths: &mut [(u32, u32)],
        out: &mut Decided,
    ) {
        let (mut robot, mut marks) = (Vec::new(), Vec::new());
        let reach = self.reach_of(voxels, members);
        let in_contact = |at: usize| self.reaches(&voxels[at], reach);
        for &at in members.iter().filter(|at| in_contact(**at)) {
            let mark = mark(voxels[at].nearest);
            robot.push((at, mark));
            marks.push(mark);
        }
        let Some(link) = most_frequent(&mut marks) else { return };
        graph.shortest_paths(&robot, paths);
        let is_fixed = |at: usize| !in_contact(at) && self.is_fixed(&voxels[at]);
        let n_fixed = members.iter().filter(|at| is_fixed(**at)).count();
        let is_held = n_fixed >= MIN_FIXED || (n_fixed > 0 && n_fixed * FEW >= members.len());
        let may_stand = is_held || members.len() >= LEAST_STRUCTURE;
        let component = may_stand
            .then(|| self.component(graph.part(members), (voxels, members, reach), paths, link));
        let component = component.filter(|c| is_held || c.beyond_hose.contains(&true));
        let is_cut = component.is_some();
        let is_hidden = matches!(reach, Reach::Hidden(_));
        if is_hidden && !is_cut {
            return;
        }
        let mut group = Group { link, n_attached: 0, n_uncertain: 0, n_points: 0, is_cut };
        let sides = if let Some(component) = &component {
            self.cut(component)
        } else if members.len() < self.settings.min_voxels {
            vec![Share::Open; members.len()]
        } else {
            vec![Share::Robot; members.len()]
        };
        for (&at, share) in members.iter().zip(sides) {
            match share {
                Share::Fixed if is_hidden || !in_contact(at) => {}
                // What is only below a flange may be its tool, or not.
                Share::Robot if is_hidden => {
                    group.n_uncertain += 1;
                    out.labels[at] = Some(Label::UNCERTAIN);
                }
                Share::Fixed | Share::Open => {
                    group.n_uncertain += 1;
                    out.labels[at] = Some(Label::UNCERTAIN);
                }
                Share::Robot => {
                    group.n_attached += 1;
                    group.n_points += u64::from(voxels[at].n_residual);
                    out.labels[at] = Some(attached_to(paths[at].1));
                }
            }
        }
        out.groups.push(group);
    }

    /// What is asked of a component before it is cut; `graph` is that of the component alone.
    fn component<'a>(
        &self,
        graph: Graph,
        (voxels, members, reach): (&'a [ResidualVoxel], &'a [usize], Reach),
        paths: &[(u32, u32)],
        link: LinkAt,
    ) -> Component<'a> {
        let length: Vec<u32> = members.iter().map(|at| paths[*at].0).collect();
        let shape = thin::shapes(&graph, &length, self.settings.thin);
        let longest_tool = self.tools.get(usize::from(link.robot)).copied().unwrap_or(0);
        let is_at_robot = |k: usize| {
            let voxel = &voxels[members[k]];
            let is_at_hand = voxel.distance.is_finite() && is_among(&self.wrists, voxel.nearest);
            is_at_hand || self.reaches(voxel, reach)
        };
        let beyond_hose = beyond_hoses(&graph, &shape, is_at_robot);
        Component { graph, voxels, members, reach, length, shape, longest_tool, beyond_hose }
    }

    /// Shares out a component that reaches something fixed.
    fn cut(&self, of: &Component<'_>) -> Vec<Share> {
        let &Component { voxels, members, reach, longest_tool, .. } = of;
        // No tool and nothing that it holds is so far away, which bounds the time of the cuts.
        let too_far = (FAR_TOOLS * longest_tool).max(LEAST_FAR);
        let is_too_far = |k: usize| {
            of.length[k] > too_far && matches!(of.shape[k], LocalShape::Body | LocalShape::Flat)
        };
        let is_grounded = |k: usize| voxels[members[k]].grounded;
        let ends = thin::ending_hoses(&of.graph, &of.length, &of.shape, is_grounded);
        let mut from_hand = self.ways_from_hand(of);
        let passes = |k: &usize| of.shape[*k] == LocalShape::Hose && !ends[*k];
        (0..members.len()).filter(passes).for_each(|k| from_hand[k] = None);
        let contact = |k: usize| match voxels[members[k]].distance <= TOUCH || ends[k] {
            _ if !self.reaches(&voxels[members[k]], reach) => TouchesRobot::None,
            true => TouchesRobot::Touch,
            false => TouchesRobot::Near,
        };
        let is_fixed = |k: usize| {
            let voxel = &voxels[members[k]];
            let stands = !self.reaches(voxel, reach) && self.is_fixed(voxel);
            stands || of.beyond_hose[k] || is_too_far(k)
        };
        let is_fixed = (0..members.len()).map(is_fixed).collect();
        share(&Body {
            graph: &of.graph,
            from_hand,
            longest_tool,
            thin: self.settings.thin,
            contact: (0..members.len()).map(contact).collect(),
            is_fixed,
            shape: of.shape.clone(),
            length: of.length.clone(),
            facet: members.iter().map(|at| VoxelFacet::of(&voxels[*at])).collect(),
        })
    }

    /// For each voxel of a component the way from a hand, where that is about as near as the
    /// nearest link: hoses along the wrist lead to a tool as well.
    fn ways_from_hand(&self, of: &Component<'_>) -> Vec<Option<u32>> {
        let &Component { voxels, members, reach, .. } = of;
        let touches_hand = |at: &usize| {
            self.reaches(&voxels[*at], reach) && is_among(&self.wrists, voxels[*at].nearest)
        };
        let seeds: Vec<(usize, u32)> =
            (0..members.len()).filter(|k| touches_hand(&members[*k])).map(|k| (k, 0)).collect();
        let mut paths = vec![(u32::MAX, 0); members.len()];
        of.graph.shortest_paths(&seeds, &mut paths);
        let is_near = |(path, length): (&(u32, u32), &u32)| {
            (path.0 <= length.saturating_add(BESIDE_HAND)).then_some(path.0)
        };
        paths.iter().zip(&of.length).map(is_near).collect()
    }

    /// The graph with hidden ends of hoses joined to them; what ends beside a link touches it.
    fn with_hidden_ends(
        &self,
        graph: Graph,
        residual: &mut [ResidualVoxel],
        links: &[ResidualVoxel],
    ) -> Graph {
        let hidden = EndsOf {
            graph: &graph,
            voxels: residual,
            links,
            thin: self.settings.thin,
            is_moving: &|link| self.is_moving(link),
            in_contact: &|voxel| self.in_contact(voxel),
        }
        .find(&graph.components());
        hidden.ends.iter().for_each(|at| residual[*at].distance = self.settings.contact);
        graph.with_edges(&hidden.edges)
    }

    /// Whether a voxel touches a link that moves.
    fn in_contact(&self, voxel: &ResidualVoxel) -> bool {
        voxel.distance <= self.settings.contact && self.is_moving(voxel.nearest)
    }

    /// How a component reaches a robot: where none of it touches one, what of it is nearest to a
    /// hand and lies a short way from it.
    fn reach_of(&self, voxels: &[ResidualVoxel], members: &[usize]) -> Reach {
        let mut own = members.iter().map(|at| &voxels[*at]);
        if own.clone().any(|voxel| self.in_contact(voxel)) {
            return Reach::Touching;
        }
        let is_at_hand = |v: &&ResidualVoxel| is_among(&self.hands, v.nearest);
        let distances = own.by_ref().filter(is_at_hand).map(|v| v.distance);
        let least = distances.fold(f32::INFINITY, f32::min);
        Reach::Hidden(HIDDEN_MOUNT.min(least + RESIDUAL_EDGE as f32))
    }

    fn reaches(&self, voxel: &ResidualVoxel, reach: Reach) -> bool {
        match reach {
            Reach::Touching => self.in_contact(voxel),
            Reach::Hidden(far) => voxel.distance <= far && is_among(&self.hands, voxel.nearest),
        }
    }

    /// Whether a voxel shows that its body is fixed: it stands on the floor, continues outside of
    /// the region, or touches a link that no joint moves.
    fn is_fixed(&self, voxel: &ResidualVoxel) -> bool {
        let on_base = voxel.distance <= self.settings.contact && !self.is_moving(voxel.nearest);
        on_base || voxel.at_border || voxel.grounded
    }
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
        let (mut residual, links): (Vec<ResidualVoxel>, Vec<ResidualVoxel>) =
            sum.voxels.into_iter().partition(|v| v.n_residual > 0);
        // Voxels without residual points are filled by a link. They show the roughness of the link
        // and must not connect components.
        let places: Vec<Voxel> = residual.iter().map(|v| v.voxel).collect();
        let graph = Graph::new(&places);
        let bridges = bridges(&graph, self.settings.thin);
        let graph = self.with_hidden_ends(graph.with_edges(&bridges), &mut residual, &links);
        let mut paths = vec![(u32::MAX, u32::MAX); residual.len()];
        let components = graph.components();
        let mut decided = Decided { labels: vec![None; residual.len()], groups: Vec::new() };
        for members in &components {
            self.decide(&graph, &residual, members, &mut paths, &mut decided);
        }
        let bodies = Bodies {
            gap: self.settings.gap,
            thin: self.settings.thin,
            voxels: &residual,
            components: &components,
            links: &links,
            is_fixed: &|voxel| self.is_fixed(voxel),
            is_hand: &|link| is_among(&self.hands, link),
        };
        floating::attach(&bodies, &mut decided);
        let labelled = residual.iter().zip(&decided.labels);
        let voxels = labelled.filter_map(|(v, label)| Some((v.voxel, (*label)?))).collect();
        Ok(Attached { voxels, groups: decided.groups })
    }
}

impl ResidualSum {
    /// Merges what was gathered; the result does not depend on when this is called.
    fn merge(&mut self) {
        ResidualVoxel::merge(&mut self.voxels);
        self.n_merged = self.voxels.len();
    }
}

/// Whether a link is among those that are true in these lists, by robot.
fn is_among(links: &[Vec<bool>], at: LinkAt) -> bool {
    links.get(usize::from(at.robot)).and_then(|links| links.get(usize::from(at.link)))
        == Some(&true)
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
mod hose_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod touch_tests;
