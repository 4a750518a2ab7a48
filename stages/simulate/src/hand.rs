//! A robot's model in; a tool on its flange, and a part that the tool holds, out.

use crate::scene::{CarriedBox, Tool, ToolShape, pose};
use geometry::Point;
use robot::Model;

/// A tool of a length, metres, that stands on a flange of a model and points away from the arm.
#[must_use]
pub fn tool_on(model: &Model, flange: usize, shape: ToolShape, length: f64) -> Tool {
    let link = model.links[flange].name.clone();
    Tool { link, shape, xyz: [0.0; 3], rpy_deg: outward(model, flange), length }
}

/// A part of a size, metres, at the end of a tool of a robot.
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

/// Roll, pitch and yaw, degrees, that turn +z to where a flange looks.
fn outward(model: &Model, flange: usize) -> [f64; 3] {
    let (roll, pitch, yaw) = model.mount(flange).0.euler_angles();
    [roll, pitch, yaw].map(f64::to_degrees)
}
