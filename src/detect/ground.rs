//! Floor, planes, occupied space and the covered part of each scan's lattice, computed from all
//! tiles in one pass that joins the map of stage `lattice` and the fold of stage `floor`.

use crate::engine::Engine;
use crate::job::Settings;
use crate::store::{Store, TileEntry};
use contract::{Fold, Map, Result, Scan, ScanId, TILE_SIDE, Tile, TileSummary, Weigh};
use lattice::{LatticeExtent, Summarise};
use serde::{Deserialize, Serialize};

/// The map: summarises a tile, and finds the rows and columns of its scan that it covers.
struct Surfaces(Summarise);

/// Summary and covered part of one tile.
struct Surface {
    scan: ScanId,
    extent: Option<LatticeExtent>,
    summary: TileSummary,
}

/// The fold that joins the summaries of all tiles.
struct GatherGround {
    find: floor::Find,
    n_scans: usize,
}

/// Floor, planes, occupied space and coverage of the whole plant.
#[derive(Serialize, Deserialize)]
pub(crate) struct Ground {
    /// Floor, planes and occupied space.
    pub(crate) surfaces: floor::FloorFindings,
    /// For each scan, the rows and columns of its lattice that its points cover.
    pub(crate) extents: Vec<Option<LatticeExtent>>,
}

/// What the tiles of some scans add to the ground: the sum of the fold before it ends.
#[derive(Serialize, Deserialize)]
pub(crate) struct GroundPart(<GatherGround as Fold>::Sum);

/// The fold whose result is its sum.
struct PartOf(GatherGround);

impl Ground {
    /// Computes the ground in one pass over the tiles of a store.
    ///
    /// # Errors
    /// A damaged tile; cancelled.
    pub(crate) fn of_tiles(
        scans: &[Scan],
        store: &Store,
        settings: &Settings,
        engine: &Engine,
    ) -> Result<Self> {
        Self::gather(Surfaces::new(scans, &settings.lattice), scans, store, settings, engine)
    }

    /// What the tiles of some scans add to the ground.
    ///
    /// # Errors
    /// A damaged tile; cancelled.
    pub(crate) fn part(
        scans: &[Scan],
        store: &Store,
        settings: &Settings,
        engine: &Engine,
    ) -> Result<GroundPart> {
        let surfaces = Surfaces::new(scans, &settings.lattice);
        let gather = PartOf(GatherGround::new(scans, &settings.floor));
        let (source, reads) = (store.picks(|entry| surfaces.skip(entry)), store.reads());
        engine.pass(store.task("surfaces"), source, |f| f.map(&reads).map(&surfaces).fold(&gather))
    }

    /// The ground of parts in the order of their scans: the same as that of all tiles.
    ///
    /// # Errors
    /// Those of the fold.
    pub(crate) fn join(
        parts: impl IntoIterator<Item = Result<GroundPart>>,
        scans: &[Scan],
        settings: &Settings,
    ) -> Result<Self> {
        let gather = GatherGround::new(scans, &settings.floor);
        let mut sum = gather.empty();
        for part in parts {
            gather.join(&mut sum, part?.0)?;
        }
        gather.finish(sum)
    }

    /// Like [`Ground::of_tiles`], without planes, for runs in which floor and walls are known.
    ///
    /// # Errors
    /// Those of [`Ground::of_tiles`].
    pub(crate) fn without_planes(
        scans: &[Scan],
        store: &Store,
        settings: &Settings,
        engine: &Engine,
    ) -> Result<Self> {
        let surfaces = Surfaces::new(scans, &settings.lattice).without_planes();
        Self::gather(surfaces, scans, store, settings, engine)
    }

    fn gather(
        surfaces: Surfaces,
        scans: &[Scan],
        store: &Store,
        settings: &Settings,
        engine: &Engine,
    ) -> Result<Self> {
        let gather = GatherGround::new(scans, &settings.floor);
        let (source, reads) = (store.picks(|entry| surfaces.skip(entry)), store.reads());
        engine.pass(store.task("surfaces"), source, |f| f.map(&reads).map(&surfaces).fold(&gather))
    }
}

impl Surfaces {
    fn new(scans: &[Scan], settings: &lattice::Settings) -> Self {
        Self(Summarise::new(scans, settings))
    }

    /// How much of a tile's points may be left out (see [`Tile::skip`]).
    fn skip(&self, entry: &TileEntry) -> u32 {
        self.0.skip(entry.at.scan, entry.range)
    }

    /// Like [`Surfaces::new`], without planes, for runs in which floor and walls are known.
    fn without_planes(self) -> Self {
        Self(self.0.without_planes())
    }
}

impl GatherGround {
    fn new(scans: &[Scan], settings: &floor::Settings) -> Self {
        Self { find: floor::Find::new(scans, settings), n_scans: scans.len() }
    }
}

impl Map for Surfaces {
    type In = Tile;
    type Out = Surface;
    type Scratch = lattice::LatticeScratch;

    fn apply(&self, tile: Tile, scratch: &mut Self::Scratch) -> Result<Surface> {
        let scan = tile.at.scan;
        let extent = extent(&tile);
        Ok(Surface { scan, extent, summary: self.0.apply(tile, scratch)? })
    }
}

impl Fold for GatherGround {
    type In = Surface;
    type Sum = (floor::FloorSum, Vec<Option<LatticeExtent>>);
    type Out = Ground;

    fn empty(&self) -> Self::Sum {
        (self.find.empty(), vec![None; self.n_scans])
    }

    fn add(&self, sum: &mut Self::Sum, item: Surface) -> Result<()> {
        let slot = &mut sum.1[item.scan.0 as usize];
        *slot = join(*slot, item.extent);
        self.find.add(&mut sum.0, item.summary)
    }

    fn join(&self, earlier: &mut Self::Sum, later: Self::Sum) -> Result<()> {
        for (slot, extent) in earlier.1.iter_mut().zip(later.1) {
            *slot = join(*slot, extent);
        }
        self.find.join(&mut earlier.0, later.0)
    }

    fn finish(&self, sum: Self::Sum) -> Result<Ground> {
        Ok(Ground { surfaces: self.find.finish(sum.0)?, extents: sum.1 })
    }
}

impl Fold for PartOf {
    type In = Surface;
    type Sum = <GatherGround as Fold>::Sum;
    type Out = GroundPart;

    fn empty(&self) -> Self::Sum {
        self.0.empty()
    }

    fn add(&self, sum: &mut Self::Sum, item: Surface) -> Result<()> {
        self.0.add(sum, item)
    }

    fn join(&self, earlier: &mut Self::Sum, later: Self::Sum) -> Result<()> {
        self.0.join(earlier, later)
    }

    fn finish(&self, sum: Self::Sum) -> Result<GroundPart> {
        Ok(GroundPart(sum))
    }
}

/// Rows and columns of the lattice that a tile covers.
fn extent(tile: &Tile) -> Option<LatticeExtent> {
    // Points are sorted by pixel and therefore by row.
    let (first, last) = (tile.pixel.first()?, tile.pixel.last()?);
    let cols = tile.pixel.iter().map(|pixel| *pixel as u8);
    let [left, right] =
        cols.fold([u8::MAX, 0], |[least, most], c| [least.min(c), most.max(c)]).map(u32::from);
    let [low, high] = [first, last].map(|pixel| u32::from(pixel >> 8));
    let (row, col) = (tile.at.row * TILE_SIDE, tile.at.col * TILE_SIDE);
    Some([row + low, row + high, col + left, col + right])
}

fn union(a: LatticeExtent, b: LatticeExtent) -> LatticeExtent {
    [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])]
}

fn join(a: Option<LatticeExtent>, b: Option<LatticeExtent>) -> Option<LatticeExtent> {
    match (a, b) {
        (Some(a), Some(b)) => Some(union(a, b)),
        (a, b) => a.or(b),
    }
}

impl Weigh for Surface {
    fn weight_bytes(&self) -> usize {
        self.summary.weight_bytes()
    }

    fn n_points(&self) -> u64 {
        self.summary.n_points
    }
}
