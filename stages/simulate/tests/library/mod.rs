//! The library of demo robots, written to a folder and loaded again.

use robot::{Library, Settings};
use simulate::demo_robots;

/// The library without CAD clouds.
pub(crate) fn load() -> Library {
    let dir = tempfile::tempdir().unwrap();
    for (path, bytes) in demo_robots::files() {
        let path = dir.path().join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    Library::load(dir.path(), &Settings { clouds: false, ..Settings::default() }).unwrap()
}
