//! Errors in, exit codes out: what scripts rely on.

use contract::Kind;
use std::process::ExitCode;

/// All is well.
pub const OK: u8 = 0;
/// Done, and the answer is no: a path is not free.
pub const NO: u8 = 1;
/// Done in part: something was skipped or refused, as the result says.
pub const PARTIAL: u8 = 3;

/// The code that a program ends with after an error of this kind.
#[must_use]
pub fn code(kind: Kind) -> u8 {
    match kind {
        Kind::Usage => 2,
        Kind::BadInput | Kind::Unsupported => 4,
        Kind::OverBudget => 5,
        Kind::Cancelled => 130,
        // Io, Bug, and kinds that `contract` may gain.
        _ => 1,
    }
}

/// The same for `main`.
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
