//! Tells in which scans a robot stood in which posture, where somebody moved it between two
//! stations and the scans contradict each other.

use contract::words::count;
use contract::{Candidate, Fan, Fit, InstallationPlane, OneByOne, Region, Verdict, View};
use geometry::{Point, Pose};

use crate::problem::{Problem, judged};
use crate::solve::{fit, quick};
use crate::state::Hypothesis;
use crate::verdict::{self, MIN_AGREEING, VerdictEvent};
use crate::{MeasuredScene, Prepared, Settings};

/// When a posture that another scan tells stands in a scan, too.
struct AgreeingScan {
    /// Least share of the judged surface of the moving links, explained less contradicted.
    min_score: f64,
    /// Share of the moving surface that the scan must have judged to say anything.
    min_judged: f64,
}

const AGREES: AgreeingScan = AgreeingScan { min_score: 0.35, min_judged: 0.03 };
/// Most postures of one robot that are told apart.
const MAX_STAYS: usize = 4;

/// What is seen of a region, scan by scan.
#[derive(Debug, Clone, Copy)]
pub struct ScansOfRegion<'a> {
    /// The region.
    pub region: &'a Region,
    /// Views of the region.
    pub views: &'a [View],
    /// Planes about it, world.
    pub floors: &'a [InstallationPlane],
}

/// What the scans say where they disagree: the fit of the scans that agree on the best posture,
/// with a fit of the others beside it ([`Fit::stays`]); `None` where they do not disagree, or no
/// group of them shows the robot plainly.
#[must_use]
pub fn stays(
    candidate: &Candidate,
    prepared: &Prepared<'_>,
    sights: &ScansOfRegion<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Option<Fit> {
    let seeing = (0..sights.views.len()).filter(|&v| !sights.views[v].images.is_empty()).collect();
    let single =
        |v: usize| Single::new(&sights.views[v], candidate, prepared, sights, settings, fan);
    let singles: Vec<Single<'_>> = fan.fan(seeing, single);
    let mut left: Vec<usize> = (0..singles.len()).collect();
    let mut out: Vec<(Fit, Hypothesis)> = Vec::new();
    let mut candidate = candidate.clone();
    while out.len() < MAX_STAYS {
        // The posture of one scan that most surface of the others bears out.
        let groups = left.iter().filter_map(|&v| {
            let h = singles[v].found.as_ref()?;
            let says = left.iter().map(|&u| (u, singles[u].says(h, prepared, settings)));
            let own: Vec<_> = says.filter(|(u, s)| *u == v || bears_out(s)).collect();
            let net = own.iter().map(|(_, s)| s[0]).sum::<f64>();
            Some((net, own.into_iter().map(|(u, _)| u).collect::<Vec<_>>()))
        });
        let Some((_, own)) = groups.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if own.len() == singles.len() {
            return None;
        }
        left.retain(|v| !own.contains(v));
        let views: Vec<&View> = own.iter().map(|&v| singles[v].view).collect();
        let scene = MeasuredScene::of(sights.region, &views, sights.floors, settings, fan);
        let found = fit(&candidate, prepared, &scene, settings, fan);
        let is_plain = |f: &Fit| match own.len() < MIN_AGREEING {
            true => f.verdict == Verdict::Trusted,
            false => f.verdict != Verdict::Refused,
        };
        let Some(mut found) = found.filter(is_plain) else {
            if out.is_empty() {
                return None;
            }
            continue;
        };
        verdict::apply(&mut found, &VerdictEvent::ScansAgree(own.len()));
        found.stands_in = views.iter().map(|v| v.scan).collect();
        // It did not move its base.
        candidate.bases = vec![(found.world_from_base, candidate.bases[0].1)];
        let h = Hypothesis {
            local_from_base: scene.world_from_local().inverse() * found.world_from_base,
            posture: found.joints.iter().map(|j| j.value).collect(),
            score: found.score,
        };
        out.push((found, h));
    }
    together(out, &left, &singles, prepared, settings)
}

/// One fit of all groups; scans that show too little for a posture of their own go with the one
/// that they bear out most.
fn together(
    mut groups: Vec<(Fit, Hypothesis)>,
    left: &[usize],
    singles: &[Single<'_>],
    prepared: &Prepared<'_>,
    settings: &Settings,
) -> Option<Fit> {
    let mut n_silent = 0;
    for &u in left {
        let net = |h: &Hypothesis| singles[u].says(h, prepared, settings)[0];
        let best = groups.iter_mut().max_by(|a, b| net(&a.1).total_cmp(&net(&b.1)));
        match best.filter(|group| net(&group.1) > 0.0) {
            Some(group) => group.0.stands_in.push(singles[u].view.scan),
            None => n_silent += 1,
        }
    }
    let mut fits = groups.into_iter().map(|(mut fit, _)| {
        fit.stands_in.sort_unstable();
        fit
    });
    let mut first = fits.next()?;
    first.stays = fits.collect();
    let silent = (n_silent > 0).then(|| {
        let scans = count(n_silent as u64, "scan");
        format!("in {scans} it stands in no posture that was found")
    });
    let moved = match first.stays.len() {
        0 => "scans contradict one another about it: some of them bear this posture out".into(),
        n => format!("it moved between scans: {} postures", 1 + n),
    };
    verdict::note(&mut first, silent.into_iter().chain([moved]));
    Some(first)
}

/// Whether a scan shows what a posture asks for: explained, judged and whole surface of the moving
/// links, m².
fn bears_out([net, judged, whole]: &[f64; 3]) -> bool {
    *judged > AGREES.min_judged * whole && *net > AGREES.min_score * judged
}

/// One scan alone, and the posture that it shows, if it shows one.
struct Single<'a> {
    view: &'a View,
    scene: MeasuredScene<'a>,
    found: Option<Hypothesis>,
}

impl<'a> Single<'a> {
    fn new(
        view: &'a View,
        candidate: &Candidate,
        prepared: &Prepared<'_>,
        sights: &ScansOfRegion<'a>,
        settings: &Settings,
        fan: &dyn Fan,
    ) -> Self {
        let scene = MeasuredScene::of(sights.region, &[view], sights.floors, settings, fan);
        let local_from_world = scene.world_from_local().inverse();
        let bases: Vec<Pose> =
            candidate.bases.iter().map(|(pose, _)| local_from_world * pose).collect();
        let base = bases.first().map_or_else(Point::origin, |b| b.translation.vector.into());
        let nearby = scene.nearby(prepared, &base);
        let problem = Problem::new(prepared, &scene, settings, fan).with_points(&nearby);
        let found = quick(&problem, &bases).map(|found| found.hypothesis);
        Self { view, scene, found }
    }

    /// What this scan says of a posture: explained less contradicted, judged and whole surface of
    /// the moving links, m².
    fn says(&self, h: &Hypothesis, prepared: &Prepared<'_>, settings: &Settings) -> [f64; 3] {
        let judgement = judged(&Problem::new(prepared, &self.scene, settings, &OneByOne), h);
        let moving = (0..prepared.links.len()).filter(|l| !prepared.fixed.contains(l));
        moving.fold([0.0; 3], |sum, l| {
            let [net, judged] = judgement.links[l];
            [sum[0] + net, sum[1] + judged, sum[2] + prepared.links[l].area]
        })
    }
}
