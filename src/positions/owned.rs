//! Which points of a cloud were measured from a setup.

/// Which points of a cloud are those of a setup.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ownership {
    /// All.
    Whole,
    /// Those with this `point_source_id`.
    Source(u16),
    /// Those at these places in the file: first and last of each stretch.
    Places(Vec<[u64; 2]>),
    /// About so many points, which lie on its raster; they are in no order, so that a scanners file
    /// cannot name them.
    Raster(u64),
    /// It is not known, or cannot be said in a scanners file.
    Untold,
}

impl Ownership {
    /// In words.
    #[must_use]
    pub fn words(&self) -> String {
        match self {
            Self::Whole => "all points".into(),
            Self::Source(id) => format!("points with point_source_id {id}"),
            Self::Places(places) => {
                let n: u64 = places.iter().map(|[first, last]| last - first + 1).sum();
                let stretches = contract::words::count(places.len() as u64, "stretch");
                format!("{n} points in {stretches} of the file")
            }
            Self::Raster(n) => {
                format!("about {n} points lie on its raster, in no order: a run cannot use it yet")
            }
            Self::Untold => "it is open which points are its own".into(),
        }
    }
}
