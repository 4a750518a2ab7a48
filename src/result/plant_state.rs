//! The state of a plant for later sessions: `plant.bin` beside the result holds scans, floor,
//! robots and keys of tiles.

use crate::cache::{Key, VerifiedFiles, read, written};
use contract::{Error, Fit, Floor, Input, Kind, Mask, Result, Scan};
use export::{LasSettings, Quantum, RawVlr};
use geometry::Pose;
use ingest::Before;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the file.
const NAME: &str = "plant.bin";
/// First bytes of the file: name and version of its format.
pub(super) const FORMAT: &[u8] = b"stillpoint.plant/9\n";

/// Scans, floor and robots of a plant as a run has found them.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct PlantState {
    pub(crate) inputs: Vec<Input>,
    pub(crate) masks: Vec<Mask>,
    pub(crate) scans: Vec<Scan>,
    /// Key of the tiles of each input: the name of their folder in the store.
    pub(crate) tiles: Vec<Key>,
    /// For each input, the pose that carried its scans to the plant's frame, where its files are
    /// in another one.
    pub(crate) frames: Vec<Option<Pose>>,
    /// Digest of the content of each of these stores (see `Store::contents`).
    pub(crate) contents: Vec<String>,
    pub(crate) floor: Floor,
    /// Fits in the order of the result; robots that are gone are refused.
    pub(crate) fits: Vec<Fit>,
    /// Path of the robot library as it was given.
    pub(crate) robots: PathBuf,
    pub(crate) records: Records,
}

/// Layout of the records of clouds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Records {
    scale: [f64; 3],
    offset: [f64; 3],
    with_color: bool,
    with_bodies: bool,
    compress: bool,
    /// Edge of the spatial tiles, metres; `None` without tiles.
    tile_edge: Option<f64>,
    /// Records of the reference system.
    system: Vec<RawVlr>,
}

impl Records {
    pub(crate) fn of(las: &LasSettings, export: &export::Settings) -> Self {
        Self {
            scale: las.quantum.scale,
            offset: las.quantum.offset,
            with_color: las.with_color,
            with_bodies: export.bodies,
            compress: export.compress,
            tile_edge: export.tiles.then_some(export.tile_edge),
            system: las.vlrs.clone(),
        }
    }

    pub(crate) fn las(&self) -> LasSettings {
        let quantum = Quantum { scale: self.scale, offset: self.offset };
        LasSettings {
            with_color: self.with_color,
            with_bodies: self.with_bodies,
            compress: self.compress,
            vlrs: self.system.clone(),
            ..LasSettings::new(quantum)
        }
    }

    /// Settings for clouds that are written beside the present ones.
    pub(crate) fn export(&self, settings: &export::Settings) -> export::Settings {
        export::Settings {
            tiles: self.tile_edge.is_some(),
            tile_edge: self.tile_edge.unwrap_or(settings.tile_edge),
            fixed_cloud: false,
            bodies: self.with_bodies,
            compress: self.compress,
            ..*settings
        }
    }

    /// Edge of the spatial tiles, metres; `None` without tiles.
    pub(crate) fn tile_edge(&self) -> Option<f64> {
        self.tile_edge
    }
}

impl PlantState {
    /// Writes the state beside a result.
    pub(crate) fn write(&self, out: &Path) -> Result<()> {
        let body = written(self)
            .ok_or_else(|| Error::new(Kind::Bug, "the state of the plant cannot be encoded"))?;
        export::atomic::write(&out.join(NAME), &[FORMAT, &body].concat())
    }

    /// Reads the state of a result.
    ///
    /// # Errors
    /// There is none, it was changed, or another version wrote it.
    pub(crate) fn read(files: &VerifiedFiles) -> Result<Self> {
        Self::parse(&files.bytes(NAME)?).map_err(|e| e.at(NAME))
    }

    pub(super) fn parse(bytes: &[u8]) -> Result<Self> {
        let hint = "run the whole plant again with this version";
        let bad = |what: &str| Error::bad_input(what.to_owned()).hint(hint);
        let body = bytes.strip_prefix(FORMAT);
        let body = body.ok_or_else(|| bad("this was written by another version"))?;
        let state: Self = read(body).ok_or_else(|| bad("the file is damaged"))?;
        if state.is_consistent() {
            Ok(state)
        } else {
            Err(bad("its inputs, masks and scans are numbered inconsistently"))
        }
    }

    /// Whether inputs, masks and scans are numbered in order and refer to each other, and clouds
    /// have a scale. The digest detects damage, but not another program that writes such a file.
    fn is_consistent(&self) -> bool {
        let (inputs, masks, scans) = (&self.inputs, &self.masks, &self.scans);
        let is_number = |id: u32, at: usize| id as usize == at;
        let is_scale = |v: &f64| v.is_finite() && *v > 0.0;
        let Records { scale, offset, tile_edge, .. } = &self.records;
        let is_pose = |pose: &Pose| pose.to_homogeneous().iter().all(|v| v.is_finite());
        self.tiles.len() == inputs.len()
            && self.frames.len() <= inputs.len()
            && self.frames.iter().flatten().all(is_pose)
            && self.contents.len() == inputs.len()
            && inputs.iter().enumerate().all(|(at, input)| is_number(input.id.0, at))
            && masks.iter().enumerate().all(|(at, mask)| is_number(mask.id.0, at))
            && masks.iter().all(|mask| (mask.input.0 as usize) < inputs.len())
            && scans.iter().enumerate().all(|(at, scan)| is_number(scan.id.0, at))
            && scans.iter().all(|scan| {
                masks.get(scan.mask.0 as usize).is_some_and(|mask| mask.input == scan.input)
            })
            && scale.iter().chain(tile_edge).all(is_scale)
            && offset.iter().all(|v| v.is_finite())
    }

    /// Its inputs, after which new inputs are numbered.
    pub(crate) fn before(&self) -> Before {
        let (inputs, masks, scans) = (self.inputs.clone(), self.masks.clone(), self.scans.clone());
        Before { inputs, masks, scans }
    }

    /// Number of the first scan of an input.
    pub(crate) fn first_scan(&self, input: usize) -> u32 {
        let own = self.scans.iter().find(|s| s.input.0 as usize == input);
        own.map_or(0, |s| s.id.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plant_whose_numbers_name_nothing_is_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let las = LasSettings::new(Quantum { scale: [1e-4; 3], offset: [0.0; 3] });
        let (input, id) = (contract::InputId(0), contract::MaskId(0));
        let whole = PlantState {
            inputs: vec![Input {
                id: input,
                path: "a.las".into(),
                format: contract::Format::Las,
                n_bytes: 1,
            }],
            masks: vec![Mask { id, input, name: "a".into(), n_points: None }],
            scans: Vec::new(),
            tiles: vec![Key::of("test", &["a"])],
            frames: vec![None],
            contents: vec!["blake3:0".into()],
            floor: Floor::default(),
            fits: Vec::new(),
            robots: "robots".into(),
            records: Records::of(&las, &export::Settings::default()),
        };
        let read_back = |state: &PlantState| {
            state.write(dir.path()).expect("writes");
            PlantState::parse(&std::fs::read(dir.path().join(NAME)).expect("reads"))
        };
        assert!(read_back(&whole).is_ok());
        let wrong: [fn(&mut PlantState); 8] = [
            |s| s.frames.push(None),
            |s| s.frames[0] = Some(Pose::translation(f64::NAN, 0.0, 0.0)),
            |s| s.masks[0].input.0 = 1,
            |s| s.masks[0].id.0 = 7,
            |s| s.tiles.clear(),
            |s| s.contents.clear(),
            |s| s.records.scale[1] = 0.0,
            |s| s.records.tile_edge = Some(f64::NAN),
        ];
        for (i, wrong) in wrong.into_iter().enumerate() {
            let mut state = whole.clone();
            wrong(&mut state);
            let error = read_back(&state).expect_err("refused").to_string();
            assert!(error.contains("numbered inconsistently"), "{i}: {error}");
        }
        // A key must be the plain name of a folder in the store.
        let foreign = written(&vec!["../../elsewhere".to_owned()]).expect("is written");
        assert!(read::<Vec<Key>>(&foreign).is_none());
        let own = written(&whole.tiles).expect("is written");
        assert_eq!(read::<Vec<Key>>(&own), Some(whole.tiles));
    }

    #[test]
    fn it_comes_back_and_damage_is_told() {
        let dir = tempfile::tempdir().expect("a folder");
        let las = LasSettings::new(Quantum { scale: [1e-4; 3], offset: [1e3, 0.0, 0.0] });
        let state = PlantState {
            inputs: Vec::new(),
            masks: Vec::new(),
            scans: Vec::new(),
            tiles: Vec::new(),
            frames: Vec::new(),
            contents: Vec::new(),
            floor: Floor::default(),
            fits: vec![Fit { score: 0.7, ..Fit::default() }],
            robots: "robots".into(),
            records: Records::of(&las, &export::Settings::default()),
        };
        state.write(dir.path()).expect("writes");
        let path = dir.path().join(NAME);
        let again = PlantState::parse(&std::fs::read(&path).expect("reads")).expect("reads");
        assert_eq!((again.fits, again.records.las()), (state.fits, las));
        let mut bytes = std::fs::read(&path).expect("reads");
        *bytes.last_mut().expect("a byte") ^= 1;
        assert!(PlantState::parse(&bytes).expect_err("damaged").to_string().contains("damaged"));
        let old = PlantState::parse(b"stillpoint.plant/0\n");
        assert!(old.expect_err("old").to_string().contains("version"));
    }
}
