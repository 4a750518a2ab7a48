//! Robots and strips in; the label of every point, as masks, clouds and pictures, and the known
//! space around each robot, out.

pub(crate) mod cluster_lookup;
pub(crate) mod known_space;
pub(crate) mod label_strips;
pub(crate) mod labelling;
pub(crate) mod masks;
pub(crate) mod near_robots;
