//! Items, points and bytes: how much a stage has to do, and how much of it is done.

/// Items, points and bytes; as a total, zero means not known.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Amount {
    /// Number of items (strips, tiles, candidates).
    pub items: u64,
    /// Number of points.
    pub points: u64,
    /// Bytes.
    pub bytes: u64,
}

impl Amount {
    /// So many items.
    #[must_use]
    pub fn items(items: u64) -> Self {
        Self { items, ..Self::default() }
    }

    /// So many points.
    #[must_use]
    pub fn points(points: u64) -> Self {
        Self { points, ..Self::default() }
    }

    /// Share of `total` that is done, 0..1, by the first of points, bytes, items whose total is
    /// known.
    #[must_use]
    pub fn share(&self, total: &Self) -> Option<f64> {
        [(self.points, total.points), (self.bytes, total.bytes), (self.items, total.items)]
            .into_iter()
            .find(|(_, of)| *of > 0)
            .map(|(done, of)| (done as f64 / of as f64).min(1.0))
    }
}
