//! Writes the scene of a plant for planners and simulators: robots in their found postures with
//! everything that the library says of them, and what stands still around them. The crate makes
//! bytes and touches no disk.
//!
//! Readers accept much that they then misread, so that every scene is checked first
//! ([`PlantScene::check`]). README.md tells what each format cannot say.
#![forbid(unsafe_code)]

mod checks;
mod gltf;
mod joint_rules;
mod link_pairs;
mod mjcf;
mod moveit;
mod names;
mod output;
mod physics;
mod plant_scene;
mod robodk;
mod sdf;
mod signed_distance;
mod text;
mod touching;
mod urdf;
mod usd;
mod usd_text;
mod voxel_boxes;

pub use gltf::gltf;
pub use mjcf::mjcf;
pub use moveit::{moveit, srdf};
pub use output::{SceneFile, SceneFiles};
pub use plant_scene::{FixedBox, FloorPatch, PlantRobot, PlantScene, TouchingBoxes};
pub use robodk::robodk;
pub use sdf::sdf;
pub use signed_distance::signed_distances;
pub use touching::FoundHulls;
pub use urdf::urdf;
pub use usd::usd;
pub use voxel_boxes::voxel_boxes;
