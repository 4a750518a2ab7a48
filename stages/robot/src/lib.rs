//! Robots as models: URDF, meshes, chains and loops in; kinematics and CAD clouds out. Knows no
//! scans.
#![forbid(unsafe_code)]

mod bodies;
mod chain;
mod close;
mod closed_loop;
mod cloud;
mod correct;
mod dress;
mod encoding;
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
pub use finding::{Finding, Severity};
pub use hull::hull;
pub use library::Library;
pub use load::urdf_of;
pub use model::{
    CadCloud, Joint, JointKind, Kinematics, Link, Mesh, Model, Motion, Role, Symmetry,
};
pub use reading::urdf_text;
pub use settings::Settings;
