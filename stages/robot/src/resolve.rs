//! Finds the file that a mesh path of a URDF names. It never opens a file outside of the model's
//! and the library's folder, follows no symbolic link out of them, and starts no process or network
//! access.

use std::path::{Component, Path, PathBuf};

/// The folders in which files may lie.
#[derive(Debug, Clone)]
pub(crate) struct Roots {
    /// Canonical paths of the model's folder and, if the model is in one, the library's.
    model: PathBuf,
    library: Option<PathBuf>,
}

/// A file that was found.
#[derive(Debug)]
pub(crate) struct FoundFile {
    pub(crate) path: PathBuf,
    /// Whether the file's name differs in case from the path in the URDF.
    pub(crate) other_case: bool,
}

impl Roots {
    pub(crate) fn new(model: &Path, library: Option<&Path>) -> std::io::Result<Self> {
        Ok(Self {
            model: model.canonicalize()?,
            library: library.map(Path::canonicalize).transpose()?,
        })
    }

    /// Checks that the model's folder is not a link that leads out of the library's folder; the
    /// error says so in words.
    pub(crate) fn check(&self) -> Result<(), String> {
        match &self.library {
            Some(library) if !self.model.starts_with(library) => {
                Err("is a link that leads out of the library's folder".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// The canonical path of a file that lies in the model's or the library's folder, else an error
    /// in words.
    pub(crate) fn inside(&self, path: &Path) -> Result<PathBuf, String> {
        match path.canonicalize() {
            Ok(found) if self.holds(&found) => Ok(path.to_path_buf()),
            Ok(_) => {
                Err("is a link that leads out of the model's and the library's folder".to_owned())
            }
            Err(error) => Err(format!("cannot be opened ({error})")),
        }
    }

    /// The file that the path `written` means, or an error in words.
    pub(crate) fn find(&self, written: &str) -> Result<FoundFile, String> {
        let candidates = self.candidates(written)?;
        let mut outside = false;
        for other_case in [false, true] {
            for (root, rest) in &candidates {
                let joined = if other_case { any_case(root, rest) } else { Some(root.join(rest)) };
                let Some(path) = joined else {
                    continue;
                };
                let Ok(path) = path.canonicalize() else {
                    continue;
                };
                if !path.is_file() {
                    continue;
                }
                if self.holds(&path) {
                    return Ok(FoundFile { path, other_case });
                }
                outside = true;
            }
        }
        Err(if outside {
            "the path leads out of the model's and the library's folder".to_owned()
        } else {
            "the file is missing".to_owned()
        })
    }

    fn holds(&self, path: &Path) -> bool {
        path.starts_with(&self.model)
            || self.library.as_ref().is_some_and(|root| path.starts_with(root))
    }

    /// Roots and relative paths to try, in order.
    fn candidates(&self, written: &str) -> Result<Vec<(PathBuf, PathBuf)>, String> {
        let slashed = written.trim().replace('\\', "/");
        let mut out = Vec::new();
        if let Some(rest) =
            slashed.strip_prefix("package://").or_else(|| slashed.strip_prefix("model://"))
        {
            let (package, inner) =
                rest.split_once('/').ok_or("the path names a package but no file")?;
            out.push((self.model.clone(), PathBuf::from(inner)));
            let with_package = PathBuf::from(package).join(inner);
            if let Some(library) = &self.library {
                out.push((library.clone(), with_package.clone()));
            }
            out.push((self.model.clone(), with_package));
            if let Some(library) = &self.library {
                out.push((library.clone(), PathBuf::from(inner)));
            }
        } else if let Some(rest) = slashed.strip_prefix("file://") {
            if rest.contains("$(") {
                return Err("the path is xacro, not expanded".to_owned());
            }
            let root = if rest.starts_with('/') { PathBuf::from("/") } else { self.model.clone() };
            out.push((root, PathBuf::from(rest.trim_start_matches('/'))));
        } else if slashed.contains("://") {
            return Err("the path is an address on a network, and nothing is fetched".to_owned());
        } else if slashed.is_empty() {
            return Err("the path is empty".to_owned());
        } else if slashed.starts_with('/') {
            out.push((PathBuf::from("/"), PathBuf::from(slashed.trim_start_matches('/'))));
        } else {
            out.push((self.model.clone(), PathBuf::from(slashed)));
        }
        Ok(out)
    }
}

/// `root/rest` with each part matched regardless of case; the first by name if several match.
fn any_case(root: &Path, rest: &Path) -> Option<PathBuf> {
    // An absolute path is taken as it is; the rest of the disk is not searched for it.
    root.parent()?;
    let mut at = root.to_path_buf();
    for part in rest.components() {
        let Component::Normal(part) = part else {
            return None;
        };
        let wanted = part.to_str()?.to_lowercase();
        let mut names: Vec<_> = std::fs::read_dir(&at)
            .ok()?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| name.to_lowercase() == wanted)
            .collect();
        names.sort();
        at.push(names.first()?);
    }
    Some(at)
}
