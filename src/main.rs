//! The program: arguments in, an exit code out.

use std::process::ExitCode;

/// Gives memory back when a stage ends; what the next ones need would otherwise come on top of it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    use_small_pages();
    stillpoint::cli::exit::exit(stillpoint::cli::main(std::env::args_os()))
}

/// Memory is handed from stage to stage in pieces of all sizes; in pages of 2 MiB the system clears
/// more of it than is used, which takes up to a fifth of a short run (benches/LEARNT.md).
fn use_small_pages() {
    #[cfg(target_os = "linux")]
    {
        // Advice only: where the system does not take it, the run is right and slower.
        let _ = rustix::thread::disable_transparent_huge_pages(true);
    }
}
