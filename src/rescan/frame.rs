//! Finds the frame of the new scans from surfaces and beams of both sessions, unless it is that of
//! the plant, and carries scans and tiles to the plant's frame.

use super::earlier_points::{EarlierPoints, World};
use crate::engine::{AllThreads, Engine, Task};
use crate::store::Store;
use contract::{Error, Result, Scan, words};
use export::CarriedEntry;
use frame::{Answer, FramePlace, Gathered, Panorama, Refusal, SessionSurfaces};
use geometry::{Aabb, Point, Pose, Vector};
use ingest::Sources;
use nalgebra::{Translation3, UnitQuaternion};

/// What the user states about the frame of the new scans.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Frame {
    /// Nothing: the frame is that of the plant unless surfaces contradict it.
    #[default]
    Find,
    /// The frame is that of the plant.
    Stated,
    /// Approximate position of the first new scanner in the plant, metres, and turn from the new
    /// frame to that of the plant, degrees.
    Rough([f64; 4]),
}

/// The frame of the new scans.
#[derive(Default)]
pub(crate) struct CarriedSession {
    /// Pose that carries the new scans to the plant's frame; `None` where they are in it.
    pub(crate) plant_from_new: Option<Pose>,
    /// The entry of that pose in the result, with its evidence.
    pub(crate) entry: Option<CarriedEntry>,
    /// Warnings about the frame.
    pub(crate) warnings: Vec<String>,
}

/// Greatest angle between beams that are used, radians (0.25°); larger for a plant with many scans.
const STEP: f64 = 0.004_36;
const MANY_SCANS: f64 = 16.0;
/// Approximate number of points that are used of a scan without a raster.
const N_LOOSE: u64 = 1_000_000;
/// Most earlier scans whose beams are compared with the stated frame.
const MAX_ASKED: usize = 8;
/// Margin around the new scans within which the earlier session is compared, metres.
const ROOM: f64 = 1.0;

/// Finds the frame of the new scans, and carries them and their tiles to that of the plant. `stood`
/// are bounds of the robots in their earlier postures, world frame, metres.
///
/// # Errors
/// `BadInput` where no frame is unambiguous, or surfaces contradict the stated one.
pub(crate) fn carry(
    wish: &Frame,
    past: &EarlierPoints<'_>,
    stood: Vec<Aabb>,
    sources: &mut Sources,
    new: &mut Store,
    engine: &Engine,
) -> Result<CarriedSession> {
    let carried = FrameSearch { past, stood, new, sources, engine }.find(wish)?;
    if let Some(motion) = &carried.plant_from_new {
        for scan in &mut sources.scans[past.scans.len()..] {
            scan.world_from_scan = motion * scan.world_from_scan;
        }
        new.carry(motion);
    }
    Ok(carried)
}

/// Surfaces of both sessions.
#[derive(Clone, Copy)]
struct BothSessions<'s> {
    old: &'s SessionSurfaces,
    new: &'s SessionSurfaces,
}

/// Scans, stores and settings with which the frame is found.
struct FrameSearch<'a> {
    past: &'a EarlierPoints<'a>,
    stood: Vec<Aabb>,
    new: &'a Store,
    sources: &'a Sources,
    engine: &'a Engine,
}

impl FrameSearch<'_> {
    fn find(&self, wish: &Frame) -> Result<CarriedSession> {
        let new = self.new_session()?;
        let near = self.old_session(Some(&self.bounds().grown(ROOM)))?;
        let stated = local(&Pose::identity(), &near, &new);
        match wish {
            Frame::Stated => {
                let answer = frame::at_stated(&near, &new, &stated);
                return self.as_stated(answer, BothSessions { old: &near, new: &new });
            }
            Frame::Rough(rough) => {
                let old = self.old_session(None)?;
                return self.rough(*rough, BothSessions { old: &old, new: &new });
            }
            Frame::Find => {}
        }
        match frame::at_stated(&near, &new, &stated) {
            Answer::Holds(_) => return Ok(CarriedSession::default()),
            Answer::Near(place) => {
                return Ok(carried(&place, "found", BothSessions { old: &near, new: &new }));
            }
            Answer::Not(_) => {}
        }
        let old = self.old_session(None)?;
        let stated = local(&Pose::identity(), &old, &new);
        let found = self.engine.pool()?.install(|| frame::find(&old, &new, &stated, &AllThreads));
        match found {
            Ok(place) if frame::is_stated(&place, &stated, &new) => Ok(CarriedSession::default()),
            Ok(place) => Ok(carried(&place, "found", BothSessions { old: &old, new: &new })),
            Err(refusal) => Err(self.refused(&refusal, BothSessions { old: &old, new: &new })),
        }
    }

    /// Accepts the user's statement that the frame is that of the plant, unless surfaces and beams
    /// contradict it.
    fn as_stated(&self, answer: Answer, both: BothSessions<'_>) -> Result<CarriedSession> {
        let warning = "too few surfaces of the new scans lie on the plant's to confirm the frame that --frame states";
        match answer {
            Answer::Holds(_) => Ok(CarriedSession::default()),
            Answer::Near(place) => Ok(carried(&place, "given", both)),
            Answer::Not(Some(place)) if is_contradicted(&place) => Err(self.contradicted(&place)),
            Answer::Not(_) if both.old.surfels.all.is_empty() => {
                let what = "--frame says that the new scans are in the plant's frame, but no point of the plant lies where they do";
                let hint = "leave --frame out, or give --frame X,Y,Z,YAW";
                Err(Error::bad_input(what).at(self.input()).hint(hint))
            }
            Answer::Not(_) => {
                Ok(CarriedSession { warnings: vec![warning.into()], ..CarriedSession::default() })
            }
        }
    }

    fn rough(&self, rough: [f64; 4], both: BothSessions<'_>) -> Result<CarriedSession> {
        let plant_from_new = self.posed(rough);
        match frame::from_rough(both.old, both.new, &local(&plant_from_new, both.old, both.new)) {
            Ok(place) => Ok(carried(&place, "given", both)),
            Err(Some(place)) => Err(self.contradicted(&place)),
            Err(None) => {
                let what = "no surfaces of the new scans lie near the plant's where --frame says that they stand";
                Err(Error::bad_input(what)
                    .at(self.input())
                    .hint("give the place of the first new scanner in the plant to 0.3 m and 2°"))
            }
        }
    }

    /// Pose of the new frame in the plant, from the position of the first new scanner (metres) and
    /// a turn in degrees.
    fn posed(&self, [x, y, z, yaw]: [f64; 4]) -> Pose {
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw.to_radians());
        let shift = Vector::new(x, y, z) - turn * self.first();
        Pose::from_parts(Translation3::from(shift), turn)
    }

    /// Position of the first new scanner in the new frame; the middle of its points where it is
    /// unknown.
    fn first(&self) -> Vector {
        let scans = self.scans();
        scans.first().map_or_else(Vector::zeros, |scan| scan.world_from_scan.translation.vector)
    }

    fn scans(&self) -> &[Scan] {
        &self.sources.scans[self.past.scans.len()..]
    }

    fn bounds(&self) -> Aabb {
        self.new.entries().iter().fold(Aabb::EMPTY, |all, e| all.union(&e.bounds))
    }

    fn input(&self) -> String {
        let first = self.sources.opened().first();
        first.map_or_else(String::new, |input| input.path.display().to_string())
    }

    fn new_session(&self) -> Result<SessionSurfaces> {
        let origin = self.first().map(f64::round);
        let all = (0..self.new.entries().len()).collect();
        let gather = SessionReader { store: self.new, origin, superseded: None, bounds: None };
        gather.session(self.scans(), all, &[], usize::MAX, self.engine)
    }

    /// Surfaces of the earlier session, all or those within some bounds.
    fn old_session(&self, bounds: Option<&Aabb>) -> Result<SessionSurfaces> {
        let store = self.past.store;
        let tiles = match bounds {
            Some(bounds) => store.touching(bounds),
            None => (0..store.entries().len()).collect(),
        };
        let first = tiles.first().map_or(0, |&i| store.entries()[i].at.scan.0 as usize);
        let origin = self.past.scans.get(first).map_or_else(Vector::zeros, |scan| {
            scan.world_from_scan.translation.vector.map(f64::round)
        });
        let gather = SessionReader { store, origin, superseded: Some(self.past), bounds };
        let n_asked = if bounds.is_some() { MAX_ASKED } else { usize::MAX };
        gather.session(self.past.scans, tiles, &self.stood, n_asked, self.engine)
    }

    fn refused(&self, refusal: &Refusal, both: BothSessions<'_>) -> Error {
        let way_out = "if they are of this plant, say about where the first new scanner stands in it and how far the new frame is turned (--frame X,Y,Z,YAW, metres and degrees; --frame same where the frame is the plant's), give scans that are registered to the plant, or scan more of what surrounds the cell";
        let error = match refusal {
            Refusal::Nothing(None) => Error::bad_input(
                "the new scans are not in the plant's frame, and too few of their surfaces lie on the plant's in any other",
            ),
            Refusal::Nothing(Some(best)) => Error::bad_input(format!(
                "the new scans are not in the plant's frame, and fit it nowhere well: at the best place {}",
                in_words(best)
            )),
            Refusal::Several(places) => {
                let told: Vec<String> = places.iter().map(|p| self.flag(p, both)).collect();
                Error::bad_input(format!(
                    "the new scans are not in the plant's frame, and fit at {} places that differ by no more than what may have been moved: {}",
                    places.len(),
                    told.join(", ")
                ))
            }
        };
        let way_out = match refusal {
            Refusal::Several(_) => {
                "choose one of these by its flag, or give scans that are registered to the plant"
            }
            Refusal::Nothing(_) => way_out,
        };
        error.at(self.input()).hint(way_out)
    }

    fn contradicted(&self, place: &FramePlace) -> Error {
        let what = format!("the frame that --frame states is contradicted: {}", in_words(place));
        Error::bad_input(what).at(self.input()).hint(
            "give the place of the first new scanner in the plant to 0.3 m and 2°, or leave --frame out",
        )
    }

    /// The `--frame` flag that states this pose.
    fn flag(&self, place: &FramePlace, both: BothSessions<'_>) -> String {
        let BothSessions { old, new } = both;
        let pose = world(&place.laid.old_from_new, old, new);
        let at = pose * Point::from(self.first());
        let yaw = pose.rotation.euler_angles().2.to_degrees();
        let [x, y, z, yaw] = [at.x, at.y, at.z, yaw].map(|v| words::fixed(v, 2));
        format!("--frame {x},{y},{z},{yaw}")
    }
}

/// Whether beams passed through more surface than agrees.
fn is_contradicted(place: &FramePlace) -> bool {
    place.evidence.n_against() > place.evidence.n_same()
}

/// The evidence for and against a pose, as text.
fn in_words(place: &FramePlace) -> String {
    let e = &place.evidence;
    format!(
        "{:.1} m² of upright surfaces agree, and beams went through {:.1} m² of them",
        0.04 * e.n_same() as f64,
        0.04 * e.n_against() as f64
    )
}

/// Converts poses between world frames to poses between the origins of sessions, and back.
fn local(plant_from_new: &Pose, old: &SessionSurfaces, new: &SessionSurfaces) -> Pose {
    Translation3::from(-old.surfels.origin)
        * plant_from_new
        * Translation3::from(new.surfels.origin)
}

fn world(old_from_new: &Pose, old: &SessionSurfaces, new: &SessionSurfaces) -> Pose {
    Translation3::from(old.surfels.origin) * old_from_new * Translation3::from(-new.surfels.origin)
}

fn carried(place: &FramePlace, by: &str, both: BothSessions<'_>) -> CarriedSession {
    let BothSessions { old, new } = both;
    let pose = world(&place.laid.old_from_new, old, new);
    let e = &place.evidence;
    let entry = CarriedEntry {
        by: by.into(),
        xyz: pose.translation.vector.into(),
        quat_xyzw: pose.rotation.coords.into(),
        about: (place.laid.about + old.surfels.origin).into(),
        sigma: place.laid.sigma,
        rms: place.laid.rms,
        n_on_old: e.n_on_old,
        n_where_old_saw_through: e.n_where_old_saw_through,
        n_on_new: e.n_on_new,
        n_where_new_saw_through: e.n_where_new_saw_through,
        margin: place.margin,
    };
    CarriedSession { plant_from_new: Some(pose), entry: Some(entry), warnings: Vec::new() }
}

/// Reads the surfaces of a session.
struct SessionReader<'a> {
    store: &'a Store,
    origin: Vector,
    /// Superseded points, which are left out.
    superseded: Option<&'a EarlierPoints<'a>>,
    /// Bounds outside of which surfaces are left out, world frame, metres.
    bounds: Option<&'a Aabb>,
}

impl SessionReader<'_> {
    fn session(
        &self,
        scans: &[Scan],
        tiles: Vec<usize>,
        robots: &[Aabb],
        n_asked: usize,
        engine: &Engine,
    ) -> Result<SessionSurfaces> {
        let entries = self.store.entries();
        // For each scan, its tiles in the bounds and their number of points.
        let mut own: Vec<(&Scan, Vec<usize>, u64)> =
            scans.iter().map(|scan| (scan, Vec::new(), 0)).collect();
        let first = scans.first().map_or(0, |scan| scan.id.0);
        for i in tiles {
            let (_, list, n) = &mut own[(entries[i].at.scan.0 - first) as usize];
            list.push(i);
            *n += entries[i].n_points;
        }
        own.retain(|(_, list, _)| !list.is_empty());
        let mut order: Vec<usize> = (0..own.len()).collect();
        order.sort_by_key(|&k| (std::cmp::Reverse(own[k].2), k));
        let asked = &order[..order.len().min(n_asked)];
        let step = STEP * (own.len() as f64 / MANY_SCANS).sqrt().max(1.0);
        let mut all = Gathered::about(self.origin);
        let mut eyes = Vec::new();
        // Few scans are read at a time, since the surfaces of each are kept until they are merged.
        let work: Vec<_> = own.iter().enumerate().collect();
        for some in work.chunks(2 * engine.n_workers) {
            let read =
                engine.fan_out(Task::new("frame"), some.to_vec(), |(k, (scan, list, n))| {
                    self.scan(scan, list, *n, asked.contains(&k), step)
                })?;
            for (gathered, eye) in read {
                all.join(gathered);
                eyes.extend(eye);
            }
        }
        Ok(SessionSurfaces { surfels: all.surfels(robots), eyes })
    }

    /// Surfaces of one scan, and on request the ranges of its beams.
    fn scan(
        &self,
        scan: &Scan,
        tiles: &[usize],
        n: u64,
        is_asked: bool,
        step: f64,
    ) -> Result<(Gathered, Option<Panorama>)> {
        let (skip, take) = match &scan.lattice {
            Some(lattice) => {
                let of = (step / lattice.row_step.max(lattice.col_step)).max(1.0);
                ((of.log2() as u32).min(contract::MAX_SKIP), 1)
            }
            None => (0, (n / N_LOOSE).max(1) as usize),
        };
        let scanner = scan.lattice.map(|_| scan.world_from_scan.translation.vector);
        let mut eye = (is_asked && scan.lattice.is_some())
            .then(|| Panorama::new(&scan.world_from_scan, &self.origin));
        let mut out = Gathered::about(self.origin);
        let in_world = World::from(scan);
        let entries = self.store.entries();
        let is_own = |i: &usize| entries[*i].at.scan == scan.id;
        let every: Vec<usize> = if eye.is_some() {
            (0..entries.len()).filter(is_own).collect()
        } else {
            tiles.to_vec()
        };
        for i in every {
            let is_here = tiles.binary_search(&i).is_ok();
            let tile = self.store.tile(i, skip)?;
            for (xyz, place) in tile.xyz.iter().zip(&tile.place).step_by(take) {
                let place = tile.first_place + u64::from(*place);
                if self.superseded.is_some_and(|past| past.was_superseded(scan.mask, place)) {
                    continue;
                }
                eye.iter_mut().for_each(|eye| eye.add(*xyz));
                let world = in_world.of(*xyz);
                if is_here && self.bounds.is_none_or(|bounds| bounds.contains(world)) {
                    out.add(world, scanner.as_ref());
                }
            }
        }
        Ok((out, eye.map(Panorama::finish)))
    }
}
