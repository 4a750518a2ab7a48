//! Reads the meshes of a model's links. A mesh that cannot be read becomes a finding, so that all
//! problems of a library are reported at once.

use crate::finding::Findings;
use crate::mesh;
use crate::model::JointKind;
use crate::reading::{file_name, read_bytes};
use crate::resolve::Roots;
use crate::settings::Settings;
use crate::tree::LinkTree;
use crate::urdf::{UrdfBody, UrdfShape};
use geometry::Aabb;
use std::sync::Arc;

/// Largest plausible size of a link, metres; a larger one was probably drawn in millimetres.
const LARGEST_LINK: f64 = 30.0;
/// Size from which on a link is refused, metres. No beam of a gantry is as long, but a part of 0.1
/// m that was drawn in millimetres is.
const FAR_TOO_LARGE: f64 = 100.0;
/// Size below which a link is refused, metres: a part of 1 mm that was scaled to metres twice.
const FAR_TOO_SMALL: f64 = 1e-5;

/// Reads meshes from the folders of a model within limits on their size.
pub(crate) struct MeshFiles<'a> {
    pub(crate) roots: &'a Roots,
    pub(crate) settings: &'a Settings,
}

impl MeshFiles<'_> {
    /// Reads the meshes of all links into the tree.
    pub(crate) fn read(&self, tree: &mut LinkTree, file: &str, findings: &mut Findings) {
        let mut any = false;
        let shown = shown(tree);
        for ((link, raw), shown) in tree.links.iter_mut().zip(&tree.raw_links).zip(shown) {
            let place = format!("{file}: link {}", link.name);
            let mesh = Arc::make_mut(&mut link.mesh);
            for body in &raw.visuals {
                self.body(mesh, body, &place, findings);
            }
            let is_padding = shown && raw.visuals.is_empty();
            let collisions = if is_padding { &[][..] } else { &raw.collisions[..] };
            if mesh.triangles.is_empty() && !collisions.is_empty() {
                for body in collisions {
                    self.body(mesh, body, &place, findings);
                }
                if !mesh.triangles.is_empty() {
                    let what =
                        "has no visual; its collision mesh is used instead and may be a hull";
                    findings.warn(&place, what, "add a visual");
                }
            }
            if mesh.triangles.is_empty() && !(raw.visuals.is_empty() && collisions.is_empty()) {
                findings.warn(&place, "has no surface", "correct its visual");
            }
            any |= !mesh.triangles.is_empty();
            link.bounds = Aabb::of(mesh.vertices.iter().map(|p| p.map(f64::from)));
            let size = link.bounds.size().into_iter().fold(0.0, f64::max);
            let in_millimetres = "if it is drawn in millimetres, add scale=\"0.001 0.001 0.001\"";
            if size > FAR_TOO_LARGE {
                let what = format!("is far larger than any robot's link, metres \"{size:.1}\"");
                findings.fail(&place, what, in_millimetres);
            } else if !mesh.triangles.is_empty() && size < FAR_TOO_SMALL {
                let what = format!("is too small for any scanner, metres \"{size:e}\"");
                findings.fail(&place, what, "correct the scale of its mesh");
            } else if size > LARGEST_LINK {
                let what = format!("is larger than any robot's link, metres \"{size:.1}\"");
                findings.warn(&place, what, in_millimetres);
            }
        }
        if !any {
            findings.fail(file, "no link has a surface, so no scan can show it", "add meshes");
        }
    }

    fn body(&self, into: &mut crate::Mesh, body: &UrdfBody, place: &str, findings: &mut Findings) {
        use mesh::primitive;
        let positive = |sizes: &[f64]| sizes.iter().all(|s| *s > 0.0);
        let (soup, scale) = match &body.shape {
            UrdfShape::Box(size) if positive(size) => (primitive::cuboid(*size), [1.0; 3]),
            UrdfShape::Cylinder { radius, length } if positive(&[*radius, *length]) => {
                (primitive::cylinder(*radius, *length), [1.0; 3])
            }
            UrdfShape::Capsule { radius, length } if positive(&[*radius, *length]) => {
                (primitive::capsule(*radius, *length), [1.0; 3])
            }
            UrdfShape::Sphere(radius) if positive(&[*radius]) => {
                (primitive::sphere(*radius), [1.0; 3])
            }
            UrdfShape::Mesh { path, scale } if scale.iter().all(|s| *s != 0.0) => {
                let Some(soup) = self.mesh(path, place, findings) else {
                    return;
                };
                (soup, *scale)
            }
            _ => {
                findings.warn(
                    place,
                    "has a body without extent, which is ignored",
                    "give sizes above zero",
                );
                return;
            }
        };
        let n_broken = mesh::append(into, &soup, &body.link_from_body, scale);
        if n_broken > 0 {
            findings.warn(
                place,
                format!("triangles with non-finite corners were left out \"{n_broken}\""),
                "",
            );
        }
    }

    fn mesh(&self, written: &str, place: &str, findings: &mut Findings) -> Option<mesh::Soup> {
        let found = match self.roots.find(written) {
            Ok(found) => found,
            Err(what) => {
                findings.warn(
                    place,
                    format!("{what} \"{written}\""),
                    "put the mesh there, or correct its path",
                );
                return None;
            }
        };
        let place = format!("{place}: {written}");
        if found.other_case {
            let name = file_name(&found.path);
            findings.warn(
                &place,
                format!("is there with other upper and lower case \"{name}\""),
                "correct the path",
            );
        }
        let extension =
            found.path.extension().map_or_else(String::new, |e| e.to_string_lossy().into_owned());
        let soup = read_bytes(&found.path, self.settings.max_mesh_bytes, "max_mesh_bytes")
            .and_then(|bytes| mesh::read(&bytes, &extension, self.settings));
        match soup {
            Ok(soup) => {
                for note in &soup.notes {
                    findings.note(&place, note.as_str(), "");
                }
                Some(soup)
            }
            Err(what) => {
                findings.warn(&place, what, "repair or replace the mesh");
                None
            }
        }
    }
}

/// For each link, whether it is rigidly connected to a link that has a visual. The collision bodies
/// of such a link are capsules around that visual, drawn for collision checks, and no surface that
/// a scan could show.
fn shown(tree: &LinkTree) -> Vec<bool> {
    let mut leader: Vec<usize> = (0..tree.links.len()).collect();
    for l in 0..leader.len() {
        let joint = tree.links[l].parent_joint.map(|j| &tree.joints[j]);
        if let Some(joint) = joint.filter(|joint| joint.kind == JointKind::Fixed) {
            leader[l] = leader[joint.parent];
        }
    }
    let mut is_shown = vec![false; leader.len()];
    for (l, raw) in tree.raw_links.iter().enumerate() {
        is_shown[leader[l]] |= !raw.visuals.is_empty();
    }
    leader.into_iter().map(|l| is_shown[l]).collect()
}
