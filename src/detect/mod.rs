//! Tiles in, robots out: ground and occupied space, the search of each region, tools on flanges,
//! joints calibrated where that is asked for, and what a person knows of the robots.

pub mod calibrate;
pub(crate) mod ground;
pub(crate) mod library;
pub(crate) mod region_failures;
pub mod review;
pub(crate) mod robot_id;
pub(crate) mod robots;
pub(crate) mod search;
pub(crate) mod tools;
