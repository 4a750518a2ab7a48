//! Text of a progress line for people, and the JSON object of the same state for programs.

use super::course::Whole;
use crate::engine::amount::Amount;
use contract::words::count;

/// Width of the bar, columns.
const BAR: usize = 16;
/// Share of points or bytes, and time, from which their rate tells when they end: buffers fill and
/// disks wake up before.
const TELLING_SHARE: f64 = 0.05;
const TELLING_SECONDS: f64 = 2.0;
/// Number of items, a quarter of all, from which they tell how long the others take: one region
/// takes ten times as long as another.
const TELLING_ITEMS: u64 = 4;

/// Estimated seconds that remain, at the average rate so far; `None` where no total is known, and
/// at the beginning, when the rate says little.
fn eta(done: &Amount, total: &Amount, seconds: f64) -> Option<f64> {
    let share = done.share(total)?;
    let is_told = if total.points > 0 || total.bytes > 0 {
        share >= TELLING_SHARE && seconds >= TELLING_SECONDS
    } else {
        share >= 0.5 || share >= 0.25 && done.items >= TELLING_ITEMS
    };
    is_told.then(|| seconds * (1.0 - share) / share)
}

/// What people are told that a stage does; programs get its name.
pub(crate) fn title(name: &str) -> &str {
    match name {
        "digest" => "comparing inputs",
        "robots" => "robot library",
        "ingest" | "read" => "reading scans",
        "store" => "storing points",
        "surfaces" | "surface" => "floor and surfaces",
        "fit" | "search" => "finding robots",
        "join" => "adjusting scans",
        "space" | "unknown" => "free space",
        "segment" => "points of robots",
        "write" => "labelling points",
        "compare" => "comparing scans",
        "list" => "listing files",
        "list_page" => "listing the page",
        "verify" => "checking files",
        "review" => "reviewed postures",
        "hints" => "reviewed places",
        "page" => "report page",
        name => name,
    }
}

/// Progress of a stage at one moment.
pub(super) struct StageState<'a> {
    /// The amount that is done.
    pub(super) done: &'a Amount,
    /// The total amount of the stage.
    pub(super) total: &'a Amount,
    /// Numbers of pieces done and of pieces known so far.
    pub(super) pieces: [u64; 2],
    /// Wall-clock seconds since the stage began.
    pub(super) seconds: f64,
    /// Processor seconds that the whole program has used since the stage began.
    pub(super) cpu_seconds: f64,
    /// Whether the stage has ended.
    pub(super) is_over: bool,
}

impl<'a> StageState<'a> {
    /// The state of a stage that begins.
    pub(super) fn start(total: &'a Amount) -> Self {
        const NOTHING: &Amount = &Amount { items: 0, points: 0, bytes: 0 };
        let (seconds, cpu_seconds) = (0.0, 0.0);
        Self { done: NOTHING, total, pieces: [0; 2], seconds, cpu_seconds, is_over: false }
    }
}

/// The line of the bar: the stage, how far the whole run is or else the stage, the time to go, and
/// what is done. What matters most stands first, since a narrow terminal cuts the line.
pub(super) fn bar_line(
    name: &str,
    state: &StageState<'_>,
    whole: Option<Whole>,
    elapsed: f64,
) -> String {
    let &StageState { done, total, pieces: [n_done, n_known], seconds, .. } = state;
    let share = done.share(total);
    let full = (whole.map_or(share.unwrap_or(0.0), |w| w.share) * BAR as f64) as usize;
    let bar: String = (0..BAR)
        .map(|at| match at {
            at if at < full => '=',
            at if at == full => '>',
            _ => ' ',
        })
        .collect();
    let to_go = whole.map(|w| w.to_go).or_else(|| eta(done, total, seconds));
    let mut words = Vec::new();
    words.extend(to_go.map(|s| format!("about {} to go", time(s))));
    words.extend(match (done.points, done.items, total.items) {
        (0, 0, 0) => None,
        (0, items, 0) => Some(count(items, "item")),
        (0, items, all) => Some(format!("{items} of {}", count(all, "item"))),
        (points, ..) => Some(match share {
            Some(share) => {
                let all = short(total.points.max(points) as f64);
                format!("{:.0} % of {all} points", 100.0 * share)
            }
            None => format!("{} points", short(points as f64)),
        }),
    });
    if n_known > 0 {
        words.push(format!("{n_done} of {n_known} steps"));
    }
    words.push(format!("{} so far", time(elapsed)));
    format!("{} [{bar}] {}", title(name), words.join(", "))
}

/// A time for people: no more digits than they read.
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 99.5 => format!("{s:.0} s"),
        s if s < 5_970.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// The progress as a line for people.
pub(super) fn words(state: &StageState<'_>) -> String {
    let &StageState { done, total, pieces: [n_done, n_known], seconds, is_over: last, .. } = state;
    let mut words = Vec::new();
    if let Some(share) = done.share(total) {
        words.push(format!("{:.0} %", 100.0 * share));
    }
    let rate = |n: u64| n as f64 / seconds.max(1e-3);
    if done.points > 0 {
        words.push(format!("{} points", short(done.points as f64)));
        words.push(format!("{} points/s", short(rate(done.points))));
    } else {
        words.push(count(done.items, "item"));
    }
    if n_known > 0 && !last {
        words.push(format!("{n_done} of {} known so far", count(n_known, "piece")));
    }
    // Without a known total, bytes count items in memory and mean nothing to people.
    if total.bytes > 0 {
        words.push(format!("{}B/s", short(rate(done.bytes))));
    }
    match eta(done, total, seconds) {
        _ if last => words.push(format!("done in {seconds:.1} s")),
        Some(eta) => words.push(format!("{eta:.0} s to go")),
        None => words.push(format!("{seconds:.0} s so far")),
    }
    words.join(", ")
}

/// The progress as a JSON object for programs.
pub(super) fn json(name: &str, state: &StageState<'_>) -> String {
    let &StageState { done, total, pieces: [n_done, n_known], seconds, cpu_seconds, is_over } =
        state;
    let last = is_over;
    let known = |n: u64| (n > 0).then_some(n);
    let rate = done.points as f64 / seconds.max(1e-3);
    serde_json::json!({
        "event": if last { "stage_end" } else { "progress" },
        "stage": name,
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
        "items": done.items, "items_total": known(total.items),
        "points": done.points, "points_total": known(total.points),
        "bytes": done.bytes, "bytes_total": known(total.bytes),
        "pieces": known(n_known).map(|_| n_done), "pieces_known": known(n_known),
        "points_per_second": rate,
        "share": done.share(total),
        "eta_seconds": if last { Some(0.0) } else { eta(done, total, seconds) },
    })
    .to_string()
}

/// A number with three digits and a decimal prefix.
fn short(value: f64) -> String {
    let (scaled, prefix) = match value {
        v if v >= 1e9 => (v / 1e9, " G"),
        v if v >= 1e6 => (v / 1e6, " M"),
        v if v >= 1e3 => (v / 1e3, " k"),
        v => return format!("{v:.0} "),
    };
    format!("{scaled:.*}{prefix}", if scaled < 10.0 { 2 } else { usize::from(scaled < 100.0) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stage after nine seconds, with 17 of 60 pieces.
    fn begun([done, total]: &[Amount; 2]) -> StageState<'_> {
        let (seconds, cpu_seconds, is_over) = (9.0, 9.0, false);
        StageState { done, total, pieces: [17, 60], seconds, cpu_seconds, is_over }
    }

    #[test]
    fn rate_and_time_to_go() {
        let (done, total) = (Amount::points(25), Amount::points(100));
        assert_eq!(eta(&done, &total, 10.0), Some(30.0));
        assert_eq!(eta(&Amount::default(), &total, 10.0), None);
        assert_eq!(eta(&done, &total, 1.0), None);
        assert_eq!(eta(&Amount::points(4), &total, 10.0), None);
        // One region of sixteen says nothing of the others, four of them do, and one of two does.
        let of = |done, total| eta(&Amount::items(done), &Amount::items(total), 30.0);
        assert_eq!(
            [of(1, 16), of(3, 9), of(4, 16), of(1, 2)],
            [None, None, Some(90.0), Some(30.0)]
        );
        assert_eq!(short(35_200_000.0), "35.2 M");
        let amounts = [Amount::items(1), Amount::items(4)];
        let fit = begun(&amounts);
        assert_eq!(words(&fit), "25 %, 1 item, 17 of 60 pieces known so far, 9 s so far");
        let over = StageState { pieces: [60, 60], is_over: true, ..fit };
        assert_eq!(words(&over), "25 %, 1 item, done in 9.0 s");
        let amounts = [Amount::items(5), Amount::items(20)];
        assert_eq!(
            words(&begun(&amounts)),
            "25 %, 5 items, 17 of 60 pieces known so far, 27 s to go"
        );
    }

    #[test]
    fn the_bar_shows_the_whole_run_and_says_first_how_long_it_goes_on() {
        let amounts = [Amount::items(1), Amount::items(4)];
        let state = begun(&amounts);
        let whole = Whole { share: 0.5, to_go: 130.0 };
        assert_eq!(
            bar_line("fit", &state, Some(whole), 128.0),
            "finding robots [========>       ] about 2 min to go, 1 of 4 items, 17 of 60 steps, 2 min so far"
        );
        assert_eq!(
            bar_line("fit", &StageState { pieces: [0; 2], ..state }, None, 9.0),
            "finding robots [====>           ] 1 of 4 items, 9 s so far"
        );
        let (done, total) = (Amount::points(2_500_000), Amount::points(10_000_000));
        let points = StageState { done: &done, total: &total, pieces: [0; 2], ..state };
        assert_eq!(
            bar_line("ingest", &points, None, 9.0),
            "reading scans [====>           ] about 27 s to go, 25 % of 10.0 M points, 9 s so far"
        );
        assert_eq!(
            bar_line("digest", &StageState::start(&Amount::default()), None, 0.0),
            "comparing inputs [>               ] 0 s so far"
        );
        assert_eq!([time(7_200.0), time(3_600.0), time(99.0)], ["2.0 h", "60 min", "99 s"]);
    }
}
