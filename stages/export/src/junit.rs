//! Writes a result as a JUnit file. Each robot and each of its joints is a test case, so that a
//! build server shows what is unknown beside what is wrong.
//!
//! | what | case |
//! | --- | --- |
//! | a trusted robot | passes |
//! | a doubtful or refused robot | fails, its reasons in the message |
//! | a joint that is determined or coarse, of a trusted robot | passes |
//! | an undetermined joint, or a joint of a robot that is not trusted | is skipped with its value |
//! | a run that left something out | a case of its own that fails |

use crate::atomic;
use crate::posture::JointWords;
use crate::result::{ResultFile, RobotEntry};
use contract::words::triple;
use contract::{Certainty, Error, Kind, Result, Verdict, quote};
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use std::path::Path;

/// Writes the file; `is_partial` says that the run left out inputs, models or regions that failed.
///
/// # Errors
/// If the file cannot be written.
pub fn write_junit(path: &Path, result: &ResultFile, is_partial: bool) -> Result<()> {
    atomic::write(path, junit(result, is_partial)?.as_bytes())
}

fn junit(result: &ResultFile, is_partial: bool) -> Result<String> {
    let mut suite = TestSuite::new("stillpoint");
    if is_partial {
        suite.add_test_case(left_out(result));
    }
    for robot in &result.robots {
        of_robot(&mut suite, robot);
    }
    if !result.warnings.is_empty() {
        suite.set_system_err(lines(&result.warnings));
    }
    let mut report = Report::unnamed();
    report.add_test_suite(suite);
    let bug = |e| Error::new(Kind::Bug, "JUnit report cannot be encoded").because(e);
    report.to_string().map_err(bug)
}

/// A case with lines for whoever looks at it.
fn case(class: &str, name: &str, status: TestCaseStatus, output: &[String]) -> TestCase {
    let mut case = TestCase::new(&*quote::shown(name), status);
    case.set_classname(&*quote::shown(class));
    if !output.is_empty() {
        case.set_system_out(lines(output));
    }
    case
}

fn failed(kind: &str, why: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_type(&*quote::shown(kind)).set_message(&*quote::shown(why));
    status
}

fn skipped(why: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::skipped();
    status.set_message(&*quote::shown(why));
    status
}

/// The case of a run that left something out.
fn left_out(result: &ResultFile) -> TestCase {
    let why = format!("inputs, models or regions were left out: {}", result.warnings.join("; "));
    case(
        "stillpoint",
        "all inputs, models and regions were processed",
        failed("partial", &why),
        &[],
    )
}

/// The test cases of a robot: the robot, its joints, and its postures in other scans.
fn of_robot(suite: &mut TestSuite, robot: &RobotEntry) {
    let scans: Vec<String> = robot.stands_in.iter().map(u32::to_string).collect();
    let stands =
        if scans.is_empty() { String::new() } else { format!(" in scans {}", scans.join(", ")) };
    let mut output = vec![format!("base at {} m", triple(robot.base_pose.xyz, 4))];
    output.extend(robot.posture().map(|joint| format!("{} = {}", joint.name, joint.say())));
    output.extend(robot.reasons.iter().cloned());
    let is_trusted = robot.verdict == Verdict::Trusted.word();
    let why = || match robot.reasons.join("; ") {
        why if why.is_empty() => format!("the robot is {}, and no reason is given", robot.verdict),
        why => why,
    };
    let status =
        if is_trusted { TestCaseStatus::success() } else { failed(&robot.verdict, &why()) };
    let name = format!("{} {}{stands}", robot.id, robot.model);
    suite.add_test_case(case(&robot.model, &name, status, &output));
    for joint in robot.posture() {
        let name = format!("{} {}{stands}", robot.id, joint.name);
        let status = of_joint(robot, &joint, is_trusted);
        suite.add_test_case(case(&robot.model, &name, status, &[joint.say()]));
    }
    robot.stays.iter().for_each(|stay| of_robot(suite, stay));
}

/// An undetermined joint is skipped and does not pass: its value may be any other.
fn of_joint(robot: &RobotEntry, joint: &JointWords<'_>, is_trusted: bool) -> TestCaseStatus {
    let said = joint.say();
    if !is_trusted {
        return skipped(&format!("{said}, and the robot is {}", robot.verdict));
    }
    if joint.certainty == Certainty::Undetermined {
        let quoted = format!("joint '{}' ", joint.name);
        let mut reasons = robot.reasons.iter().filter_map(|why| why.strip_prefix(&quoted));
        let why = reasons.find_map(|why| why.split_once(": ")).map(|(_, why)| format!(": {why}"));
        return skipped(&(said + &why.unwrap_or_default()));
    }
    TestCaseStatus::success()
}

/// Several such lines.
fn lines(all: &[String]) -> String {
    all.iter().map(|line| quote::shown(line)).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(id: &str, verdict: &str, reasons: &[&str]) -> RobotEntry {
        serde_json::from_value(serde_json::json!({
            "id": id, "model": "kr10", "base_link": "base",
            "base_pose": {"xyz": [1.0, -0.000_01, 0.0], "quat_wxyz": [1.0, 0.0, 0.0, 0.0]},
            "base_sigma": {"xyz": [1e-4, 1e-4, 1e-4], "rotation": [1e-4, 1e-4, 1e-4]},
            "joints": {"a": 1.003_267_6, "slide": 0.25, "wrist": 3.1},
            "sigma": {"a": 0.001_047_2, "slide": 0.000_2, "wrist": 1.813_8},
            "slides": ["slide"],
            "determined": {"a": false, "slide": true, "wrist": false},
            "certainty": {"a": "coarse", "slide": "determined", "wrist": "undetermined"},
            "links": ["base"], "verdict": verdict, "score": 0.9, "reasons": reasons
        }))
        .expect("an entry")
    }

    fn result(robots: Vec<RobotEntry>, warnings: &[&str]) -> ResultFile {
        serde_json::from_value(serde_json::json!({
            "schema": crate::SCHEMA, "version": "0", "robots": robots,
            "labels": {"table": "t", "scans": []}, "inputs": [], "stages": [], "warnings": warnings
        }))
        .expect("a result")
    }

    #[test]
    fn what_nobody_knows_is_skipped_with_its_deviation_and_only_trusted_robots_pass() {
        let wrist =
            "joint 'wrist' is undetermined (± 103.9°): it may as well stand at 2.0° or elsewhere";
        let said = |result| junit(result, false).expect("encodes");
        let trusted = said(&result(vec![robot("R1", "trusted", &[wrist])], &[]));
        let expected = "\
<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<testsuites tests=\"4\" skipped=\"1\" failures=\"0\" errors=\"0\">
    <testsuite name=\"stillpoint\" tests=\"4\" skipped=\"1\" errors=\"0\" failures=\"0\">
        <testcase name=\"R1 kr10\" classname=\"kr10\">
            <system-out>base at (1.0000, 0.0000, 0.0000) m
a = 57.483° ± 0.060° coarse
slide = 250.000 mm ± 0.200 mm
wrist = 177.617° ± 103.9° undetermined
joint &apos;wrist&apos; is undetermined (± 103.9°): it may as well stand at 2.0° or elsewhere</system-out>
        </testcase>
        <testcase name=\"R1 a\" classname=\"kr10\">
            <system-out>57.483° ± 0.060° coarse</system-out>
        </testcase>
        <testcase name=\"R1 slide\" classname=\"kr10\">
            <system-out>250.000 mm ± 0.200 mm</system-out>
        </testcase>
        <testcase name=\"R1 wrist\" classname=\"kr10\">
            <skipped message=\"177.617° ± 103.9° undetermined: it may as well stand at 2.0° or elsewhere\"/>
            <system-out>177.617° ± 103.9° undetermined</system-out>
        </testcase>
    </testsuite>
</testsuites>
";
        assert_eq!(trusted, expected);
        let robots = vec![robot("R1", "doubtful", &["score 0.5"]), robot("R2", "refused", &[])];
        let text = junit(&result(robots, &["scan 2 could not be read"]), true).expect("encodes");
        for part in [
            "tests=\"9\" skipped=\"6\" failures=\"3\" errors=\"0\"",
            "<failure message=\"inputs, models or regions were left out: scan 2",
            "type=\"partial\"/>",
            "<failure message=\"score 0.5\" type=\"doubtful\"/>",
            "<failure message=\"the robot is refused, and no reason is given\" type=\"refused\"/>",
            "<skipped message=\"250.000 mm ± 0.200 mm, and the robot is doubtful\"/>",
            "<system-err>scan 2 could not be read</system-err>",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }

    #[test]
    fn results_without_the_words_are_read_by_their_deviations() {
        let mut old = robot("R1", "trusted", &[]);
        old.certainty.0.clear();
        let words = old.posture().map(|joint| joint.certainty.word()).collect::<Vec<_>>();
        assert_eq!(words, ["coarse", "determined", "undetermined"]);
        // A small deviation, but one of several possible values.
        old.sigma.0[0].1 = 1e-4;
        assert_eq!(old.posture().next().map(|a| a.certainty), Some(Certainty::Undetermined));
    }

    #[test]
    fn a_robot_that_moved_has_a_case_for_each_of_its_postures() {
        let mut moved = robot("R1", "trusted", &[]);
        moved.stands_in = vec![0, 1];
        moved.stays =
            vec![RobotEntry { stands_in: vec![2], ..robot("R1", "doubtful", &["few points"]) }];
        let text = junit(&result(vec![moved], &[]), false).expect("encodes");
        assert!(text.contains("name=\"R1 kr10 in scans 0, 1\""), "{text}");
        assert!(text.contains("name=\"R1 wrist in scans 2\""), "{text}");
        assert!(text.contains("tests=\"8\" skipped=\"4\" failures=\"1\""), "{text}");
    }
}
