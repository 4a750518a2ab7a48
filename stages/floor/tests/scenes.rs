//! Floors of synthetic rooms are found as built, and the law of the fold holds at every cut.

use contract::{
    Floor, Fold, InputId, Lattice, MaskId, Occupancy, PlanePatch, Scan, ScanId, TileSummary,
};
use floor::{Find, Settings, find};
use geometry::{Aabb, Moments, Pose, Vector};
use std::collections::BTreeMap;

fn scan(id: u32, position: Option<[f64; 3]>) -> Scan {
    Scan {
        id: ScanId(id),
        input: InputId(0),
        mask: MaskId(0),
        name: format!("scan {id}"),
        source_id: None,
        places: Vec::new(),
        raster: None,
        scanner: contract::ScannerPosition::Stated,
        world_from_scan: Pose::new(Vector::from(position.unwrap_or_default()), Vector::zeros()),
        lattice: position.map(|_| Lattice::new(0.002, 0.002, 0.0, 0.0)),
        stated_bounds: None,
        stated_points: None,
        notes: Vec::new(),
    }
}

#[derive(Default)]
struct Scene {
    patches: Vec<PlanePatch>,
    voxels: BTreeMap<[i32; 3], u32>,
}

impl Scene {
    /// Adds points every 2 cm on z = height(x, y) over a rectangle where `seen` holds, as patches
    /// of `tile` metres.
    fn surface(
        &mut self,
        scan: u32,
        rectangle: [[f64; 2]; 2],
        side: f64,
        height: impl Fn(f64, f64) -> f64,
        seen: impl Fn(f64, f64) -> bool,
    ) {
        let mut tiles: BTreeMap<[i32; 2], Vec<Vector>> = BTreeMap::new();
        let [[x0, x1], [y0, y1]] = rectangle;
        let count = |a: f64, b: f64| ((b - a) / 0.02).round() as i32;
        for i in 0..count(x0, x1) {
            for j in 0..count(y0, y1) {
                let (x, y) = (x0 + (f64::from(i) + 0.5) * 0.02, y0 + (f64::from(j) + 0.5) * 0.02);
                if seen(x, y) {
                    let noise = 0.002 * f64::from((i * 7 + j * 13) % 11 - 5) / 3.2;
                    let p = Vector::new(x, y, height(x, y) + noise);
                    tiles.entry([x, y].map(|v| (v / 1.7).floor() as i32)).or_default().push(p);
                    let voxel = [p.z, p.y, p.x].map(|v| (v / 0.05).floor() as i32);
                    *self.voxels.entry(voxel).or_default() += 1;
                }
            }
        }
        for points in tiles.values().filter(|p| p.len() > 20) {
            let mut moments = Moments::new(points[0]);
            points.iter().for_each(|p| moments.add(p));
            let Some(fit) = moments.plane() else { continue };
            let plane =
                if fit.plane.normal.z * side < 0.0 { fit.plane.flipped() } else { fit.plane };
            let mut ground: BTreeMap<[i32; 2], (u32, f64)> = BTreeMap::new();
            for p in points {
                let cell = ground.entry([p.x, p.y].map(|v| (v / 0.25).floor() as i32)).or_default();
                *cell = (cell.0 + 1, cell.1 + p.z);
            }
            self.patches.push(PlanePatch {
                scan: ScanId(scan),
                plane,
                moments,
                rms: fit.rms,
                bounds: Aabb::of(points.iter().map(|p| (*p).into())),
                area: points.len() as f64 * 4e-4,
                ground: ground.into_iter().map(|(c, (n, z))| (c, n, z)).collect(),
            });
        }
    }

    fn occupancy(&self) -> Occupancy {
        let voxels = self.voxels.iter().map(|(k, n)| ([k[2], k[1], k[0]], *n)).collect();
        Occupancy { edge: 0.05, voxels }
    }

    fn find(&self, scans: &[Scan]) -> Floor {
        find(&self.patches, &self.occupancy(), scans, &Settings::default())
    }
}

const ROOM: [[f64; 2]; 2] = [[-4.0, 4.0], [-3.0, 5.0]];

fn wavy(x: f64, y: f64) -> f64 {
    0.02 * x - 0.01 * y + 0.008 * (1.3 * x).sin() * (0.9 * y).cos()
}

#[test]
fn tilted_wavy_floor_with_a_larger_ceiling_tables_and_a_ring() {
    let mut scene = Scene::default();
    let scans = [scan(0, Some([0.0, 0.0, 1.6])), scan(1, Some([2.0, 1.0, 1.6]))];
    // Both scans see a part of the floor and all of the ceiling.
    scene.surface(0, ROOM, 1.0, wavy, |x, y| (x + y) % 2.0 > -0.5 && !(x.abs() < 1.0 && y > 2.0));
    scene.surface(1, ROOM, 1.0, |x, y| wavy(x, y) + 0.004, |x, _| x > 0.0);
    for s in 0..2 {
        scene.surface(s, ROOM, -1.0, |_, _| 3.0, |_, _| true);
    }
    for i in 0..4 {
        let x = -3.5 + 1.9 * f64::from(i);
        scene.surface(0, [[x, x + 1.2], [-2.0, -1.2]], 1.0, |_, _| 0.74, |_, _| true);
    }
    let ring = |x: f64, y: f64| (0.2..0.26).contains(&(x - 2.0).hypot(y - 3.0));
    scene.surface(1, [[1.5, 2.5], [2.5, 3.5]], 1.0, |_, _| 0.35, ring);
    let floor = scene.find(&scans);
    assert_eq!(
        floor.levels.len(),
        1,
        "{:?}",
        floor.levels.iter().map(|l| (l.plane, l.area)).collect::<Vec<_>>()
    );
    let level = &floor.levels[0];
    assert!(level.area > 35.0 && level.waviness < 0.008, "{} {}", level.area, level.waviness);
    // Noise of 2 mm, two scans 4 mm apart, and waves within a cell.
    assert!((0.003..0.006).contains(&level.scatter), "{}", level.scatter);
    for (x, y) in [(-2.5, 0.5), (2.5, 2.2), (3.2, -2.0), (1.0, 1.0)] {
        let off = level.height(x, y).expect("known floor") - wavy(x, y);
        assert!(off.abs() < 0.009, "{off} at {x} {y}");
    }
    let stands: Vec<_> = floor.planes.iter().filter(|p| !p.is_floor).collect();
    let ring = stands.iter().find(|p| (p.plane.offset - 0.35).abs() < 0.01).expect("the ring");
    assert!((ring.area - 0.0867).abs() < 0.01 && ring.plane.normal.z > 0.9999, "{ring:?}");
    assert!((ring.bounds.max[0] - 2.26).abs() < 0.03);
    let tables = stands.iter().filter(|p| (p.plane.offset - 0.74).abs() < 0.01).count();
    assert_eq!(tables, 4);
    assert!(stands.iter().all(|p| p.plane.offset > 0.3), "{stands:?}");
    assert!(floor.planes.iter().filter(|p| p.is_floor).count() == 1);
}

#[test]
fn two_levels_and_no_third() {
    let mut scene = Scene::default();
    scene.surface(0, [[-4.0, 1.0], [-3.0, 3.0]], 1.0, |_, _| 0.0, |_, _| true);
    scene.surface(0, [[1.0, 6.0], [-3.0, 3.0]], 1.0, |_, _| 0.6, |_, _| true);
    scene.surface(0, [[-3.0, -1.0], [-2.0, -1.0]], 1.0, |_, _| 1.4, |_, _| true);
    let floor = scene.find(&[scan(0, Some([0.0, 0.0, 1.6]))]);
    let mut heights: Vec<f64> = floor.levels.iter().map(|l| l.plane.offset).collect();
    heights.sort_by(f64::total_cmp);
    assert_eq!(heights.len(), 2, "{heights:?}");
    assert!(heights[0].abs() < 0.005 && (heights[1] - 0.6).abs() < 0.005);
    let scatters: Vec<f64> = floor.levels.iter().map(|l| l.scatter).collect();
    assert!(scatters.iter().all(|s| (0.0019..0.0025).contains(s)), "{scatters:?}");
    assert!(floor.height_above([4.0, 0.0, 1.0], 0.1).is_some_and(|h| (h - 0.4).abs() < 0.01));
}

#[test]
fn floor_in_small_pieces_between_machines() {
    let mut scene = Scene::default();
    let tilted = |x: f64, y: f64| 0.012 * x + 0.004 * y;
    let seen = |x: f64, y: f64| (x.rem_euclid(1.6) < 0.6) && (y.rem_euclid(1.4) < 0.5);
    scene.surface(0, [[-8.0, 8.0], [-5.0, 5.0]], 1.0, tilted, seen);
    let floor = scene.find(&[scan(0, Some([0.0, 0.0, 1.6]))]);
    assert_eq!(floor.levels.len(), 1);
    assert!((floor.levels[0].mean_height(5.0, 0.0) - 0.06).abs() < 0.006);
    assert!(floor.levels[0].area > 15.0);
}

#[test]
fn mirror_images_below_the_floor_are_refused() {
    let mut scene = Scene::default();
    scene.surface(0, ROOM, 1.0, |_, _| 0.0, |x, y| !(x > 3.0 && y > 4.0));
    // Mirror images of the ceiling and of a table in a glossy floor.
    scene.surface(0, [[-3.0, 3.0], [-2.0, 4.0]], 1.0, |_, _| -3.0, |_, _| true);
    scene.surface(0, [[1.0, 2.0], [1.0, 2.0]], 1.0, |_, _| -0.8, |_, _| true);
    let floor = scene.find(&[scan(0, Some([0.0, 0.0, 1.6]))]);
    assert_eq!(floor.levels.len(), 1);
    assert!(floor.levels[0].plane.offset.abs() < 0.005);
    assert_eq!(floor.planes.len(), 1, "{:?}", floor.planes);
}

#[test]
fn without_a_scanner_a_ceiling_is_recognised_by_its_surroundings() {
    let mut scene = Scene::default();
    scene.surface(0, ROOM, 1.0, wavy, |x, _| x < 2.0);
    scene.surface(0, ROOM, 1.0, |_, _| 2.8, |_, _| true);
    let floor = scene.find(&[scan(0, None)]);
    assert_eq!(floor.levels.len(), 1);
    assert!(floor.levels[0].mean_height(0.0, 0.0).abs() < 0.02);
}

#[test]
fn no_floor_gives_no_level() {
    let mut scene = Scene::default();
    scene.surface(0, [[0.0, 1.2], [0.0, 0.8]], 1.0, |_, _| 0.7, |_, _| true);
    let floor = scene.find(&[scan(0, Some([0.0, -2.0, 1.4]))]);
    assert!(floor.levels.is_empty() && floor.planes.len() == 1);
    assert_eq!(find(&[], &Occupancy::default(), &[], &Settings::default()), Floor::default());
}

#[test]
fn the_result_does_not_depend_on_the_order_of_parts() {
    let mut scene = Scene::default();
    scene.surface(0, ROOM, 1.0, wavy, |_, _| true);
    scene.surface(0, [[0.0, 1.2], [0.0, 0.8]], 1.0, |_, _| 0.7, |_, _| true);
    let voxels: Vec<_> = scene.occupancy().voxels;
    let n = scene.patches.len();
    let items: Vec<TileSummary> = scene
        .patches
        .iter()
        .enumerate()
        .map(|(i, patch)| TileSummary {
            n_points: 10,
            n_veils: i as u64,
            patches: vec![patch.clone()],
            // The shares overlap, so that the same voxels come from several parts.
            occupancy: Occupancy {
                edge: 0.05,
                voxels: voxels.iter().skip(i % 3).step_by(1 + i % 5).copied().collect(),
            },
        })
        .collect();
    let stage = Find::new(&[scan(0, Some([0.0, 0.0, 1.6]))], &Settings::default());
    let fold = |items: &[TileSummary]| {
        let mut sum = stage.empty();
        items.iter().for_each(|i| stage.add(&mut sum, i.clone()).expect("a summary"));
        sum
    };
    let whole = stage.finish(fold(&items)).expect("a floor");
    assert_eq!(whole.floor.levels.len(), 1);
    for cut in 0..=n {
        let mut earlier = fold(&items[..cut]);
        stage.join(&mut earlier, fold(&items[cut..])).expect("joined");
        assert!(stage.finish(earlier).expect("a floor") == whole, "cut at {cut}");
    }
}
