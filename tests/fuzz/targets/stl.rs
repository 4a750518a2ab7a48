//! Fuzz target `stl`; what it does and checks stands in `src/robots.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(init: stillpoint_fuzz::begin(), |data: &[u8]| {
    stillpoint_fuzz::case(|| stillpoint_fuzz::robots::stl(data));
});
