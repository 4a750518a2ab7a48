//! Reads the meshes of a robot as [`write_robot`](crate::write_robot) has written them.

use contract::{Error, Result};
use robot::Mesh;
use std::path::{Path, PathBuf};

/// The meshes of a written robot, each with the index of its link.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WrittenBodies {
    /// Surfaces of the links.
    pub links: Vec<(usize, Mesh)>,
    /// Convex pieces of what hangs on them.
    pub hanging: Vec<(usize, Mesh)>,
}

impl WrittenBodies {
    /// Reads these mesh files of one robot; their names say what they are.
    ///
    /// # Errors
    /// If a file cannot be read or is no mesh of this program.
    pub fn read(files: &[PathBuf]) -> Result<Self> {
        let mut out = Self::default();
        for file in files {
            let Some((link, hangs)) = meaning(file) else { continue };
            let bytes = std::fs::read(file);
            let bytes = bytes.map_err(|e| Error::of_read("mesh cannot be read", file, e))?;
            let mesh = Mesh::from_stl(&bytes).ok_or_else(|| {
                let hint = "`stillpoint verify` checks whether the result is complete";
                Error::bad_input("this is no mesh of a result").at(file.display()).hint(hint)
            })?;
            if hangs { &mut out.hanging } else { &mut out.links }.push((link, mesh));
        }
        Ok(out)
    }
}

/// Index of the link, and whether the mesh hangs on it: `04_wrist_hanging_2.stl`.
fn meaning(file: &Path) -> Option<(usize, bool)> {
    let stem = file.file_stem()?.to_str()?;
    let link = stem.split_once('_')?.0.parse().ok()?;
    let piece = stem.rsplit_once("_hanging_").map(|(_, number)| number);
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    Some((link, piece.is_some_and(is_number)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_which_link_and_whether_it_hangs() {
        let of = |name: &str| meaning(Path::new(name));
        assert_eq!(of("meshes/04_wrist.stl"), Some((4, false)));
        assert_eq!(of("meshes/112_wrist_hanging_10.stl"), Some((112, true)));
        assert_eq!(of("meshes/03_hanging_lamp.stl"), Some((3, false)));
        assert_eq!(of("meshes/lamp.stl"), None);
    }
}
