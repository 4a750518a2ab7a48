//! Writes a fitted robot as planners load it: a URDF with meshes, attached things as convex pieces
//! of its links, and the posture as YAML and CSV.
//! ```text
//! robots/R1/robot.urdf        links, joints, limits; closed loops are open, see joints.csv
//! robots/R1/meshes/*.stl      metres, frames of the links
//! robots/R1/joints.yaml       name: value, as ROS loads it
//! robots/R1/joints.csv        name, value, unit, deviation, determined, limits, certainty
//! ```

use crate::atomic;
use contract::{Fit, JointFit, Result, quote};
use geometry::{Pose, STL_HEAD, STL_TRIANGLE, roll_pitch_yaw};
use robot::{Joint, JointKind, Mesh, Model, Motion};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Writes the robot with this id; `hanging` holds convex pieces by index of the link.
///
/// # Errors
/// If a file cannot be written.
pub fn write_robot(
    out: &Path,
    id: &str,
    fit: &Fit,
    model: &Model,
    hanging: &BTreeMap<usize, Vec<Mesh>>,
) -> Result<String> {
    let folder = format!("robots/{id}");
    let dir = out.join(&folder);
    let names = file_names(model);
    let mut links = String::new();
    for (l, link) in model.links.iter().enumerate() {
        let mut bodies = Vec::new();
        if !link.mesh.triangles.is_empty() {
            bodies.push((names[l].clone(), &*link.mesh));
        }
        let pieces = hanging.get(&l).into_iter().flatten().enumerate();
        bodies.extend(pieces.map(|(k, mesh)| (format!("{}_hanging_{k}", names[l]), mesh)));
        let _ = writeln!(links, "  <link name=\"{}\">", quote::xml(&link.name));
        for (name, mesh) in bodies {
            atomic::write(&dir.join(format!("meshes/{name}.stl")), &mesh.to_stl())?;
            for kind in ["visual", "collision"] {
                let _ = writeln!(
                    links,
                    "    <{kind}><geometry><mesh filename=\"meshes/{name}.stl\"/></geometry></{kind}>"
                );
            }
        }
        links.push_str("  </link>\n");
    }
    let joints: String = model.joints.iter().map(|j| joint(model, j)).collect();
    let urdf = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n{links}{joints}</robot>\n",
        quote::xml(&format!("{id} {}", fit.model_name))
    );
    atomic::write(&dir.join("robot.urdf"), urdf.as_bytes())?;
    atomic::write(&dir.join("joints.yaml"), yaml(fit, model).as_bytes())?;
    atomic::write(&dir.join("joints.csv"), csv(fit, model).as_bytes())?;
    Ok(folder)
}

/// Path (relative to the output folder) and length in bytes of each link's mesh file, for the robot
/// with this id; `None` for links without a body.
#[must_use]
pub fn mesh_files(id: &str, model: &Model) -> Vec<Option<(String, u64)>> {
    let of_link = |(link, name): (&robot::Link, String)| {
        let n = link.mesh.triangles.len();
        let n_bytes = (STL_HEAD + STL_TRIANGLE * n) as u64;
        (n > 0).then(|| (format!("robots/{id}/meshes/{name}.stl"), n_bytes))
    };
    model.links.iter().zip(file_names(model)).map(of_link).collect()
}

/// A unique name for the files of each link, valid on every file system.
fn file_names(model: &Model) -> Vec<String> {
    let all = model.links.iter().enumerate();
    all.map(|(l, link)| format!("{l:02}_{}", quote::file_name(&link.name))).collect()
}

fn joint(model: &Model, joint: &Joint) -> String {
    let kind = match joint.kind {
        JointKind::Revolute => "revolute",
        JointKind::Continuous => "continuous",
        JointKind::Prismatic => "prismatic",
        JointKind::Fixed => "fixed",
    };
    let [parent, child] = [joint.parent, joint.child].map(|l| quote::xml(&model.links[l].name));
    let mut text = format!(
        "  <joint name=\"{}\" type=\"{kind}\">\n    {}\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n",
        quote::xml(&joint.name),
        origin(&joint.parent_from_joint)
    );
    if joint.kind != JointKind::Fixed {
        let a = joint.axis;
        let _ = writeln!(text, "    <axis xyz=\"{:.9} {:.9} {:.9}\"/>", a.x, a.y, a.z);
    }
    if let Some([low, high]) = joint.limits {
        let _ = writeln!(
            text,
            "    <limit lower=\"{low:.9}\" upper=\"{high:.9}\" effort=\"0\" velocity=\"0\"/>"
        );
    }
    if let Motion::Mimic { free, multiplier, offset } = joint.motion {
        let driver = quote::xml(&model.joints[model.free[free]].name);
        let _ = writeln!(
            text,
            "    <mimic joint=\"{driver}\" multiplier=\"{multiplier:.9}\" offset=\"{offset:.9}\"/>"
        );
    }
    text + "  </joint>\n"
}

fn origin(pose: &Pose) -> String {
    let (p, [roll, pitch, yaw]) = (pose.translation.vector, roll_pitch_yaw(&pose.rotation));
    format!(
        "<origin xyz=\"{:.9} {:.9} {:.9}\" rpy=\"{roll:.9} {pitch:.9} {yaw:.9}\"/>",
        p.x, p.y, p.z
    )
}

/// Index and value of every joint that moves, including those of closed loops.
fn values(fit: &Fit, model: &Model) -> Vec<(usize, f64)> {
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    let all = model.joint_values(&posture);
    (0..all.len())
        .filter(|&j| model.joints[j].kind != JointKind::Fixed)
        .map(|j| (j, all[j]))
        .collect()
}

fn yaml(fit: &Fit, model: &Model) -> String {
    let pose = &fit.world_from_base;
    let (p, q) = (pose.translation.vector, pose.rotation);
    let mut text = format!(
        "# {}: metres and radians\nbase:\n  link: {}\n  xyz: [{:.6}, {:.6}, {:.6}]\n  quat_wxyz: [{:.9}, {:.9}, {:.9}, {:.9}]\njoints:\n",
        fit.verdict.word(),
        quote::yaml(&model.links[0].name),
        p.x,
        p.y,
        p.z,
        q.w,
        q.i,
        q.j,
        q.k
    );
    for (j, value) in values(fit, model) {
        let open = joint_fit(fit, model, j).filter(|f| !f.is_determined());
        let open = open
            .map_or_else(String::new, |f| format!("  # {}, ± {:.4}", f.certainty.word(), f.sigma));
        let _ = writeln!(text, "  {}: {value:.9}{open}", quote::yaml(&model.joints[j].name));
    }
    text
}

/// The fit of a joint of the model; `None` if it follows other joints.
fn joint_fit<'a>(fit: &'a Fit, model: &Model, joint: usize) -> Option<&'a JointFit> {
    model.free.iter().position(|&f| f == joint).and_then(|free| fit.joints.get(free))
}

fn csv(fit: &Fit, model: &Model) -> String {
    let mut text = String::from("joint,value,unit,sigma,determined,lower,upper,certainty\n");
    for (j, value) in values(fit, model) {
        let joint = &model.joints[j];
        let unit = if joint.kind == JointKind::Prismatic { "m" } else { "rad" };
        let own = joint_fit(fit, model, j);
        let is_determined =
            own.map_or_else(|| ",".into(), |f| format!("{:.9},{}", f.sigma, f.is_determined()));
        let limits = joint.limits.map_or_else(|| ",".into(), |[a, b]| format!("{a:.9},{b:.9}"));
        let name = quote::csv(&joint.name);
        let word = own.map_or("", |f| f.certainty.word());
        let _ = writeln!(text, "{name},{value:.9},{unit},{is_determined},{limits},{word}");
    }
    text
}
