//! Tools on a robot's flange, and parts that a tool holds.

use crate::scene::{CarriedBox, Tool, ToolShape, pose};
use geometry::Point;
use robot::Model;

/// A tool of this length (metres) on a flange of a model, pointing away from the arm.
#[must_use]
pub fn tool_on(model: &Model, flange: usize, shape: ToolShape, length: f64) -> Tool {
    let link = model.links[flange].name.clone();
    Tool { link, shape, xyz: [0.0; 3], rpy_deg: outward(model, flange), length }
}

/// A part of this size (metres) at the end of a robot's tool.
#[must_use]
pub fn part_in(tool: &Tool, robot: &str, size: [f64; 3]) -> CarriedBox {
    let middle = pose([0.0; 3], tool.rpy_deg) * Point::new(0.0, 0.0, tool.length + 0.5 * size[2]);
    CarriedBox {
        name: format!("part of {robot}"),
        robot: robot.to_owned(),
        link: tool.link.clone(),
        xyz: middle.coords.into(),
        rpy_deg: tool.rpy_deg,
        size,
    }
}

/// Roll, pitch and yaw (degrees) that turn +z to the direction in which a flange faces.
fn outward(model: &Model, flange: usize) -> [f64; 3] {
    let (roll, pitch, yaw) = model.mount(flange).0.euler_angles();
    [roll, pitch, yaw].map(f64::to_degrees)
}
