//! Checks the links and joints of a description and orders them as a tree: one root, unique names,
//! parents before children. Also determines what sets each joint.

use crate::finding::Findings;
use crate::model::{Joint, JointKind, Link, Motion, Role};
use crate::urdf::{RawJoint, RawLink, UrdfDescription};
use geometry::{Aabb, Vector};
use nalgebra::Unit;
use std::collections::{BTreeMap, BTreeSet};

/// Largest number of links of a model; a humanoid with hands has a few hundred.
const MAX_LINKS: usize = 5_000;

/// Links and joints in tree order.
#[derive(Debug, Default)]
pub(crate) struct LinkTree {
    pub(crate) links: Vec<Link>,
    pub(crate) raw_links: Vec<RawLink>,
    pub(crate) joints: Vec<Joint>,
    pub(crate) free: Vec<usize>,
}

/// Checks and orders a description. `passive` maps the names of joints that loops set to the index
/// of the loop.
pub(crate) fn build(
    description: &UrdfDescription,
    passive: &BTreeMap<String, usize>,
    file: &str,
    findings: &mut Findings,
) -> Option<LinkTree> {
    let before = findings.list.len();
    let by_name = names(description, file, findings);
    check_joints(description, passive, &by_name, file, findings);
    if findings.list[before..].iter().any(|f| f.severity == crate::Severity::Error) {
        return None;
    }
    let mut children: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    let mut carried: BTreeSet<&str> = BTreeSet::new();
    for (at, joint) in description.joints.iter().enumerate() {
        children.entry(&joint.parent).or_default().push(at);
        if !carried.insert(&joint.child) {
            let what =
                format!("is carried by more than one joint; a URDF is a tree \"{}\"", joint.child);
            findings.fail(format!("{file}: link"), what, "describe the loop in robot.toml");
            return None;
        }
    }
    let mut roots = description.links.iter().filter(|l| !carried.contains(l.name.as_str()));
    let (Some(root), None) = (roots.next(), roots.next()) else {
        let n = description.links.iter().filter(|l| !carried.contains(l.name.as_str())).count();
        findings.fail(
            file,
            format!("a URDF has one root link, this one has {n}"),
            "join the parts, or break the circle",
        );
        return None;
    };
    let mut tree = LinkTree::default();
    tree.grow(description, &children, by_name[root.name.as_str()]);
    if tree.links.len() != description.links.len() {
        findings.fail(file, "joints form a circle", "describe the loop in robot.toml");
        return None;
    }
    tree.set_motions(description, passive, file, findings)?;
    Some(tree)
}

fn names<'a>(
    description: &'a UrdfDescription,
    file: &str,
    findings: &mut Findings,
) -> BTreeMap<&'a str, usize> {
    if description.links.is_empty() {
        findings.fail(file, "has no links", "give a URDF with links");
    }
    if description.links.len() > MAX_LINKS {
        findings.fail(
            file,
            format!("has more links than a robot \"{}\"", description.links.len()),
            "",
        );
    }
    let mut by_name = BTreeMap::new();
    for (at, link) in description.links.iter().enumerate() {
        if link.name.is_empty() {
            findings.fail(format!("{file}: link"), "has an empty name", "name it");
        }
        if by_name.insert(link.name.as_str(), at).is_some() {
            findings.fail(
                format!("{file}: link"),
                format!("is there twice \"{}\"", link.name),
                "rename one",
            );
        }
    }
    let mut seen = BTreeSet::new();
    for joint in &description.joints {
        if !seen.insert(joint.name.as_str()) {
            findings.fail(
                format!("{file}: joint"),
                format!("is there twice \"{}\"", joint.name),
                "rename one",
            );
        }
    }
    by_name
}

fn check_joints(
    description: &UrdfDescription,
    passive: &BTreeMap<String, usize>,
    links: &BTreeMap<&str, usize>,
    file: &str,
    findings: &mut Findings,
) {
    use urdf_rs::JointType as T;
    for joint in &description.joints {
        let place = format!("{file}: joint {}", joint.name);
        for (end, name) in [("parent", &joint.parent), ("child", &joint.child)] {
            if !links.contains_key(name.as_str()) {
                findings.fail(
                    &place,
                    format!("its {end} is no link \"{name}\""),
                    "add the link, or correct the name",
                );
            }
        }
        if matches!(joint.kind, T::Floating | T::Planar | T::Spherical) {
            let what =
                format!("a joint type that is not supported \"{:?}\"", joint.kind).to_lowercase();
            findings.fail(&place, what, "use revolute, continuous, prismatic or fixed");
        }
        check_axis(joint, &place, findings);
        let follows = joint.mimic.is_some() || passive.contains_key(&joint.name);
        check_limits(joint, follows, &place, findings);
    }
}

/// Checks the length of the axis of a joint that moves. Here it has no meaning, but some readers
/// take it for a gear ratio, and rerun makes quaternions of it that are no unit ones.
fn check_axis(joint: &RawJoint, place: &str, findings: &mut Findings) {
    /// Difference from one that is rounding.
    const ROUNDED: f64 = 1e-3;
    if joint.kind == urdf_rs::JointType::Fixed {
        return;
    }
    let length = Vector::from(joint.axis).norm();
    if length < 1e-9 {
        findings.fail(place, "its axis has length zero", "give an axis such as \"0 0 1\"");
    } else if (length - 1.0).abs() > ROUNDED {
        let what = format!("its axis has length {length:.4}: it is taken as a unit vector");
        findings.warn(
            place,
            what,
            "make it one: yourdfpy, PyBullet and rerun move the link by another value",
        );
    }
}

/// Checks the limits of a joint; `follows` says whether another joint or a loop sets its value.
fn check_limits(joint: &RawJoint, follows: bool, place: &str, findings: &mut Findings) {
    use urdf_rs::JointType as T;
    if !matches!(joint.kind, T::Revolute | T::Prismatic) {
        return;
    }
    match joint.limits {
        None if follows => {}
        None if joint.kind == T::Prismatic => findings.fail(
            place,
            "a prismatic joint without limits",
            "add <limit lower=.. upper=../>",
        ),
        None => findings.warn(
            place,
            "a revolute joint without limits is taken as continuous",
            "add a <limit>",
        ),
        Some([lower, upper]) if lower > upper => {
            let what = format!("its lower limit is above the upper \"{lower} > {upper}\"");
            findings.fail(place, what, "swap them");
        }
        Some([lower, upper]) if lower == upper && !follows => findings.warn(
            place,
            format!("its lower and upper limit are equal \"{lower}\""),
            "make it fixed",
        ),
        Some([lower, upper]) if joint.kind == T::Revolute && upper - lower > 100.0 => {
            findings.warn(place, "its limits look like degrees", "write radians");
        }
        Some(_) => {}
    }
}

impl LinkTree {
    /// Adds links depth first in the order of the file, so that a serial chain stays together.
    fn grow(
        &mut self,
        description: &UrdfDescription,
        children: &BTreeMap<&str, Vec<usize>>,
        root: usize,
    ) {
        let mut stack = vec![(root, None::<(usize, usize)>)];
        while let Some((raw, via)) = stack.pop() {
            let at = self.links.len();
            let parent_joint = via.map(|(joint, parent)| {
                self.joints.push(plain_joint(&description.joints[joint], parent, at));
                self.joints.len() - 1
            });
            let raw_link = &description.links[raw];
            self.links.push(Link {
                name: raw_link.name.clone(),
                role: Role::Main,
                parent_joint,
                mesh: Default::default(),
                cad: Default::default(),
                bounds: Aabb::EMPTY,
            });
            self.raw_links.push(raw_link.clone());
            for &joint in children.get(raw_link.name.as_str()).into_iter().flatten().rev() {
                let child = &description.joints[joint].child;
                if let Some(raw_child) = description.links.iter().position(|l| l.name == *child) {
                    stack.push((raw_child, Some((joint, at))));
                }
            }
        }
    }

    fn set_motions(
        &mut self,
        description: &UrdfDescription,
        passive: &BTreeMap<String, usize>,
        file: &str,
        findings: &mut Findings,
    ) -> Option<()> {
        let raw: BTreeMap<&str, &RawJoint> =
            description.joints.iter().map(|j| (j.name.as_str(), j)).collect();
        let mut free_of: BTreeMap<&str, usize> = BTreeMap::new();
        for (at, joint) in self.joints.iter_mut().enumerate() {
            let written = raw[joint.name.as_str()];
            joint.motion = if joint.kind == JointKind::Fixed {
                Motion::Fixed
            } else if let Some(&index) = passive.get(&joint.name) {
                Motion::Loop(index)
            } else if written.mimic.is_some() {
                continue;
            } else {
                free_of.insert(&written.name, self.free.len());
                self.free.push(at);
                Motion::Free(self.free.len() - 1)
            };
        }
        for joint in &mut self.joints {
            let written = raw[joint.name.as_str()];
            if joint.motion != Motion::Fixed
                || joint.kind == JointKind::Fixed
                || written.mimic.is_none()
            {
                continue;
            }
            let place = format!("{file}: joint {}", joint.name);
            match follow(written, &raw, &free_of) {
                Ok((free, multiplier, offset)) => {
                    joint.motion = Motion::Mimic { free, multiplier, offset }
                }
                Err(what) => {
                    findings.fail(place, what, "let it mimic a joint that moves by itself");
                    return None;
                }
            }
        }
        Some(())
    }
}

fn plain_joint(raw: &RawJoint, parent: usize, child: usize) -> Joint {
    use urdf_rs::JointType as T;
    let kind = match raw.kind {
        T::Revolute if raw.limits.is_none() && raw.mimic.is_none() => JointKind::Continuous,
        T::Revolute => JointKind::Revolute,
        T::Continuous => JointKind::Continuous,
        T::Prismatic => JointKind::Prismatic,
        _ => JointKind::Fixed,
    };
    let limits = raw.limits.filter(|_| matches!(kind, JointKind::Revolute | JointKind::Prismatic));
    let axis = Unit::try_new(Vector::from(raw.axis), 1e-9).unwrap_or(Vector::x_axis());
    let axis = if kind == JointKind::Fixed { Vector::x_axis() } else { axis };
    Joint {
        name: raw.name.clone(),
        kind,
        parent,
        child,
        parent_from_joint: raw.parent_from_joint,
        axis,
        limits,
        motion: Motion::Fixed,
    }
}

/// Follows a chain of mimics to the free joint at its end. Returns the index of that joint's entry
/// in the posture, and the combined factor and offset.
fn follow(
    joint: &RawJoint,
    raw: &BTreeMap<&str, &RawJoint>,
    free_of: &BTreeMap<&str, usize>,
) -> Result<(usize, f64, f64), String> {
    let (mut multiplier, mut offset) = (1.0, 0.0);
    let mut at = joint;
    for _ in 0..=raw.len() {
        let Some((target, m, o)) = &at.mimic else {
            return Err(format!(
                "mimics a joint that a loop sets or that does not move \"{}\"",
                at.name
            ));
        };
        offset += multiplier * o;
        multiplier *= m;
        let Some(next) = raw.get(target.as_str()) else {
            return Err(format!("mimics a joint that is not there \"{target}\""));
        };
        if let Some(&free) = free_of.get(target.as_str()) {
            return Ok((free, multiplier, offset));
        }
        at = next;
    }
    Err(format!("mimics in a circle \"{}\"", joint.name))
}
