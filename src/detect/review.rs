//! A review: the TOML file in which a person states what is known of robots, and how its entries
//! change the fits.
//!
//! ```toml
//! [[robot]]                     # one entry for each place
//! at = [2.7, 0.0, 0.3]          # a point near the base, world frame, metres
//! radius = 0.5                  # greatest distance of the base from that point, metres
//! model = "kuka_kr10"           # the only model that may stand here
//! verdict = "accept"            # or "reject": no robot stands here; without it as found
//! joints = { joint_1 = 0.35 }   # start of the fit, radians or metres; others as found, else 0
//! rpy = [0.0, 0.0, 1.57]        # with joints: orientation of the base, whose origin is `at`
//! ```
//!
//! An entry with a model and without joints starts a search around its place where no robot of the
//! model is trusted there, also where the run found no region to search. The yaw and the height of
//! the base are open. So they are for an entry with joints and without `rpy`, where the posture
//! does not stand on a base that was found.
//!
//! The user keeps the file and passes it to every run, so that its statements survive reruns.

mod effects;
mod hints;

use super::search::Search;
use crate::engine::{AllThreads, Engine, Task};
use crate::job::{Job, MAX_TEXT};
use contract::words::triple;
use contract::{Error, Fit, JointFit, Result, Verdict};
use fit::verdict::{self, VerdictEvent};
use geometry::{Point, Pose};
use nalgebra::{Translation3, UnitQuaternion};
use robot::Model;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Default of `radius`: how near a base must be to the place of an entry, metres.
const RADIUS: f64 = 0.5;

/// All entries of a review.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Review {
    /// The entries, one for each place.
    #[serde(default, rename = "robot")]
    pub places: Vec<ReviewPlace>,
}

/// An entry of a review: what a person knows of one place.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReviewPlace {
    /// A point near the base, world frame, metres.
    pub at: [f64; 3],
    /// Greatest distance of the base from that point, metres.
    #[serde(default = "radius")]
    pub radius: f64,
    /// The only model that may stand there, if it is known.
    #[serde(default)]
    pub model: Option<String>,
    /// Decision of the person, if there is one.
    #[serde(default)]
    pub verdict: Option<Decision>,
    /// Joint values near which the robot stands, by name, radians or metres; empty where they are
    /// not known.
    #[serde(default)]
    pub joints: BTreeMap<String, f64>,
    /// Orientation of the base, roll, pitch and yaw as in URDF, radians; [`ReviewPlace::at`] is
    /// then the origin of the base.
    #[serde(default)]
    pub rpy: Option<[f64; 3]>,
}

/// Decision of a person about a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// The robot stands there as it was found.
    Accept,
    /// No robot stands there.
    Reject,
}

fn radius() -> f64 {
    RADIUS
}

impl Review {
    /// The review of a job; empty where the job names none.
    ///
    /// # Errors
    /// Those of [`Review::read`].
    pub(crate) fn of(job: &Job, models: &[Model]) -> Result<Self> {
        let most = job.means.settings.ingest.max_text_bytes;
        let read = |path: &PathBuf| Self::read(path, models, most);
        Ok(job.review.as_ref().map(read).transpose()?.unwrap_or_default())
    }

    /// Reads a review.
    ///
    /// # Errors
    /// A file that cannot be read, has more than `most` bytes, is not a review, or names a model
    /// that the library does not have.
    pub fn read(path: &Path, models: &[Model], most: u64) -> Result<Self> {
        let bad = |what: String| {
            Error::bad_input(what)
                .at(path.display())
                .hint("a review has [[robot]] with at, and radius, model, verdict, joints or rpy")
        };
        let text = ingest::read_text(path, most, MAX_TEXT)?;
        let review: Self = toml::from_str(&text).map_err(|e| {
            let line = e.span().map_or(1, |span| text[..span.start].lines().count().max(1));
            bad(format!("line {line}: {}", e.message().trim().replace('\n', " ")))
        })?;
        for (k, place) in review.places.iter().enumerate() {
            place.check(k + 1, models).map_err(bad)?;
        }
        Ok(review)
    }

    /// The fits of all candidates after fits from given postures have replaced others, and the
    /// indices of entries whose posture the scans contradict.
    pub(crate) fn correct(
        &self,
        mut fits: Vec<Fit>,
        search: &Search<'_, '_>,
        models: &[Model],
        engine: &Engine,
    ) -> Result<(Vec<Fit>, Vec<usize>)> {
        let given = self.places.iter().enumerate().filter(|(_, place)| !place.joints.is_empty());
        let starts: Vec<(usize, Fit)> =
            given.filter_map(|(k, place)| Some((k, place.start(&fits, models)?))).collect();
        let found = engine.fan_out(
            Task::new("review").large(),
            starts.iter().collect(),
            |(_, start)| {
                search.with_scene(start, |scene, settings| {
                    let prepared = search.library().prepared(start.model);
                    fit::again(start, prepared, scene, settings, &AllThreads)
                })
            },
        )?;
        let mut open = Vec::new();
        for ((k, start), fit) in starts.into_iter().zip(found) {
            match fit.flatten() {
                Some(fit) => self.replace(&mut fits, k, fit),
                None => open.push((k, start)),
            }
        }
        let wrong = self.search_for(&mut fits, open, search, engine)?;
        Ok((fits, wrong))
    }

    /// The fits of all candidates after the review: an accepted robot stays as the only one at its
    /// place.
    #[must_use]
    pub fn apply(&self, mut fits: Vec<Fit>) -> Vec<Fit> {
        for place in &self.places {
            let here = |f: &Fit| place.has(f);
            if place.verdict == Some(Decision::Reject) {
                fits.retain(|f| !here(f));
                continue;
            }
            if let Some(model) = &place.model {
                fits.retain(|f| !here(f) || f.model_name == *model);
            }
            let Some(best) = place.best(&fits) else { continue };
            if place.verdict == Some(Decision::Accept) {
                let mut at = 0;
                fits.retain(|f| {
                    at += 1;
                    at - 1 == best || !here(f)
                });
            }
        }
        self.accept(&mut fits);
        fits
    }

    /// The robots that would be reported without the review, for [`Review::effects`]; empty for a
    /// review without entries.
    #[must_use]
    pub(crate) fn without(&self, found: &[Fit], models: &[Model]) -> Vec<Fit> {
        if self.places.is_empty() {
            Vec::new()
        } else {
            fit::choose(found.to_vec(), models, |_| false)
        }
    }

    /// Whether an entry accepts a fit.
    #[must_use]
    pub fn accepts(&self, fit: &Fit) -> bool {
        self.places.iter().any(|p| p.verdict == Some(Decision::Accept) && p.has(fit))
    }

    /// Sets accepted fits to trusted, whatever later checks have found.
    pub fn accept(&self, fits: &mut [Fit]) {
        for fit in fits.iter_mut().filter(|f| self.accepts(f)) {
            verdict::apply(fit, &VerdictEvent::Accepted);
        }
    }
}

impl ReviewPlace {
    /// Checks the values of an entry; `number` counts from 1.
    ///
    /// # Errors
    /// The first value that is not possible, as a message.
    fn check(&self, number: usize, models: &[Model]) -> std::result::Result<(), String> {
        let numbers = self.at.iter().chain([&self.radius]).chain(self.joints.values());
        if !numbers.chain(self.rpy.iter().flatten()).all(|v| v.is_finite()) || self.radius <= 0.0 {
            let what = "at, joints and rpy must be numbers, and radius one above 0";
            return Err(format!("entry {number}, near {}: {what}", self.words()));
        }
        if self.rpy.is_some() && self.joints.is_empty() {
            return Err(format!("rpy near {} needs joints: give them as well", self.words()));
        }
        let Some(name) = &self.model else {
            return if self.joints.is_empty() {
                Ok(())
            } else {
                Err(format!("joints near {} need a model: give it as well", self.words()))
            };
        };
        let Some(model) = models.iter().find(|m| m.name == *name) else {
            return Err(format!("the library has no model \"{name}\""));
        };
        let known: Vec<&str> = model.free.iter().map(|&joint| &*model.joints[joint].name).collect();
        match self.joints.keys().find(|joint| !known.contains(&joint.as_str())) {
            Some(odd) => {
                Err(format!("{name} has no joint \"{odd}\": there are {}", known.join(", ")))
            }
            None => Ok(()),
        }
    }

    /// Index of the fit at this place that explains most points.
    fn best(&self, fits: &[Fit]) -> Option<usize> {
        let here = fits.iter().enumerate().filter(|(_, f)| self.has(f));
        here.max_by(|(_, a), (_, b)| by_rank(a, b)).map(|(at, _)| at)
    }

    /// Whether the base of a fit lies at this place.
    fn has(&self, fit: &Fit) -> bool {
        let base = Point::from(fit.world_from_base.translation.vector);
        (base - Point::from(self.at)).norm() <= self.radius
    }

    /// The start of the fit from the given posture: on the given base, else on that of the best fit
    /// here.
    fn start(&self, fits: &[Fit], models: &[Model]) -> Option<Fit> {
        let index = models.iter().position(|m| Some(&m.name) == self.model.as_ref())?;
        let own = fits.iter().filter(|f| f.model == index && self.has(f));
        let best = own.max_by(|a, b| by_rank(a, b));
        let turn = |[r, p, y]: [f64; 3]| UnitQuaternion::from_euler_angles(r, p, y);
        let world_from_base = match (self.rpy, best) {
            (None, Some(best)) => best.world_from_base,
            (rpy, _) => {
                Pose::from_parts(Translation3::from(self.at), turn(rpy.unwrap_or_default()))
            }
        };
        let model = &models[index];
        // The joint values belong to the base that was found.
        let best = best.filter(|_| self.rpy.is_none());
        let found = |name: &str| best?.joints.iter().find(|j| j.name == name).map(|j| j.value);
        let joint = |&joint: &usize| {
            let name = model.joints[joint].name.clone();
            let given = self.joints.get(&name).copied();
            let value = given.or_else(|| found(&name)).unwrap_or(0.0);
            JointFit { value, name, ..JointFit::default() }
        };
        Some(Fit {
            model: index,
            model_name: model.name.clone(),
            world_from_base,
            joints: model.free.iter().map(joint).collect(),
            ..Fit::default()
        })
    }

    /// The position as text, metres.
    fn words(&self) -> String {
        triple(self.at, 2)
    }
}

/// Order of fits: refused ones last, since they are not reported; otherwise those that explain more
/// points first.
fn by_rank(a: &Fit, b: &Fit) -> std::cmp::Ordering {
    let stands = |f: &Fit| f.verdict != Verdict::Refused;
    stands(a).cmp(&stands(b)).then_with(|| a.explained.total_cmp(&b.explained))
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn fit(model: &str, x: f64, explained: f64) -> Fit {
        let world_from_base = Pose::translation(x, 0.0, 0.0);
        Fit { model_name: model.into(), world_from_base, explained, ..Fit::default() }
    }

    pub(super) fn place(x: f64, model: Option<&str>, verdict: Option<Decision>) -> ReviewPlace {
        let (model, joints) = (model.map(Into::into), BTreeMap::new());
        ReviewPlace { at: [x, 0.0, 0.0], radius: RADIUS, model, verdict, joints, rpy: None }
    }

    #[test]
    fn joints_that_nobody_names_start_where_they_were_found() {
        let link = |name: &str| {
            format!(
                "<link name='{name}'><visual><geometry><box size='0.2 0.1 0.1'/></geometry></visual></link>"
            )
        };
        let joint = |name: &str, parent: &str, child: &str| {
            format!(
                "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/><axis xyz='0 0 1'/>\
                 <limit lower='-3' upper='3' effort='1' velocity='1'/></joint>"
            )
        };
        let links: String = ["foot", "trunk", "arm"].map(link).concat();
        let joints = joint("turn", "foot", "trunk") + &joint("bend", "trunk", "arm");
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("arm.urdf");
        let urdf = format!("<robot name='arm'>{links}{joints}</robot>");
        std::fs::write(&path, urdf).expect("is written");
        let models =
            [Model::load_urdf(&path, "arm", &robot::Settings::default()).expect("loads").0];
        let value =
            |name: &str, value: f64| JointFit { name: name.into(), value, ..JointFit::default() };
        let found =
            Fit { joints: vec![value("turn", 0.3), value("bend", 0.9)], ..fit("arm", 0.1, 1.0) };
        let given = ReviewPlace {
            joints: BTreeMap::from([("bend".to_string(), -1.2)]),
            ..place(0.0, Some("arm"), None)
        };
        let values = |fits: &[Fit]| {
            let start = given.start(fits, &models).expect("the model is known");
            start.joints.iter().map(|j| j.value).collect::<Vec<_>>()
        };
        assert_eq!(values(&[found]), [0.3, -1.2]);
        assert_eq!(values(&[]), [0.0, -1.2]);
    }

    #[test]
    fn what_cannot_be_is_named_by_entry_and_line_in_plain_words() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("review.toml");
        let said = |text: &str| {
            std::fs::write(&path, text).expect("is written");
            Review::read(&path, &[], 1 << 20).expect_err("cannot be").to_string()
        };
        let good = "[[robot]]\nat = [1.0, 2.0, 0.0]\n";
        let radius = said(&format!("{good}[[robot]]\nat = [1.0, -0.001, 0.0]\nradius = 0.0\n"));
        assert!(
            radius.contains(
                "entry 2, near (1.00, 0.00, 0.00): at, joints and rpy must be numbers, and radius one above 0"
            ),
            "{radius}"
        );
        let verdict = said(&format!("{good}verdict = \"acept\"\n"));
        assert!(verdict.contains("review.toml: line 3: unknown variant `acept`"), "{verdict}");
        for text in [radius, verdict] {
            assert!(!text.contains('\n') && !text.contains("Place {"), "{text}");
        }
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
        let fits = review.apply(fits);
        let left: Vec<(&str, Verdict)> = fits.iter().map(|f| (&*f.model_name, f.verdict)).collect();
        assert_eq!(left, [("b", Verdict::Trusted), ("a", Verdict::Doubtful)]);
        assert_eq!(fits[0].reasons, ["accepted in review"]);
        // An entry without a model means the best fit, and its rivals become doubtful.
        let review = Review { places: vec![place(0.0, None, Some(Decision::Accept))] };
        let mut fits = review.apply(vec![fit("a", 0.1, 2.0), fit("b", -0.1, 1.9)]);
        assert_eq!(fits.len(), 1);
        assert!(review.accepts(&fits[0]) && fits[0].model_name == "a");
        // A refused fit was never reported, so the entry cannot mean it.
        let refused = Fit { verdict: Verdict::Refused, ..fit("a", 0.1, 3.0) };
        assert_eq!(review.apply(vec![refused, fit("b", -0.1, 1.9)])[0].model_name, "b");
        // Reasons that the fit of a tool adds later do not undo it.
        (fits[0].verdict, fits[0].reasons) = (Verdict::Doubtful, vec!["few points".into()]);
        review.accept(&mut fits);
        assert_eq!(fits[0].verdict, Verdict::Trusted);
        assert_eq!(fits[0].reasons, ["accepted in review", "few points"]);
    }
}
