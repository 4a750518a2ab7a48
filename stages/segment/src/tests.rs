//! A robot made of boxes on a floor beside a wall, seen by one scanner with noise and mixed pixels:
//! labels are compared with the truth.

use crate::{FloorHeights, Segment, SegmentScratch, Settings};
use contract::{
    Fit, Floor, FloorLevel, InputId, JointFit, Label, Lattice, Map, MaskId, OneByOne, Pixel,
    PlaceRun, PointKind, Scan, ScanId, Tile, TileAt, Verdict,
};
use geometry::{Aabb, Plane, Point, Pose, Vector};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::SplitMix64;
use robot::{CadCloud, Joint, JointKind, Link, Model, Motion, Role};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A box in its own frame, given by its half sizes, metres.
struct Brick {
    world_from_box: Pose,
    half: [f64; 3],
    label: Label,
}

impl Brick {
    /// Range at which a ray enters, metres.
    fn hit(&self, from: Point, direction: Vector) -> Option<f64> {
        let box_from_world = self.world_from_box.inverse();
        let (o, d) = (box_from_world * from, box_from_world * direction);
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for i in 0..3 {
            let (a, b) = ((-self.half[i] - o[i]) / d[i], (self.half[i] - o[i]) / d[i]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near < far && near > 0.0).then_some(near)
    }
}

fn normal(random: &mut SplitMix64) -> f64 {
    let (u, v) = (random.random::<f64>().max(1e-300), random.random::<f64>());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::translation(x, y, z)
}

/// Samples every 5 mm on a box about `middle`, in the frame of the link.
fn link(name: &str, parent_joint: Option<usize>, middle: [f64; 3], half: [f64; 3]) -> Link {
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let count = |i: usize| (half[i] * 2.0 / 0.005).ceil() as i32;
        for side in [-1.0, 1.0] {
            for (i, j) in (0..=count(u)).flat_map(|i| (0..=count(v)).map(move |j| (i, j))) {
                let mut p = [0.0; 3];
                p[axis] = side * half[axis];
                p[u] = (f64::from(i) / f64::from(count(u)) - 0.5) * 2.0 * half[u];
                p[v] = (f64::from(j) / f64::from(count(v)) - 0.5) * 2.0 * half[v];
                points.push([0, 1, 2].map(|k| (p[k] + middle[k]) as f32));
                let mut n = [0.0; 3];
                n[axis] = side as f32;
                normals.push(n);
            }
        }
    }
    let min = [0, 1, 2].map(|k| middle[k] - half[k]);
    let max = [0, 1, 2].map(|k| middle[k] + half[k]);
    Link {
        name: name.into(),
        role: Role::Main,
        parent_joint,
        mesh: Arc::default(),
        cad: CadCloud { points, normals, spacing: 0.005, area: 1.0 }.into(),
        bounds: Aabb { min, max },
    }
}

const BASE: [f64; 3] = [0.15, 0.15, 0.25];
const ARM: [f64; 3] = [0.06, 0.08, 0.4];

fn model() -> Model {
    Model {
        name: "box".into(),
        links: vec![
            link("base", None, [0.0, 0.0, 0.25], BASE),
            link("arm", Some(0), [0.0, 0.0, 0.4], ARM),
        ],
        joints: vec![Joint {
            name: "j1".into(),
            kind: JointKind::Revolute,
            parent: 0,
            child: 1,
            parent_from_joint: at(0.0, 0.0, 0.52),
            axis: Vector::y_axis(),
            limits: None,
            motion: Motion::Free(0),
        }],
        free: vec![0],
        loops: Vec::new(),
        main_chain: vec![0],
        symmetries: Vec::new(),
        mesh_sigmas: Vec::new(),
    }
}

fn fit(world_from_base: Pose, q: f64) -> Fit {
    Fit {
        model: 0,
        model_name: "box".into(),
        world_from_base,
        base_sigma: [1e-4; 6],
        joints: vec![JointFit {
            name: "j1".into(),
            value: q,
            sigma: 1e-4,
            certainty: contract::Certainty::Determined,
            ..JointFit::default()
        }],
        verdict: Verdict::Trusted,
        ..Fit::default()
    }
}

fn floor() -> Floor {
    let cells = (-40..40).flat_map(|i| (-40..40).map(move |j| ([i, j], 0.0)));
    let plane = Plane { normal: Vector::z(), offset: 0.0 };
    let level = FloorLevel {
        plane,
        waviness: 0.0,
        scatter: 0.002,
        area: 400.0,
        cell: 0.25,
        heights: cells.collect(),
    };
    Floor { levels: vec![level], planes: Vec::new() }
}

fn scan(world_from_scan: Pose) -> Scan {
    Scan {
        id: ScanId(0),
        input: InputId(0),
        mask: MaskId(0),
        name: "s".into(),
        source_id: None,
        places: Vec::new(),
        raster: None,
        scanner: contract::ScannerPosition::Stated,
        world_from_scan,
        lattice: Some(Lattice::new(0.0015, 0.0015, 0.0, 0.0)),
        stated_bounds: None,
        stated_points: None,
        notes: Vec::new(),
    }
}

/// A tile with the truth of its points; `None` for mixed pixels.
type Shot = (Tile, Vec<Option<Label>>);

/// Casts the rays of a scan; returns the points by tile, with truth.
fn shoot(bricks: &[Brick], scan: &Scan) -> Vec<Shot> {
    let lattice = scan.lattice.expect("has one");
    let origin = scan.world_from_scan * Point::origin();
    let mut random = SplitMix64::seed_from_u64(7);
    let mut tiles: BTreeMap<(u32, u32), Shot> = BTreeMap::new();
    let mut place = 0;
    let cast = |row: u32, col: u32| -> Option<(f64, Label)> {
        let d = scan.world_from_scan * Vector::from(lattice.direction(Pixel { row, col }));
        let mut best = (d.z < 0.0).then(|| (-origin.z / d.z, Label::FLOOR)).filter(|h| h.0 < 9.0);
        for brick in bricks {
            if let Some(range) = brick.hit(origin, d).filter(|r| best.is_none_or(|b| *r < b.0)) {
                best = Some((range, brick.label));
            }
        }
        best
    };
    for row in (lattice.n_rows / 2 - 420)..(lattice.n_rows / 2 + 260) {
        for col in (lattice.n_cols / 2 - 400)..(lattice.n_cols / 2 + 400) {
            let Some((mut range, label)) = cast(row, col) else {
                continue;
            };
            let mut truth = Some(label);
            let behind = cast(row, col + 1).map(|h| h.0).filter(|b| (b - range).abs() > 0.05);
            if let Some(behind) = behind.filter(|_| random.random::<f64>() < 0.3) {
                range += random.random::<f64>() * (behind - range);
                truth = None;
            }
            range += 0.002 * normal(&mut random);
            let p = lattice.direction(Pixel { row, col }).map(|v| (v * range) as f32);
            let (tr, tc) = (row / 256, col / 256);
            let (tile, truths) = tiles.entry((tr, tc)).or_insert_with(|| {
                let at = TileAt { scan: ScanId(0), row: tr, col: tc };
                let (place, pixel, xyz) = (Vec::new(), Vec::new(), Vec::new());
                (
                    Tile {
                        at,
                        first_place: 0,
                        place,
                        pixel,
                        xyz,
                        bounds: Aabb::EMPTY,
                        skip: 0,
                        n_all: 0,
                    },
                    Vec::new(),
                )
            });
            let world = scan.world_from_scan * Point::from(p.map(f64::from));
            tile.bounds.add([world.x, world.y, world.z]);
            tile.place.push(place);
            tile.pixel.push(((row % 256) * 256 + col % 256) as u16);
            tile.xyz.push(p);
            truths.push(truth);
            place += 1;
        }
    }
    tiles.into_values().collect()
}

/// The labels, place by place.
fn single(runs: &[PlaceRun<Label>]) -> impl Iterator<Item = (u64, Label)> {
    runs.iter().flat_map(|run| (run.first..run.end()).map(|place| (place, run.what)))
}

fn segment(fits: &[Fit], scan: &Scan) -> Segment {
    let scans = std::slice::from_ref(scan);
    Segment::new(fits, &[model()], &floor(), scans, Settings::default(), &OneByOne)
}

#[test]
fn links_are_found_and_nothing_fixed_is_lost() {
    let q = 0.7;
    let world_from_base = at(0.5, 0.2, 0.0);
    let world_from_arm = world_from_base * model().poses(&[q])[1];
    let on = |link: i16| Label { kind: PointKind::Link, robot: 0, link };
    let bricks = [
        Brick { world_from_box: world_from_base * at(0.0, 0.0, 0.25), half: BASE, label: on(0) },
        Brick { world_from_box: world_from_arm * at(0.0, 0.0, 0.4), half: ARM, label: on(1) },
        // A wall behind, and a box on the floor 4 cm from the base.
        Brick { world_from_box: at(-1.2, 0.0, 1.5), half: [0.05, 3.0, 1.5], label: Label::FIXED },
        Brick { world_from_box: at(0.5, 0.64, 0.2), half: [0.15, 0.25, 0.2], label: Label::FIXED },
    ];
    let scan = scan(at(4.0, 1.6, 1.4) * Pose::rotation(Vector::z() * 3.5));
    let tiles = shoot(&bricks, &scan);
    let fits = [fit(world_from_base, q)];
    let segment = segment(&fits, &scan);
    let ground = FloorHeights::new(&floor(), &Settings::default());
    let mut scratch = SegmentScratch::default();
    let (mut hit, mut missed, mut invented, mut n_fixed) = ([0_u32; 2], [0_u32; 2], [0_u32; 2], 0);
    let (mut n_veils, mut veils_on_link, mut floor_right, mut n_floor) = (0, 0, 0, 0);
    for (tile, truth) in tiles {
        let xyz = tile.xyz.clone();
        let out = segment.apply(tile.clone(), &mut scratch).expect("maps");
        assert!(out.labels.windows(2).all(|w| w[0].end() <= w[1].first));
        let known: std::collections::HashMap<u64, Label> = single(&out.labels).collect();
        assert!(out.voxels.windows(2).all(|w| w[0].voxel < w[1].voxel));
        for (i, truth) in truth.iter().enumerate() {
            let place = u64::from(tile.place[i]);
            let world = scan.world_from_scan * Point::from(xyz[i].map(f64::from));
            let by_place = ground.label([world.x, world.y, world.z]);
            let label = known.get(&place).copied().unwrap_or(by_place);
            let Some(truth) = truth else {
                n_veils += 1;
                veils_on_link += u32::from(label.kind == PointKind::Link);
                continue;
            };
            n_fixed += u32::from(truth.kind == PointKind::Fixed);
            if truth.kind == PointKind::Floor {
                n_floor += 1;
                floor_right += u32::from(label.kind == PointKind::Floor);
            }
            for link in 0..2 {
                match (*truth == on(link as i16), label == on(link as i16)) {
                    (true, true) => hit[link] += 1,
                    (true, false) => missed[link] += 1,
                    (false, true) => invented[link] += 1,
                    (false, false) => {}
                }
            }
        }
    }
    let iou = |l: usize| f64::from(hit[l]) / f64::from(hit[l] + missed[l] + invented[l]);
    assert!(hit[0] > 3000 && hit[1] > 3000 && n_fixed > 20_000, "{hit:?} {n_fixed}");
    assert!(
        iou(0) > 0.97 && iou(1) > 0.97,
        "{} {} {hit:?} {missed:?} {invented:?}",
        iou(0),
        iou(1)
    );
    assert!(
        f64::from(invented[0] + invented[1]) < 0.005 * f64::from(n_fixed + n_floor),
        "{invented:?}"
    );
    assert!(f64::from(floor_right) > 0.99 * f64::from(n_floor));
    assert!(f64::from(veils_on_link) < 0.15 * f64::from(n_veils), "{veils_on_link} of {n_veils}");
}

#[test]
fn the_top_of_a_stand_goes_on_beside_the_foot() {
    let world_from_base = at(0.5, 0.2, 0.6);
    let on = |link: i16| Label { kind: PointKind::Link, robot: 0, link };
    let stand = [0.25, 0.25, 0.3];
    let bricks = [
        Brick { world_from_box: world_from_base * at(0.0, 0.0, 0.25), half: BASE, label: on(0) },
        Brick { world_from_box: at(0.5, 0.2, 0.3), half: stand, label: Label::FIXED },
    ];
    let scan = scan(at(3.0, 1.6, 1.9) * Pose::rotation(Vector::z() * 3.6));
    let fits = [fit(world_from_base, 0.0)];
    let segment = segment(&fits, &scan);
    let mut scratch = SegmentScratch::default();
    let (mut n_stand, mut n_lost, mut n_base, mut n_found) = (0_u32, 0_u32, 0_u32, 0_u32);
    for (tile, truth) in shoot(&bricks, &scan) {
        let out = segment.apply(tile.clone(), &mut scratch).expect("maps");
        let known: std::collections::HashMap<u64, Label> = single(&out.labels).collect();
        for (truth, place) in truth.iter().zip(&tile.place) {
            let is_link = known.get(&u64::from(*place)).is_some_and(|l| l.kind == PointKind::Link);
            n_stand += u32::from(*truth == Some(Label::FIXED));
            n_lost += u32::from(*truth == Some(Label::FIXED) && is_link);
            n_base += u32::from(*truth == Some(on(0)));
            n_found += u32::from(*truth == Some(on(0)) && is_link);
        }
    }
    assert!(n_stand > 5000 && n_base > 5000, "{n_stand} {n_base}");
    assert!(f64::from(n_lost) < 0.005 * f64::from(n_stand), "{n_lost} of {n_stand} lost");
    assert!(f64::from(n_found) > 0.97 * f64::from(n_base), "{n_found} of {n_base} found");
}

/// Points of a real robot's own surface with 2 mm of noise, in a tile without raster.
#[test]
#[allow(clippy::print_stderr)]
fn points_of_a_real_robot_go_to_their_links() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/robots/kuka_kr10_r1100_sixx");
    if !folder.is_dir() {
        eprintln!("skipped: no {}", folder.display());
        return;
    }
    let model = Model::load(&folder, &robot::Settings::default()).expect("loads").0;
    let posture: Vec<f64> =
        model.home().iter().enumerate().map(|(i, q)| q + 0.1 * i as f64).collect();
    let world_from_base = at(2.0, 1.0, 0.0);
    let mut fit = fit(world_from_base, 0.0);
    fit.joints = (posture.iter().enumerate())
        .map(|(i, q)| JointFit {
            name: format!("j{i}"),
            value: *q,
            sigma: 1e-4,
            certainty: contract::Certainty::Determined,
            ..JointFit::default()
        })
        .collect();
    let poses = model.poses(&posture);
    let fields: Vec<_> =
        model.links.iter().map(|link| crate::field::DistanceField::new(&link.cad)).collect();
    // Faces pressed together inside a joint belong to either link, and no scanner sees them.
    let is_apart = |link: usize, base: Point| {
        let others = fields.iter().zip(&poses).enumerate().filter(|(other, _)| *other != link);
        others
            .filter_map(|(_, (field, pose))| Some((field.as_ref()?, pose.inverse() * base)))
            .all(|(field, p)| field.near([p.x as f32, p.y as f32, p.z as f32]).is_err())
    };
    let mut random = SplitMix64::seed_from_u64(3);
    let mut truth = Vec::new();
    let tile_at = TileAt { scan: ScanId(0), row: 0, col: 0 };
    let mut tile = Tile {
        at: tile_at,
        first_place: 0,
        place: Vec::new(),
        pixel: Vec::new(),
        xyz: Vec::new(),
        bounds: Aabb::EMPTY,
        skip: 0,
        n_all: 0,
    };
    for (link, pose) in poses.iter().enumerate() {
        for (p, n) in
            model.links[link].cad.points.iter().zip(&model.links[link].cad.normals).take(6000)
        {
            let shift = Vector::from(n.map(f64::from)) * 0.002 * normal(&mut random);
            let base = pose * (Point::from(p.map(f64::from)) + shift);
            let p = world_from_base * base;
            // The lowest samples of the foot lie on the floor, and count as floor.
            if p.z > 0.02 && is_apart(link, base) {
                tile.place.push(truth.len() as u32);
                tile.pixel.push(0);
                tile.xyz.push([p.x as f32, p.y as f32, p.z as f32]);
                tile.bounds.add([p.x, p.y, p.z]);
                truth.push(link as i16);
            }
        }
    }
    let scan = Scan { lattice: None, ..scan(Pose::identity()) };
    let started = std::time::Instant::now();
    let segment = Segment::new(&[fit], &[model], &floor(), &[scan], Settings::default(), &OneByOne);
    let built = started.elapsed();
    let out = segment.apply(tile, &mut SegmentScratch::default()).expect("maps");
    let labels: Vec<(u64, Label)> = single(&out.labels).collect();
    let right = labels.iter().filter(|(place, label)| label.link == truth[*place as usize]).count();
    let taken = started.elapsed() - built;
    eprintln!(
        "{} points: {:.3} on a link, {:.3} on the right one; fields {built:?}, {taken:?}",
        truth.len(),
        labels.len() as f64 / truth.len() as f64,
        right as f64 / truth.len() as f64
    );
    assert!(labels.len() as f64 > 0.985 * truth.len() as f64);
    assert!(right as f64 > 0.985 * truth.len() as f64);
}
