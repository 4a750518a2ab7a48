//! Voxels as a graph of 26 neighbours: sorted voxels in; components and shortest ways out.

use contract::Voxel;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Neighbours of each voxel of a sorted list.
pub(crate) struct Graph {
    /// Neighbours of voxel `i` are `to[starts[i]..starts[i + 1]]`, ascending.
    starts: Vec<usize>,
    to: Vec<u32>,
    /// Length of each step in hundredths of an edge: whole numbers keep sums exact and ties alike
    /// everywhere.
    steps: Vec<u32>,
}

impl Graph {
    /// The graph of voxels, each once.
    pub(crate) fn new(voxels: &[Voxel]) -> Self {
        // Only looked up, never walked: its order cannot reach the answer.
        let index: HashMap<Voxel, u32> =
            voxels.iter().enumerate().map(|(i, v)| (*v, i as u32)).collect();
        let mut graph = Self { starts: vec![0], to: Vec::new(), steps: Vec::new() };
        for v in voxels {
            for n in (0..27).filter(|n| *n != 13) {
                let by = [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1];
                let other = [0, 1, 2].map(|i| v[i].wrapping_add(by[i]));
                if let Some(&at) = index.get(&other) {
                    graph.to.push(at);
                    let n_axes: i32 = by.iter().map(|b: &i32| b.abs()).sum();
                    graph.steps.push([0, 100, 141, 173][n_axes as usize]);
                }
            }
            graph.starts.push(graph.to.len());
        }
        graph
    }

    /// Number of voxels.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Neighbours of a voxel and the steps to them, hundredths of an edge.
    pub(crate) fn beside(&self, at: usize) -> impl Iterator<Item = (usize, u32)> + '_ {
        let range = self.starts[at]..self.starts[at + 1];
        self.to[range.clone()].iter().map(|t| *t as usize).zip(self.steps[range].iter().copied())
    }

    /// Connected components, each with ascending members, by their first member.
    pub(crate) fn components(&self) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.len()];
        let mut out = Vec::new();
        for start in 0..self.len() {
            if seen[start] {
                continue;
            }
            seen[start] = true;
            let mut members = vec![start];
            let mut next = 0;
            while next < members.len() {
                for (other, _) in self.beside(members[next]) {
                    if !seen[other] {
                        seen[other] = true;
                        members.push(other);
                    }
                }
                next += 1;
            }
            members.sort_unstable();
            out.push(members);
        }
        out
    }

    /// Length of the shortest way from any seed (hundredths of an edge, `u32::MAX` where there is
    /// none) and which seed's `mark` it comes from; equal ways go to the smaller mark. Works
    /// inside what the seeds reach.
    pub(crate) fn ways(&self, seeds: &[(usize, u32)], ways: &mut [(u32, u32)]) {
        let mut heap = BinaryHeap::new();
        for &(at, mark) in seeds {
            if (0, mark) < ways[at] {
                ways[at] = (0, mark);
                heap.push(Reverse((0, mark, at)));
            }
        }
        while let Some(Reverse((length, mark, at))) = heap.pop() {
            if (length, mark) > ways[at] {
                continue;
            }
            for (other, step) in self.beside(at) {
                let way = (length.saturating_add(step), mark);
                if way < ways[other] {
                    ways[other] = way;
                    heap.push(Reverse((way.0, mark, other)));
                }
            }
        }
    }
}
