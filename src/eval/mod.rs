//! Evaluation of the program: benches, the demo, the virtual scanner, and the comparison of results
//! with the truth. Only the command line imports this room.

pub mod bench;
pub mod compare;
pub mod confusion;
pub mod demo;
#[cfg(fuzzing)]
pub mod fuzz_doors;
pub mod virtual_scan;
