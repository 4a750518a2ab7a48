//! Checks that a name from a list of files denotes a file inside a result folder, and that no
//! symbolic link leads elsewhere.
//!
//! Lists of files are read from disk, and the files that they name are read, moved and removed. A
//! name with `..`, an absolute path or a symbolic link could otherwise reach files outside of the
//! result.

use contract::{Error, Result};
use std::path::{Component, Path, PathBuf};

/// Folders of a result whose files its list may name.
pub(crate) const FOLDERS: [&str; 5] = ["tiles", "clouds", "labels", "robots", "pictures"];
/// Files of a result outside of those folders.
pub(crate) const FILES: [&str; 5] =
    ["result.json", "plant.bin", "changes.json", "changes.csv", "report.html"];

/// Whether `name` can be a file of a result: relative, without dots, and either one of [`FILES`] or
/// inside one of [`FOLDERS`].
pub(crate) fn is_own(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let (first, rest) = (parts.next(), parts.clone().count());
    let Some(Component::Normal(first)) = first else { return false };
    let is_plain = parts.all(|part| matches!(part, Component::Normal(_)));
    let names: &[&str] = if rest == 0 { &FILES } else { &FOLDERS };
    // Stillpoint writes no name with a trailing or double slash.
    is_plain && names.iter().any(|n| first == *n) && !name.ends_with('/') && !name.contains("//")
}

/// The path of the file `name` in `folder`, after a check that neither the file nor a folder on the
/// way is a symbolic link. The file need not exist.
///
/// # Errors
/// A symbolic link, named by its path.
pub(crate) fn without_links(folder: &Path, name: &str) -> Result<PathBuf> {
    let mut path = folder.to_path_buf();
    for part in Path::new(name).components() {
        path.push(part);
        refuse_link(&path)?;
    }
    Ok(path)
}

/// Refuses a path that is a symbolic link.
///
/// # Errors
/// The path is a symbolic link.
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
