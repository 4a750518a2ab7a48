//! Applies the entries of `robot.toml` about passive joints, symmetries and single links.

use crate::close;
use crate::finding::Findings;
use crate::model::{JointKind, Model, Symmetry};
use crate::sheet::{Sheet, SubChain};
use crate::urdf::UrdfDescription;
use geometry::Vector;
use nalgebra::Unit;

/// Indices of the joints that the loops of a sub chain set: those that `robot.toml` names, else the
/// `moving` joints of the sub chain's own URDF.
pub(crate) fn named_passive(
    description: &UrdfDescription,
    sub_chain: &SubChain,
    moving: Vec<String>,
    findings: &mut Findings,
) -> Option<Vec<String>> {
    let place = close::place(sub_chain);
    let named = match &sub_chain.passive {
        Some(named) => named.clone(),
        None if sub_chain.closures.is_empty() => Vec::new(),
        None if sub_chain.urdf.is_some() => moving,
        None => {
            findings.fail(&place, "does not say which joints its loop sets", "add passive = [..]");
            return None;
        }
    };
    for name in &named {
        if !description
            .joints
            .iter()
            .any(|j| j.name == *name && j.kind != urdf_rs::JointType::Fixed)
        {
            findings.fail(
                &place,
                format!("a passive joint is not there or is fixed \"{name}\""),
                "correct the name",
            );
            return None;
        }
    }
    Some(named)
}

/// Applies the entries of `robot.toml` about single links.
pub(crate) fn note_links(model: &mut Model, sheet: &Sheet, findings: &mut Findings) {
    for note in &sheet.link {
        let place = format!("robot.toml: link {}", note.name);
        let Some(link) = model.link(&note.name) else {
            findings.fail(&place, "no such link", "correct the name");
            continue;
        };
        if let Some(turn) = &note.symmetry {
            match Unit::try_new(Vector::from(turn.axis), 1e-9) {
                Some(axis) if turn.through.iter().all(|v| v.is_finite()) => {
                    model.symmetries.push(Symmetry {
                        link,
                        axis,
                        through: turn.through.into(),
                        order: turn.order,
                    });
                }
                _ => findings.fail(
                    &place,
                    "its symmetry has no axis",
                    "give a direction such as [0, 0, 1]",
                ),
            }
        }
        if let Some(sigma) = note.mesh_sigma {
            if sigma.is_finite() && sigma >= 0.0 {
                model.mesh_sigmas.push((link, sigma));
            } else {
                findings.fail(
                    &place,
                    format!("mesh_sigma is not a length in metres \"{sigma}\""),
                    "write metres",
                );
            }
        }
        if let Some(text) = &note.note {
            findings.note(&place, text.clone(), "");
        }
    }
    let n_moving = model.joints.iter().filter(|j| j.kind != JointKind::Fixed).count();
    if model.free.is_empty() && n_moving == 0 {
        findings.warn("", "no joint moves: this is a static object, not a robot", "");
    }
}
