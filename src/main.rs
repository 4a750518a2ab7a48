//! The program: arguments in, an exit code out.

use std::process::ExitCode;

/// Gives memory back when a stage ends; what the next ones need would otherwise come on top of it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    stillpoint::exit::exit(stillpoint::cli::main(std::env::args_os()))
}
