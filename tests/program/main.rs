//! The whole program from outside. All of it is one test program, since each links everything: the
//! tests of a file run with `cargo test --release --test program FILE`.

mod again;
mod bench;
mod calibrate;
mod cameras;
mod check;
mod clouds;
mod command_line;
mod common;
mod faults;
mod frames;
mod guide;
mod mesh;
mod moved;
#[cfg(target_os = "linux")]
mod pseudo_terminal;
mod rescan;
mod review;
mod scanners;
mod scans_back;
mod shards;
mod tamper;
mod terminal;
mod units;
mod whole;
