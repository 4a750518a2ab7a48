//! A unit of length.

use contract::quote;
use serde::Serialize;
use std::fmt;

/// Largest relative difference of two units that are the same: rounding, and the two kinds of foot
/// (2e-6).
const SAME: f64 = 1e-3;

/// A unit of length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LengthUnit {
    /// Display name.
    pub name: String,
    /// Length of one unit, metres.
    pub metres: f64,
}

impl LengthUnit {
    pub(crate) fn new(name: impl Into<String>, metres: f64) -> Self {
        Self { name: name.into(), metres }
    }

    /// Whether the unit is about `metres` long.
    pub(crate) fn is_about(&self, metres: f64) -> bool {
        is_same(self.metres, metres)
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name.as_str() {
            "metre" if is_same(self.metres, 1.0) => write!(f, "metre"),
            name => write!(f, "{} ({} m)", quote::shown(name), (self.metres * 1e9).round() / 1e9),
        }
    }
}

/// Whether two units, in metres, are the same.
pub(crate) fn is_same(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < SAME
}
