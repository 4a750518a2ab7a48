//! Compares a result with the truth of its scene, robot by robot and point by point.

use super::confusion::Confusion;
use contract::words::{Unit, count};
use contract::{Certainty, Error, Kind, Label, PointKind, Result};
use export::{ResultFile, RobotEntry};
use geometry::angle;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use simulate::{TrueRobot, Truth};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Distance of bases beyond which a found robot is not the true one, metres.
const SAME_PLACE: f64 = 0.5;
/// Greatest error of a determined joint for a posture to count as found, radians (1°) or metres.
const SAME_POSTURE: f64 = 0.0175;

/// Agreement of a result with the truth.
#[derive(Debug, Clone)]
pub struct Agreement {
    /// One for each true robot, in the order of the truth.
    pub robots: Vec<RobotAgreement>,
    /// Found robots that correspond to no true one.
    pub n_invented: usize,
    /// Counts of points by true and assigned label.
    pub points: Confusion,
    /// For each object of the scene, the number of its points, of those labelled as moving, and of
    /// those labelled as uncertain; empty where the truth names no objects.
    pub by_object: Vec<[u64; 3]>,
    /// Names of the objects.
    pub objects: Vec<String>,
}

/// Comparison of one true robot.
#[derive(Debug, Clone)]
pub struct RobotAgreement {
    /// Name in the scene.
    pub name: String,
    /// True model.
    pub model: String,
    /// Number of postures in which it was scanned.
    pub n_postures: usize,
    /// The robot that was found at its place.
    pub found: Option<FoundRobot>,
}

/// A robot that was found at a true robot's place.
#[derive(Debug, Clone)]
pub struct FoundRobot {
    /// Its model, right or wrong.
    pub model: String,
    /// Whether the true model is among the models that it may be.
    pub is_right: bool,
    /// Its verdict.
    pub verdict: String,
    /// Number of true postures that were found.
    pub n_postures: usize,
    /// Error of the base: metres, radians.
    pub base: [f64; 2],
    /// Errors of the joints that both name.
    pub joints: Vec<JointError>,
}

/// Error of a joint.
#[derive(Debug, Clone)]
pub struct JointError {
    /// Its name.
    pub name: String,
    /// Found minus true value, radians or metres; turns of 360° taken out.
    pub error: f64,
    /// Stated standard deviation, same unit.
    pub sigma: f64,
    /// Certainty that the result states.
    pub certainty: Certainty,
    /// Whether it slides: its values are metres.
    pub slides: bool,
}

impl JointError {
    /// Whether the result states that it is determined.
    fn is_determined(&self) -> bool {
        self.certainty == Certainty::Determined
    }
}

impl FoundRobot {
    /// Largest error of a joint that turns and is said to be determined, degrees; of all that turn
    /// where none is.
    #[must_use]
    pub fn worst_joint_deg(&self) -> f64 {
        let joints = judged(&self.joints).filter(|j| !j.slides);
        joints.map(|j| j.error.abs().to_degrees()).fold(0.0, f64::max)
    }
}

impl Agreement {
    /// Compares `OUT/result.json` and its masks with the truth beside the scans; the result must be
    /// of `scans.e57`.
    pub fn of(out: &Path, truth_dir: &Path) -> Result<Self> {
        Self::of_session(out, truth_dir, 0)
    }

    /// Like the comparison above, for a rescan's result, by the masks of its own scans from the
    /// mask `first` on. Their uncertain points lie outside of the cell and are ignored.
    pub fn of_session(out: &Path, truth_dir: &Path, first: usize) -> Result<Self> {
        let truth = Truth::from_json(&read_text(&truth_dir.join("truth.json"))?)?;
        let result: ResultFile = serde_json::from_str(&read_text(&out.join("result.json"))?)
            .map_err(|e| Error::bad_input("the result is no result").because(e))?;
        let mut taken = vec![None; result.robots.len()];
        let robots = truth
            .robots
            .iter()
            .enumerate()
            .map(|(t, robot)| match_robot(t, robot, &result.robots, &mut taken));
        let robots: Vec<RobotAgreement> = robots.collect();
        let stands = result.robots.iter().map(|r| r.verdict != "refused");
        let n_invented =
            taken.iter().zip(stands).filter(|(t, stands)| t.is_none() && *stands).count();
        let mut agreement = Self {
            robots,
            n_invented,
            points: Confusion::new(truth.robots.iter().map(|r| r.links.len())),
            by_object: vec![[0; 3]; truth.objects.len()],
            objects: truth.objects.clone(),
        };
        for (i, scan) in result.labels.scans[first..].iter().enumerate() {
            let mut ours = Triple::read(out, [&scan.kind, &scan.robot, &scan.link])?;
            let name = |what: &str| format!("labels/{i}.{what}.npy");
            let mut theirs =
                Triple::read(truth_dir, [&name("kind"), &name("robot"), &name("link")])?;
            if first > 0 {
                let inside: Vec<bool> =
                    ours.kind.iter().map(|k| *k != PointKind::Uncertain as u8).collect();
                ours.keep(&inside);
                theirs.keep(&inside);
            }
            agreement.count(&ours, &theirs, &taken)?;
            if first > 0 {
                continue;
            }
            if !truth.objects.is_empty() {
                agreement.count_objects(&ours, &npy(&truth_dir.join(name("object")))?);
            }
        }
        Ok(agreement)
    }

    fn count(&mut self, ours: &Triple, theirs: &Triple, taken: &[Option<usize>]) -> Result<()> {
        if ours.kind.len() != theirs.kind.len() {
            let what =
                format!("masks have {} entries, the truth {}", ours.kind.len(), theirs.kind.len());
            return Err(Error::new(Kind::Bug, what));
        }
        let whose = |robot: usize| taken.get(robot).copied().flatten();
        for i in 0..ours.kind.len() {
            self.points.add(ours.label(i), theirs.label(i), whose);
        }
        Ok(())
    }

    /// Points of each thing, those that are said to move, and those that are left open.
    fn count_objects(&mut self, ours: &Triple, objects: &[u8]) {
        for (i, object) in objects.as_chunks::<2>().0.iter().enumerate().take(ours.kind.len()) {
            let at = usize::from(u16::from_le_bytes(*object));
            if let Some(count) = self.by_object.get_mut(at) {
                count[0] += 1;
                let said = ours.label(i);
                count[1] += u64::from(said.moves());
                count[2] += u64::from(said.kind == PointKind::Uncertain);
            }
        }
    }

    /// Intersection over union of each true link of a found robot with at least so many points.
    #[must_use]
    pub fn link_ious(&self, least: u64) -> Vec<f64> {
        let found = (0..self.robots.len()).filter(|&r| self.robots[r].found.is_some());
        found.flat_map(|r| self.points.link_ious(r, least)).collect()
    }

    /// Largest error of a joint that turns and is said to be determined, over all robots, degrees.
    #[must_use]
    pub fn worst_joint_deg(&self) -> f64 {
        let found = self.robots.iter().filter_map(|r| r.found.as_ref());
        found.map(FoundRobot::worst_joint_deg).fold(0.0, f64::max)
    }

    /// A table for people.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = String::new();
        for robot in &self.robots {
            let Some(found) = &robot.found else {
                let _ = writeln!(text, "{:<12} {:<26} NOT FOUND", robot.name, robot.model);
                continue;
            };
            let right = if found.model == robot.model { "right model" } else { "WRONG MODEL" };
            let _ = writeln!(
                text,
                "{:<12} {:<26} {right}, {}, base off by {:.2} mm and {:.3}°",
                robot.name,
                found.model,
                found.verdict,
                found.base[0] * 1e3,
                found.base[1].to_degrees()
            );
            for JointError { name, error, sigma, certainty, slides } in &found.joints {
                let (unit, note) = (Unit::of(*slides), certainty.note());
                let _ = writeln!(
                    text,
                    "             {name:<26} error {:>9}  stated ± {}{note}",
                    unit.say(*error, 4),
                    unit.deviation(*sigma)
                );
            }
        }
        text.push_str(&self.points.words());
        if self.n_invented > 0 {
            let n = count(self.n_invented as u64, "robot");
            let _ = writeln!(text, "{n} INVENTED");
        }
        text
    }
}

/// The found robot nearest to a true one; notes at `taken` whose it is.
fn match_robot(
    at: usize,
    truth: &TrueRobot,
    found: &[RobotEntry],
    taken: &mut [Option<usize>],
) -> RobotAgreement {
    let place = Vector3::from(truth.base_pose.xyz);
    let near = found
        .iter()
        .enumerate()
        .filter(|(i, _)| taken[*i].is_none())
        .map(|(i, r)| (i, (Vector3::from(r.base_pose.xyz) - place).norm()))
        .filter(|(_, d)| *d < SAME_PLACE)
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let found = near.map(|(i, distance)| {
        taken[i] = Some(at);
        let robot = &found[i];
        let turn =
            rotation(truth.base_pose.quat_wxyz).angle_to(&rotation(robot.base_pose.quat_wxyz));
        // Where it moved between scans: the true posture that the found one is nearest to.
        let all = || std::iter::once(&truth.joints).chain(truth.later.iter().map(|l| &l.joints));
        let joints = all().map(|posture| off(robot, posture));
        let joints = joints.min_by(|a, b| worst(a).total_cmp(&worst(b))).unwrap_or_default();
        let stands = |posture: &&BTreeMap<String, f64>| {
            let found = std::iter::once(robot).chain(&robot.stays);
            found.map(|f| worst(&off(f, posture))).any(|worst| worst < SAME_POSTURE)
        };
        FoundRobot {
            model: robot.model.clone(),
            is_right: robot.model == truth.model || robot.alike.contains(&truth.model),
            verdict: robot.verdict.clone(),
            n_postures: all().filter(stands).count(),
            base: [distance, turn],
            joints,
        }
    });
    RobotAgreement {
        name: truth.name.clone(),
        model: truth.model.clone(),
        n_postures: 1 + truth.later.len(),
        found,
    }
}

/// The joints against a true posture.
fn off(robot: &RobotEntry, truth: &BTreeMap<String, f64>) -> Vec<JointError> {
    let joints = robot.posture().filter_map(|joint| {
        let (name, value, truth) = (joint.name, joint.value, truth.get(joint.name)?);
        let slides = joint.unit == Unit::MILLIMETRES;
        let error = if slides { value - truth } else { angle::from_to(*truth, value) };
        let (sigma, certainty) = (joint.sigma, joint.certainty);
        Some(JointError { name: name.into(), error, sigma, certainty, slides })
    });
    joints.collect()
}

/// Largest error of a joint that is said to be determined, radians or metres; of all where none is.
fn worst(joints: &[JointError]) -> f64 {
    judged(joints).map(|j| j.error.abs()).fold(0.0, f64::max)
}

/// The joints that are said to be determined; where none is, all of them.
fn judged(joints: &[JointError]) -> impl Iterator<Item = &JointError> {
    let is_none = joints.iter().all(|j| !j.is_determined());
    joints.iter().filter(move |j| is_none || j.is_determined())
}

fn rotation(wxyz: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3]))
}

/// Labels of one mask.
struct Triple {
    kind: Vec<u8>,
    robot: Vec<i16>,
    link: Vec<i16>,
}

impl Triple {
    fn read(dir: &Path, names: [&str; 3]) -> Result<Self> {
        let wide = |bytes: Vec<u8>| {
            bytes.as_chunks::<2>().0.iter().map(|c| i16::from_le_bytes(*c)).collect()
        };
        Ok(Self {
            kind: npy(&dir.join(names[0]))?,
            robot: wide(npy(&dir.join(names[1]))?),
            link: wide(npy(&dir.join(names[2]))?),
        })
    }
}

impl Triple {
    fn label(&self, i: usize) -> Label {
        let kind = PointKind::of(self.kind[i]).unwrap_or(PointKind::Uncertain);
        Label { kind, robot: self.robot[i], link: self.link[i] }
    }

    /// Keeps the entries that are marked.
    fn keep(&mut self, marked: &[bool]) {
        fn few<T: Copy>(all: &mut Vec<T>, marked: &[bool]) {
            let kept = all.iter().zip(marked).filter(|(_, keep)| **keep).map(|(v, _)| *v);
            *all = kept.collect();
        }
        few(&mut self.kind, marked);
        few(&mut self.robot, marked);
        few(&mut self.link, marked);
    }
}

/// The data of a one-dimensional `.npy` file of this program, after its header.
fn npy(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = std::fs::read(path).map_err(|e| Error::from(e).at(path.display()))?;
    if bytes.len() < 10 || &bytes[..6] != b"\x93NUMPY" {
        return Err(Error::bad_input("this is no NumPy array").at(path.display()));
    }
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes.drain(..header.min(bytes.len()));
    Ok(bytes)
}

fn read_text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|e| Error::from(e).at(path.display()))
}
