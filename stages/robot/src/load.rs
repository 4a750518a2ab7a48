//! Loads a model from its folder: URDF, `robot.toml`, sub chains, meshes and CAD clouds.

use crate::bodies::MeshFiles;
use crate::finding::{Finding, Findings};
use crate::model::{Link, Model};
use crate::notes::{named_passive, note_links};
use crate::reading::{file_name, read_text, read_xml};
use crate::resolve::Roots;
use crate::settings::Settings;
use crate::sheet::{Sheet, SubChain};
use crate::tree::LinkTree;
use crate::urdf::UrdfDescription;
use crate::{chain, close, cloud, tree, urdf};
use contract::{Error, Fan, OneByOne, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

impl Model {
    /// Loads one model from its folder and returns it with its findings.
    ///
    /// # Errors
    /// The first finding that prevents the model from loading.
    pub fn load(folder: &Path, settings: &Settings) -> Result<(Self, Vec<Finding>)> {
        let name = folder
            .file_name()
            .map_or_else(|| "robot".to_owned(), |n| n.to_string_lossy().into_owned());
        let mut findings = Findings::new(&name);
        match load(folder, &name, folder.parent(), settings, &mut findings) {
            Some(model) => Ok((model, findings.list)),
            None => Err(findings.first_error()),
        }
    }

    /// Loads one model from a URDF file and returns it with its findings; a `robot.toml` in the
    /// same folder is not read.
    ///
    /// # Errors
    /// The first finding that prevents the model from loading.
    pub fn load_urdf(path: &Path, name: &str, settings: &Settings) -> Result<(Self, Vec<Finding>)> {
        let mut findings = Findings::new(name);
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let roots = Roots::new(folder, None).map_err(|e| Error::from(e).at(folder.display()))?;
        let loader = Loader { name, roots, settings };
        match loader.load(path, &Sheet::default(), &mut findings) {
            Some(model) => Ok((model, findings.list)),
            None => Err(findings.first_error()),
        }
    }

    /// Makes the CAD clouds of all links of a model that was loaded without them.
    pub fn sample(&mut self, settings: &Settings, fan: &dyn Fan) {
        let links = self.links.iter().collect();
        let sample =
            |link: &Link| cloud::sample(&link.mesh, settings.spacing, settings.max_samples);
        let clouds = fan.fan(links, sample);
        for (link, cloud) in self.links.iter_mut().zip(clouds) {
            link.cad = cloud.into();
        }
    }
}

/// Loads the model of a folder and collects its findings.
pub(crate) fn load(
    folder: &Path,
    name: &str,
    library: Option<&Path>,
    settings: &Settings,
    findings: &mut Findings,
) -> Option<Model> {
    let library = library.filter(|p| !p.as_os_str().is_empty());
    let roots = match Roots::new(folder, library) {
        Ok(roots) => roots,
        Err(error) => {
            findings.fail(
                folder.display(),
                format!("cannot be opened ({error})"),
                "check the path",
            );
            return None;
        }
    };
    if let Err(what) = roots.check() {
        findings.fail(folder.display(), what, "put the model's folder itself into the library");
        return None;
    }
    let sheet = read_sheet(folder, &roots, settings, findings)?;
    let path = urdf_in(folder, &sheet, &roots, findings)?;
    Loader { name, roots, settings }.load(&path, &sheet, findings)
}

/// The path of the URDF file from which a model's folder is loaded.
///
/// # Errors
/// If `robot.toml` cannot be read, or if there is no URDF file.
pub fn urdf_of(folder: &Path) -> Result<PathBuf> {
    let mut findings = Findings::new(&file_name(folder));
    let roots = Roots::new(folder, None).map_err(|e| Error::from(e).at(folder.display()))?;
    let settings = Settings::default();
    let mut find = || {
        let sheet = read_sheet(folder, &roots, &settings, &mut findings)?;
        urdf_in(folder, &sheet, &roots, &mut findings)
    };
    find().ok_or_else(|| findings.first_error())
}

/// The URDF that `robot.toml` names, else `robot.urdf`, else the only URDF of the folder.
pub(crate) fn urdf_in(
    folder: &Path,
    sheet: &Sheet,
    roots: &Roots,
    findings: &mut Findings,
) -> Option<PathBuf> {
    let Some(written) = &sheet.urdf else {
        let path = find_urdf(folder, findings)?;
        return inside(&path, roots, findings);
    };
    match roots.find(written) {
        Ok(found) => Some(found.path),
        Err(what) => {
            findings.fail("robot.toml: urdf", format!("{what} \"{written}\""), "correct the name");
            None
        }
    }
}

pub(crate) fn read_sheet(
    folder: &Path,
    roots: &Roots,
    settings: &Settings,
    findings: &mut Findings,
) -> Option<Sheet> {
    let path = folder.join("robot.toml");
    if path.symlink_metadata().is_err() {
        return Some(Sheet::default());
    }
    let path = inside(&path, roots, findings)?;
    let text = read_text(&path, settings.max_urdf_bytes, "robot.toml", findings)?;
    match toml::from_str(&text) {
        Ok(sheet) => Some(sheet),
        Err(error) => {
            let what = format!("cannot be read ({})", error.to_string().trim().replace('\n', " "));
            findings.fail("robot.toml", what, "see stages/robot/README.md");
            None
        }
    }
}

/// The path of a file of the model, unless it is a link that leads out of the model's and the
/// library's folder.
fn inside(path: &Path, roots: &Roots, findings: &mut Findings) -> Option<PathBuf> {
    let found = roots.inside(path);
    found.map_err(|what| findings.fail(file_name(path), what, "put the file itself there")).ok()
}

/// `robot.urdf`, or else the only URDF of the folder.
pub(crate) fn find_urdf(folder: &Path, findings: &mut Findings) -> Option<PathBuf> {
    let path = folder.join("robot.urdf");
    if path.is_file() {
        return Some(path);
    }
    match &urdfs(folder)[..] {
        [only] => {
            let name = file_name(only);
            findings.note(
                folder.display(),
                format!("has no robot.urdf; taken instead is \"{name}\""),
                "",
            );
            Some(only.clone())
        }
        [] => {
            findings.fail(folder.display(), "has no robot.urdf", "put the robot's URDF there");
            None
        }
        several => {
            let what = format!("has no robot.urdf, but {} other URDF files", several.len());
            findings.fail(
                folder.display(),
                what,
                "name the right one robot.urdf, or in robot.toml",
            );
            None
        }
    }
}

/// The URDF files of a folder, sorted by name.
pub(crate) fn urdfs(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = (entries.filter_map(|e| e.ok().map(|e| e.path())))
        .filter(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("urdf")) && p.is_file())
        .collect();
    paths.sort();
    paths
}

struct Loader<'a> {
    name: &'a str,
    roots: Roots,
    settings: &'a Settings,
}

impl Loader<'_> {
    fn load(&self, path: &Path, sheet: &Sheet, findings: &mut Findings) -> Option<Model> {
        let file = file_name(path);
        let text = read_xml(path, self.settings.max_urdf_bytes, &file, findings)?;
        let mut description = urdf::read(&text, &file, &self.settings.xml(), findings)?;
        let mut passive = BTreeMap::new();
        let mut moving = Vec::new();
        for sub_chain in &sheet.sub_chain {
            moving.push(self.join(&mut description, sub_chain, findings)?);
        }
        for (at, (sub_chain, moving)) in sheet.sub_chain.iter().zip(moving).enumerate() {
            for name in named_passive(&description, sub_chain, moving, findings)? {
                if passive.insert(name.clone(), at).is_some() {
                    let what = format!("a joint is passive twice \"{name}\"");
                    findings.fail(close::place(sub_chain), what, "let one loop set it");
                    return None;
                }
            }
        }
        let mut tree = tree::build(&description, &passive, &file, findings)?;
        let main_chain = chain::main_chain(&tree, sheet, findings);
        chain::set_roles(&mut tree, &main_chain, sheet, findings);
        let mut model = Model { name: self.name.to_owned(), main_chain, ..Model::default() };
        let bodies = MeshFiles { roots: &self.roots, settings: self.settings };
        bodies.read(&mut tree, &file, findings);
        LinkTree { links: model.links, joints: model.joints, free: model.free, .. } = tree;
        close::close(&mut model, &sheet.sub_chain, findings)?;
        note_links(&mut model, sheet, findings);
        if findings.failed() {
            return None;
        }
        if self.settings.clouds {
            model.sample(self.settings, &OneByOne);
        }
        Some(model)
    }

    /// Adds the links and joints of a sub chain's own URDF and returns the names of its moving
    /// joints.
    fn join(
        &self,
        description: &mut UrdfDescription,
        sub_chain: &SubChain,
        findings: &mut Findings,
    ) -> Option<Vec<String>> {
        let Some(written) = &sub_chain.urdf else {
            return Some(Vec::new());
        };
        let added = self.sub_urdf(description, sub_chain, written, findings)?;
        let moving = (added.joints.iter())
            .filter(|j| j.kind != urdf_rs::JointType::Fixed)
            .map(|j| j.name.clone())
            .collect();
        description.links.extend(added.links);
        description.joints.extend(added.joints);
        Some(moving)
    }

    /// The new links and joints of a sub chain's URDF. Its root link is replaced by the link of the
    /// main URDF that it stands for.
    fn sub_urdf(
        &self,
        main: &UrdfDescription,
        sub_chain: &SubChain,
        written: &str,
        findings: &mut Findings,
    ) -> Option<UrdfDescription> {
        let place = close::place(sub_chain);
        let found = self.roots.find(written).map_err(|what| {
            findings.fail(&place, format!("{what} \"{written}\""), "correct the name");
        });
        let most = self.settings.max_urdf_bytes;
        let text = read_xml(&found.ok()?.path, most, written, findings)?;
        let mut sub = urdf::read(&text, written, &self.settings.xml(), findings)?;
        let children: BTreeSet<String> = sub.joints.iter().map(|j| j.child.clone()).collect();
        let roots: Vec<String> = sub
            .links
            .iter()
            .map(|l| l.name.clone())
            .filter(|name| !children.contains(name))
            .collect();
        let [root] = &roots[..] else {
            findings.fail(
                written,
                format!("a URDF has one root link, this one has {}", roots.len()),
                "join the parts",
            );
            return None;
        };
        let attach = sub_chain.root.as_ref().unwrap_or(root);
        let in_main = |name: &str| main.links.iter().any(|l| l.name == name);
        if !in_main(attach) {
            let what = format!("its root is no link of the main URDF \"{attach}\"");
            findings.fail(&place, what, "set root to the link that the sub chain stands on");
            return None;
        }
        if let Some(link) = sub.links.iter().find(|l| l.name != *root && in_main(&l.name)) {
            let what = format!("a link is in the main URDF too \"{}\"", link.name);
            findings.fail(
                &place,
                what,
                "keep it in one; a whole robot with open pins goes into urdf = at the top",
            );
            return None;
        }
        for joint in sub.joints.iter_mut().filter(|j| j.parent == *root) {
            joint.parent.clone_from(attach);
        }
        sub.links.retain(|l| l.name != *root);
        Some(sub)
    }
}
