//! A scene and robot models in; what a terrestrial laser scanner would see, with the truth, out.
//!
//! Robots of our own ([`demo_robots`]) and scenes of our own ([`demo_scene()`]) come with it, so
//! that the whole way can be shown and measured on a bare machine.
#![forbid(unsafe_code)]

mod attach;
mod beams;
mod check;
mod columns;
pub mod demo_robots;
mod demo_scene;
mod hall;
mod hand;
mod line;
mod place;
mod plant;
mod plots;
mod posture;
pub mod random;
mod scan;
mod scanner;
pub mod scene;
mod sessions;
mod shapes;
mod simulator;
pub mod solid;
mod spot;
mod truth;
mod world;

pub use columns::{ScanFrame, SimColumns, SimScan};
pub use demo_scene::{demo_scene, paper_scene};
pub use hand::{part_in, tool_on};
pub use line::{Ends, ProductionLine, line};
pub use plant::{Plant, plant};
pub use plots::hall;
pub use posture::Postures;
pub use scene::Scene;
pub use sessions::sessions;
pub use shapes::{BodyShape, Shapes};
pub use simulator::Simulator;
pub use truth::{LaterPosture, SCHEMA, TruePose, TrueRobot, TrueScan, Truth};
