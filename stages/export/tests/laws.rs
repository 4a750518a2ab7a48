//! Random robots that are written and loaded again are the same robots.

use contract::{Fit, JointFit};
use export::write_robot;
use proptest::prelude::*;
use robot::{Model, Settings};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Number of random robots; each is written to disk and loaded twice.
const N_CASES: u32 = 64;
/// Tolerance, metres and radians: nine decimals are written, and a chain of eight joints adds up
/// their errors.
const NEAR: f64 = 1e-7;

/// A joint: kind, parent (among the links before it), origin, turn, axis, limits.
type Drawn = (usize, prop::sample::Index, [f64; 3], [f64; 3], [f64; 3], [f64; 2]);

fn joints() -> impl Strategy<Value = Vec<Drawn>> {
    let axis = [-1.0..1.0, -1.0..1.0, -1.0..1.0]
        .prop_filter("an axis has a direction", |a| a.iter().map(|v| v * v).sum::<f64>() > 0.01);
    let turn = [-3.1..3.1, -1.5..1.5, -3.1..3.1];
    let place = [-0.9..0.9, -0.9..0.9, -0.9..0.9];
    let limits = [-3.0..-0.1, 0.1..3.0];
    let joint = (0_usize..5, any::<prop::sample::Index>(), place, turn, axis, limits);
    prop::collection::vec(joint, 1..8)
}

/// The URDF of such a robot; the fifth kind of joint follows the first joint.
fn urdf(joints: &[Drawn]) -> String {
    let mut text = String::from("<robot name='drawn'>");
    for i in 0..=joints.len() {
        let shape = "<visual><geometry><box size='.1 .2 .3'/></geometry></visual>";
        let _ = write!(text, "<link name='l{i}'>{shape}</link>");
    }
    for (i, (kind, parent, xyz, rpy, axis, limits)) in joints.iter().enumerate() {
        let follows = *kind == 4 && i > 0;
        let kind = ["revolute", "continuous", "prismatic", "fixed", "revolute"][*kind];
        let words = |v: &[f64; 3]| format!("{} {} {}", v[0], v[1], v[2]);
        let _ = write!(
            text,
            "<joint name='j{i}' type='{kind}'><origin xyz='{}' rpy='{}'/><parent link='l{}'/><child link='l{}'/><axis xyz='{}'/>",
            words(xyz),
            words(rpy),
            parent.index(i + 1),
            i + 1,
            words(axis)
        );
        if kind != "fixed" && kind != "continuous" {
            let _ = write!(
                text,
                "<limit lower='{}' upper='{}' effort='1' velocity='1'/>",
                limits[0], limits[1]
            );
        }
        if follows {
            let _ = write!(text, "<mimic joint='j0' multiplier='0.5' offset='0.1'/>");
        }
        text += "</joint>";
    }
    text + "</robot>"
}

fn load(path: &Path, text: Option<&str>) -> Option<Model> {
    if let Some(text) = text {
        std::fs::write(path, text).expect("is written");
    }
    Model::load_urdf(path, "drawn", &Settings::without_clouds()).ok().map(|(model, _)| model)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(N_CASES))]

    #[test]
    fn a_robot_that_is_written_is_the_same_robot(joints in joints(), at in prop::collection::vec(0.0..1.0, 8)) {
        let dir = tempfile::tempdir().expect("a folder");
        let text = urdf(&joints);
        // Where the first joint is fixed nothing can follow it, and the URDF is refused.
        let Some(model) = load(&dir.path().join("a.urdf"), Some(&text)) else {
            prop_assert!(joints[0].0 == 3, "{}", text);
            return Ok(());
        };
        let value = |(k, free): (usize, &usize)| {
            let [low, high] = model.joints[*free].limits.unwrap_or([-3.0, 3.0]);
            low + at[k % at.len()] * (high - low)
        };
        let posture: Vec<f64> = model.free.iter().enumerate().map(value).collect();
        let fit = Fit {
            model_name: model.name.clone(),
            joints: model.free.iter().zip(&posture).map(|(free, value)| JointFit {
                name: model.joints[*free].name.clone(),
                value: *value,
                sigma: 0.01,
                certainty: contract::Certainty::Determined,
                ..JointFit::default()
            }).collect(),
            ..Fit::default()
        };
        write_robot(dir.path(), "R1", &fit, &model, &BTreeMap::new()).expect("is written");
        let again = load(&dir.path().join("robots/R1/robot.urdf"), None).expect("loads");
        prop_assert_eq!(again.free.len(), model.free.len());
        let name = |m: &Model, l: usize| m.links[l].name.clone();
        // Compared by name, since links may come in any order.
        let poses = |m: &Model| -> BTreeMap<String, geometry::Pose> {
            let by_name: BTreeMap<&str, f64> = fit.joints.iter().map(|j| (&*j.name, j.value)).collect();
            let posture: Vec<f64> = m.free.iter().map(|f| by_name[&*m.joints[*f].name]).collect();
            m.poses(&posture).into_iter().enumerate().map(|(l, pose)| (name(m, l), pose)).collect()
        };
        for ((name, a), (_, b)) in poses(&model).iter().zip(&poses(&again)) {
            let off = a.inverse() * b;
            prop_assert!(off.translation.vector.norm() < NEAR && off.rotation.angle() < NEAR, "{}: {}", name, off);
        }
        // Poses are products along the way from the root: a pose of a link is its parent's times
        // its joint's.
        let (at, values) = (model.poses(&posture), model.joint_values(&posture));
        for (joint, value) in model.joints.iter().zip(values) {
            let off = (at[joint.parent] * joint.parent_from_child(value)).inverse() * at[joint.child];
            prop_assert!(off.translation.vector.norm() < 1e-12 && off.rotation.angle() < 1e-7, "{}", off);
        }
        // The table has the model's value for each joint.
        let csv = std::fs::read_to_string(dir.path().join("robots/R1/joints.csv")).expect("is there");
        for line in csv.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let name = cells[0].trim_matches('"');
            let joint = model.joints.iter().position(|j| j.name == name).expect("a joint of the model");
            let value: f64 = cells[1].parse().expect("a number");
            prop_assert!((value - model.joint_values(&posture)[joint]).abs() < NEAR, "{}", line);
        }
    }
}
