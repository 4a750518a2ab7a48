//! Points that an adjustment is made of in; the same with what is known of where their beams end,
//! in parts and chunks, out.

use crate::pairs::Known;

/// Chunks that points are summed up in, as far as that leaves so many points in one, at least and
/// at most: each has sums of its own for hundreds of patches, all of which are joined in the end;
/// more of them end on all threads together.
const N_CHUNKS: usize = 8;
const CHUNK: [usize; 2] = [1024, 16_384];

/// Points of a scene, with the triangles that their beams met last.
#[derive(Debug, Clone)]
pub(crate) struct Sampled {
    points: Vec<u32>,
    known: Vec<Option<Known>>,
    /// No point farther than this from the surface takes part, metres.
    pub(crate) gate: f64,
}

impl Sampled {
    pub(crate) fn new(points: Vec<u32>, gate: f64) -> Self {
        Self { known: vec![None; points.len()], points, gate }
    }

    /// One of so many.
    pub(crate) fn every(&self, step: usize) -> Self {
        let points = self.points.iter().copied().step_by(step).collect();
        let known = self.known.iter().copied().step_by(step).collect();
        Self { points, known, gate: self.gate }
    }

    /// One of so many that about `n` are left, if there are more.
    pub(crate) fn about(&self, n: usize) -> Self {
        self.every((self.points.len() / n.max(1)).max(1))
    }

    /// Their indices in the scene.
    pub(crate) fn points(&self) -> &[u32] {
        &self.points
    }

    /// Those that are to be kept.
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

    /// Those whose beams met other links than these, and the rest, nothing of it known.
    pub(crate) fn parted(&self, links: &[usize]) -> [Self; 2] {
        let rests = |k: &Option<Known>| k.is_some_and(|k| !links.contains(&k.link()));
        let pairs = self.points.iter().copied().zip(self.known.iter().copied());
        let (resting, others): (Vec<_>, Vec<_>) = pairs.partition(|(_, k)| rests(k));
        let (points, known) = resting.into_iter().unzip();
        let others = others.into_iter().map(|(point, _)| point).collect();
        [Self { points, known, gate: self.gate }, Self::new(others, self.gate)]
    }

    /// Points that one thread works on at a time, and what is known of them.
    pub(crate) fn chunks(&mut self) -> Vec<(&[u32], &mut [Option<Known>])> {
        let n = self.points.len().div_ceil(N_CHUNKS).clamp(CHUNK[0], CHUNK[1]);
        self.points.chunks(n).zip(self.known.chunks_mut(n)).collect()
    }
}
