//! Entries of `changes.json` for bodies that appeared, went or moved, and their lines for people.

use change::{Thing, ThingChange, ThingMotion};
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
    /// Displacement of the point of the thing that stood at `motion.at`, metres, where it moved and
    /// that can be told. In results of earlier versions, which state no `motion`, it is that of the
    /// middle of the bounds.
    pub(crate) shift: Option<[f64; 3]>,
    /// What is known of the shift and of the turn.
    #[serde(default)]
    pub(crate) motion: Option<MotionEntry>,
    /// Why no shift is stated of a thing that moved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) shift_unknown: Option<String>,
    /// Volume of the voxels that changed, m³.
    pub(crate) volume_m3: f64,
    /// Number of points in these voxels.
    pub(crate) n_points: u64,
}

/// The motion of a thing, beside its shift.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct MotionEntry {
    /// Where the point stood whose shift is stated, world frame, metres.
    pub(crate) at: [f64; 3],
    /// Standard deviations of the shift in x, y and z, metres.
    pub(crate) sigma: [f64; 3],
    /// Covariance of the shift, m².
    pub(crate) covariance: [[f64; 3]; 3],
    /// Turn about the vertical, counter-clockwise seen from above, degrees, with its standard
    /// deviation; `null` where the points do not tell, as of a drum, or of a box after whose
    /// quarter turns they fit about as well.
    pub(crate) turn_deg: Option<f64>,
    pub(crate) turn_sigma_deg: Option<f64>,
    /// Other turns with which the thing looks the same, degrees.
    pub(crate) other_turns_deg: Vec<f64>,
    /// Unit vectors along which the shift is hardly determined, the least determined first.
    pub(crate) open: Vec<[f64; 3]>,
    /// Shares of what the earlier and the later session saw of the thing that the other one saw
    /// too.
    pub(crate) common: [f64; 2],
}

impl MotionEntry {
    fn of(motion: &ThingMotion) -> Self {
        let covariance = motion.covariance;
        Self {
            at: motion.at,
            sigma: [0, 1, 2].map(|i| covariance[i][i].max(0.0).sqrt()),
            covariance,
            turn_deg: motion.turn.map(|[turn, _]| turn.to_degrees()),
            turn_sigma_deg: motion.turn.map(|[_, sigma]| sigma.to_degrees()),
            other_turns_deg: motion.other_turns.iter().map(|turn| turn.to_degrees()).collect(),
            open: motion.open.clone(),
            common: motion.common,
        }
    }

    /// Standard deviations and turn for people.
    fn words(&self) -> String {
        let mut words = format!(" (± {} mm)", triple(self.sigma.map(|s| 1e3 * s), 0));
        if let Some(turn) = self.turn_deg {
            words += &format!(", turned by {}°", fixed(turn, 1));
        }
        if !self.open.is_empty() {
            words += ", open where its ends were not seen";
        }
        words
    }
}

impl ThingEntry {
    pub(crate) fn of(thing: &Thing) -> Self {
        let bounds = |b: Option<Aabb>| b.map(|b| [b.min, b.max]);
        let motion = thing.motion.as_ref().and_then(|m| m.as_ref().ok());
        let unknown = thing.motion.as_ref().and_then(|m| m.as_ref().err());
        Self {
            change: word(thing.change).into(),
            then: bounds(thing.then),
            now: bounds(thing.now),
            shift: motion.map(|m| m.shift),
            motion: motion.map(MotionEntry::of),
            shift_unknown: unknown.map(|why| why.words().into()),
            volume_m3: thing.volume,
            n_points: thing.n_points,
        }
    }

    /// A line for people; `k` is its index, from 0.
    pub(crate) fn words(&self, k: usize) -> String {
        let [min, max] = self.now.or(self.then).unwrap_or_default();
        let size = [0, 1, 2].map(|i| fixed(max[i] - min[i], 2)).join(" x ");
        let middle = [0, 1, 2].map(|i| 0.5 * (min[i] + max[i]));
        let mut line = format!("T{} {}: {size} m at {} m", k + 1, self.change, triple(middle, 2));
        if let Some(by) = self.shift {
            line += &format!(", by {} m", triple(by, if self.motion.is_some() { 3 } else { 2 }));
        }
        if let Some(motion) = &self.motion {
            line += &motion.words();
        }
        if let Some(why) = &self.shift_unknown {
            line += &format!(", shift unknown: {why}");
        }
        line
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
        .expect("an entry of an earlier version");
        let expected =
            "T3 moved: 0.60 x 0.40 x 0.90 m at (1.30, 0.00, 0.45) m, by (1.00, -0.20, 0.00) m";
        assert_eq!(entry.words(2), expected);
        let gone = ThingEntry { change: "gone".into(), now: None, shift: None, ..entry.clone() };
        assert_eq!(gone.words(0), "T1 gone: 0.60 x 0.40 x 0.90 m at (0.30, 0.20, 0.45) m");
        let motion = ThingMotion {
            at: [0.3, 0.2, 0.45],
            shift: [1.0, -0.2, -0.000_4],
            covariance: [[9e-6, 0.0, 0.0], [0.0, 4e-2, 0.0], [0.0, 0.0, 4e-6]],
            turn: Some([0.1, 0.002]),
            other_turns: vec![],
            open: vec![[0.0, 1.0, 0.0]],
            common: [0.6, 0.7],
        };
        let known = ThingEntry { motion: Some(MotionEntry::of(&motion)), ..entry.clone() };
        let more = ", by (1.000, -0.200, 0.000) m (± (3, 200, 2) mm), turned by 5.7°, open where \
                    its ends were not seen";
        assert!(known.words(0).ends_with(more), "{}", known.words(0));
        let why = change::UnknownMotion::NothingCommon.words();
        let unknown = ThingEntry { shift: None, shift_unknown: Some(why.into()), ..entry };
        assert!(unknown.words(0).ends_with(&format!("shift unknown: {why}")));
    }
}
