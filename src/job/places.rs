//! Checks the paths of a job: each input exists and is named once, and nothing that the job reads
//! lies where it writes.

use super::Job;
use crate::io::own_paths::{FILES, FOLDERS, refuse_link};
use contract::{Error, Kind, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names that a run writes into its output folder besides the files of its result. Anything else
/// that a user keeps there is left alone.
const STORE: &str = "store";
const LIST: &str = "manifest.json";

impl Job {
    /// Checks that each file the job reads exists, is named once and does not lie where the job
    /// writes.
    ///
    /// # Errors
    /// The first path that fails one of these checks, by name.
    pub(crate) fn check_places(&self) -> Result<()> {
        let others = self.scanners.iter().chain(&self.review);
        if !self.robots.is_dir() {
            return Err(Error::bad_input("the folder of the robot library does not exist")
                .at(self.robots.display())
                .hint("--robots takes a folder that has one folder for each model"));
        }
        for file in self.inputs.iter().chain(others.clone()) {
            ingest::regular(file)?;
            if file.to_str().is_none() {
                let what = "the name of this file is not UTF-8, and results name their inputs";
                return Err(Error::bad_input(what).at(file.display()).hint("rename the file"));
            }
        }
        let mut seen: BTreeMap<PathBuf, &Path> = BTreeMap::new();
        for input in &self.inputs {
            if let Some(before) = seen.insert(real(input), input) {
                let what = format!("this input is the same file as {}", before.display());
                return Err(usage(&what, input).hint("name each input once"));
            }
        }
        let out = real(&self.out);
        for file in self.inputs.iter().chain(others) {
            self.check_kept(&real(file), &out, file)?;
        }
        let library = real(&self.robots);
        if out.starts_with(&library) {
            return Err(usage("the output folder lies in the robot library", &self.out)
                .hint("a result there would be read as a robot model: give an --out elsewhere"));
        }
        self.check_kept(&library, &out, &self.robots)
    }

    /// Refuses an output folder that is, contains or lies in `base`, the result that a rescan
    /// starts from.
    ///
    /// # Errors
    /// One of the folders contains the other.
    pub(crate) fn refuse_base_overlap(&self, base: &Path) -> Result<()> {
        refuse_overlap(base, &self.out)
    }

    /// Refuses a path that the job reads and would overwrite.
    fn check_kept(&self, path: &Path, out: &Path, named: &Path) -> Result<()> {
        let Ok(inside) = path.strip_prefix(out) else { return Ok(()) };
        let first = inside.components().next();
        let first = first.map(|c| c.as_os_str().to_string_lossy().into_owned());
        let is_ours = |first: &String| {
            let names = FOLDERS.iter().chain(&FILES).chain(&[STORE, LIST]);
            names.into_iter().any(|name| first == name) || inside.as_os_str().is_empty()
        };
        if first.as_ref().is_none_or(is_ours) {
            let out = self.out.display();
            let what =
                format!("this path is an input and would be overwritten by the result in {out}");
            return Err(usage(&what, named).hint("give another --out, or move the input"));
        }
        Ok(())
    }
}

fn usage(what: &str, path: &Path) -> Error {
    Error::new(Kind::Usage, what).at(path.display())
}

/// Refuses an output folder in which a symbolic link would lead files of the run elsewhere. The
/// output folder itself may be a link.
///
/// # Errors
/// The first symbolic link that is found.
pub(crate) fn refuse_links(out: &Path) -> Result<()> {
    for name in FILES.iter().chain(&[LIST, STORE]) {
        refuse_link(&out.join(name))?;
    }
    refuse_link(&out.join(STORE).join("next"))?;
    let mut folders: Vec<PathBuf> = FOLDERS.iter().map(|name| out.join(name)).collect();
    while let Some(folder) = folders.pop() {
        refuse_link(&folder)?;
        // A missing folder is made later, and an unreadable one is reported when it is written to.
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            match entry.file_type() {
                Ok(kind) if kind.is_symlink() => refuse_link(&entry.path())?,
                Ok(kind) if kind.is_dir() => folders.push(entry.path()),
                _ => {}
            }
        }
    }
    Ok(())
}

/// Refuses an output folder that is, contains or lies in the folder of the earlier result.
///
/// # Errors
/// One of the folders contains the other.
fn refuse_overlap(base: &Path, out: &Path) -> Result<()> {
    let (within, outside) = (real(out), real(base));
    let what = if within == outside {
        "a rescan does not overwrite the result that it starts from"
    } else if within.starts_with(&outside) {
        "the output folder lies in the result that the rescan starts from"
    } else if outside.starts_with(&within) {
        "the result that the rescan starts from lies in the output folder"
    } else {
        return Ok(());
    };
    Err(usage(what, out).hint("give another --out, beside the earlier result"))
}

/// The absolute path without links and dots, as far as the path exists.
fn real(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
    for there in path.ancestors() {
        if let (Ok(found), Ok(rest)) = (there.canonicalize(), path.strip_prefix(there)) {
            return found.join(rest);
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{FlagValues, Means};

    #[test]
    fn what_is_read_is_never_written() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |path: &str| dir.path().join(path);
        for folder in ["out/clouds", "out/scans", "out/robots/arm", "lib/arm"] {
            std::fs::create_dir_all(at(folder)).expect("is made");
        }
        for file in ["a.las", "out/clouds/fixed.las", "out/scans/a.las"] {
            std::fs::write(at(file), "x").expect("is written");
        }
        let checked = |inputs: &[&str], robots: &str, out: &str| {
            let inputs = inputs.iter().map(|i| at(i)).collect();
            let means = Means::of(&FlagValues::default()).expect("defaults");
            Job::new(inputs, at(robots), at(out), means).check_places()
        };
        for good in
            [["a.las", "lib", "out"], ["out/scans/a.las", "lib", "out"], ["a.las", "lib", "new"]]
        {
            checked(&[good[0]], good[1], good[2]).expect("can be");
        }
        let bad: [(&[&str], &str, &str, Kind); 9] = [
            (&["out/clouds/fixed.las"], "lib", "out", Kind::Usage),
            (&["out/scans/../clouds/fixed.las"], "lib", "out", Kind::Usage),
            (&["a.las"], "out/robots", "out", Kind::Usage),
            (&["a.las"], "lib", "lib", Kind::Usage),
            (&["a.las"], "lib", "lib/results/new", Kind::Usage),
            (&["a.las", "out/../a.las"], "lib", "out", Kind::Usage),
            (&["none.las"], "lib", "out", Kind::BadInput),
            (&["out"], "lib", "new", Kind::BadInput),
            (&["a.las"], "none", "out", Kind::BadInput),
        ];
        for (inputs, robots, out, kind) in bad {
            let error = checked(inputs, robots, out).expect_err("cannot be");
            assert_eq!(error.kind(), kind, "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_in_an_output_folder_and_folders_in_one_another_are_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |path: &str| dir.path().join(path);
        for folder in ["base/labels", "out/robots/R1", "plain"] {
            std::fs::create_dir_all(at(folder)).expect("is made");
        }
        for link in ["out/labels", "out/store", "out/robots/R1/meshes", "out/result.json"] {
            std::os::unix::fs::symlink(at("base/labels"), at(link)).expect("is made");
            let error = refuse_links(&at("out")).expect_err(link);
            assert_eq!(error.kind(), Kind::BadInput);
            assert!(error.to_string().contains(link), "{error}");
            std::fs::remove_file(at(link)).expect("goes");
        }
        refuse_links(&at("out")).expect("has no links");
        // The folder itself may lie on another disk.
        std::os::unix::fs::symlink(at("out"), at("link")).expect("is made");
        refuse_links(&at("link")).expect("has no links");
        for (base, out) in [
            ("base", "base"),
            ("base", "base/sub"),
            ("base", "base/labels/x"),
            ("link/robots", "out"),
            ("base", "."),
        ] {
            let error = refuse_overlap(&at(base), &at(out)).expect_err(out);
            assert_eq!(error.kind(), Kind::Usage);
        }
        refuse_overlap(&at("base"), &at("plain")).expect("lie apart");
        refuse_overlap(&at("base"), &at("base2")).expect("lie apart");
    }
}
