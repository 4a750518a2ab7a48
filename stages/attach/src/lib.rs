//! Decides which residual voxels of all tiles are attached to a robot (hoses, cables, brackets,
//! tools, workpieces), and makes convex pieces of them for a motion planner.
//!
//! A residual voxel is a cube that holds points near a robot that no link explains. Residual voxels
//! are connected to components over all tiles.
//!
//! A component that touches a moving link and nothing fixed is an attachment. A component that
//! touches both is cut where that costs least, twice: once where a cut near the robot is preferred,
//! and once without. What both cuts leave to the robot moves, if it is a hose or near the hand.
//! What they disagree on is uncertain, and so is what a deeper cut leaves to the hand, if that may
//! be a tool; the rest is fixed. Cuts follow inner corners of the surface, where things touch. What
//! rests on something so lightly that it cannot stand there, or hangs on a hose besides, moves with
//! the hand that it touches. A hose whose end is in a shadow touches the link at which it points. A
//! body in the air beside a hand, far from everything else, belongs to the hand.
#![forbid(unsafe_code)]

mod attached;
mod body_cut;
mod bridges;
mod decide;
mod deeper;
mod facets;
mod floating;
mod hands;
mod held;
mod hidden_ends;
mod hulls;
mod layers;
mod max_flow;
mod near_voxels;
mod settings;
mod share;
mod structure;
mod thin;
mod tool_shape;
mod touched_line;
mod voxel_graph;

pub use attached::{Attached, Group};
pub use decide::Attach;
pub use hulls::{AttachedPieces, attached_pieces};
pub use settings::Settings;
