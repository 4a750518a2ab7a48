//! Access for the fuzz targets: decodes the body of a `plant.bin`, and tells whether a rescan would
//! accept it.

use super::plant_state::{FORMAT, PlantState, Records};
use crate::cache::written;
use contract::{Fit, Floor, Format, Input, InputId, Mask, MaskId, Result, Scan, ScanId};
use export::{LasSettings, Quantum};
use geometry::Pose;
use std::path::Path;

/// A complete file with this body and its digest.
pub(crate) fn file(body: &[u8]) -> Vec<u8> {
    [FORMAT, blake3::hash(body).as_bytes(), body].concat()
}

/// The body of a plant of one scan and one robot.
pub(crate) fn body() -> Vec<u8> {
    let las = LasSettings::new(Quantum { scale: [1e-4; 3], offset: [0.0; 3] });
    let (id, input, mask) = (ScanId(0), InputId(0), MaskId(0));
    let scan = Scan {
        id,
        input,
        mask,
        name: "one".into(),
        source_id: Some(1),
        places: Vec::new(),
        raster: None,
        scanner: contract::ScannerPosition::Stated,
        world_from_scan: Pose::identity(),
        lattice: Some(contract::Lattice::new(0.01, 0.01, 0.0, 0.0)),
        stated_bounds: None,
        stated_points: Some(7),
        notes: vec!["a note".into()],
    };
    let path = "a.las".into();
    let state = PlantState {
        inputs: vec![Input { id: input, path, format: Format::Las, n_bytes: 9 }],
        masks: vec![Mask { id: mask, input, name: "a.las".into(), n_points: Some(7) }],
        scans: vec![scan],
        tiles: vec![crate::cache::Key::of("tiles", &["a"])],
        frames: vec![Some(Pose::identity())],
        contents: vec!["blake3:0".into()],
        floor: Floor::default(),
        fits: vec![Fit { score: 0.7, ..Fit::default() }],
        robots: "robots".into(),
        records: Records::of(&las, &export::Settings::default()),
    };
    written(&state).map_or_else(Vec::new, |bytes| bytes[32..].to_vec())
}

/// Reads the file in a folder; all indices in it must be valid.
pub(crate) fn read(out: &Path) -> Result<()> {
    let state = PlantState::parse(&std::fs::read(out.join("plant.bin"))?)?;
    assert_eq!(state.tiles.len(), state.inputs.len(), "tiles of each input");
    for (input, key) in state.tiles.iter().enumerate() {
        let _ = state.first_scan(input);
        let is_plain = key.name().bytes().all(|b| b.is_ascii_hexdigit());
        assert!(is_plain && key.name().len() == 32, "a key is a name of a folder");
    }
    for (i, scan) in state.scans.iter().enumerate() {
        assert_eq!(scan.id.0 as usize, i, "scans are numbered");
        let mask = &state.masks[scan.mask.0 as usize];
        assert_eq!(mask.input, scan.input, "a scan's mask is of its input");
    }
    for (i, mask) in state.masks.iter().enumerate() {
        assert_eq!(mask.id.0 as usize, i, "masks are numbered");
        let _ = &state.inputs[mask.input.0 as usize];
    }
    for (i, input) in state.inputs.iter().enumerate() {
        assert_eq!(input.id.0 as usize, i, "inputs are numbered");
    }
    let las = state.records.las();
    let is_scale = |v: f64| v.is_finite() && v > 0.0;
    assert!(las.quantum.scale.into_iter().all(is_scale), "clouds have a scale");
    assert!(las.quantum.offset.into_iter().all(f64::is_finite), "clouds have an offset");
    Ok(())
}
