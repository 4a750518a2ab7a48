//! Reads a robot's path from a file: names of joints, and their values at each waypoint.
//!
//! ```text
//! CSV     a head of joints' names, perhaps with a column `time`; a line for each waypoint; radians and metres
//! JSON    trajectory_msgs/JointTrajectory: joint_names, points[].positions, points[].time_from_start; or an object that has
//!         one as joint_trajectory, as MoveIt's RobotTrajectory
//! ```

use crate::job::MAX_TEXT;
use contract::{Error, Kind, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Most waypoints of a path.
const MAX_WAYPOINTS: usize = 1_000_000;
/// Greatest joint value, radians, degrees or metres.
const MAX_VALUE: f64 = 1e5;
/// Names of columns that hold times instead of joint values.
const TIMES: [&str; 2] = ["time", "time_from_start"];

/// A path of one robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Names of joints, each once.
    pub joints: Vec<String>,
    /// Joint values at each waypoint, in that order and in the units of the file; at least one
    /// waypoint.
    pub points: Vec<Vec<f64>>,
    /// Time of each waypoint, seconds; empty where the file states none.
    pub times: Vec<f64>,
}

/// Reads paths.
///
/// # Errors
/// A file that cannot be read, has more than `most` bytes, or is not a path, or more waypoints than
/// [`MAX_WAYPOINTS`] together.
pub(super) fn read_all(files: &[PathBuf], most: u64) -> Result<Vec<Trajectory>> {
    let mut n = 0;
    let one = |file: &PathBuf| {
        let path = Trajectory::read(file, most)?;
        n += path.points.len();
        if n > MAX_WAYPOINTS {
            let what = format!("the paths have more than {MAX_WAYPOINTS} waypoints together");
            let error = Error::new(Kind::Unsupported, what).at(file.display());
            return Err(error.hint("check them in several calls"));
        }
        Ok(path)
    };
    files.iter().map(one).collect()
}

impl Trajectory {
    /// Reads a path.
    ///
    /// # Errors
    /// A file that cannot be read, has more than `most` bytes, or is not a path; named with the
    /// line or the waypoint.
    pub fn read(path: &Path, most: u64) -> Result<Self> {
        let bad = |what: String| {
            let hint = "a path is CSV with joints' names in its head, or JSON as trajectory_msgs/JointTrajectory, both in UTF-8";
            Error::new(Kind::BadInput, what).at(path.display()).hint(hint)
        };
        let text = ingest::read_text(path, most, MAX_TEXT)?;
        let text = text.trim_start_matches('\u{feff}');
        let is_json = text.trim_start().starts_with(['{', '[']);
        let read = if is_json { json(text) } else { csv(text) };
        read.and_then(Self::checked).map_err(bad)
    }

    fn checked(self) -> std::result::Result<Self, String> {
        let mut names: Vec<&String> = self.joints.iter().collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(format!("joint \"{}\" is named twice", twice[0]));
        }
        if self.joints.is_empty() || self.points.is_empty() {
            return Err("it has no joints or no waypoints".into());
        }
        if self.points.len() > MAX_WAYPOINTS {
            return Err(format!("it has more than {MAX_WAYPOINTS} waypoints: cut it into parts"));
        }
        let n = self.joints.len();
        for (at, point) in self.points.iter().enumerate() {
            if point.len() != n {
                return Err(format!("waypoint {at} has {} values for {n} joints", point.len()));
            }
            if let Some(odd) = point.iter().position(|v| v.is_nan() || v.abs() > MAX_VALUE) {
                return Err(format!(
                    "waypoint {at}: {} of {} is no value of a joint",
                    point[odd], self.joints[odd]
                ));
            }
        }
        Ok(self)
    }
}

fn csv(text: &str) -> std::result::Result<Trajectory, String> {
    let lines = text.lines().enumerate().map(|(at, line)| (at + 1, line.trim()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (_, head) = lines.next().ok_or("it is empty")?;
    let separator = [';', ',', '\t'].into_iter().find(|c| head.contains(*c));
    let cells = |line: &str| -> Vec<String> {
        let clean = |cell: &str| cell.trim().trim_matches('"').to_owned();
        match separator {
            Some(c) => line.split(c).map(clean).collect(),
            None => line.split_whitespace().map(clean).collect(),
        }
    };
    let head = cells(head);
    if head.iter().all(|cell| cell.parse::<f64>().is_ok()) {
        return Err("its first line has numbers instead of joints' names".into());
    }
    let time = head.iter().position(|name| TIMES.contains(&name.to_lowercase().as_str()));
    let is_joint = |column: &usize| Some(*column) != time;
    let joints = (0..head.len()).filter(is_joint).map(|c| head[c].clone()).collect();
    let (mut points, mut times) = (Vec::new(), Vec::new());
    for (at, line) in lines {
        let cells = cells(line);
        if cells.len() != head.len() {
            return Err(format!(
                "line {at} has {} values, the head {} names",
                cells.len(),
                head.len()
            ));
        }
        let number = |c: usize| -> std::result::Result<f64, String> {
            // Where columns are separated by semicolons, a comma is the decimal separator.
            let cell =
                if separator == Some(';') { cells[c].replace(',', ".") } else { cells[c].clone() };
            let value = cell.parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| format!("line {at}: \"{}\" of {} is no number", cells[c], head[c]))
        };
        times.extend(time.map(number).transpose()?);
        let own = (0..head.len()).filter(is_joint).map(number);
        points.push(own.collect::<std::result::Result<Vec<f64>, String>>()?);
    }
    Ok(Trajectory { joints, points, times })
}

fn json(text: &str) -> std::result::Result<Trajectory, String> {
    let all: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let path = all.get("joint_trajectory").unwrap_or(&all);
    let base = all.get("multi_dof_joint_trajectory").and_then(|t| t["points"].as_array());
    if base.is_some_and(|points| !points.is_empty()) {
        return Err("it moves a base, too (multi_dof_joint_trajectory): robots stand".into());
    }
    let list =
        |name: &str| path.get(name).and_then(Value::as_array).ok_or(format!("it has no {name}"));
    let name =
        |v: &Value| v.as_str().map(str::to_owned).ok_or("a joint's name is no text".to_owned());
    let joints = list("joint_names")?.iter().map(name).collect::<std::result::Result<_, _>>()?;
    let (mut points, mut times) = (Vec::new(), Vec::new());
    for (at, point) in list("points")?.iter().enumerate() {
        let positions = point.get("positions").and_then(Value::as_array);
        let positions = positions.ok_or_else(|| format!("waypoint {at} has no positions"))?;
        points.push(positions.iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect());
        times.extend(point.get("time_from_start").and_then(seconds));
    }
    if times.len() != points.len() {
        times.clear();
    }
    Ok(Trajectory { joints, points, times })
}

/// A duration of ROS 1 or 2, or a number.
fn seconds(value: &Value) -> Option<f64> {
    let part = |names: [&str; 2]| names.iter().find_map(|name| value.get(name)?.as_f64());
    value
        .as_f64()
        .or_else(|| Some(part(["sec", "secs"])? + 1e-9 * part(["nanosec", "nsecs"]).unwrap_or(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Trajectory> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("path");
        std::fs::write(&path, text).expect("is written");
        Trajectory::read(&path, 1 << 20)
    }

    #[test]
    fn the_same_path_in_every_form() {
        let path = Trajectory {
            joints: vec!["a".into(), "b".into()],
            points: vec![vec![0.5, -1.0], vec![0.25, 2.0]],
            times: vec![0.0, 1.5],
        };
        let forms = [
            "time,a,b\n0,0.5,-1\n1.5,0.25,2\n",
            "# a comment\n\"Time\";\"a\";\"b\"\n\n0;0,5;-1\n1,5;0,25;2,0\n",
            "a b time\n0.5 -1 0\n0.25 2 1.5\n",
            r#"{"joint_names": ["a", "b"], "points": [{"positions": [0.5, -1], "time_from_start": {"sec": 0, "nanosec": 0}},
                {"positions": [0.25, 2.0], "time_from_start": {"secs": 1, "nsecs": 500000000}}]}"#,
            r#"{"joint_trajectory": {"joint_names": ["a", "b"], "points": [{"positions": [0.5, -1], "time_from_start": 0},
                {"positions": [0.25, 2.0], "time_from_start": 1.5}]}}"#,
        ];
        for form in forms {
            assert_eq!(read(form).expect(form), path, "{form}");
        }
    }

    #[test]
    fn what_is_no_path_is_named() {
        for (text, said) in [
            ("", "empty"),
            ("0.1,0.2\n0.3,0.4\n", "numbers instead of joints' names"),
            ("a,b\n0.1,0.2\n0.1\n", "line 3 has 1 values"),
            ("a,b\n0.1,x\n", "line 2: \"x\" of b is no number"),
            ("a,b\n0.1,inf\n", "line 2: \"inf\" of b is no number"),
            ("a,a\n0.1,0.2\n", "\"a\" is named twice"),
            ("a,b\n", "no waypoints"),
            ("{\"joint_names\": [\"a\"]}", "no points"),
            (
                "{\"joint_names\": [\"a\"], \"points\": [{\"positions\": [1, 2]}]}",
                "waypoint 0 has 2 values",
            ),
            (
                "{\"joint_names\": [\"a\"], \"points\": [{\"positions\": [\"x\"]}]}",
                "NaN of a is no value",
            ),
            ("a\n1e9\n", "1000000000 of a is no value"),
            (
                "{\"joint_trajectory\": {}, \"multi_dof_joint_trajectory\": {\"points\": [{}]}}",
                "moves a base",
            ),
            ("{\"joint_names\"", "EOF"),
        ] {
            let error = read(text).expect_err(text).to_string();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
