//! Finds the main chain of a model and the role of each link.

use crate::finding::Findings;
use crate::model::{Motion, Role};
use crate::sheet::Sheet;
use crate::tree::LinkTree;

/// Indices of the joints from link `root` down to link `tip`, or `None` if `tip` is not below
/// `root`.
pub(crate) fn path(tree: &LinkTree, root: usize, tip: usize) -> Option<Vec<usize>> {
    let mut joints = Vec::new();
    let mut at = tip;
    while at != root {
        let joint = tree.links[at].parent_joint?;
        joints.push(joint);
        at = tree.joints[joint].parent;
    }
    joints.reverse();
    Some(joints)
}

/// Joints of the main chain: the one that `robot.toml` names, else the chain with most free joints,
/// among equals the longest, then the first.
pub(crate) fn main_chain(tree: &LinkTree, sheet: &Sheet, findings: &mut Findings) -> Vec<usize> {
    let mut find = |name: &Option<String>| {
        let name = name.as_ref()?;
        let at = tree.links.iter().position(|l| l.name == *name);
        if at.is_none() {
            findings.fail(
                "robot.toml: main_chain",
                format!("no such link \"{name}\""),
                "correct the name",
            );
        }
        at
    };
    let root = find(&sheet.main_chain.root).unwrap_or(0);
    if let Some(tip) = find(&sheet.main_chain.tip) {
        return path(tree, root, tip).unwrap_or_else(|| {
            findings.fail(
                "robot.toml: main_chain",
                "the tip is not connected to the root",
                "name two links of one chain",
            );
            Vec::new()
        });
    }
    let mut best = (0, 0, Vec::new());
    for tip in 0..tree.links.len() {
        let Some(joints) = path(tree, root, tip) else {
            continue;
        };
        let n_free =
            joints.iter().filter(|&&j| matches!(tree.joints[j].motion, Motion::Free(_))).count();
        if (n_free, joints.len()) > (best.0, best.1) {
            best = (n_free, joints.len(), joints);
        }
    }
    best.2
}

/// Sets the role of each link: main chain, sub chain or effector.
pub(crate) fn set_roles(
    tree: &mut LinkTree,
    main_chain: &[usize],
    sheet: &Sheet,
    findings: &mut Findings,
) {
    let moving = |tree: &LinkTree, j: usize| tree.joints[j].motion != Motion::Fixed;
    let last =
        main_chain.iter().rev().copied().find(|&j| moving(tree, j)).map(|j| tree.joints[j].child);
    let on_chain: Vec<usize> = main_chain.iter().map(|&j| tree.joints[j].child).collect();
    let mut named = vec![false; tree.links.len()];
    for name in sheet.effector.links.iter().chain(&sheet.effector.root) {
        match tree.links.iter().position(|l| l.name == *name) {
            Some(at) => named[at] = true,
            None => findings.fail(
                "robot.toml: effector",
                format!("no such link \"{name}\""),
                "correct the name",
            ),
        }
    }
    // Links come after their parents, so each inherits the role of its parent.
    let mut beyond = vec![false; tree.links.len()];
    let mut tool = vec![false; tree.links.len()];
    let mut followed = vec![false; tree.links.len()];
    for at in 0..tree.links.len() {
        if let Some(j) = tree.links[at].parent_joint {
            let parent = tree.joints[j].parent;
            beyond[at] = beyond[parent] || Some(parent) == last;
            tool[at] = tool[parent];
            let follows = matches!(tree.joints[j].motion, Motion::Loop(_) | Motion::Mimic { .. });
            followed[at] = !on_chain.contains(&at) && (followed[parent] || follows);
        }
        tool[at] |= sheet.effector.root.as_ref() == Some(&tree.links[at].name);
        tree.links[at].role = if beyond[at] || tool[at] || named[at] {
            Role::Effector
        } else if followed[at] {
            Role::Sub
        } else {
            Role::Main
        };
    }
}
