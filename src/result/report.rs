//! Writes `result.json`, the legend of the masks, and the summary for people.

use super::advice::SearchInputs;
use crate::cache::{Digests, OutputDir};
use crate::detect::robot_id::robot_id;
use crate::detect::robots::FittedRobots;
use crate::detect::robots::poses;
use crate::job::{Outcome, units};
use crate::label::labelling::WrittenLabels;
use crate::label::masks::MaskCount;
use crate::store::Store;
use contract::words::{Unit, count, fixed, triple};
use contract::{Fit, Format, Input, JointFit, Mask, Result, Scan, Verdict, quote};
use export::{
    InputEntry, LabelFiles, NamedMap, ResultFile, ReviewEntry, RobotEntry, SCHEMA, ScanEntry,
    ScanLabels, SpaceEntry, StageEntry, write_table,
};
use geometry::Aabb;
use ingest::{MISPLACED, Sources};
use robot::{JointKind, Library, Model, Motion};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// Everything that `result.json` and the summary are made of.
pub(crate) struct Report<'a> {
    pub(crate) digests: &'a Digests,
    pub(crate) sources: &'a Sources,
    pub(crate) store: &'a Store,
    pub(crate) library: &'a Library,
    pub(crate) robots: FittedRobots<'a>,
    /// Number of clusters, and of regions that were searched for robots.
    pub(crate) n_searched: [usize; 2],
    pub(crate) written: &'a WrittenLabels,
    /// Effect of each entry of the review.
    pub(crate) review: Vec<ReviewEntry>,
    /// Messages about inputs and regions that failed and were left out.
    pub(crate) left_out: Vec<String>,
}

impl Report<'_> {
    /// Writes the legend and the result, as the last of all files.
    pub(crate) fn finish(&self, output: &OutputDir) -> Result<Outcome> {
        let robots: Vec<RobotEntry> = self
            .robots
            .fits
            .iter()
            .enumerate()
            .map(|(i, fit)| {
                let space = self.written.spaces[i].clone();
                let scanners = self.scanners_near(fit);
                RobotEntry { scanners, ..robot_entry(i, fit, self.robots.models, space) }
            })
            .collect();
        write_table(output.next(), &robots)?;
        let warnings = self.warnings();
        let masks = self.sources.masks.iter().zip(&self.written.masks);
        let labels = LabelFiles {
            table: LabelFiles::TABLE.into(),
            scans: masks.map(|(mask, count)| ScanLabels::new(mask, count.n_points)).collect(),
        };
        let result = ResultFile {
            schema: SCHEMA.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            robots,
            labels,
            inputs: self.sources.inputs.iter().map(|input| self.input(input)).collect(),
            stages: self.stages(),
            warnings: warnings.clone(),
            review: self.review.clone(),
            rescan: None,
        };
        result.write(output.next())?;
        let partial = !self.left_out.is_empty() || self.models_left_out().next().is_some();
        Ok(Outcome { summary: self.summary(), warnings, partial, ..Outcome::default() })
    }

    /// Number of scans with points near a robot by how the positions of their scanners are known.
    fn scanners_near(&self, fit: &Fit) -> NamedMap<u32> {
        /// Distance from the links' frames within which points are near, metres.
        const NEAR: f64 = 0.5;
        let links = poses(fit, &self.robots.models[fit.model]);
        let bounds = Aabb::of(links.iter().map(|pose| pose.translation.vector.into())).grown(NEAR);
        let touching = self.store.touching(&bounds);
        let scans: BTreeSet<_> =
            touching.iter().map(|i| self.store.entries()[*i].at.scan).collect();
        let mut counts: BTreeMap<&str, u32> = BTreeMap::new();
        for scan in scans {
            *counts.entry(self.sources.scans[scan.0 as usize].scanner.word()).or_default() += 1;
        }
        NamedMap(counts.into_iter().map(|(word, n)| (word.into(), n)).collect())
    }

    /// Counts of each stage, without times, so that the same input gives the same bytes.
    fn stages(&self) -> Vec<StageEntry> {
        let n_points = self.written.masks.iter().map(|m| m.n_points).sum();
        let entry =
            |name: &str, n_in: u64, n_out: u64| StageEntry { name: name.into(), n_in, n_out };
        vec![
            entry("ingest", self.sources.inputs.len() as u64, n_points),
            entry("cluster", n_points, self.n_searched[0] as u64),
            entry("fit", self.n_searched[0] as u64, self.robots.fits.len() as u64),
            entry("label", n_points, self.written.masks.iter().map(|m| m.n_moving).sum()),
        ]
    }

    /// Scans with points: for a large LAZ file it is not known in advance whether it has points
    /// without a known scanner.
    fn scans(&self) -> impl Iterator<Item = &Scan> {
        let has_points = |scan: &&Scan| self.store.entries().iter().any(|e| e.at.scan == scan.id);
        self.sources.scans.iter().filter(has_points)
    }

    /// The entry of an input. A scan without points, such as the rest of a cloud whose points are
    /// all of known scanners, has nothing that could be missing.
    fn input(&self, input: &Input) -> InputEntry {
        let scans: Vec<&Scan> = self.scans().filter(|scan| scan.input == input.id).collect();
        InputEntry {
            n_scans: scans.len() as u32,
            notes: scans.iter().flat_map(|scan| &scan.notes).cloned().collect(),
            ..input_entry(self.sources, input, self.digests, &self.written.masks)
        }
    }

    /// Findings about models that could not be loaded.
    fn models_left_out(&self) -> impl Iterator<Item = &robot::Finding> {
        self.library.findings.iter().filter(|f| f.severity == robot::Severity::Error)
    }

    fn warnings(&self) -> Vec<String> {
        let mut out = self.sources.warnings.clone();
        out.extend(self.written.oddities.iter().cloned());
        out.extend(self.left_out.iter().cloned());
        let odd = self.review.iter().filter(|entry| entry.needs_look);
        out.extend(odd.map(ReviewEntry::words));
        out.extend(self.models_left_out().map(|finding| {
            let [model, place, what] =
                [&finding.model, &finding.place, &finding.what].map(|part| quote::shown(part));
            format!("robot model '{model}' is left out: {place}: {what}")
        }));
        out.extend(dropped(self.sources, &self.written.masks));
        for scan in self.scans().filter(|s| !s.has_beams()) {
            // A given position that is not used has a note with the reason.
            let why = scan.notes.iter().find(|note| note.contains(MISPLACED));
            let why = why.map_or("its scanner's position is not known", String::as_str);
            let name = quote::shown(&scan.name);
            out.push(format!("scan '{name}': {why}: no proof of free space from it"));
        }
        if self.robots.fits.is_empty() {
            let scans: Vec<&Scan> = self.scans().collect();
            let (tiles, models) = (self.store.entries(), &self.library.models[..]);
            out.extend(
                SearchInputs { scans: &scans, tiles, models, n_places: self.n_searched[1] }
                    .advice(),
            );
        }
        out
    }

    /// Appends value and standard deviation of each joint.
    fn say_posture(&self, text: &mut String, fit: &Fit) {
        let model = &self.robots.models[fit.model];
        for (joint, &index) in fit.joints.iter().zip(&model.free) {
            let slides = model.joints[index].kind == JointKind::Prismatic;
            let _ = writeln!(text, "     {}", joint_line(joint, slides));
        }
    }

    fn summary(&self) -> String {
        let mut text = String::new();
        let n_scans = count(self.scans().count() as u64, "scan");
        let _ = writeln!(text, "{} in {n_scans}", count(self.robots.fits.len() as u64, "robot"));
        for line in units::in_words(self.sources) {
            let _ = writeln!(text, "  unit {line}");
        }
        if self.robots.fits.is_empty() {
            let n_arms = self.library.models.iter().filter(|model| !model.is_tool()).count();
            let places = count(self.n_searched[1] as u64, "place");
            let models = count(n_arms as u64, "model");
            let _ = writeln!(
                text,
                "  {places} as large as a robot searched for {models}: none of them stands there"
            );
        }
        for (i, fit) in self.robots.fits.iter().enumerate() {
            let _ = writeln!(
                text,
                "  {} {} at {} m: {}, score {}, rms {:.1} mm",
                robot_id(i),
                quote::shown(&fit.model_name),
                triple(fit.world_from_base.translation.vector.into(), 3),
                fit.verdict.word(),
                fixed(fit.score, 2),
                fit.rms * 1e3
            );
            if let Some(tool) = &fit.tool {
                let turn = Unit::DEGREES.say(tool.mount, 0);
                let _ = writeln!(text, "     carries {} on '{}' at {turn}", tool.model, tool.link);
            }
            self.say_posture(&mut text, fit);
            let word = if fit.verdict == Verdict::Trusted { "note" } else { "why" };
            for reason in &fit.reasons {
                let _ = writeln!(text, "     {word}: {reason}");
            }
            for stay in &fit.stays {
                let _ = writeln!(
                    text,
                    "     in {}: {}, score {}",
                    count(stay.stands_in.len() as u64, "other scan"),
                    stay.verdict.word(),
                    fixed(stay.score, 2)
                );
                self.say_posture(&mut text, stay);
            }
        }
        for entry in &self.review {
            let _ = writeln!(text, "  {}", entry.words());
        }
        let n: u64 = self.written.masks.iter().map(|m| m.n_points).sum();
        let moving: u64 = self.written.masks.iter().map(|m| m.n_moving).sum();
        let _ = writeln!(text, "{} labelled, {moving} of them moving", count(n, "point"));
        let tiles = count(self.written.clouds.tiles.len() as u64, "spatial tile");
        let pictures = count(self.written.pictures.len() as u64, "picture");
        let _ = writeln!(text, "{tiles}, {pictures}");
        text
    }
}

/// A line of the summary for a joint: name, value, standard deviation, and a word where it is not
/// determined well.
fn joint_line(joint: &JointFit, slides: bool) -> String {
    let unit = Unit::of(slides);
    let (value, sigma) = (unit.say(joint.value, 3), unit.deviation(joint.sigma));
    format!("{:<24} {value:>11} ± {sigma}{}", quote::shown(&joint.name), joint.certainty.note())
}

/// The entry of a robot in the result; `models` are the models that fits refer to.
pub(crate) fn robot_entry(
    index: usize,
    fit: &Fit,
    models: &[Model],
    space: Option<SpaceEntry>,
) -> RobotEntry {
    let model = &models[fit.model];
    let names: Vec<String> = model.links.iter().map(|l| l.name.clone()).collect();
    let tip = tip(model).map(|l| (names[l].clone(), poses(fit, model)[l]));
    let mut entry = RobotEntry { space, ..RobotEntry::new(&robot_id(index), fit, &names, tip) };
    add_link_poses(&mut entry, fit, models);
    entry
}

/// Adds the poses of the links, also of the same robot in other scans.
fn add_link_poses(entry: &mut RobotEntry, fit: &Fit, models: &[Model]) {
    let model = &models[fit.model];
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    let joints = model.joints.iter().zip(model.joint_values(&posture));
    let passive =
        joints.filter(|(j, _)| matches!(j.motion, Motion::Mimic { .. } | Motion::Loop(_)));
    entry.passive = NamedMap(passive.map(|(j, value)| (j.name.clone(), value)).collect());
    let slides = model.joints.iter().filter(|j| j.kind == JointKind::Prismatic);
    entry.slides = slides.map(|j| j.name.clone()).collect();
    let links = model.links.iter().zip(poses(fit, model));
    entry.link_poses = NamedMap(links.map(|(l, pose)| (l.name.clone(), (&pose).into())).collect());
    for (entry, stay) in entry.stays.iter_mut().zip(&fit.stays) {
        add_link_poses(entry, stay, models);
    }
}

/// Warnings about masks of the open inputs with dropped points.
pub(crate) fn dropped(sources: &Sources, counts: &[MaskCount]) -> Vec<String> {
    let masks = sources.opened_masks().iter().zip(counts).filter(|(_, count)| count.n_dropped > 0);
    let say = |(mask, count): (&Mask, &MaskCount)| {
        let (n, all) = (count.n_dropped, count.n_points);
        format!(
            "'{}': {n} of {all} points were dropped: withheld by the file, no numbers, or far from all others",
            quote::shown(&mask.name)
        )
    };
    masks.map(say).collect()
}

/// The entry of an input in the result; `counts` are those of the masks of all open inputs.
pub(crate) fn input_entry(
    sources: &Sources,
    input: &Input,
    digests: &Digests,
    counts: &[MaskCount],
) -> InputEntry {
    let scans: Vec<_> = sources.scans.iter().filter(|s| s.input == input.id).collect();
    let own = sources.opened_masks().iter().zip(counts).filter(|(m, _)| m.input == input.id);
    let (n_points, n_dropped) =
        own.fold((0, 0), |sum, (_, c)| (sum.0 + c.n_points, sum.1 + c.n_dropped));
    InputEntry {
        path: input.path.display().to_string(),
        format: format_word(input.format).into(),
        n_bytes: input.n_bytes,
        digest: digests.input(input).unwrap_or_default().to_owned(),
        n_scans: scans.len() as u32,
        n_points,
        n_dropped,
        units: units::entry(sources, input),
        notes: scans.iter().flat_map(|s| &s.notes).cloned().collect(),
        scans: scans.iter().map(|scan| ScanEntry::from(*scan)).collect(),
    }
}

/// The last link of the main chain. Frames of the base, which URDF files may state after it, belong
/// to the main chain's root.
fn tip(model: &Model) -> Option<usize> {
    model.main_chain.last().map(|&joint| model.joints[joint].child)
}

fn format_word(format: Format) -> &'static str {
    match format {
        Format::E57 => "e57",
        Format::Ptx => "ptx",
        Format::Las => "las",
        Format::Laz => "laz",
        Format::Pts => "pts",
        Format::Xyz => "xyz",
        Format::Ply => "ply",
        Format::Pcd => "pcd",
        Format::Memory => "memory",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::Certainty;

    #[test]
    fn the_tip_is_at_the_end_of_the_arm_though_a_frame_of_the_base_stands_behind_it() {
        let urdf = "<robot name='arm'><link name='foot'/><link name='hand'><visual><geometry>
              <box size='0.2 0.2 0.2'/></geometry></visual></link><link name='tool0'/>
            <link name='base'/>
            <joint name='turn' type='revolute'><parent link='foot'/><child link='hand'/>
              <limit lower='-1' upper='1' effort='1' velocity='1'/></joint>
            <joint name='hold' type='fixed'><parent link='hand'/><child link='tool0'/></joint>
            <joint name='stand' type='fixed'><parent link='foot'/><child link='base'/></joint>
            </robot>";
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("arm.urdf");
        std::fs::write(&path, urdf).expect("is written");
        let (model, _) =
            Model::load_urdf(&path, "arm", &robot::Settings::default()).expect("loads");
        // Poses were stated of the frame at the base: its place is the base's, not the tip's.
        assert_eq!(tip(&model).map(|l| &*model.links[l].name), Some("tool0"));
    }

    #[test]
    fn a_joint_has_its_deviation_always_and_the_word_that_fits_it() {
        let joint = |value: f64, sigma: f64, certainty| JointFit {
            name: "joint_a4".into(),
            value: value.to_radians(),
            sigma: sigma.to_radians(),
            certainty,
            ..JointFit::default()
        };
        let lines = [
            joint_line(&joint(-0.000_1, 0.012, Certainty::Determined), false),
            joint_line(&joint(57.483, 0.06, Certainty::Coarse), false),
            joint_line(&joint(178.0, 103.9, Certainty::Undetermined), false),
            joint_line(
                &joint(0.25_f64.to_degrees(), 0.000_3_f64.to_degrees(), Certainty::Determined),
                true,
            ),
        ];
        assert_eq!(
            lines,
            [
                "joint_a4                      0.000° ± 0.012°",
                "joint_a4                     57.483° ± 0.060° coarse",
                "joint_a4                    178.000° ± 103.9° undetermined",
                "joint_a4                  250.000 mm ± 0.300 mm",
            ]
        );
    }
}
