//! What a person knows of the robots, as a file in; the fits with that applied, and what could not be, out.
//!
//! ```toml
//! [[robot]]                     # one for each place that something is known of
//! at = [2.7, 0.0, 0.3]          # near its base, world, metres
//! radius = 0.5                  # how near, metres
//! model = "kuka_kr10"           # no other model stands here
//! verdict = "accept"            # or "reject": no robot stands here; left out: as the program finds
//! ```
//!
//! The file is the user's and is given again with every run, so what it says survives reruns.

use contract::{Error, Fit, Kind, Result, Verdict};
use geometry::Point;
use serde::Deserialize;
use std::path::Path;

/// How near a base must be to the place given, metres.
const RADIUS: f64 = 0.5;
/// A review is a page: larger files are something else, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// The whole file.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Review {
    /// What is known, place by place.
    #[serde(default, rename = "robot")]
    pub places: Vec<Place>,
}

/// What is known of one place.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Near the base, world, metres.
    pub at: [f64; 3],
    /// How near, metres.
    #[serde(default = "radius")]
    pub radius: f64,
    /// The only model that may stand there.
    #[serde(default)]
    pub model: Option<String>,
    /// What a person decided.
    #[serde(default)]
    pub verdict: Option<Decision>,
}

/// What a person decided of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// It stands there, as found.
    Accept,
    /// Nothing stands there.
    Reject,
}

fn radius() -> f64 {
    RADIUS
}

impl Review {
    /// Reads a review.
    ///
    /// # Errors
    /// A file that cannot be read, is no review, or names a model that the library has not.
    pub fn read(path: &Path, models: &[robot::Model]) -> Result<Self> {
        let bad = |what: String| {
            Error::bad_input(what)
                .at(path.display())
                .hint("a review has [[robot]] with at, and radius, model or verdict")
        };
        let io = |e: std::io::Error| Error::from(e).at(path.display());
        if std::fs::metadata(path).map_err(io)?.len() > MAX_BYTES {
            return Err(bad("too large for a review".into()));
        }
        let text = std::fs::read_to_string(path).map_err(io)?;
        let review: Self = toml::from_str(&text).map_err(|e| bad(e.to_string()))?;
        for place in &review.places {
            if !place.at.iter().chain([&place.radius]).all(|v| v.is_finite()) || place.radius <= 0.0
            {
                return Err(bad(format!("a place or radius is no number: {place:?}")));
            }
            if let Some(model) = &place.model
                && !models.iter().any(|m| m.name == *model)
            {
                let what = format!("the library has no model \"{model}\"");
                return Err(Error::new(Kind::BadInput, what).at(path.display()));
            }
        }
        Ok(review)
    }

    /// The fits of all candidates with what is known applied, and a warning for each place where nothing fits it.
    #[must_use]
    pub fn apply(&self, mut fits: Vec<Fit>) -> (Vec<Fit>, Vec<String>) {
        let mut warnings = Vec::new();
        for place in &self.places {
            let here = |f: &Fit| {
                let base = Point::from(f.world_from_base.translation.vector);
                (base - Point::from(place.at)).norm() <= place.radius
            };
            if place.verdict == Some(Decision::Reject) {
                fits.retain(|f| !here(f));
                continue;
            }
            if let Some(model) = &place.model {
                fits.retain(|f| !here(f) || f.model_name == *model);
            }
            let best = fits
                .iter_mut()
                .filter(|f| here(f))
                .max_by(|a, b| a.explained.total_cmp(&b.explained));
            match best {
                Some(fit) if place.verdict == Some(Decision::Accept) => {
                    if fit.verdict != Verdict::Trusted {
                        fit.reasons.insert(0, "accepted in review".into());
                    }
                    fit.verdict = Verdict::Trusted;
                }
                Some(_) => {}
                None => {
                    let [x, y, z] = place.at;
                    let what = place.model.as_deref().unwrap_or("robot");
                    warnings.push(format!(
                        "the review expects a {what} near ({x:.2}, {y:.2}, {z:.2}), and none was found there"
                    ));
                }
            }
        }
        (fits, warnings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Pose;

    fn fit(model: &str, x: f64, explained: f64) -> Fit {
        let world_from_base = Pose::translation(x, 0.0, 0.0);
        Fit { model_name: model.into(), world_from_base, explained, ..Fit::default() }
    }

    fn place(x: f64, model: Option<&str>, verdict: Option<Decision>) -> Place {
        Place { at: [x, 0.0, 0.0], radius: RADIUS, model: model.map(Into::into), verdict }
    }

    #[test]
    fn a_person_knows_better() {
        let review = Review {
            places: vec![
                place(0.0, Some("b"), Some(Decision::Accept)),
                place(5.0, None, Some(Decision::Reject)),
                place(9.0, Some("a"), None),
            ],
        };
        let fits =
            vec![fit("a", 0.1, 2.0), fit("b", -0.1, 1.0), fit("a", 5.1, 3.0), fit("a", 20.0, 1.0)];
        let (fits, warnings) = review.apply(fits);
        let left: Vec<(&str, Verdict)> = fits.iter().map(|f| (&*f.model_name, f.verdict)).collect();
        assert_eq!(left, [("b", Verdict::Trusted), ("a", Verdict::Doubtful)]);
        assert_eq!(fits[0].reasons, ["accepted in review"]);
        assert_eq!(warnings.len(), 1, "{warnings:?}");
    }
}
