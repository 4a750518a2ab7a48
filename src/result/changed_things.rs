//! Entries of `changes.json` for bodies that appeared, went or moved, and their lines for people.

use change::{Thing, ThingChange};
use contract::words::{fixed, triple};
use geometry::Aabb;
use serde::{Deserialize, Serialize};

/// A body that changed, as an entry of `changes.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ThingEntry {
    /// `appeared`, `gone` or `moved`.
    pub(crate) change: String,
    /// Corners of its bounds before and now, world frame, metres.
    pub(crate) then: Option<[[f64; 3]; 2]>,
    pub(crate) now: Option<[[f64; 3]; 2]>,
    /// Shift of the middle of its bounds, metres, where it moved.
    pub(crate) shift: Option<[f64; 3]>,
    /// Volume of the voxels that changed, m³.
    pub(crate) volume_m3: f64,
    /// Number of points in these voxels.
    pub(crate) n_points: u64,
}

impl ThingEntry {
    pub(crate) fn of(thing: &Thing) -> Self {
        let bounds = |b: Option<Aabb>| b.map(|b| [b.min, b.max]);
        Self {
            change: word(thing.change).into(),
            then: bounds(thing.then),
            now: bounds(thing.now),
            shift: thing.shift,
            volume_m3: thing.volume,
            n_points: thing.n_points,
        }
    }

    /// A line for people; `k` is its index, from 0.
    pub(crate) fn words(&self, k: usize) -> String {
        let [min, max] = self.now.or(self.then).unwrap_or_default();
        let size = [0, 1, 2].map(|i| fixed(max[i] - min[i], 2)).join(" x ");
        let middle = [0, 1, 2].map(|i| 0.5 * (min[i] + max[i]));
        let line = format!("T{} {}: {size} m at {} m", k + 1, self.change, triple(middle, 2));
        self.shift.map_or(line.clone(), |by| format!("{line}, by {} m", triple(by, 2)))
    }
}

/// The change of a body, as a word.
pub(crate) fn word(change: ThingChange) -> &'static str {
    match change {
        ThingChange::Appeared => "appeared",
        ThingChange::Gone => "gone",
        ThingChange::Moved => "moved",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thing_is_said_by_size_place_and_way() {
        let entry: ThingEntry = serde_json::from_value(serde_json::json!({
            "change": "moved",
            "then": [[0.0, 0.0, 0.0], [0.6, 0.4, 0.9]],
            "now": [[1.0, -0.2, 0.0], [1.6, 0.2, 0.9]],
            "shift": [1.0, -0.2, -0.000_4], "volume_m3": 0.1, "n_points": 900
        }))
        .expect("an entry");
        let expected =
            "T3 moved: 0.60 x 0.40 x 0.90 m at (1.30, 0.00, 0.45) m, by (1.00, -0.20, 0.00) m";
        assert_eq!(entry.words(2), expected);
        let gone = ThingEntry { change: "gone".into(), now: None, shift: None, ..entry };
        assert_eq!(gone.words(0), "T1 gone: 0.60 x 0.40 x 0.90 m at (0.30, 0.20, 0.45) m");
    }
}
