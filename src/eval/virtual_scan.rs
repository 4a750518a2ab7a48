//! Runs the virtual scanner: writes scans, scanner poses and truth of a scene as files.
//!
//! ```text
//! OUT/scans.e57            all scans with poses, rows and columns; beams without return are flagged as invalid
//! OUT/scans.las            the same points in the world, scan n has point_source_id n + 1
//! OUT/scanners.toml        for --scanners: the stated poses, by point_source_id
//! OUT/truth/truth.json     what really stands there, and where the scanners really stood
//! OUT/truth/labels/N.*     labels of scan N, in the order of the E57 file, and the things they are of
//! OUT/truth/las/labels/0.* labels of the LAS file
//! ```

use crate::engine::{Amount, Engine, Task};
use crate::job::MAX_TEXT;
use contract::{Error, Label, Map, MaskId, Result, Weigh};
use export::atomic;
use export::{
    E57Scans, GridPoint, GridScan, LabelColumns, LasSettings, LasWriter, MaskWriter, NpyWriter,
    PointColumns, Quantum,
};
use geometry::{Aabb, Pose};
use robot::Model;
use simulate::{ScanFrame, Scene, SimColumns, Simulator, Truth};
use std::ops::Range;
use std::path::Path;

/// Columns that a worker casts at a time: enough that the one more on either side costs little.
const COLUMNS: u32 = 32;

/// Which files of points are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Formats {
    /// `scans.e57`.
    pub e57: bool,
    /// `scans.las`.
    pub las: bool,
    /// Its points in 20 bytes instead of 30: LAS format 0.
    pub short: bool,
    /// `truth/labels` and `truth/las/labels`.
    pub labels: bool,
}

impl Formats {
    /// All.
    pub const ALL: Self = Self { e57: true, las: true, short: false, labels: true };
}

/// Scans a scene into `out`; returns the truth with its counts.
pub fn scan_scene(
    scene: &Scene,
    models: &[Model],
    out: &Path,
    formats: Formats,
    engine: &Engine,
) -> Result<Truth> {
    let simulator = Simulator::new(scene, models)?;
    let mut truth = simulator.truth();
    let folder =
        |path: &Path| std::fs::create_dir_all(path).map_err(|e| Error::from(e).at(path.display()));
    let truth_dir = out.join("truth");
    folder(&truth_dir.join("labels"))?;
    folder(&truth_dir.join("las/labels"))?;
    let mut files = Files::create(&simulator, out, formats)?;
    for (i, scan) in truth.scans.iter_mut().enumerate() {
        scan.n_points = files.scan(&simulator, i, &truth_dir, engine)?;
    }
    files.finish()?;
    atomic::write(&out.join("scanners.toml"), scanners(&simulator).as_bytes())?;
    atomic::write(&truth_dir.join("truth.json"), truth.to_json()?.as_bytes())?;
    Ok(truth)
}

/// The open files of all scans.
struct Files {
    e57: Option<E57Scans>,
    las: Option<LasWriter>,
    las_mask: Option<MaskWriter>,
    labels: bool,
}

impl Files {
    fn create(simulator: &Simulator, out: &Path, formats: Formats) -> Result<Self> {
        let e57 = formats.e57.then(|| E57Scans::create(out.join("scans.e57"))).transpose()?;
        let las = formats.las.then(|| {
            let frames = (0..simulator.n_scans()).map(|i| simulator.frame(i));
            let near = Aabb::of(frames.map(|f| f.world_from_scan.translation.vector.into()));
            let mut settings = LasSettings::new(Quantum::around(&near));
            settings.with_labels = false;
            settings.short = formats.short;
            LasWriter::create(out.join("scans.las"), settings)
        });
        let labels = formats.labels;
        let mask = || MaskWriter::create(&out.join("truth/las"), MaskId(0));
        let las_mask = (formats.las && labels).then(mask).transpose()?;
        Ok(Self { e57, las: las.transpose()?, las_mask, labels })
    }

    /// Casts and writes one scan; returns its number of points.
    fn scan(
        &mut self,
        simulator: &Simulator,
        i: usize,
        truth: &Path,
        engine: &Engine,
    ) -> Result<u64> {
        let frame = simulator.frame(i);
        let cast = Cast { simulator, scanner: i };
        let n_rows = frame.n_rows;
        let source = (0..frame.n_cols)
            .step_by(COLUMNS as usize)
            .map(|from| Ok(Columns { range: from..(from + COLUMNS).min(frame.n_cols), n_rows }));
        let n_beams = u64::from(frame.n_rows) * u64::from(frame.n_cols);
        let task = Task::new(format!("scan {}", frame.name)).of(Amount::points(n_beams));
        let mut known = self.labels.then(|| ScanTruth::create(truth, i)).transpose()?;
        let mut n_points = 0;
        let source_id = u16::try_from(i + 1).map_err(|_| {
            Error::bad_input(format!("LAS knows 65535 scanners at most, this is \"{}\"", i + 1))
        })?;
        engine.pass(task, source, |flow| {
            let mut seen = flow.map(&cast).items().map(|seen| {
                let seen = seen?.0;
                n_points += seen.n_points() as u64;
                if let Some(known) = &mut known {
                    let labels = known.add(&seen)?;
                    self.las_mask.iter_mut().try_for_each(|mask| mask.push(&labels))?;
                }
                if let Some(las) = &mut self.las {
                    write_las(las, &seen, &frame.world_from_scan, source_id)?;
                }
                Ok(seen)
            });
            match &mut self.e57 {
                Some(e57) => e57.add(&grid(frame), Points::new(seen)).map(drop),
                None => seen.try_for_each(|s| s.map(drop)),
            }
        })?;
        known.map_or(Ok(()), ScanTruth::finish)?;
        Ok(n_points)
    }

    fn finish(self) -> Result<()> {
        if let Some(e57) = self.e57 {
            e57.finish()?;
        }
        if let Some(las) = self.las {
            las.finish()?;
        }
        self.las_mask.map_or(Ok(()), |mask| mask.finish().map(drop))
    }
}

/// Truth of the points of one scan.
struct ScanTruth {
    mask: MaskWriter,
    objects: NpyWriter<u16>,
}

impl ScanTruth {
    fn create(truth: &Path, i: usize) -> Result<Self> {
        let objects = NpyWriter::create(truth.join(format!("labels/{i}.object.npy")))?;
        Ok(Self { mask: MaskWriter::create(truth, MaskId(i as u32))?, objects })
    }

    /// Writes the labels of the beams that came back.
    fn add(&mut self, seen: &SimColumns) -> Result<LabelColumns> {
        let hits = || (0..seen.len()).filter(|&k| seen.hit[k]);
        let labels: Vec<Label> = hits().map(|k| seen.label[k]).collect();
        let labels = LabelColumns::of(&labels);
        self.mask.push(&labels)?;
        self.objects.push(&hits().map(|k| seen.object[k]).collect::<Vec<_>>())?;
        Ok(labels)
    }

    fn finish(self) -> Result<()> {
        self.objects.finish()?;
        self.mask.finish().map(drop)
    }
}

fn grid(frame: &ScanFrame) -> GridScan {
    GridScan {
        name: frame.name.clone(),
        world_from_scan: frame.world_from_scan,
        n_rows: frame.n_rows,
        n_cols: frame.n_cols,
    }
}

fn intensity(share: f32) -> u16 {
    (share.clamp(0.0, 1.0) * f32::from(u16::MAX)).round() as u16
}

fn write_las(
    las: &mut LasWriter,
    seen: &SimColumns,
    world_from_scan: &Pose,
    id: u16,
) -> Result<()> {
    let hits: Vec<usize> = (0..seen.len()).filter(|&k| seen.hit[k]).collect();
    let world = |k: &usize| (world_from_scan * nalgebra::Point3::from(seen.xyz[*k])).into();
    let world: Vec<[f64; 3]> = hits.iter().map(world).collect();
    let intensity: Vec<u16> = hits.iter().map(|&k| intensity(seen.intensity[k])).collect();
    // Scans hold no labels: what a point belongs to is the truth, which stands beside them.
    let labels = vec![Label::FIXED; hits.len()];
    las.push(&PointColumns {
        world: &world,
        labels: &labels,
        intensity: &intensity,
        scan: id,
        ..PointColumns::default()
    })
}

/// Columns of beams before they are cast.
struct Columns {
    range: Range<u32>,
    n_rows: u32,
}

impl Weigh for Columns {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
    }

    fn n_points(&self) -> u64 {
        u64::from(self.n_rows) * u64::from(self.range.end - self.range.start)
    }
}

/// Columns of beams after they are cast.
struct SimulatedColumns(SimColumns);

impl Weigh for SimulatedColumns {
    fn weight_bytes(&self) -> usize {
        self.0.len() * (size_of::<f64>() * 4 + size_of::<f32>() + size_of::<Label>() + 2)
    }

    fn n_points(&self) -> u64 {
        self.0.n_points() as u64
    }
}

struct Cast<'a> {
    simulator: &'a Simulator,
    scanner: usize,
}

impl Map for Cast<'_> {
    type In = Columns;
    type Out = SimulatedColumns;
    type Scratch = ();

    fn apply(&self, columns: Columns, (): &mut ()) -> Result<SimulatedColumns> {
        Ok(SimulatedColumns(self.simulator.columns(self.scanner, columns.range)))
    }
}

/// Beam after beam of columns after columns.
struct Points<I> {
    columns: I,
    seen: SimColumns,
    at: usize,
}

impl<I> Points<I> {
    fn new(columns: I) -> Self {
        Self { columns, seen: SimColumns::default(), at: 0 }
    }
}

impl<I: Iterator<Item = Result<SimColumns>>> Iterator for Points<I> {
    type Item = Result<GridPoint>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.at == self.seen.len() {
            match self.columns.next()? {
                Ok(seen) => (self.seen, self.at) = (seen, 0),
                Err(error) => return Some(Err(error)),
            }
        }
        let k = self.at;
        self.at += 1;
        let (row, col) = self.seen.pixel(k);
        let xyz = self.seen.hit[k].then(|| self.seen.xyz[k].map(|v| v as f32));
        Some(Ok(GridPoint { xyz, row, col, intensity: intensity(self.seen.intensity[k]) }))
    }
}

/// The stated poses, as `--scanners` takes them.
fn scanners(simulator: &Simulator) -> String {
    let entry = |i: usize| {
        let frame = simulator.frame(i);
        let pose = &frame.world_from_scan;
        let (p, q) = (pose.translation.vector, pose.rotation);
        format!(
            "[[scanner]]\npoint_source_id = {}\nname = {}\nposition = {:?}\nquaternion_wxyz = {:?}\n\n",
            i + 1,
            toml::Value::String(frame.name.clone()),
            [p.x, p.y, p.z],
            [q.w, q.i, q.j, q.k],
        )
    };
    (0..simulator.n_scans()).map(entry).collect()
}

/// Reads a scene file of at most `most` bytes.
///
/// # Errors
/// A file that cannot be read, is longer, or is no scene; with its path.
pub fn read_scene(path: &Path, most: u64) -> Result<Scene> {
    let text = ingest::read_text(path, most, MAX_TEXT)?;
    Scene::from_toml(&text).map_err(|e| e.at(path.display()))
}
