//! Chooses, among the fits of all candidates, those that can stand together: at most one for each
//! body of points (METHOD.md §16).

use contract::{Fit, RunnerUp, Verdict};
use geometry::{Aabb, Point};
use robot::Model;

use crate::verdict::{self, VerdictEvent};

/// Two fits compete where this share of the smaller one's box is shared.
const OVERLAP: f64 = 0.25;
/// Bases nearer than this compete whatever their boxes, metres.
const SAME_BASE: f64 = 0.35;
/// Two robots that cross share less of their surface than this: boxes about links hold more than
/// the links.
const CROSSED: f64 = 0.15;
/// Samples of a link that are asked for that.
const N_SAMPLES: usize = 200;
/// A model that explains this share of what the best explains, as well, is alike.
const ALIKE: f64 = 0.97;

/// Chooses among the fits, best explained first; the losers become runners-up of the winners. A fit
/// that somebody vouches for (`is_known`) stands before all others, and as it is. A refused fit
/// that explains the most keeps what is doubtful from standing there, since what stands there is
/// none of them; what is trusted it does not.
#[must_use]
pub fn choose(mut fits: Vec<Fit>, models: &[Model], is_known: impl Fn(&Fit) -> bool) -> Vec<Fit> {
    fits.sort_by(|a, b| {
        let by_points = || b.explained.total_cmp(&a.explained).then_with(|| a.model.cmp(&b.model));
        is_known(b).cmp(&is_known(a)).then_with(by_points)
    });
    let mut chosen: Vec<(Fit, Aabb)> = Vec::new();
    for fit in fits {
        let bounds = bounds(&fit, models);
        let competes =
            |(w, b): &(Fit, Aabb)| compete(w, b, &fit, &bounds) && !stand_apart([w, &fit], models);
        let stands = |w: &(Fit, Aabb)| w.0.verdict != Verdict::Refused || is_known(&w.0);
        let winner = chosen.iter().position(|w| stands(w) && competes(w));
        match winner.or_else(|| chosen.iter().position(competes)) {
            Some(w) if !stands(&chosen[w]) && fit.verdict == Verdict::Trusted => {
                let refused = std::mem::replace(&mut chosen[w], (fit, bounds)).0;
                lose(&mut chosen[w].0, &refused);
            }
            Some(w) => {
                let winner = &mut chosen[w].0;
                lose(winner, &fit);
                if !is_known(winner) {
                    doubt(winner, &fit);
                }
            }
            None => chosen.push((fit, bounds)),
        }
    }
    let stands = |f: &Fit| f.verdict != Verdict::Refused || is_known(f);
    let mut out: Vec<Fit> = chosen.into_iter().map(|c| c.0).filter(stands).collect();
    // Named from the south-west on, so that ids do not depend on scores.
    out.sort_by(|a, b| {
        let (p, q) = (a.world_from_base.translation.vector, b.world_from_base.translation.vector);
        p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y))
    });
    out
}

/// Box of all links in the world.
fn bounds(fit: &Fit, models: &[Model]) -> Aabb {
    let model = &models[fit.model];
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    let mut out = Aabb::EMPTY;
    for (link, pose) in model.links.iter().zip(model.poses(&posture)) {
        if link.bounds.is_empty() {
            continue;
        }
        for corner in link.bounds.corners() {
            out.add((fit.world_from_base * pose * Point::from(corner)).coords.into());
        }
    }
    out
}

fn compete(a: &Fit, a_box: &Aabb, b: &Fit, b_box: &Aabb) -> bool {
    let apart =
        (a.world_from_base.translation.vector - b.world_from_base.translation.vector).norm();
    if apart < SAME_BASE {
        return true;
    }
    let volume = |x: &Aabb| x.size().iter().product::<f64>();
    let shared = Aabb {
        min: [0, 1, 2].map(|i| a_box.min[i].max(b_box.min[i])),
        max: [0, 1, 2].map(|i| a_box.max[i].min(b_box.max[i])),
    };
    let smaller = volume(a_box).min(volume(b_box));
    smaller > 0.0 && volume(&shared) > OVERLAP * smaller
}

/// Whether two fits are of two robots whose arms cross: on bases of their own, and hardly any
/// surface of one is within a link of the other. Doubtful ones of one model, too: each of two such
/// arms is the other's likeliest other posture. What is refused bars nothing that stands apart from
/// it.
fn stand_apart(fits: [&Fit; 2], models: &[Model]) -> bool {
    let [a, b] = fits.map(|f| f.world_from_base.translation.vector);
    let is = |verdict: Verdict| move |f: &&Fit| f.verdict == verdict;
    let may_cross = fits.iter().all(is(Verdict::Trusted))
        || fits.iter().any(is(Verdict::Refused))
        || fits[0].model == fits[1].model;
    may_cross
        && (a - b).norm() >= SAME_BASE
        && share_within(fits, models) < CROSSED
        && share_within([fits[1], fits[0]], models) < CROSSED
}

/// Share of the surface of the first within boxes about the links of the second.
fn share_within([own, other]: [&Fit; 2], models: &[Model]) -> f64 {
    let links = |fit: &Fit| {
        let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
        let poses = models[fit.model].poses(&posture);
        poses.into_iter().map(|pose| fit.world_from_base * pose).collect::<Vec<_>>()
    };
    let boxes: Vec<_> = models[other.model].links.iter().zip(links(other)).collect();
    let is_within = |p: Point| {
        let within = |(link, pose): &(&robot::Link, geometry::Pose)| {
            link.bounds.contains(pose.inverse_transform_point(&p).coords.into())
        };
        boxes.iter().any(within)
    };
    let (mut n, mut n_within) = (0_u32, 0_u32);
    for (link, pose) in models[own.model].links.iter().zip(links(own)) {
        for p in link.cad.points.iter().take(N_SAMPLES) {
            n += 1;
            n_within += u32::from(is_within(pose * Point::from(p.map(f64::from))));
        }
    }
    f64::from(n_within) / f64::from(n.max(1))
}

/// Notes the loser at the winner, as runner-up.
fn lose(winner: &mut Fit, loser: &Fit) {
    let share = loser.explained / winner.explained;
    let score = share * winner.score;
    if winner.runner_up.as_ref().is_none_or(|r| r.score < score) {
        winner.runner_up = Some(RunnerUp {
            model: loser.model_name.clone(),
            score,
            same_model: loser.model == winner.model,
            margin: 1.0 - share,
        });
    }
}

/// Notes a loser of another model at the winner where it explains nearly as much: as alike, or else
/// as a rival, by which the winner may become doubtful.
fn doubt(winner: &mut Fit, loser: &Fit) {
    if loser.model == winner.model || loser.verdict == Verdict::Refused {
        return;
    }
    let share = loser.explained / winner.explained;
    if share > ALIKE {
        winner.alike.push(loser.model_name.clone());
    } else {
        verdict::apply(winner, &VerdictEvent::RivalModel { model: &loser.model_name, share });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Verdict::{Doubtful, Refused, Trusted};
    use contract::JointFit;

    /// What stands, of fits on one base, each of a model of its own: verdict and explained surface,
    /// m².
    fn stands(fits: &[(Verdict, f64)], known: Option<usize>) -> Vec<(usize, Verdict)> {
        let models = vec![Model::default(); fits.len()];
        let fit = |(model, &(verdict, explained)): (usize, &(Verdict, f64))| {
            let (world_from_base, score) = (geometry::Pose::identity(), 0.5);
            Fit { model, verdict, explained, score, world_from_base, ..Fit::default() }
        };
        let fits = fits.iter().enumerate().map(fit).collect();
        let chosen = choose(fits, &models, |f| known == Some(f.model));
        chosen.iter().map(|f| (f.model, f.verdict)).collect()
    }

    #[test]
    fn a_refused_fit_takes_no_place_from_a_trusted_one() {
        assert_eq!(stands(&[(Refused, 3.0), (Trusted, 2.0)], None), [(1, Trusted)]);
        assert_eq!(stands(&[(Refused, 3.0), (Doubtful, 2.0)], None), []);
        assert_eq!(
            stands(&[(Refused, 3.0), (Trusted, 2.0), (Doubtful, 1.9)], None),
            [(1, Doubtful)]
        );
        assert_eq!(stands(&[(Trusted, 3.0), (Doubtful, 2.8)], None), [(0, Doubtful)]);
        assert_eq!(stands(&[(Trusted, 3.0), (Trusted, 2.95)], None), [(0, Trusted)]);
    }

    #[test]
    fn arms_that_cross_are_two_robots_though_both_are_doubtful() {
        let models = [crate::problem::bar(), crate::problem::bar()];
        let fit = |model: usize, explained: f64, (x, turn, verdict): (f64, f64, Verdict)| Fit {
            model,
            verdict,
            explained,
            joints: vec![JointFit { value: turn, ..JointFit::default() }],
            world_from_base: geometry::Pose::translation(x, 0.0, 0.0),
            ..Fit::default()
        };
        let n_chosen = |model: usize, explained: f64, other: (f64, f64, Verdict)| {
            let fits = vec![fit(0, 1.0, (0.0, 0.8, Doubtful)), fit(model, explained, other)];
            choose(fits, &models, |_| false).len()
        };
        assert_eq!(n_chosen(0, 2.0, (0.5, -0.8, Doubtful)), 2);
        // On one base, or of two models, there is one.
        assert_eq!(n_chosen(0, 2.0, (0.3, -0.8, Doubtful)), 1);
        assert_eq!(n_chosen(1, 2.0, (0.5, -0.8, Doubtful)), 1);
        // What is refused bars it from its own place only.
        assert_eq!(n_chosen(1, 2.0, (0.5, -0.8, Refused)), 1);
        assert_eq!(n_chosen(1, 2.0, (0.3, -0.8, Refused)), 0);
    }

    #[test]
    fn what_somebody_vouches_for_stands_as_it_is() {
        let fits = [(Trusted, 3.0), (Trusted, 1.0)];
        assert_eq!(stands(&fits, Some(1)), [(1, Trusted)]);
        assert_eq!(stands(&[(Trusted, 3.0), (Trusted, 2.8)], Some(0)), [(0, Trusted)]);
        assert_eq!(stands(&[(Refused, 3.0), (Trusted, 4.0)], Some(0)), [(0, Refused)]);
    }
}
