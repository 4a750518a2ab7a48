//! Fuzz target `trajectory`; what it does and checks stands in `src/program.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(init: stillpoint_fuzz::begin(), |data: &[u8]| {
    stillpoint_fuzz::case(|| stillpoint_fuzz::program::trajectory(data));
});
