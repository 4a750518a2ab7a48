//! Evidence of fits in; what the rules of the verdict make of it, case by case.

use super::super::{findings, holds_any};
use super::*;
use crate::verdict::rule::{AlsoAsked, RowOutcome};
use contract::Certainty;

impl FitEvidence {
    /// Nothing speaks against it: one link, two joints, the last of them open.
    pub(in crate::verdict) fn with_one_of_each() -> Self {
        let joint = JointKnown { is_determined: true, n_points: 400, ..JointKnown::default() };
        Self {
            score: 0.9,
            seen: 0.4,
            n_points: 5000,
            rms: 0.002,
            noise: SceneNoise { all: 0.002, excused: 0.002 },
            held: JointShare::of_all(6, 6),
            known: JointShare::of_all(6, 6),
            known_but_last: JointShare::of_all(5, 5),
            determined: JointShare::of_all(6, 6),
            margin: f64::INFINITY,
            has_scanners: true,
            is_only_scanners: true,
            trade_off: Some(String::new()),
            links: vec![LinkSeen { seen: 0.4, is_held: true, ..LinkSeen::default() }],
            joints: vec![joint.clone(), JointKnown { is_last: true, ..joint }],
            ..Self::default()
        }
    }

    fn good() -> Self {
        Self { trade_off: None, ..Self::with_one_of_each() }
    }
}

fn outcomes(evidence: &FitEvidence) -> Vec<RowOutcome> {
    findings(evidence).into_iter().map(|(outcome, _)| outcome).collect()
}

#[test]
fn a_good_fit_is_trusted_without_a_word() {
    assert_eq!(findings(&FitEvidence::good()), []);
}

#[test]
fn a_rod_that_a_model_has_fixed_beside_its_arm_does_not_speak_against_the_arm() {
    let link = |name: &str| {
        format!(
            "<link name='{name}'><visual><geometry><box size='0.2 0.1 0.1'/></geometry></visual></link>"
        )
    };
    let joint = |name: &str, kind: &str, [parent, child]: [&str; 2]| {
        format!(
            "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/><axis xyz='0 0 1'/>\
             <limit lower='-3' upper='3' effort='1' velocity='1'/></joint>"
        )
    };
    let links: String = ["foot", "trunk", "arm", "rod"].map(link).concat();
    let joints = [
        joint("a", "revolute", ["foot", "trunk"]),
        joint("b", "revolute", ["trunk", "arm"]),
        joint("c", "fixed", ["trunk", "rod"]),
    ];
    let urdf = format!("<robot name='rods'>{links}{}</robot>", joints.concat());
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("rods.urdf");
    std::fs::write(&path, urdf).expect("is written");
    let model = Model::load_urdf(&path, "rods", &robot::Settings::default()).expect("loads").0;
    let aside = model.links.iter().enumerate().filter(|(l, _)| is_aside(&model, *l));
    let names: Vec<&str> = aside.map(|(_, link)| link.name.as_str()).collect();
    assert_eq!(names, ["rod"]);
}

#[test]
fn what_beams_went_through_refuses_a_link_only_where_its_joints_hold_it() {
    let pierced = |violation: f64, is_held: bool, is_aside: bool| {
        let name = "rod".to_owned();
        let link = LinkSeen { name, seen: 0.4, violation, is_aside, is_held };
        findings(&FitEvidence { links: vec![link], ..FitEvidence::good() })
    };
    let said = |outcome: RowOutcome, text: &str| vec![(outcome, text.to_owned())];
    let (refused, doubtful) = (RowOutcome::Refused, RowOutcome::Doubtful);
    let plain = "beams went through 40 % of link 'rod'";
    let of_a_loop =
        "beams went through 40 % of link 'rod': a loop that the model lacks may move it";
    assert_eq!(pierced(0.4, true, false), said(refused, plain));
    assert_eq!(pierced(0.4, false, false), said(doubtful, plain));
    assert_eq!(pierced(0.4, true, true), said(doubtful, of_a_loop));
    assert_eq!(pierced(0.06, true, false), []);
}

#[test]
fn what_leaves_most_joints_but_the_last_open_may_be_anything_flat() {
    let joint = |sigma: f64| JointFit { sigma, ..JointFit::default() };
    let known = |sigmas: &[f64]| {
        n_known(&Fit { joints: sigmas.iter().copied().map(joint).collect(), ..Fit::default() })
    };
    assert_eq!(known(&[0.1, 0.01, 0.01, 0.1, 1.8, 0.001]), [3, 2]);
    assert_eq!(known(&[0.001, 0.01, 1.8]), [2, 2]);
    let with = |n_but_last: usize, n_joints: usize, is_only_scanners: bool| {
        outcomes(&FitEvidence {
            known: JointShare::of_all(n_but_last, n_joints),
            known_but_last: JointShare::of_all(n_but_last, n_joints - 1),
            is_only_scanners,
            ..FitEvidence::good()
        })
    };
    let (refused, doubtful) = (vec![RowOutcome::Refused], vec![RowOutcome::Doubtful]);
    assert_eq!((with(2, 6, true), with(3, 6, true)), (refused.clone(), doubtful.clone()));
    assert_eq!((with(2, 7, true), with(3, 7, true)), (refused, doubtful.clone()));
    // A depth camera bends what it sees: of it no more can be asked.
    assert_eq!(with(2, 6, false), doubtful);
    // A turntable that looks the same all around is all last joint.
    assert_eq!(with(0, 1, true), doubtful);
}

#[test]
fn what_lies_beside_its_points_and_leaves_half_of_its_joints_open_may_be_anything() {
    let off = |rms: f64, n_known: usize| {
        let evidence =
            FitEvidence { rms, held: JointShare::of_all(n_known, 6), ..FitEvidence::good() };
        (outcomes(&evidence), holds_any(&evidence, AlsoAsked::BeforeReport))
    };
    let (refused, doubtful) = (vec![RowOutcome::Refused], vec![RowOutcome::Doubtful]);
    assert_eq!(off(0.0055, 3), (refused.clone(), true));
    assert_eq!(off(0.0055, 4), (vec![], false));
    assert_eq!((off(0.003, 0), off(0.003, 6)), ((vec![], false), (vec![], false)));
    assert_eq!(off(0.006, 6), (doubtful, false));
    assert_eq!(off(0.008, 6), (refused.clone(), true));
    let furniture = FitEvidence { rms: 0.006, score: 0.51, ..FitEvidence::good() };
    assert_eq!(outcomes(&furniture), [RowOutcome::Doubtful, RowOutcome::Refused]);
    assert!(!holds_any(&furniture, AlsoAsked::BeforeReport));
    assert!(holds_any(&furniture, AlsoAsked::Contradicts));
    assert!(!holds_any(&FitEvidence::good(), AlsoAsked::Contradicts));
}

#[test]
fn an_open_joint_is_named_once_and_a_last_one_only_noted() {
    let joint = |is_last: bool, n_points: usize, own_sigma: f64| JointKnown {
        name: "a".into(),
        is_last,
        n_points,
        own_sigma,
        sigma: 0.1,
        certainty: Certainty::Undetermined.word(),
        ..JointKnown::default()
    };
    let said =
        |joint: JointKnown| findings(&FitEvidence { joints: vec![joint], ..FitEvidence::good() });
    let doubt = |text: &str| vec![(RowOutcome::Doubtful, text.to_owned())];
    assert_eq!(said(joint(false, 29, 0.1)), doubt("only 29 points on what joint 'a' moves"));
    assert_eq!(said(joint(false, 30, 0.1)), doubt("joint 'a' is undetermined (± 5.7°)"));
    let note = vec![(RowOutcome::Note, "joint 'a' is undetermined (± 5.7°)".to_owned())];
    assert_eq!(said(joint(false, 30, 0.001)), note);
    assert_eq!(said(joint(true, 0, 0.1)), note);
    let beyond = |joint: JointKnown| said(JointKnown { beyond_limit: 0.2, ..joint }).len();
    assert_eq!(beyond(joint(false, 30, 0.001)), 2);
    assert_eq!(beyond(joint(true, 30, 0.001)), 1);
    assert_eq!(beyond(JointKnown { slides: true, ..joint(false, 30, 0.001) }), 1);
    assert_eq!(beyond(JointKnown { is_determined: true, sigma: 0.06, ..joint(true, 30, 0.0) }), 1);
    assert_eq!(beyond(JointKnown { is_determined: true, sigma: 0.07, ..joint(true, 30, 0.0) }), 0);
}

#[test]
fn what_is_said_of_a_joint_has_its_deviation_and_the_word_that_fits_it() {
    let said = |[value, sigma]: [f64; 2], certainty: Certainty, others: &[f64]| {
        let (value, sigma) = (value.to_radians(), sigma.to_radians());
        let joint = JointFit { value, sigma, certainty, ..JointFit::default() };
        let equal = |v: &f64| contract::Equal { posture: vec![v.to_radians()], margin: 0.0 };
        let equals = others.iter().map(equal).collect();
        let fit = Fit { joints: vec![joint], equals, ..Fit::default() };
        let joint = JointKnown {
            name: "a".into(),
            is_last: true,
            certainty: certainty.word(),
            sigma,
            elsewhere: words::elsewhere(&fit, 0, false),
            ..JointKnown::default()
        };
        let found = findings(&FitEvidence { joints: vec![joint], ..FitEvidence::good() });
        found.into_iter().map(|(_, sentence)| sentence).collect::<String>()
    };
    let (coarse, open) = (Certainty::Coarse, Certainty::Undetermined);
    assert_eq!(said([57.483, 0.06], coarse, &[]), "joint 'a' is coarse (± 0.060°)");
    assert_eq!(said([5.0, 12.0], open, &[]), "joint 'a' is undetermined (± 12.0°)");
    assert_eq!(
        said([5.0, 104.0], open, &[65.0, 125.0]),
        "joint 'a' is undetermined (± 104.0°): it may as well stand at 65.0°, 125.0° or elsewhere"
    );
    assert_eq!(
        said([5.0, 0.02], open, &[]),
        "joint 'a' is undetermined (± 0.020°): another posture explains the points nearly as well"
    );
}
