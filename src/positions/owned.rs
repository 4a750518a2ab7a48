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
    /// Those that lie on its raster, in no order, and surely on no other one's: about so many.
    Raster(u64),
    /// Points in no order, of which so many scatter too much about the raster, or so many are those
    /// of others, that it is open which are its own.
    Scattered,
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
                format!("about {n} points, in no order, which lie on its raster and on no other one's")
            }
            Self::Scattered => {
                "it is open which points are its own: they scatter about its raster, or too many are \
                 those of others"
                    .into()
            }
            Self::Untold => "it is open which points are its own".into(),
        }
    }
}
