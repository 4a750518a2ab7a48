//! Rewrites the text of a URDF with some joint origins moved. All other text stays as it was,
//! except for the declared encoding: the result is UTF-8.

use crate::encoding;
use crate::settings::Settings;
use crate::urdf::{self, has_quaternions};
use contract::{Error, Result};
use geometry::{Pose, Vector, roll_pitch_yaw};
use nalgebra::{Translation3, UnitQuaternion};
use roxmltree::{Document, Node};

/// Moves the origins of the named joints, each by a pose in the joint's own frame
/// (`model_joint_from_joint`, metres), and returns the new text.
///
/// # Errors
/// If the text is no URDF, or if it has no joint of that name.
pub fn correct(text: &str, moves: &[(String, Pose)]) -> Result<String> {
    let text = encoding::declare_utf8(text);
    contract::check_xml(text.as_bytes(), &Settings::default().xml()).map_err(Error::bad_input)?;
    let document = Document::parse(&text)
        .map_err(|e| Error::bad_input(format!("not well-formed XML ({e})")))?;
    let turns = has_quaternions(document.root_element());
    let mut edits: Vec<(std::ops::Range<usize>, String)> = Vec::new();
    for (name, moved) in moves {
        let is_it = |n: &Node<'_, '_>| n.has_tag_name("joint") && n.attribute("name") == Some(name);
        let joint = document
            .root_element()
            .children()
            .find(is_it)
            .ok_or_else(|| Error::bad_input(format!("there is no joint '{name}'")))?;
        let origin = joint.children().find(|n| n.has_tag_name("origin"));
        let corrected = origin.map_or_else(Pose::identity, |n| pose(&n, turns)) * moved;
        let (p, [roll, pitch, yaw]) =
            (corrected.translation.vector, roll_pitch_yaw(&corrected.rotation));
        let written = format!(
            "<origin xyz=\"{:.9} {:.9} {:.9}\" rpy=\"{roll:.9} {pitch:.9} {yaw:.9}\"/>",
            p.x, p.y, p.z
        );
        match origin {
            Some(origin) => edits.push((origin.range(), written)),
            None => {
                let Some(first) = joint.first_child() else {
                    return Err(Error::bad_input(format!("joint '{name}' is empty")));
                };
                edits.push((first.range().start..first.range().start, written));
            }
        }
    }
    edits.sort_by_key(|e| e.0.start);
    let mut out = String::with_capacity(text.len() + 100 * edits.len());
    let mut from = 0;
    for (range, written) in edits {
        out.push_str(&text[from..range.start]);
        out.push_str(&written);
        from = range.end;
    }
    out.push_str(&text[from..]);
    Ok(out)
}

/// The pose of an `<origin>`; a word that is no number counts as zero, as when a model is loaded.
/// `turns` says whether `quat_xyzw` is supported in this file.
fn pose(origin: &Node<'_, '_>, turns: bool) -> Pose {
    let vector = |name: &str| {
        let mut numbers = origin
            .attribute(name)
            .unwrap_or("")
            .split_whitespace()
            .map(|w| w.parse().unwrap_or(0.0));
        Vector::from_fn(|_, _| numbers.next().unwrap_or(0.0))
    };
    let (xyz, rpy) = (vector("xyz"), vector("rpy"));
    let quaternion = origin.attribute("quat_xyzw").filter(|_| turns).and_then(urdf::turn);
    let turn = quaternion.unwrap_or_else(|| UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z));
    Pose::from_parts(Translation3::from(xyz), turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_moved_and_the_rest_is_left() {
        let text = "<robot name=\"r\"><!-- kept --><joint name=\"a\" type=\"revolute\">\
                    <origin xyz=\"1 2 3\" rpy=\"0 0 1.5707963267948966\"/><axis xyz=\"0 0 1\"/></joint>\
                    <joint name=\"b\" type=\"fixed\"><parent link=\"x\"/></joint></robot>";
        let moved = Pose::translation(0.1, 0.0, 0.0);
        let out = correct(text, &[("a".into(), moved), ("b".into(), moved)]).expect("is a URDF");
        assert!(out.contains("xyz=\"1.000000000 2.100000000 3.000000000\""), "{out}");
        assert!(out.contains("<origin xyz=\"0.100000000 0.000000000 0.000000000\""), "{out}");
        assert!(out.contains("<!-- kept -->") && out.contains("<axis xyz=\"0 0 1\"/>"));
        assert!(correct(text, &[("c".into(), moved)]).is_err());
    }

    #[test]
    fn a_quaternion_is_moved_as_the_reader_reads_it() {
        // The quaternion is a quarter turn about z, so that a move along x goes along y. In URDF
        // 1.0 it is ignored.
        let text = |version: &str| {
            format!(
                "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><robot{version}><joint name=\"a\">\
                 <origin xyz=\"1 2 3\" quat_xyzw=\"0 0 2 2\"/></joint></robot>"
            )
        };
        let moves = [("a".to_owned(), Pose::translation(0.1, 0.0, 0.0))];
        let out = correct(&text(" version=\"1.1\""), &moves).expect("is a URDF");
        assert!(out.contains("xyz=\"1.000000000 2.100000000 3.000000000\""), "{out}");
        assert!(
            out.contains("rpy=\"0.000000000 -0.000000000 1.570796327\"")
                || out.contains("0.000000000 1.570796327"),
            "{out}"
        );
        assert!(out.starts_with("<?xml version=\"1.0\" encoding=\"UTF-8\"?>"), "{out}");
        let out = correct(&text(""), &moves).expect("is a URDF");
        assert!(out.contains("xyz=\"1.100000000 2.000000000 3.000000000\""), "{out}");
    }
}
