//! Labels all points of the inputs and writes masks, clouds, pictures and the known space around
//! each robot.

pub(crate) mod cluster_lookup;
pub(crate) mod input_labels;
pub(crate) mod joined_files;
pub(crate) mod known_space;
pub(crate) mod label_strips;
pub(crate) mod labelling;
pub(crate) mod masks;
pub(crate) mod near_robots;
pub(crate) mod page_parts;
mod piece_records;
mod robot_pictures;
