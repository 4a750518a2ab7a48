//! What the program is worth: benches, the demo, the virtual scanner and the comparison of a result
//! with the truth of its scene. Only the command line imports this room.

pub mod bench;
pub mod compare;
pub mod confusion;
pub mod demo;
#[cfg(fuzzing)]
pub mod fuzz_doors;
pub mod virtual_scan;
