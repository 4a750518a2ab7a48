//! Files with arbitrary names in them (escape sequences, line breaks, direction marks, formulas)
//! stay valid for their readers.

use contract::{Fit, JointFit, Verdict, quote};
use export::{LabelFiles, ResultFile, RobotEntry, SCHEMA, write_junit, write_robot};
use robot::{Model, Settings};
use std::collections::BTreeMap;
use std::path::Path;

/// An escape sequence that clears the screen, a zero, a bell, a line break, a direction mark, the
/// special characters of XML, and a non-character.
const ODD: &str = "a\u{1b}[2J\u{0}\u{7}\r\nb\u{202e}c<&>\"'d\u{ffff}e";

/// The part of that which a URDF can hold: XML has no ESC and no zero.
const ODD_IN_XML: &str = "a\r\n\tb\u{202e}c<&>\"'d\u{9b}2J";

fn model(dir: &Path) -> Model {
    let name = |at: usize| quote::xml(&format!("{ODD_IN_XML}{at}")).into_owned();
    let link = |at: usize| {
        let shape = "<visual><geometry><box size='.1 .1 .1'/></geometry></visual>";
        format!("<link name=\"{}\">{shape}</link>", name(at))
    };
    let joint = format!(
        "<joint name=\"={}\" type='revolute'><parent link=\"{}\"/><child link=\"{}\"/><axis xyz='0 0 1'/>\
         <limit lower='-1' upper='1' effort='1' velocity='1'/></joint>",
        name(7),
        name(0),
        name(1)
    );
    let path = dir.join("odd.urdf");
    let text = format!("<robot name='r'>{}{}{joint}</robot>", link(0), link(1));
    std::fs::write(&path, text).expect("is written");
    Model::load_urdf(&path, ODD, &Settings::without_clouds()).expect("loads").0
}

fn fit(model: &Model) -> Fit {
    let name = model.joints[0].name.clone();
    Fit {
        model_name: model.name.clone(),
        joints: vec![JointFit { name, value: 0.5, sigma: 0.1, ..JointFit::default() }],
        verdict: Verdict::Doubtful,
        reasons: vec![format!("joint is not determined: \"{ODD}\"")],
        ..Fit::default()
    }
}

fn is_clean(text: &str) -> bool {
    text.chars().all(|c| !quote::is_odd(c) || c == '\n')
}

#[test]
fn the_urdf_of_a_robot_with_odd_names_loads_and_its_names_are_the_same() {
    let dir = tempfile::tempdir().expect("a folder");
    let model = model(dir.path());
    assert_eq!(model.links[1].name, format!("{ODD_IN_XML}1"));
    write_robot(dir.path(), "R1", &fit(&model), &model, &BTreeMap::new()).expect("is written");
    let folder = dir.path().join("robots/R1");
    let text = std::fs::read_to_string(folder.join("robot.urdf")).expect("is there");
    assert!(is_clean(&text), "{text:?}");
    roxmltree::Document::parse(&text).expect("well-formed XML");
    let (again, _) =
        Model::load_urdf(&folder.join("robot.urdf"), "again", &Settings::without_clouds())
            .expect("loads");
    let names = |m: &Model| m.links.iter().map(|l| l.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&again), names(&model));
    assert_eq!(again.joints[0].name, model.joints[0].name);
    let yaml = std::fs::read_to_string(folder.join("joints.yaml")).expect("is there");
    assert!(is_clean(&yaml), "{yaml:?}");
    // A joint name that a spreadsheet would evaluate is quoted, and stays on one line.
    let csv = std::fs::read_to_string(folder.join("joints.csv")).expect("is there");
    assert!(is_clean(&csv) && csv.lines().count() == 2, "{csv:?}");
    assert!(csv.lines().nth(1).is_some_and(|line| line.starts_with("\"'=")), "{csv:?}");
}

#[test]
fn junit_of_a_result_with_odd_names_is_xml_that_says_them() {
    let dir = tempfile::tempdir().expect("a folder");
    let model = model(dir.path());
    let links: Vec<String> = model.links.iter().map(|l| l.name.clone()).collect();
    let result = ResultFile {
        schema: SCHEMA.into(),
        version: "0".into(),
        robots: vec![RobotEntry::new(ODD, &fit(&model), &links, None)],
        labels: LabelFiles { table: "t".into(), scans: Vec::new() },
        inputs: Vec::new(),
        stages: Vec::new(),
        warnings: Vec::new(),
        review: Vec::new(),
        rescan: None,
    };
    let path = dir.path().join("junit.xml");
    write_junit(&path, &result, false).expect("is written");
    let text = std::fs::read_to_string(&path).expect("is there");
    assert!(is_clean(&text), "{text:?}");
    let document = roxmltree::Document::parse(&text).expect("well-formed XML");
    let case = document.descendants().find(|n| n.has_tag_name("testcase")).expect("a case");
    let said = case.attribute("classname").expect("a model");
    assert_eq!(said, quote::shown(ODD));
    assert!(said.contains("\\u{1b}[2J\\u{0}") && said.contains("c<&>\"'d"), "{said}");
}
