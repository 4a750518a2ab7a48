//! A result in, a JUnit file out: each robot is a test case, so that a build server shows those to look at.

use crate::atomic;
use crate::result::{ResultFile, RobotEntry};
use crate::robot_model::escaped;
use contract::Result;
use std::fmt::Write as _;
use std::path::Path;

/// Writes the file. Trusted robots pass; others fail with their reasons. Values stand in the cases' output.
pub fn write_junit(path: &Path, result: &ResultFile) -> Result<()> {
    let n_failed = result.robots.iter().filter(|r| !passes(r)).count();
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let _ = writeln!(
        text,
        "<testsuites>\n<testsuite name=\"stillpoint\" tests=\"{}\" failures=\"{n_failed}\">",
        result.robots.len()
    );
    result.robots.iter().for_each(|robot| case(&mut text, robot));
    text.push_str("</testsuite>\n</testsuites>\n");
    atomic::write(path, text.as_bytes())
}

fn passes(robot: &RobotEntry) -> bool {
    robot.verdict == "trusted"
}

fn case(text: &mut String, robot: &RobotEntry) {
    let (id, model) = (escaped(&robot.id), escaped(&robot.model));
    let _ = writeln!(text, "  <testcase classname=\"{model}\" name=\"{id} {model}\">");
    if !passes(robot) {
        let why = escaped(&robot.reasons.join("; "));
        let verdict = escaped(&robot.verdict);
        let _ = writeln!(text, "    <failure type=\"{verdict}\" message=\"{why}\"/>");
    }
    let [x, y, z] = robot.base_pose.xyz;
    let _ = writeln!(text, "    <system-out>base at ({x:.4}, {y:.4}, {z:.4}) m");
    for (name, value) in &robot.joints.0 {
        let _ = writeln!(text, "{} = {value:.6}", escaped(name));
    }
    text.push_str("    </system-out>\n  </testcase>\n");
}
