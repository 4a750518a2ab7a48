//! The graph of occupied voxels, each connected to its up to 26 neighbours: connected components,
//! and shortest paths from several seeds.

use contract::Voxel;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// The neighbours of each voxel of a sorted list.
pub(crate) struct Graph {
    voxels: Vec<Voxel>,
    /// Neighbours of voxel `i` are `to[starts[i]..starts[i + 1]]`, ascending.
    starts: Vec<usize>,
    to: Vec<u32>,
    /// Length of the edge to each neighbour in `to`, in hundredths of a voxel's edge. Integers
    /// make sums exact and ties the same on every machine.
    steps: Vec<u32>,
}

impl Graph {
    /// Makes the graph of distinct voxels.
    pub(crate) fn new(voxels: &[Voxel]) -> Self {
        // The map is only looked up and never iterated, so that its order cannot affect the result.
        let index: HashMap<Voxel, u32> =
            voxels.iter().enumerate().map(|(i, v)| (*v, i as u32)).collect();
        let mut graph =
            Self { voxels: voxels.to_vec(), starts: vec![0], to: Vec::new(), steps: Vec::new() };
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

    /// The graph with more edges, each between two voxels, of a length in hundredths of a voxel's
    /// edge.
    pub(crate) fn with_edges(self, edges: &[(usize, usize, u32)]) -> Self {
        let mut more: Vec<Vec<(usize, u32)>> = vec![Vec::new(); self.len()];
        for &(a, b, step) in edges {
            more[a].push((b, step));
            more[b].push((a, step));
        }
        let mut graph =
            Self { voxels: Vec::new(), starts: vec![0], to: Vec::new(), steps: Vec::new() };
        for (at, more) in more.iter_mut().enumerate() {
            more.extend(self.neighbours(at));
            more.sort_unstable();
            more.dedup_by_key(|edge| edge.0);
            graph.to.extend(more.iter().map(|edge| edge.0 as u32));
            graph.steps.extend(more.iter().map(|edge| edge.1));
            graph.starts.push(graph.to.len());
        }
        Self { voxels: self.voxels, ..graph }
    }

    /// The graph of a connected component alone. Its voxels keep their order.
    pub(crate) fn part(&self, members: &[usize]) -> Self {
        let place = |at: usize| members.binary_search(&at).unwrap_or_default();
        let mut part =
            Self { voxels: Vec::new(), starts: vec![0], to: Vec::new(), steps: Vec::new() };
        for &at in members {
            part.voxels.push(self.voxels[at]);
            for (other, step) in self.neighbours(at) {
                part.to.push(place(other) as u32);
                part.steps.push(step);
            }
            part.starts.push(part.to.len());
        }
        part
    }

    /// The voxel with an index.
    pub(crate) fn voxel(&self, at: usize) -> Voxel {
        self.voxels[at]
    }

    /// Number of voxels.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The neighbours of a voxel by index, with the length of each edge in hundredths of a voxel's
    /// edge.
    pub(crate) fn neighbours(&self, at: usize) -> impl Iterator<Item = (usize, u32)> + '_ {
        let range = self.starts[at]..self.starts[at + 1];
        self.to[range.clone()].iter().map(|t| *t as usize).zip(self.steps[range].iter().copied())
    }

    /// The connected components. Members ascend within each; components are sorted by their first
    /// member.
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
                for (other, _) in self.neighbours(members[next]) {
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

    /// Updates, for each voxel, the length of the shortest path from any seed (hundredths of a
    /// voxel's edge; `u32::MAX` where no seed is connected) and the `mark` of that seed. Of equally
    /// long paths the smaller mark is kept. Seeds are pairs of voxel index and mark. Only voxels
    /// that the seeds reach are changed.
    pub(crate) fn shortest_paths(&self, seeds: &[(usize, u32)], shortest_paths: &mut [(u32, u32)]) {
        let mut heap = BinaryHeap::new();
        for &(at, mark) in seeds {
            if (0, mark) < shortest_paths[at] {
                shortest_paths[at] = (0, mark);
                heap.push(Reverse((0, mark, at)));
            }
        }
        while let Some(Reverse((length, mark, at))) = heap.pop() {
            if (length, mark) > shortest_paths[at] {
                continue;
            }
            for (other, step) in self.neighbours(at) {
                let path = (length.saturating_add(step), mark);
                if path < shortest_paths[other] {
                    shortest_paths[other] = path;
                    heap.push(Reverse((path.0, mark, other)));
                }
            }
        }
    }
}
