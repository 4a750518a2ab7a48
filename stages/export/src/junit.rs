//! A result in, a JUnit file out: each robot is a test case, so that a build server shows those to look at.

use crate::atomic;
use crate::result::{ResultFile, RobotEntry};
use contract::{Result, quote};
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
    let (id, model) = (for_people(&robot.id), for_people(&robot.model));
    let _ = writeln!(text, "  <testcase classname=\"{model}\" name=\"{id} {model}\">");
    if !passes(robot) {
        let why = for_people(&robot.reasons.join("; "));
        let verdict = for_people(&robot.verdict);
        let _ = writeln!(text, "    <failure type=\"{verdict}\" message=\"{why}\"/>");
    }
    let [x, y, z] = robot.base_pose.xyz;
    let _ = writeln!(text, "    <system-out>base at ({x:.4}, {y:.4}, {z:.4}) m");
    for (name, value) in &robot.joints.0 {
        let _ = writeln!(text, "{} = {value:.6}", for_people(name));
    }
    text.push_str("    </system-out>\n  </testcase>\n");
}

/// A build server shows the values to people.
fn for_people(text: &str) -> String {
    quote::xml(&quote::shown(text)).into_owned()
}
