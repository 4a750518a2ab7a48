//! A folder and the name of a file in it in; its path out, if the name is one that a result has and
//! no link leads elsewhere.
//!
//! Lists of files come from disk, and what they name is read, moved and removed: a name that leads
//! out of the folder, by dots, as an absolute path or through a link, would read, move and remove
//! the files of somebody else.

use contract::{Error, Result};
use std::path::{Component, Path, PathBuf};

/// Folders of a result that its list names files in.
pub(crate) const FOLDERS: [&str; 5] = ["tiles", "clouds", "labels", "robots", "pictures"];
/// Files beside them.
pub(crate) const FILES: [&str; 4] = ["result.json", "plant.bin", "changes.json", "changes.csv"];

/// Whether a name is one that a result gives a file: relative, without dots, and in one of a
/// result's own folders.
pub(crate) fn is_own(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let (first, rest) = (parts.next(), parts.clone().count());
    let Some(Component::Normal(first)) = first else { return false };
    let is_plain = parts.all(|part| matches!(part, Component::Normal(_)));
    let names: &[&str] = if rest == 0 { &FILES } else { &FOLDERS };
    // A trailing slash or a double one is no name that is written.
    is_plain && names.iter().any(|n| first == *n) && !name.ends_with('/') && !name.contains("//")
}

/// The path of a file, of which neither itself nor a folder on the way is a link; it need not be
/// there.
///
/// # Errors
/// A link, with its path.
pub(crate) fn without_links(folder: &Path, name: &str) -> Result<PathBuf> {
    let mut path = folder.to_path_buf();
    for part in Path::new(name).components() {
        path.push(part);
        refuse_link(&path)?;
    }
    Ok(path)
}

/// Refuses a path that is a link.
///
/// # Errors
/// It is one.
pub(crate) fn refuse_link(path: &Path) -> Result<()> {
    if path.symlink_metadata().is_ok_and(|meta| meta.is_symlink()) {
        return Err(Error::bad_input("this is a link, and links are not followed within a result")
            .at(path.display())
            .hint("put the file or folder itself there, or give another folder"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_are_none_of_a_result() {
        for name in ["result.json", "tiles/0_0.las", "robots/R1/meshes/a.stl", "labels/0.kind.npy"]
        {
            assert!(is_own(name), "{name}");
        }
        for name in [
            "",
            ".",
            "..",
            "notes.txt",
            "/etc/hostname",
            "tiles",
            "tiles/",
            "tiles//0_0.las",
            "tiles/../notes.txt",
            "../tiles/0_0.las",
            "./result.json/x",
            "store/lock",
            "manifest.json",
            "export/fixed.ply",
        ] {
            assert!(!is_own(name), "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_on_the_way_is_refused_by_name() {
        let dir = tempfile::tempdir().expect("a folder");
        let out = dir.path().join("out");
        std::fs::create_dir_all(out.join("tiles")).expect("is made");
        std::fs::create_dir_all(dir.path().join("other")).expect("is made");
        std::os::unix::fs::symlink("../other", out.join("labels")).expect("is made");
        assert!(without_links(&out, "tiles/0_0.las").is_ok());
        let error = without_links(&out, "labels/0.kind.npy").expect_err("leads out");
        assert_eq!(error.kind(), contract::Kind::BadInput);
        assert!(
            error.to_string().starts_with(&out.join("labels").display().to_string()),
            "{error}"
        );
    }
}
