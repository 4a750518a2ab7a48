//! Exit codes of the program, on which scripts rely.

use contract::Kind;
use std::process::ExitCode;

/// Success.
pub const OK: u8 = 0;
/// The answer of a check is no: a path is not free.
pub const NO: u8 = 1;
/// Success in part: something was skipped or refused, as the result states.
pub const PARTIAL: u8 = 3;

/// The exit code for an error of this kind.
#[must_use]
pub fn code(kind: Kind) -> u8 {
    match kind {
        Kind::Usage => 2,
        Kind::BadInput | Kind::Unsupported => 4,
        Kind::OverBudget => 5,
        Kind::Cancelled => 130,
        // `Io`, `Bug`, and kinds that `contract` may add.
        _ => 1,
    }
}

/// The exit code as `main` returns it.
#[must_use]
pub fn exit(code: u8) -> ExitCode {
    ExitCode::from(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_contract() {
        let kinds = [
            Kind::BadInput,
            Kind::Unsupported,
            Kind::Io,
            Kind::OverBudget,
            Kind::Usage,
            Kind::Cancelled,
            Kind::Bug,
        ];
        assert_eq!(kinds.map(code), [4, 4, 1, 5, 2, 130, 1]);
    }
}
