//! A mesh path as a URDF has it in, a file inside the declared roots out. Never a process, never
//! the network, never a file outside the model's or the library's folder, links on disk included.

use std::path::{Component, Path, PathBuf};

/// Where files may lie.
#[derive(Debug, Clone)]
pub(crate) struct Roots {
    /// Folder of the model, and that of the library if the model is in one; canonical.
    model: PathBuf,
    library: Option<PathBuf>,
}

/// A file found.
#[derive(Debug)]
pub(crate) struct FoundFile {
    pub(crate) path: PathBuf,
    /// The name on disk differs in case from the one written.
    pub(crate) other_case: bool,
}

impl Roots {
    pub(crate) fn new(model: &Path, library: Option<&Path>) -> std::io::Result<Self> {
        Ok(Self {
            model: model.canonicalize()?,
            library: library.map(Path::canonicalize).transpose()?,
        })
    }

    /// Whether the model's folder lies in the library's, and is no link that leads out of it; else
    /// what is wrong, in words.
    pub(crate) fn check(&self) -> Result<(), String> {
        match &self.library {
            Some(library) if !self.model.starts_with(library) => {
                Err("is a link that leads out of the library's folder".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// The path, if what it leads to lies in the model's or the library's folder; else what is
    /// wrong, in words.
    pub(crate) fn inside(&self, path: &Path) -> Result<PathBuf, String> {
        match path.canonicalize() {
            Ok(found) if self.holds(&found) => Ok(path.to_path_buf()),
            Ok(_) => {
                Err("is a link that leads out of the model's and the library's folder".to_owned())
            }
            Err(error) => Err(format!("cannot be opened ({error})")),
        }
    }

    /// The file that `written` means, or what is wrong with it in words.
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

    /// Folders and relative paths to try, in order.
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

/// `root/rest` with each part matched in any case; the first in order of name where several do.
fn any_case(root: &Path, rest: &Path) -> Option<PathBuf> {
    // An absolute path is taken as written: the rest of the disk is not searched.
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
