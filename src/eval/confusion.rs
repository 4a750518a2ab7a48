//! Counts of points by true and assigned label, and scores computed from them.

use contract::{Label, PointKind};
use std::fmt::Write as _;

/// Counts of points by true and assigned label.
#[derive(Debug, Clone, Default)]
pub struct Confusion {
    /// Moving points labelled as moving, moving points labelled otherwise, other points labelled
    /// as moving, and the rest.
    pub moving: [u64; 4],
    /// Of links: with the right robot and link, all that are true links, all that are said to be
    /// links.
    pub links: [u64; 3],
    /// Truly fixed points, and those of them labelled as moving.
    pub fixed: [u64; 2],
    /// For each true robot, for each of its links: points with the right robot and link, true
    /// ones, and said ones.
    pub by_link: Vec<Vec<[u64; 3]>>,
    /// Attached points: those labelled as moving (attachment or link), and all.
    pub attached: [u64; 2],
}

impl Confusion {
    /// Empty counts for robots with so many links.
    pub fn new(n_links: impl Iterator<Item = usize>) -> Self {
        Self { by_link: n_links.map(|n| vec![[0; 3]; n]).collect(), ..Self::default() }
    }

    /// Counts a point that is said to be `said` and is `real`; `whose` tells which true robot a
    /// found one is.
    pub fn add(&mut self, said: Label, real: Label, whose: impl Fn(usize) -> Option<usize>) {
        self.moving[match (real.moves(), said.moves()) {
            (true, true) => 0,
            (true, false) => 1,
            (false, true) => 2,
            (false, false) => 3,
        }] += 1;
        self.fixed[0] += u64::from(!real.moves());
        self.fixed[1] += u64::from(!real.moves() && said.moves());
        if real.kind == PointKind::Attachment {
            self.attached[0] += u64::from(said.moves());
            self.attached[1] += 1;
        }
        let index = |label: Label| {
            let is_link = label.kind == PointKind::Link;
            let numbers = (usize::try_from(label.robot).ok(), usize::try_from(label.link).ok());
            is_link.then_some(numbers)
        };
        let (is_link, said) = match index(said) {
            Some((robot, link)) => (true, robot.and_then(whose).zip(link)),
            None => (false, None),
        };
        let (is_real, real) = match index(real) {
            Some((robot, link)) => (true, robot.zip(link)),
            None => (false, None),
        };
        let same = is_link && is_real && said.is_some() && said == real;
        self.links[0] += u64::from(same);
        self.links[1] += u64::from(is_real);
        self.links[2] += u64::from(is_link);
        for (which, place) in [(1, real), (2, said)] {
            let count = place.and_then(|(r, l)| self.by_link.get_mut(r)?.get_mut(l));
            if let Some(count) = count {
                count[which] += 1;
                count[0] += u64::from(which == 1 && same);
            }
        }
    }

    /// Intersection over union of each link of a true robot with at least so many points.
    pub fn link_ious(&self, robot: usize, least: u64) -> impl Iterator<Item = f64> {
        let links = self.by_link[robot].iter().filter(move |c| c[1] >= least);
        links.map(|c| c[0] as f64 / (c[1] + c[2] - c[0]).max(1) as f64)
    }

    /// F1 score of "moves", 0 to 1.
    #[must_use]
    pub fn f1(&self) -> f64 {
        let [hit, missed, invented, _] = self.moving.map(|n| n as f64);
        if hit == 0.0 { 0.0 } else { 2.0 * hit / (2.0 * hit + missed + invented) }
    }

    /// Two lines for people.
    pub(crate) fn words(&self) -> String {
        let mut text = String::new();
        let share = |a: u64, b: u64| a as f64 / b.max(1) as f64;
        let [hit, missed, invented, _] = self.moving;
        let _ = writeln!(
            text,
            "moving/fixed: F1 {:.4}, precision {:.4}, recall {:.4}; fixed points lost {:.4} %",
            self.f1(),
            share(hit, hit + invented),
            share(hit, hit + missed),
            100.0 * share(self.fixed[1], self.fixed[0])
        );
        let _ = writeln!(
            text,
            "links: {:.2} % of the points said to be links are the right robot's right link; {:.2} % of the true ones found",
            100.0 * share(self.links[0], self.links[2]),
            100.0 * share(self.links[0], self.links[1])
        );
        text
    }
}
