//! Text that people write in; what was read of it is within its bounds, out.

use crate::{file, refused};
use ingest::KnownScanners;
use simulate::Scene;

/// `--scanners`, TOML or JSON.
pub fn scanners(data: &[u8]) {
    match KnownScanners::read(&file("scanners.toml", data), &ingest::Settings::default()) {
        Ok(scanners) => {
            for entry in &scanners.entries {
                let pose = &entry.world_from_scan;
                assert!(pose.translation.vector.iter().all(|v| v.is_finite()), "a finite place");
                assert!((pose.rotation.norm() - 1.0).abs() < 1e-9, "a rotation");
            }
        }
        Err(error) => refused(&error),
    }
}

/// A scene of the virtual scanner.
pub fn scene(data: &[u8]) {
    match std::str::from_utf8(data)
        .map_or_else(|_| Err(contract::Error::bad_input("no text")), Scene::from_toml)
    {
        Ok(scene) => {
            let text = scene.to_toml().expect("a scene that was read can be written");
            let again = Scene::from_toml(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert_eq!(again.to_toml().expect("writes"), text, "a scene is what it was");
        }
        Err(error) => refused(&error),
    }
}
