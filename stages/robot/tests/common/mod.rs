//! What the tests share: the folder of real robots, and models written for one test.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used, clippy::print_stderr)]

pub mod sheets;

use geometry::{Point, Vector};
use robot::{Finding, Model, Settings, Severity};
use std::fs;
use std::path::{Path, PathBuf};

/// The shared files, if this machine has them.
pub fn shared(part: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared").join(part);
    if path.exists() {
        Some(path)
    } else {
        eprintln!("skipped: no {}", path.display());
        None
    }
}

/// A model's folder for one test.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A copy of a shared robot.
    pub fn of(name: &str) -> Option<Self> {
        let folder = Self::new();
        copy(&shared("robots")?.join(name), &folder.path());
        Some(folder)
    }

    pub fn with(self, file: &str, bytes: impl AsRef<[u8]>) -> Self {
        let path = self.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
        self
    }

    pub fn path(&self) -> PathBuf {
        self.0.path().join("library/model")
    }

    pub fn library(&self) -> PathBuf {
        self.0.path().join("library")
    }

    pub fn load(&self) -> (Model, Vec<Finding>) {
        Model::load(&self.path(), &Settings::without_clouds()).unwrap()
    }

    /// Error and warning findings, as text.
    pub fn lint(&self) -> Vec<String> {
        (robot::Library::lint(&self.library(), &robot::Settings::default()).iter())
            .filter(|f| f.severity >= Severity::Warning)
            .map(|f| format!("{:?} {}: {} ({})", f.severity, f.place, f.what, f.way_out))
            .collect()
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::write(target, fs::read(entry.path()).unwrap()).unwrap();
        }
    }
}

/// A small generator of random postures.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn posture(&mut self, model: &Model) -> Vec<f64> {
        (0..model.free.len())
            .map(|free| {
                let [lower, upper] = model.limits(free);
                lower + (upper - lower) * self.unit()
            })
            .collect()
    }
}

/// A link with a box, and a joint's text.
pub fn link(name: &str) -> String {
    format!(
        "<link name='{name}'><visual><geometry><box size='0.1 0.1 0.1'/></geometry></visual></link>"
    )
}

pub fn joint(name: &str, kind: &str, parent: &str, child: &str, xyz: &str, rest: &str) -> String {
    format!(
        "<joint name='{name}' type='{kind}'><origin xyz='{xyz}'/><parent link='{parent}'/><child link='{child}'/>\
         <axis xyz='0 1 0'/>{rest}</joint>"
    )
}

pub const LIMIT: &str = "<limit lower='-1' upper='1'/>";

/// A serial arm: links l0..ln in steps of one metre along z.
pub fn arm(n: usize) -> String {
    let mut text = link("l0");
    for k in 1..=n {
        text += &link(&format!("l{k}"));
        text += &joint(
            &format!("j{k}"),
            "revolute",
            &format!("l{}", k - 1),
            &format!("l{k}"),
            "0 0 1",
            LIMIT,
        );
    }
    text
}

pub fn robot(inner: &str) -> String {
    format!("<?xml version='1.0'?><robot name='r'>{inner}</robot>")
}

/// Index of a free joint in a posture.
pub fn free(model: &Model, joint: &str) -> usize {
    model.free.iter().position(|&j| model.joints[j].name == joint).unwrap()
}

/// Compares twists with central differences of poses at random postures.
pub fn check_twists(model: &Model, seed: u64) {
    let mut dice = Dice::new(seed);
    let step = 1e-6;
    for _ in 0..4 {
        let posture = dice.posture(model);
        let at = model.kinematics(&posture);
        assert_eq!(at.base_from_link, model.poses(&posture));
        for k in 0..posture.len() {
            let moved = |by: f64| {
                let mut posture = posture.clone();
                posture[k] += by;
                model.poses(&posture)
            };
            let (before, after) = (moved(-step), moved(step));
            for (l, link) in model.links.iter().enumerate() {
                let [a, b, c, d, e, f] = at.twists[l][k];
                let (v, w) = (Vector::new(a, b, c), Vector::new(d, e, f));
                for p in [Point::origin(), Point::new(0.3, -0.2, 0.5)] {
                    let expected = (after[l] * p - before[l] * p) / (2.0 * step);
                    let got = v + w.cross(&(at.base_from_link[l] * p).coords);
                    let error = (expected - got).norm();
                    assert!(
                        error < 1e-6,
                        "{} {} free {k}: {expected} {got}",
                        model.name,
                        link.name
                    );
                }
            }
        }
    }
}

/// A robot of one mesh, and that mesh.
pub fn meshed(path: &str, bytes: &[u8]) -> Folder {
    Folder::new().with("robot.urdf", robot(&body(path))).with(path, bytes)
}

/// The links and the joint of a robot of one mesh.
pub fn body(path: &str) -> String {
    link("a")
        + &format!(
            "<link name='b'><visual><geometry><mesh filename='{path}'/></geometry></visual></link>"
        )
        + &joint("j", "revolute", "a", "b", "0 0 1", LIMIT)
}

/// Asserts that linting reports a finding with these words.
pub fn says(folder: &Folder, words: &str) {
    let found = folder.lint();
    assert!(found.iter().any(|f| f.contains(words)), "expected \"{words}\" in {found:#?}");
}
