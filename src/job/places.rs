//! The paths of a job in; an error where they cannot be, or where what the job writes would meet what it reads.

use super::Job;
use contract::{Error, Kind, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a run writes into its output folder, besides single files: what a user keeps there else is left alone.
const FOLDERS: [&str; 6] = ["store", "tiles", "clouds", "labels", "robots", "pictures"];
/// Those files.
const FILES: [&str; 5] =
    ["result.json", "manifest.json", "plant.bin", "changes.json", "changes.csv"];

impl Job {
    /// Checks that everything the job reads is there, is named once, and is nothing that it writes.
    ///
    /// # Errors
    /// A path of which that is not so, by its name.
    pub(crate) fn check_places(&self) -> Result<()> {
        let others = self.scanners.iter().chain(&self.review);
        if !self.robots.is_dir() {
            return Err(usage("there is no such folder", &self.robots)
                .hint("--robots takes a folder with a folder for each model"));
        }
        for file in self.inputs.iter().chain(others.clone()) {
            if file.is_dir() {
                return Err(usage("this is a folder", file).hint("name the files in it"));
            }
            if !file.is_file() {
                return Err(usage("there is no such file", file).hint("check the path"));
            }
            if file.to_str().is_none() {
                return Err(usage("its name is not UTF-8, and results name their inputs", file)
                    .hint("rename it"));
            }
        }
        let mut seen: BTreeMap<PathBuf, &Path> = BTreeMap::new();
        for input in &self.inputs {
            if let Some(before) = seen.insert(real(input), input) {
                let what = format!("the same file as {}", before.display());
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
                .hint("results beside a model would be taken for one: give an --out elsewhere"));
        }
        self.check_kept(&library, &out, &self.robots)
    }

    /// Refuses a path that the job reads where it writes.
    fn check_kept(&self, path: &Path, out: &Path, named: &Path) -> Result<()> {
        let Ok(inside) = path.strip_prefix(out) else { return Ok(()) };
        let first = inside.components().next();
        let first = first.map(|c| c.as_os_str().to_string_lossy().into_owned());
        let is_ours = |first: &String| {
            FOLDERS.contains(&first.as_str())
                || FILES.contains(&first.as_str())
                || inside.as_os_str().is_empty()
        };
        if first.as_ref().is_none_or(is_ours) {
            let what = format!("is read and would be written over in {}", self.out.display());
            return Err(usage(&what, named).hint("give another --out, or move it"));
        }
        Ok(())
    }
}

fn usage(what: &str, path: &Path) -> Error {
    Error::new(Kind::Usage, what).at(path.display())
}

/// The path without links and dots; of what is not there, as far as it is there.
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
    use crate::job::{Given, Means};

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
            let means = Means::of(&Given::default()).expect("defaults");
            Job::new(inputs, at(robots), at(out), means).check_places()
        };
        for good in
            [["a.las", "lib", "out"], ["out/scans/a.las", "lib", "out"], ["a.las", "lib", "new"]]
        {
            checked(&[good[0]], good[1], good[2]).expect("can be");
        }
        let bad: [(&[&str], &str, &str); 8] = [
            (&["out/clouds/fixed.las"], "lib", "out"),
            (&["out/scans/../clouds/fixed.las"], "lib", "out"),
            (&["a.las"], "out/robots", "out"),
            (&["a.las"], "lib", "lib"),
            (&["a.las"], "lib", "lib/results/new"),
            (&["a.las", "out/../a.las"], "lib", "out"),
            (&["none.las"], "lib", "out"),
            (&["a.las"], "none", "out"),
        ];
        for (inputs, robots, out) in bad {
            let error = checked(inputs, robots, out).expect_err("cannot be");
            assert_eq!(error.kind(), Kind::Usage, "{error}");
        }
    }
}
