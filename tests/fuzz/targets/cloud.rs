//! Fuzz target `cloud`; what it does and checks stands in `src/clouds.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(init: stillpoint_fuzz::begin(), |data: &[u8]| {
    stillpoint_fuzz::case(|| stillpoint_fuzz::clouds::cloud(data));
});
