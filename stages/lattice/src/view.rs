//! Builds a scan's view of a region from its tiles: depth images towards the region, and the points
//! inside.

use contract::{Lattice, MAX_SKIP, Pixel, Region, Scan, TILE_SIDE, Tile, TileAt, TilePoints, View};
use geometry::depth::{Empty, LANES, Lanes, Rows, lanes, rows, transform, transform_lanes};
use geometry::{DepthImage, Faces, Point, Pose, Vector};
use nalgebra::{Rotation3, Translation3, UnitQuaternion};

/// Settings of the views.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewSettings {
    /// Width of a depth image's cell in beams; below about 1.3 a regular scan leaves holes.
    pub beams_per_cell: f64,
    /// Smallest cell at the near side of the region, metres; the search has no use for finer ones.
    pub min_cell: f64,
    /// Half-width of the window about a cell that must be empty before the cell counts as "no
    /// return", cells.
    pub empty_window: i32,
}

impl Default for ViewSettings {
    fn default() -> Self {
        Self { beams_per_cell: 1.5, min_cell: 0.003, empty_window: 2 }
    }
}

/// Largest half tangent of a single image; beyond, a pinhole distorts too much, and the faces of a
/// cube are used.
const MAX_HALF_TANGENT: f64 = 1.6;

/// Rows and columns of a lattice that a scan covers: `[first row, last row, first column, last
/// column]`.
pub type LatticeExtent = [u32; 4];

/// Collects one scan's view of a region tile by tile, always in the order of the tiles, so that the
/// result is reproducible.
#[derive(Debug)]
pub struct ViewBuilder {
    view: View,
    faces: Faces,
    local_from_scan: Pose,
    lattice: Option<Lattice>,
    extent: Option<LatticeExtent>,
    bounds: geometry::Aabb,
    /// Cones from the scanner that together hold the region; `None` where the scanner is unknown.
    cones: Option<Vec<Cone>>,
    empty_window: i32,
    /// Level of subsampling (see [`Tile::skip`]) that suffices to fill the cells of the images and
    /// for the points that are kept.
    skip: u32,
    /// Level of subsampling of the points that are kept; `None` if no points are kept.
    kept: Option<u32>,
    /// Places in the mask of the view's points, by which they are ordered where no lattice tells
    /// which are neighbours.
    places: Vec<u64>,
}

impl ViewBuilder {
    /// An empty view of `region` from `scan`. `extent` is the part of the lattice that the scan
    /// covers, if known. Each 2^`thin`-th row and column of the points is kept, or none for `None`.
    #[must_use]
    pub fn new(
        scan: &Scan,
        region: &Region,
        extent: Option<LatticeExtent>,
        thin: Option<u32>,
        settings: &ViewSettings,
    ) -> Self {
        let local_from_world =
            Pose::from_parts(Translation3::from(-region.origin.coords), UnitQuaternion::identity());
        let local_from_scan = local_from_world * scan.world_from_scan;
        let scanner = scan.lattice.map(|_| local_from_scan * Point::origin());
        let beam_step = scan.lattice.map_or(0.0, |l| l.row_step.max(l.col_step));
        let focal = scanner.map_or(0.0, |s| focal(&s, region, beam_step, settings));
        let images = scanner.map_or_else(Vec::new, |s| cameras(&s, region, focal));
        let faces = Faces::new(&images);
        let thin = thin.map(|thin| if scan.lattice.is_some() { thin.min(MAX_SKIP) } else { 0 });
        // Points that are kept must be read, even where the images would need fewer.
        let skip = lattice_skip(scan, focal).min(thin.unwrap_or(MAX_SKIP));
        let cones = scanner.map(|s| cones(&s, region, &local_from_scan));
        let (id, mask, points) = (scan.id, scan.mask, Vec::new());
        let is_camera = scan.lattice.is_some_and(|l| l.is_camera);
        let view = View { scan: id, mask, scanner, beam_step, is_camera, images, points };
        Self {
            view,
            faces,
            local_from_scan,
            lattice: scan.lattice,
            extent,
            bounds: region.bounds,
            cones,
            empty_window: settings.empty_window,
            skip,
            kept: thin,
            places: Vec::new(),
        }
    }

    /// Whether a tile can hold anything that this view needs. For a scan with beams that is all in
    /// the cone of the region, also in front of it and behind it.
    #[must_use]
    pub fn wants(&self, at: TileAt) -> bool {
        if at.scan != self.view.scan {
            return false;
        }
        let (Some(lattice), Some(cones)) = (&self.lattice, &self.cones) else {
            return self.wants_ground(at);
        };
        let corner = |dr: u32, dc: u32| {
            let row = (at.row * TILE_SIDE + dr).min(lattice.n_rows - 1);
            let col = (at.col * TILE_SIDE + dc).min(lattice.n_cols - 1);
            Vector::from(lattice.direction(Pixel { row, col }))
        };
        let middle = corner(TILE_SIDE / 2, TILE_SIDE / 2);
        let radius = [(0, 0), (0, TILE_SIDE), (TILE_SIDE, 0), (TILE_SIDE, TILE_SIDE)]
            .into_iter()
            .map(|(dr, dc)| corner(dr, dc).angle(&middle))
            .fold(0.0, f64::max);
        // A tile near the pole extends beyond its corners; its half height covers that.
        let radius = radius.max(f64::from(TILE_SIDE) * 0.5 * lattice.row_step);
        cones.iter().any(|cone| middle.angle(&cone.axis) <= radius + cone.angle)
    }

    fn wants_ground(&self, at: TileAt) -> bool {
        let side = f64::from(Tile::GROUND_CELL) * f64::from(TILE_SIDE);
        let low = |i: u32| (i64::from(i) - Tile::GROUND_OFFSET) as f64 * side;
        let t = self.local_from_scan.translation;
        let (x, y) = (low(at.col) + t.x, low(at.row) + t.y);
        x <= self.bounds.max[0]
            && x + side >= self.bounds.min[0]
            && y <= self.bounds.max[1]
            && y + side >= self.bounds.min[1]
    }

    /// Level of subsampling at which tiles may be read.
    #[must_use]
    pub fn skip(&self) -> u32 {
        self.skip
    }

    /// Adds points of a tile, one level of subsampling as it is stored.
    pub fn add(&mut self, tile: &TilePoints<'_>) {
        let local_from_scan = rows(&self.local_from_scan);
        let cameras: Vec<_> = self
            .view
            .images
            .iter()
            .map(|image| rows(&(image.camera_from_local() * self.local_from_scan)))
            .collect();
        let is_kept = self.kept.is_some_and(|kept| tile.skip >= kept);
        for (some, places) in tile.xyz.chunks(LANES).zip(tile.place.chunks(LANES)) {
            let scan = lanes(some);
            let local = transform_lanes(&local_from_scan, &scan);
            self.splat(some.len(), &scan, &local, &cameras);
            if is_kept {
                self.keep(&local, places, tile.first_place);
            }
        }
    }

    /// Keeps the points that lie in the region.
    fn keep(&mut self, local: &Lanes, places: &[u32], first_place: u64) {
        for (i, place) in places.iter().enumerate() {
            let p = [local[0][i], local[1][i], local[2][i]];
            if self.bounds.contains(p.map(f64::from)) {
                self.view.points.push(p);
                if self.lattice.is_none() {
                    self.places.push(first_place + u64::from(*place));
                }
            }
        }
    }

    /// Adds a few points, given in the scan frame and in the local frame, to the images.
    fn splat(&mut self, n: usize, scan: &Lanes, local: &Lanes, cameras: &[Rows]) {
        if let Some(at) = self.faces.of_all(local) {
            let camera = transform_lanes(&cameras[at], scan);
            self.view.images[at].splat_lanes(&camera, n);
            return;
        }
        let point = |of: &Lanes, i: usize| [of[0][i], of[1][i], of[2][i]];
        for i in 0..n {
            for &at in self.faces.towards(point(local, i)) {
                self.view.images[at].splat(transform(&cameras[at], point(scan, i)));
            }
        }
    }

    /// Finishes the view and decides what empty cells mean.
    #[must_use]
    pub fn finish(mut self) -> View {
        if self.lattice.is_none() {
            let mut order: Vec<(u64, [f32; 3])> =
                self.places.into_iter().zip(self.view.points).collect();
            order.sort_unstable_by_key(|(place, _)| *place);
            self.view.points = order.into_iter().map(|(_, p)| p).collect();
        }
        let scan_from_local = self.local_from_scan.inverse();
        for image in &mut self.view.images {
            let scan_from_camera = rows(&(scan_from_local * image.camera_from_local().inverse()));
            let window =
                self.lattice.zip(self.extent).map(|(lattice, extent)| lattice.window(extent));
            let covered = |camera: [f32; 3]| {
                let direction = geometry::depth::rotate(&scan_from_camera, camera);
                window.is_some_and(|window| window.holds(direction))
            };
            image.finish(self.empty_window, |direction| {
                if covered(direction) { Empty::NoReturn } else { Empty::Unknown }
            });
        }
        self.view
    }
}

/// The directions from a scanner to a piece of space.
#[derive(Debug)]
struct Cone {
    /// Unit direction, scan frame.
    axis: Vector,
    /// Half of its opening angle, radians.
    angle: f64,
}

/// Number of pieces of a region along each axis, each with its cone. From close by, one cone around
/// the region would be the whole sphere, and all tiles of the scan would have to be read.
const PIECES: usize = 4;
/// Margin around each piece, metres: a depth image shows some space beside the region, too.
const BESIDE: f64 = 0.15;

/// Cones around the pieces of a region; the whole sphere for a piece that holds or touches the
/// scanner.
fn cones(scanner: &Point, region: &Region, local_from_scan: &Pose) -> Vec<Cone> {
    let (min, size) = (region.bounds.min, region.bounds.size());
    let half = Vector::from(size) * (0.5 / PIECES as f64);
    let radius = half.norm() + BESIDE;
    let middle = |i: usize| {
        let at = [i % PIECES, i / PIECES % PIECES, i / (PIECES * PIECES)];
        Point::from([0, 1, 2].map(|k| min[k] + (2 * at[k] + 1) as f64 * half[k]))
    };
    let cone = |i: usize| {
        let to = middle(i) - scanner;
        let distance = to.norm();
        (distance > radius).then(|| Cone {
            axis: local_from_scan.rotation.inverse() * (to / distance),
            angle: (radius / distance).asin(),
        })
    };
    let all: Option<Vec<Cone>> = (0..PIECES * PIECES * PIECES).map(cone).collect();
    all.unwrap_or_else(|| vec![Cone { axis: Vector::z(), angle: std::f64::consts::PI }])
}

/// Distance that is assumed at least between scanner and robot, metres: cells are not made finer
/// for a scanner within a region. At a third of that a robot at 5 m was seen in cells of 5 cm.
const NEAREST: f64 = 1.0;

/// Number of cells per unit of tangent of an image, as many as beams and settings allow.
fn focal(scanner: &Point, region: &Region, beam_step: f64, settings: &ViewSettings) -> f64 {
    let outside = |i: usize| {
        let (min, max) = (region.bounds.min[i], region.bounds.max[i]);
        (min - scanner[i]).max(scanner[i] - max).max(0.0).powi(2)
    };
    let near = (0..3).map(outside).sum::<f64>().sqrt().max(NEAREST);
    (1.0 / (settings.beams_per_cell * beam_step.max(1e-5))).min(near / settings.min_cell)
}

/// Smallest number of beams across a cell that leaves no holes in the image of a regular scan.
const LEAST_BEAMS: f64 = 1.3;

/// Level of subsampling of a scan whose beams are far denser than cells.
fn lattice_skip(scan: &Scan, focal: f64) -> u32 {
    let Some(lattice) = &scan.lattice else { return 0 };
    let beams = 1.0 / (focal.max(1e-6) * lattice.row_step.max(lattice.col_step));
    (0..=MAX_SKIP).rfind(|s| beams >= LEAST_BEAMS * f64::from(1 << s)).unwrap_or(0)
}

/// The images that together cover the region: one towards its centre, or the faces of a cube.
fn cameras(scanner: &Point, region: &Region, focal: f64) -> Vec<DepthImage> {
    let to = region.bounds.center() - scanner;
    if to.norm() > 1e-6 {
        let camera_from_local = look_at(scanner, &to);
        let mut half = 0.0_f64;
        for corner in region.bounds.corners() {
            let c = camera_from_local * Point::from(corner);
            half =
                if c.z > 1e-3 { half.max((c.x / c.z).abs()).max((c.y / c.z).abs()) } else { 9.9 };
        }
        if half <= MAX_HALF_TANGENT {
            return vec![DepthImage::new(camera_from_local, half * 1.02, focal)];
        }
    }
    let axes = [Vector::x(), Vector::y(), Vector::z()];
    let corners = region.bounds.grown(BESIDE).corners().map(Point::from);
    axes.iter()
        .flat_map(|a| [*a, -a])
        .filter(|a| {
            // A face does not see a box that lies entirely outside of one side of its pyramid.
            let camera_from_local = look_at(scanner, a);
            let seen = corners.map(|c| camera_from_local * c);
            let on = |is_in: fn(&Point) -> bool| seen.iter().any(is_in);
            on(|c| c.z > 0.0)
                && on(|c| c.x <= c.z)
                && on(|c| -c.x <= c.z)
                && on(|c| c.y <= c.z)
                && on(|c| -c.y <= c.z)
        })
        .map(|a| DepthImage::new(look_at(scanner, &a), 1.0, focal))
        .collect()
}

/// The pose `camera_from_local` of a camera at the scanner that looks with +z along `to`.
fn look_at(scanner: &Point, to: &Vector) -> Pose {
    let up = if to.normalize().z.abs() > 0.95 { Vector::x() } else { Vector::z() };
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::look_at_lh(to, &up));
    Pose::from_parts(Translation3::identity(), rotation)
        * Pose::from_parts(Translation3::from(-scanner.coords), UnitQuaternion::identity())
}
