//! A virtual terrestrial laser scanner: scans a scene with robot models and gives points with
//! truth.
//!
//! Demo robots ([`demo_robots`]) and scenes ([`demo_scene()`]) are included, so that the whole
//! program can be shown and measured without other files.
//!
//! # Example
//! ```
//! use simulate::{Scene, Simulator};
//!
//! // A scanner 1.5 m above a flat floor, without noise.
//! let scene = Scene::from_toml(r#"
//!     [floor]
//!     size = [20, 20]
//!     [[scanner]]
//!     name = "one"
//!     position = [0, 0, 1.5]
//!     noise = 0.0
//!     noise_per_metre = 0.0
//!     jitter = 0.0
//!     raster = { elevation_deg = [-60, -30], step_deg = 1.0 }
//! "#)?;
//! let scan = Simulator::new(&scene, &[])?.scan(0);
//! let columns = &scan.columns;
//! let first = columns.hit.iter().position(|hit| *hit).expect("beams hit the floor");
//! assert!((columns.xyz[first][2] + 1.5).abs() < 1e-3); // scan frame, metres
//! # Ok::<(), contract::Error>(())
//! ```
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
mod moved_things;
mod place;
mod plant;
mod plots;
mod posture;
pub mod random;
mod rpy;
mod scan;
mod scanner;
pub mod scene;
mod sessions;
mod shapes;
mod simulator;
pub mod solid;
mod spot;
mod truth;
mod work_cell;
mod world;

pub use columns::{ScanFrame, SimColumns, SimScan};
pub use demo_scene::{demo_scene, paper_scene};
pub use hand::{part_in, tool_on};
pub use line::{Ends, ProductionLine, line};
pub use moved_things::{MovableKind, MovedThings, TrueThing, moved_things};
pub use plant::{Plant, plant};
pub use plots::hall;
pub use posture::Postures;
pub use scene::Scene;
pub use sessions::sessions;
pub use shapes::{BodyShape, Shapes};
pub use simulator::Simulator;
pub use truth::{LaterPosture, SCHEMA, TruePose, TrueRobot, TrueScan, Truth};
pub use work_cell::{Work, WorkCell, work_cell};
