//! Finds the robots in the tiles: ground and occupied space, the search of each region, tools on
//! flanges, calibration of joints on request, and the review by a person.

pub mod calibrate;
pub(crate) mod ground;
pub(crate) mod library;
pub(crate) mod region_failures;
pub mod review;
pub(crate) mod robot_id;
pub(crate) mod robots;
pub(crate) mod search;
pub(crate) mod tools;
