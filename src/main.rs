//! The program: arguments in, an exit code out.

use std::process::ExitCode;

fn main() -> ExitCode {
    stillpoint::exit::exit(stillpoint::cli::main(std::env::args_os()))
}
