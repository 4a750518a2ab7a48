//! The least cut between a source and a sink of a small directed network (Dinic's method).

use std::collections::VecDeque;

/// A directed network with whole capacities.
#[derive(Debug, Default)]
pub(crate) struct FlowNetwork {
    /// Arcs in pairs: arc `2k + 1` is the reverse of arc `2k`.
    to: Vec<u32>,
    left: Vec<u64>,
    /// Arcs that leave each node.
    from: Vec<Vec<u32>>,
}

/// A capacity that no cut of a body reaches.
pub(crate) const UNCUT: u64 = 1 << 40;

impl FlowNetwork {
    /// A network of `n` nodes without arcs.
    pub(crate) fn new(n: usize) -> Self {
        Self { from: vec![Vec::new(); n], ..Self::default() }
    }

    /// Adds an arc.
    pub(crate) fn add(&mut self, from: usize, to: usize, capacity: u64) {
        for (a, b, capacity) in [(from, to, capacity), (to, from, 0)] {
            self.from[a].push(self.to.len() as u32);
            self.to.push(b as u32);
            self.left.push(capacity);
        }
    }

    /// Adds arcs of the same capacity in both directions.
    pub(crate) fn add_both(&mut self, a: usize, b: usize, capacity: u64) {
        self.add(a, b, capacity);
        if let Some(back) = self.left.last_mut() {
            *back = capacity;
        }
    }

    /// Fills the network with the largest flow from `source` to `sink`; returns its value, which is
    /// the cost of the least cut.
    pub(crate) fn fill(&mut self, source: usize, sink: usize) -> u64 {
        let mut value = 0;
        loop {
            let depth = self.depths(source);
            if depth[sink] == u32::MAX {
                return value;
            }
            let mut next = vec![0; self.from.len()];
            while let Some(path) = self.path(source, sink, &depth, &mut next) {
                let least = path.iter().map(|&arc| self.left[arc]).min().unwrap_or(0);
                for arc in path {
                    self.left[arc] -= least;
                    self.left[arc ^ 1] += least;
                }
                value += least;
            }
        }
    }

    /// Number of arcs with capacity left from the source to each node.
    fn depths(&self, source: usize) -> Vec<u32> {
        let mut depth = vec![u32::MAX; self.from.len()];
        depth[source] = 0;
        let mut queue = VecDeque::from([source]);
        while let Some(at) = queue.pop_front() {
            for &arc in &self.from[at] {
                let to = self.to[arc as usize] as usize;
                if self.left[arc as usize] > 0 && depth[to] == u32::MAX {
                    depth[to] = depth[at] + 1;
                    queue.push_back(to);
                }
            }
        }
        depth
    }

    /// A path to the sink along which the depth rises, as arcs; `next` remembers the arcs of each
    /// node that lead nowhere.
    fn path(
        &self,
        source: usize,
        sink: usize,
        depth: &[u32],
        next: &mut [usize],
    ) -> Option<Vec<usize>> {
        let mut path: Vec<usize> = Vec::new();
        let mut at = source;
        while at != sink {
            if let Some(&arc) = self.from[at].get(next[at]) {
                let to = self.to[arc as usize] as usize;
                if self.left[arc as usize] > 0 && depth[to] == depth[at] + 1 {
                    path.push(arc as usize);
                    at = to;
                } else {
                    next[at] += 1;
                }
            } else {
                let back = path.pop()?;
                at = self.to[back ^ 1] as usize;
                next[at] += 1;
            }
        }
        Some(path)
    }

    /// For each node of the filled network, whether the sink cannot be reached from it: of all
    /// least cuts the one that is nearest to the sink.
    pub(crate) fn before_last_cut(&self, sink: usize) -> Vec<bool> {
        let mut before = vec![true; self.from.len()];
        before[sink] = false;
        let mut queue = VecDeque::from([sink]);
        while let Some(at) = queue.pop_front() {
            for &arc in &self.from[at] {
                let other = self.to[arc as usize] as usize;
                if self.left[arc as usize ^ 1] > 0 && before[other] {
                    before[other] = false;
                    queue.push_back(other);
                }
            }
        }
        before
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_flow_is_the_least_of_all_cuts(
            arcs in prop::collection::vec((0_usize..6, 0_usize..6, 0_u64..9), 0..20),
        ) {
            let mut network = FlowNetwork::new(6);
            arcs.iter().for_each(|&(a, b, c)| network.add(a, b, c));
            let value = network.fill(0, 5);
            let cost = |before: &dyn Fn(usize) -> bool| -> u64 {
                arcs.iter().filter(|(a, b, _)| before(*a) && !before(*b)).map(|arc| arc.2).sum()
            };
            let cuts = (0_usize..64).filter(|set| set & 1 == 1 && set >> 5 == 0);
            let least = cuts.map(|set| cost(&|node| set >> node & 1 == 1)).min();
            prop_assert_eq!(Some(value), least);
            let before = network.before_last_cut(5);
            prop_assert!(before[0] && !before[5]);
            prop_assert_eq!(cost(&|node| before[node]), value);
        }
    }
}
