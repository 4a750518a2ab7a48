//! The points that an adjustment is made of, with the triangles that their beams met.

use super::pairs::MetTriangle;

/// Chunks that points are summed up in: each has sums of its own for hundreds of patches, all of
/// which are joined in the end; more of them end on all threads together.
struct Chunks {
    n: usize,
    /// Least points of a chunk.
    least: usize,
    /// Most points of a chunk.
    most: usize,
}

const CHUNKS: Chunks = Chunks { n: 8, least: 1024, most: 16_384 };

/// Points that one thread works on at a time, of `n`: few enough that threads end together, as many
/// as make what is joined after them worth it. Sums are taken chunk by chunk, so it does not depend
/// on the threads.
pub(crate) fn chunk(n: usize) -> usize {
    (n / 16).clamp(1024, 8192)
}

/// Points of a scene, with the triangles that their beams met last.
#[derive(Debug, Clone)]
pub(crate) struct AdjustPoints {
    points: Vec<u32>,
    known: Vec<Option<MetTriangle>>,
    /// No point farther than this from the surface takes part, metres.
    pub(crate) gate: f64,
}

impl AdjustPoints {
    pub(crate) fn new(points: Vec<u32>, gate: f64) -> Self {
        Self { known: vec![None; points.len()], points, gate }
    }

    /// One point of each `step`.
    pub(crate) fn every(&self, step: usize) -> Self {
        let points = self.points.iter().copied().step_by(step).collect();
        let known = self.known.iter().copied().step_by(step).collect();
        Self { points, known, gate: self.gate }
    }

    /// One of so many that about `n` are left, if there are more.
    pub(crate) fn about(&self, n: usize) -> Self {
        self.every((self.points.len() / n.max(1)).max(1))
    }

    /// Indices of the points in the scene.
    pub(crate) fn points(&self) -> &[u32] {
        &self.points
    }

    /// The points that are to be kept.
    pub(crate) fn kept(&self, is_kept: &[bool]) -> Self {
        let all = self.points.iter().zip(&self.known).zip(is_kept);
        let (points, known) = all.filter(|(_, is_kept)| **is_kept).map(|(pair, _)| pair).unzip();
        Self { points, known, gate: self.gate }
    }

    /// These and others, each once, nothing of them known.
    pub(crate) fn with(&self, others: &Self) -> Self {
        let mut points: Vec<u32> = self.points.iter().chain(&others.points).copied().collect();
        points.sort_unstable();
        points.dedup();
        Self::new(points, self.gate)
    }

    /// What was met on these links is not known any more: they turned.
    pub(crate) fn forget(&mut self, links: &[usize]) {
        for known in &mut self.known {
            *known = known.filter(|k| !links.contains(&k.link()));
        }
    }

    /// The points whose beams met other links than these, and the rest, of whose beams nothing is
    /// known any more.
    pub(crate) fn parted(&self, links: &[usize]) -> [Self; 2] {
        let rests = |k: &Option<MetTriangle>| k.is_some_and(|k| !links.contains(&k.link()));
        let pairs = self.points.iter().copied().zip(self.known.iter().copied());
        let (resting, others): (Vec<_>, Vec<_>) = pairs.partition(|(_, k)| rests(k));
        let (points, known) = resting.into_iter().unzip();
        let others = others.into_iter().map(|(point, _)| point).collect();
        [Self { points, known, gate: self.gate }, Self::new(others, self.gate)]
    }

    /// Points that one thread works on at a time, and what is known of them.
    pub(crate) fn chunks(&mut self) -> Vec<(&[u32], &mut [Option<MetTriangle>])> {
        let n = self.points.len().div_ceil(CHUNKS.n).clamp(CHUNKS.least, CHUNKS.most);
        self.points.chunks(n).zip(self.known.chunks_mut(n)).collect()
    }
}
