//! Copies of folders with all files in them.

use contract::{Error, Kind, Result};
use std::path::Path;

/// Suffix of a folder whose copy is not complete yet.
const PART: &str = ".part";

/// Copies the folder `from` with all of its files to `to`.
///
/// # Errors
/// A file that cannot be read or written.
pub(crate) fn copy(from: &Path, to: &Path) -> Result<()> {
    let at = |path: &Path| {
        let place = path.display().to_string();
        move |e: std::io::Error| Error::from(e).at(place.clone())
    };
    std::fs::create_dir_all(to).map_err(at(to))?;
    for entry in std::fs::read_dir(from).map_err(at(from))? {
        let path = entry.map_err(at(from))?.path();
        let target = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy(&path, &target)?;
        } else {
            std::fs::copy(&path, &target).map_err(at(&path))?;
        }
    }
    Ok(())
}

/// Copies the folder `from` to `to`, which must not exist and must lie outside of `from`. `change`
/// is applied to the copy before it gets its final name.
///
/// # Errors
/// `to` exists, `to` lies in `from`, or [`copy`] or `change` fails.
pub(crate) fn copy_as_new(
    from: &Path,
    to: &Path,
    change: impl FnOnce(&Path) -> Result<()>,
) -> Result<()> {
    let usage = |what: &str| Error::new(Kind::Usage, what).at(to.display());
    if to.symlink_metadata().is_ok() {
        return Err(
            usage("the folder exists already").hint("name a folder that does not exist yet")
        );
    }
    let name = to.file_name().ok_or_else(|| usage("this path has no folder name at its end"))?;
    let parent = to.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let at = |path: &Path, e: std::io::Error| Error::from(e).at(path.display());
    // A copy inside of its source would be copied again and again.
    let source = from.canonicalize().map_err(|e| at(from, e))?;
    let above = parent.ancestors().find_map(|p| p.canonicalize().ok());
    if above.is_some_and(|above| above.starts_with(&source)) {
        return Err(usage("the folder lies in the folder that is to be copied")
            .hint("name a folder outside of it"));
    }
    let mut part = name.to_os_string();
    part.push(PART);
    let part = parent.join(part);
    let made = copy(from, &part).and_then(|()| change(&part));
    let renamed = made.and_then(|()| std::fs::rename(&part, to).map_err(|e| at(to, e)));
    if renamed.is_err() {
        let _ = std::fs::remove_dir_all(&part);
    }
    renamed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_never_meets_what_it_is_made_from() {
        let dir = tempfile::tempdir().expect("a folder");
        let from = dir.path().join("arm");
        std::fs::create_dir_all(from.join("meshes")).expect("is made");
        std::fs::write(from.join("meshes/a.stl"), "solid").expect("is written");
        let copied = |to: &str| copy_as_new(&from, &dir.path().join(to), |_| Ok(()));
        for taken in ["arm", "arm/new", "arm/meshes/deep/new"] {
            let error = copied(taken).expect_err("refused");
            assert_eq!(error.kind(), Kind::Usage, "{error}");
        }
        copied("far/new").expect("is copied");
        let read = |path: &str| std::fs::read_to_string(dir.path().join(path)).expect("is there");
        assert_eq!(read("arm/meshes/a.stl"), "solid");
        assert_eq!(read("far/new/meshes/a.stl"), "solid");
        // A change that fails leaves nothing.
        let failed = |_: &Path| Err(Error::bad_input("no joint"));
        copy_as_new(&from, &dir.path().join("half"), failed).expect_err("fails");
        assert_eq!(std::fs::read_dir(dir.path()).expect("opens").count(), 2);
    }
}
