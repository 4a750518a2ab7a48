//! Loads a library: a folder with one folder for each robot or tool.

use crate::finding::{Finding, Findings, Severity};
use crate::load::{load, urdfs};
use crate::model::Model;
use crate::settings::Settings;
use contract::words::count;
use contract::{Error, Result};
use std::path::{Path, PathBuf};

/// All models that a run may find in the scans.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Library {
    /// The models, sorted by name.
    pub models: Vec<Model>,
    /// Problems and information, in the order of the models' names.
    pub findings: Vec<Finding>,
}

impl Library {
    /// Loads all models of a library. A model that cannot be loaded is left out and explained in
    /// `findings`.
    ///
    /// # Errors
    /// If the folder cannot be read, or if no model can be loaded.
    pub fn load(dir: &Path, settings: &Settings) -> Result<Self> {
        let (folders, mut library) = Self::open(dir)?;
        for folder in &folders {
            let (model, findings) = Self::load_folder(dir, folder, settings);
            library.add(model, findings);
        }
        library.checked(dir)
    }

    /// All findings about a library. A library that cannot be opened gives a single finding.
    #[must_use]
    pub fn lint(dir: &Path, settings: &Settings) -> Vec<Finding> {
        let settings = &Settings { clouds: false, ..*settings };
        let fail = |error: &Error| {
            let mut findings = Findings::new("");
            findings.fail(dir.display(), error.to_string(), "");
            findings.list
        };
        let (folders, mut library) = match Self::open(dir) {
            Ok(opened) => opened,
            Err(error) => return fail(&error),
        };
        for folder in &folders {
            let (model, findings) = Self::load_folder(dir, folder, settings);
            library.add(model, findings);
        }
        if folders.is_empty() {
            library.findings.extend(fail(&empty(dir)));
        }
        library.findings
    }

    /// The model folders of a library, sorted by name, and a library without models that already
    /// has the findings about ignored folders. It is the first step of loading models in parallel,
    /// with [`Library::load_folder`], [`Library::add`] and [`Library::checked`].
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn open(dir: &Path) -> Result<(Vec<PathBuf>, Self)> {
        let at = |e: std::io::Error| {
            let is_missing = e.kind() == std::io::ErrorKind::NotFound;
            let error = if is_missing {
                Error::bad_input("there is no such folder")
            } else {
                Error::from(e)
            };
            error.at(dir.display()).hint("give the folder of the robot library")
        };
        let mut folders = Vec::new();
        for entry in std::fs::read_dir(dir).map_err(at)? {
            let path = entry.map_err(at)?.path();
            if path.is_dir() {
                folders.push(path);
            }
        }
        folders.sort();
        let mut passed = Findings::new("");
        folders.retain(|folder| {
            let name = name(folder);
            if name.starts_with(['_', '.']) {
                passed.note(folder.display(), "is ignored because of its name", "");
                return false;
            }
            let holds = folder.join("robot.toml").is_file() || !urdfs(folder).is_empty();
            if !holds {
                passed.note(folder.display(), "is ignored, since it has no robot.urdf", "");
            }
            holds
        });
        if urdfs(dir).len() == 1 && folders.is_empty() {
            passed.note(dir.display(), "is a model, not a library", "give the folder above it");
        }
        Ok((folders, Self { models: Vec::new(), findings: passed.list }))
    }

    /// Loads the model of one folder of the library.
    #[must_use]
    pub fn load_folder(
        dir: &Path,
        folder: &Path,
        settings: &Settings,
    ) -> (Option<Model>, Vec<Finding>) {
        let name = name(folder);
        let mut findings = Findings::new(&name);
        let model = load(folder, &name, Some(dir), settings, &mut findings);
        (model, findings.list)
    }

    /// Adds a loaded model. The models must be added in the order of their folders.
    pub fn add(&mut self, model: Option<Model>, findings: Vec<Finding>) {
        self.models.extend(model);
        self.findings.extend(findings);
    }

    /// Returns the library if it holds at least one model.
    ///
    /// # Errors
    /// If it holds none, with the reasons.
    pub fn checked(self, dir: &Path) -> Result<Self> {
        if !self.models.is_empty() {
            return Ok(self);
        }
        let Some(first) = self.findings.iter().find(|f| f.severity == Severity::Error) else {
            return Err(empty(dir));
        };
        let n = self.findings.iter().filter(|f| f.severity == Severity::Error).count();
        let what = format!(
            "no model of the library could be loaded: {}, the first: {}: {}: {}",
            count(n as u64, "error"),
            first.model,
            first.place,
            first.what
        );
        Err(Error::bad_input(what)
            .at(dir.display())
            .hint("`stillpoint robots lint` explains all of them"))
    }

    /// Index of the model with this name.
    #[must_use]
    pub fn model(&self, name: &str) -> Option<usize> {
        self.models.iter().position(|m| m.name == name)
    }
}

fn name(folder: &Path) -> String {
    folder.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

fn empty(dir: &Path) -> Error {
    Error::bad_input("the library holds no robot")
        .at(dir.display())
        .hint("a library is a folder of folders, each with a robot.urdf and its meshes")
}
