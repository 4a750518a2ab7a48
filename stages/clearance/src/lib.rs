//! Checks a path of robot postures against its surroundings: where on the path which part comes
//! near which obstacle.
//!
//! The check is conservative: points count as balls that contain their whole cell, and between two
//! examined postures each part is assumed to move up to half a step farther.
//!
//! # Example
//! ```
//! use clearance::{
//!     Cells, Contacts, KnownBounds, ObstacleKind, Obstacles, PathWalk, RobotBody, leg, reach,
//! };
//! use geometry::{Aabb, Pose};
//! # let folder = tempfile::tempdir()?;
//! # let beam = "<origin xyz='0.5 0 0'/><geometry><box size='1 0.1 0.1'/></geometry>";
//! # std::fs::write(folder.path().join("robot.urdf"), format!("<robot name='arm'>
//! #   <link name='foot'/><link name='beam'><visual>{beam}</visual></link>
//! #   <joint name='j' type='revolute'><parent link='foot'/><child link='beam'/>
//! #   <axis xyz='0 0 1'/><limit lower='-3' upper='3'/></joint></robot>"))?;
//! let model = robot::Model::load(folder.path(), &robot::Settings::default())?.0; // 1 m about z
//! let (margin, found) = (0.02, vec![0.0]);
//! let mut cells = Cells::within(reach(&model) + margin, &Default::default());
//! let post = (0..40).map(|i| [0.0, 0.9, 0.01 * f64::from(i - 20)]);
//! post.for_each(|p| cells.add(p, ObstacleKind::Fixed, false, 0));
//! cells.remove_duplicates();
//! let bounds = Aabb { min: [-9.0; 3], max: [9.0; 3] };
//! let known = KnownBounds { world_from_base: Pose::identity(), bounds };
//! let mut around = Obstacles::new(&cells, &[], None, known, &contract::OneByOne);
//! let mut body = RobotBody::new(&model, Default::default(), margin, 0.0, &contract::OneByOne);
//! body.remove_robot(&found, &mut around);
//! let path = [found.clone(), vec![2.0]]; // the beam turns past a post at 90°
//! let legs = [leg(&body, &path[0], &path[1])];
//! let walk = PathWalk::new(&body, &around, &path, &legs, &found);
//! let mut contacts = Contacts::default();
//! (0..walk.n_pieces()).for_each(|piece| walk.add(walk.examine(piece), &mut contacts));
//! assert_eq!(contacts.all()[0].what, ObstacleKind::Fixed);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod body;
mod cells;
mod contact_level;
mod evidence;
mod front;
mod grid;
mod lines;
mod obstacle;
mod obstacles;
mod own_surface;
mod path;
mod pockets;
mod shadow;
mod shape;

pub use body::{AttachedPoints, BESIDE_REACH, RobotBody, STEP, reach};
pub use cells::{Cells, FARTHEST, PointCell};
pub use contact_level::ContactLevel;
pub use evidence::attached_points;
pub use obstacle::{CELL, ObstacleKind};
pub use obstacles::{KnownBounds, Obstacles};
pub use own_surface::OwnSurface;
pub use path::{Contact, Contacts, Leg, PathWalk, PieceContacts, leg};
pub use shadow::{ScannerAt, Shadow};
