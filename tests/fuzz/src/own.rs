//! Files that only this program writes, in; they are read as they were written or refused, out.
//! Where a digest guards a file, the target makes it right: it guards against damage, not against
//! somebody who computes it anew.

use crate::{file, folder, refused};
use export::{LasSettings, MaskReader, Quantum, ResultFile, read_places, read_tile};

/// `result.json`.
pub fn result(data: &[u8]) {
    match ResultFile::read(&file("result/result.json", data)) {
        Ok(result) => {
            let path = folder().join("result/again.json");
            #[cfg(feature = "program")]
            let _ = stillpoint::result::changes::words(&stillpoint::result::changes::changes(
                &result, &result,
            ));
            export::write_junit(&folder().join("result/junit.xml"), &result, true).expect("writes");
            for robot in &result.robots {
                if let Some(space) = &robot.space {
                    let _ = space.read(&folder().join("result")).map_err(|e| refused(&e));
                }
            }
            let text = serde_json::to_string(&result).expect("what was read can be written");
            std::fs::write(&path, &text).expect("a file can be written");
            let again = ResultFile::read(&path).expect("what was written can be read");
            assert_eq!(text, serde_json::to_string(&again).expect("writes"), "it is what it was");
        }
        Err(error) => refused(&error),
    }
}

/// `labels/N.*.npy` and `N.superseded.npy`.
pub fn masks(data: &[u8]) {
    let path = file("masks.npy", data);
    let reader = MaskReader::new(folder(), ["masks.npy"; 3]);
    let n = data.len().saturating_sub(128) / 2;
    for n in [n, n + 1] {
        match reader.range(0, n) {
            Ok(range) => (0..n).for_each(|i| match range.label(i) {
                Ok(_) => {}
                Err(error) => refused(&error),
            }),
            Err(error) => refused(&error),
        }
    }
    match read_places(&path, 1000) {
        Ok(places) => {
            assert!(places.iter().all(|p| *p < 1000), "places of the mask");
            assert!(places.is_sorted_by(|a, b| a < b), "each place once, ascending");
        }
        Err(error) => refused(&error),
    }
}

/// `robots/R1/space.npy`, its size in three bytes before it.
pub fn space(data: &[u8]) {
    let Some((size, bytes)) = data.split_first_chunk::<3>() else { return };
    file("space.npy", bytes);
    let size = size.map(usize::from);
    let text = serde_json::json!({
        "grid": "space.npy", "octomap": "", "unknown": "", "edge": 0.05, "origin": [0.0, 1.0, 2.0],
        "size": size, "octomap_shift": [0.0, 0.0, 0.0], "unknown_m3": 0.0, "free_m3": 0.0,
    });
    let entry: export::SpaceEntry = serde_json::from_value(text).expect("an entry");
    match entry.read(folder()) {
        Ok(space) => {
            let n: usize = size.iter().product();
            assert_eq!((space.voxels().len(), bytes.len()), (n, 128 + n), "a byte a voxel");
        }
        Err(error) => refused(&error),
    }
}

/// A tile of points, plain where the first byte is even, else compressed.
pub fn tile(data: &[u8]) {
    let Some((first, bytes)) = data.split_first() else { return };
    let las = LasSettings { compress: first % 2 == 1, ..tile_settings() };
    let mut n = 0;
    let read = read_tile(&file("tile.las", bytes), &las, None, |points| {
        n += points.len();
        assert!(points.iter().flat_map(|p| p.world).all(|v| v.is_finite()), "a finite place");
        Ok(())
    });
    if let Err(error) = read {
        refused(&error);
    }
}

/// How those tiles are written.
#[must_use]
pub fn tile_settings() -> LasSettings {
    LasSettings::new(Quantum { scale: [1e-4; 3], offset: [0.0; 3] })
}
