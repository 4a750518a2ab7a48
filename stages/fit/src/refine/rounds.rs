//! The schedule of the refinement: its rounds from wide gates to narrow ones (METHOD.md §11.1).

/// One round of the schedule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Round {
    /// Scale of the robust kernel and gate on the distance, metres.
    pub(super) gate: f64,
    /// Whether each link weighs the same (square root of its points) or by its points.
    pub(super) balanced: bool,
}

/// From a posture that a search found: gates as in METHOD.md §11, ending where the fine field takes
/// over.
pub(crate) const COARSE_ROUNDS: [Round; 9] = [
    Round { gate: 0.120, balanced: true },
    Round { gate: 0.120, balanced: true },
    Round { gate: 0.090, balanced: true },
    Round { gate: 0.065, balanced: true },
    Round { gate: 0.050, balanced: true },
    Round { gate: 0.040, balanced: true },
    Round { gate: 0.030, balanced: true },
    Round { gate: 0.025, balanced: true },
    Round { gate: 0.020, balanced: true },
];

/// The last of the coarse rounds: from a posture that is off by no more than a step of a sweep.
pub(super) const NEAR_ROUNDS: &[Round] = COARSE_ROUNDS.split_at(3).1;

/// The rounds after those, on the fine field.
pub(super) const FINE_ROUNDS: [Round; 3] = [
    Round { gate: 0.025, balanced: true },
    Round { gate: 0.018, balanced: true },
    Round { gate: 0.014, balanced: false },
];
