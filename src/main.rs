//! The program: runs the command line and returns its exit code.

use std::process::ExitCode;

/// mimalloc returns memory to the system when a stage ends, so that the memory of the next stages
/// does not add to it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    use_small_pages();
    stillpoint::cli::exit::exit(stillpoint::cli::main(std::env::args_os()))
}

/// Disables huge pages: memory passes between stages in pieces of all sizes, and with pages of 2
/// MiB the system clears more memory than is used, which takes up to a fifth of a short run
/// (benches/LEARNT.md).
fn use_small_pages() {
    #[cfg(target_os = "linux")]
    {
        // This is advice to the system: without it the run is correct, but slower.
        let _ = rustix::thread::disable_transparent_huge_pages(true);
    }
}
