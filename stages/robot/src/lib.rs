//! Robot models: reads URDF files, meshes, chains and closed loops, and gives kinematics and
//! samples of the links' surfaces (CAD clouds). The crate knows no scans.
//!
//! # Example
//! ```
//! use robot::{Model, Settings};
//!
//! let urdf = r#"<robot name="arm">
//!   <link name="base"><visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
//!   <link name="arm"><visual><geometry><box size="0.1 0.1 1"/></geometry></visual></link>
//!   <joint name="shoulder" type="revolute">
//!     <parent link="base"/><child link="arm"/>
//!     <origin xyz="0 0 0.5"/><axis xyz="0 1 0"/><limit lower="-2" upper="2"/>
//!   </joint>
//! </robot>"#;
//! let folder = tempfile::tempdir()?;
//! std::fs::write(folder.path().join("robot.urdf"), urdf)?;
//!
//! let (model, _findings) = Model::load(folder.path(), &Settings::default())?;
//! let quarter_turn = 90.0_f64.to_radians();
//! let base_from_link = model.poses(&[quarter_turn]);
//! let tip = base_from_link[1] * geometry::Point::new(0.0, 0.0, 1.0);
//! assert!((tip - geometry::Point::new(1.0, 0.0, 0.5)).norm() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod bodies;
mod chain;
mod close;
mod closed_loop;
mod cloud;
mod correct;
mod details;
mod dress;
mod encoding;
mod extras;
mod finding;
mod hull;
mod kinematics;
mod library;
mod load;
mod loops;
mod mesh;
mod model;
mod notes;
mod reading;
mod resolve;
mod settings;
mod sheet;
mod tree;
mod urdf;

pub use closed_loop::{ClosedLoop, Closure, Form};
pub use correct::correct;
pub use details::{Inertial, JointDetails, LinkDetails, ModelDetails, SafetyLimits};
pub use extras::{ExtraNode, ExtraValue, UrdfExtra};
pub use finding::{Finding, Severity};
pub use hull::hull;
pub use library::Library;
pub use load::urdf_of;
pub use model::{
    CadCloud, Joint, JointKind, Kinematics, Link, Mesh, Model, Motion, Role, Symmetry,
};
pub use reading::urdf_text;
pub use settings::Settings;
