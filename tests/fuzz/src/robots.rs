//! Robot descriptions in; a model whose numbers all name something, or a finding that says why not,
//! out.

use crate::{file, folder};
use robot::{Library, Model, Settings, Severity};
use std::path::Path;
use std::sync::OnceLock;

/// The mesh that descriptions name: a tetrahedron of 10 cm.
pub const OBJ: &str = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n";

/// Parts text at its first zero: a URDF file before it, a `robot.toml` after it.
pub fn urdf(data: &[u8]) {
    let at = data.iter().position(|b| *b == 0).unwrap_or(data.len());
    let (description, sheet) = data.split_at(at);
    let path = file("library/urdf/robot.urdf", description);
    let folder = path.parent().expect("it lies in a folder");
    let sheet_path = folder.join("robot.toml");
    match sheet.get(1..) {
        Some(sheet) => std::fs::write(sheet_path, sheet).expect("a sheet can be written"),
        None => drop(std::fs::remove_file(sheet_path)),
    }
    mesh_beside(folder);
    load(folder);
}

/// A `robot.toml` beside a robot of six joints with two loops to close.
pub fn sheet(data: &[u8]) {
    static ONCE: OnceLock<()> = OnceLock::new();
    ONCE.get_or_init(|| drop(file("library/sheet/robot.urdf", six_joints().as_bytes())));
    let path = file("library/sheet/robot.toml", data);
    load(path.parent().expect("it lies in a folder"));
}

/// An STL mesh.
pub fn stl(data: &[u8]) {
    mesh("stl", data);
}

/// An OBJ mesh.
pub fn obj(data: &[u8]) {
    mesh("obj", data);
}

/// A COLLADA mesh.
pub fn dae(data: &[u8]) {
    mesh("dae", data);
}

fn mesh(ending: &str, data: &[u8]) {
    let name = format!("library/{ending}/robot.urdf");
    let path = folder().join(&name);
    if !path.exists() {
        file(&name, with_mesh(&format!("m.{ending}")).as_bytes());
    }
    file(&format!("library/{ending}/m.{ending}"), data);
    load(path.parent().expect("it lies in a folder"));
}

/// Models for targets that need some.
pub fn models() -> &'static [Model] {
    static MODELS: OnceLock<Vec<Model>> = OnceLock::new();
    MODELS.get_or_init(|| {
        let path = file("library/known/robot.urdf", six_joints().as_bytes());
        let folder = path.parent().expect("it lies in a folder");
        vec![Model::load(folder, &Settings::without_clouds()).expect("it is whole").0]
    })
}

fn mesh_beside(folder: &Path) {
    static ONCE: OnceLock<()> = OnceLock::new();
    ONCE.get_or_init(|| std::fs::write(folder.join("m.obj"), OBJ).expect("a mesh can be written"));
}

fn load(folder: &Path) {
    let library = folder.parent().expect("it lies in a library");
    let settings = Settings { spacing: 0.05, max_samples: 500, ..Settings::without_clouds() };
    let (model, findings) = Library::load_folder(library, folder, &settings);
    let failed = findings.iter().any(|f| f.severity == Severity::Error);
    assert_eq!(model.is_none(), failed, "what is left out says why: {findings:?}");
    if let Some(model) = model {
        check(&model);
    }
}

/// All numbers of a model name something, its meshes are finite, and it stands somewhere in every
/// posture.
fn check(model: &Model) {
    let (n_links, n_joints) = (model.links.len(), model.joints.len());
    assert_eq!(n_links, n_joints + 1, "a tree");
    for joint in &model.joints {
        assert!(joint.parent < n_links && joint.child < n_links && joint.child > 0, "links");
        assert!(
            joint.limits.is_none_or(|[a, b]| a.is_finite() && a <= b && b.is_finite()),
            "limits"
        );
    }
    for link in &model.links {
        let (n, mesh) = (link.mesh.vertices.len(), &link.mesh);
        assert!(mesh.triangles.iter().flatten().all(|i| (*i as usize) < n), "corners");
        assert!(mesh.vertices.iter().flatten().all(|v| v.is_finite()), "finite corners");
    }
    assert!(model.main_chain.iter().chain(&model.free).all(|j| *j < n_joints), "joints");
    let middle = |j: &usize| model.joints[*j].limits.map_or(0.0, |[a, b]| 0.5 * (a + b));
    let posture: Vec<f64> = model.free.iter().map(middle).collect();
    let at = model.kinematics(&posture);
    assert_eq!(
        (at.base_from_link.len(), at.twists.len()),
        (n_links, n_links),
        "poses of all links"
    );
}

/// A robot of two links, the second with this mesh.
#[must_use]
pub fn with_mesh(name: &str) -> String {
    format!(
        "<robot name='r'><link name='a'><visual><geometry><box size='.1 .1 .1'/></geometry></visual></link>\
         <link name='b'><visual><geometry><mesh filename='{name}'/></geometry></visual></link>\
         <joint name='j' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>\
         <limit lower='-1' upper='1' effort='1' velocity='1'/></joint></robot>"
    )
}

/// Links `l0` to `l6` on joints `j1` to `j6`, each turned against the one before.
#[must_use]
pub fn six_joints() -> String {
    let link = |i: usize| {
        format!(
            "<link name='l{i}'><visual><geometry><box size='.1 .2 .3'/></geometry></visual></link>"
        )
    };
    let joint = |i: usize| {
        let axis = ["0 0 1", "0 1 0"][i % 2];
        format!(
            "<joint name='j{i}' type='revolute'><origin xyz='0 .1 .3'/><parent link='l{}'/><child link='l{i}'/>\
             <axis xyz='{axis}'/><limit lower='-2' upper='2' effort='1' velocity='1'/></joint>",
            i - 1
        )
    };
    let links: String = (0..=6).map(link).collect();
    let joints: String = (1..=6).map(joint).collect();
    format!("<robot name='six'>{links}{joints}</robot>")
}
