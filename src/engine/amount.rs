//! Amounts of work: items, points and bytes of a stage, as a total or as the part that is done.

/// Items, points and bytes. In a total, zero means that the number is not known.
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
    /// An amount of `items` items, with points and bytes not known.
    #[must_use]
    pub fn items(items: u64) -> Self {
        Self { items, ..Self::default() }
    }

    /// An amount of `points` points, with items and bytes not known.
    #[must_use]
    pub fn points(points: u64) -> Self {
        Self { points, ..Self::default() }
    }

    /// Share of `total` that is done, 0 to 1, computed from the first of points, bytes and items
    /// whose total is known; `None` where no total is known.
    #[must_use]
    pub fn share(&self, total: &Self) -> Option<f64> {
        [(self.points, total.points), (self.bytes, total.bytes), (self.items, total.items)]
            .into_iter()
            .find(|(_, of)| *of > 0)
            .map(|(done, of)| (done as f64 / of as f64).min(1.0))
    }
}
