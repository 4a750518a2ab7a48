//! The promises of the engine, each a test.

use super::*;
use contract::{Error, Fold, Kind, Map, Result, Weigh};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, AtomicUsize, Ordering};
use std::thread::sleep;
use std::time::Duration;

/// An item that knows how many bytes are alive.
pub(super) struct Heavy {
    pub(super) value: u64,
    bytes: usize,
    live: Arc<Live>,
}

#[derive(Default)]
pub(super) struct Live {
    now: AtomicI64,
    peak: AtomicI64,
}

impl Live {
    /// Bytes alive now, and the most there ever were.
    pub(super) fn both(&self) -> (i64, i64) {
        (self.now.load(Ordering::SeqCst), self.peak.load(Ordering::SeqCst))
    }
}

impl Heavy {
    pub(super) fn new(value: u64, bytes: usize, live: &Arc<Live>) -> Self {
        let now = live.now.fetch_add(bytes as i64, Ordering::SeqCst) + bytes as i64;
        live.peak.fetch_max(now, Ordering::SeqCst);
        Self { value, bytes, live: Arc::clone(live) }
    }
}

impl Drop for Heavy {
    fn drop(&mut self) {
        self.live.now.fetch_sub(self.bytes as i64, Ordering::SeqCst);
    }
}

impl Weigh for Heavy {
    fn weight_bytes(&self) -> usize {
        self.bytes
    }
}

/// A light item.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number(pub(super) u64);

impl Weigh for Number {
    fn weight_bytes(&self) -> usize {
        8
    }
}

fn mix(x: u64) -> u64 {
    let z = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb) >> 11
}

/// A map whose time varies from item to item, and that fails or panics at given positions.
#[derive(Default)]
pub(super) struct Work {
    pub(super) fails: Vec<u64>,
    pub(super) panics: Vec<u64>,
}

impl Map for Work {
    type In = Number;
    type Out = Number;
    type Scratch = u64;
    fn apply(&self, item: Number, scratch: &mut u64) -> Result<Number> {
        *scratch += 1;
        sleep(Duration::from_micros(mix(item.0) % 300));
        assert!(!self.panics.contains(&item.0), "item {} is unlucky", item.0);
        if self.fails.contains(&item.0) {
            return Err(Error::bad_input(format!("page {} is torn", item.0)));
        }
        Ok(Number(item.0 * 3))
    }
}

/// A digest that depends on order.
pub(super) struct Digest;

impl Fold for Digest {
    type In = Number;
    type Sum = (u64, u64);
    type Out = (u64, u64);
    fn empty(&self) -> (u64, u64) {
        (0, 0)
    }
    fn add(&self, sum: &mut (u64, u64), item: Number) -> Result<()> {
        *sum = (mix(sum.0.wrapping_add(item.0)), sum.1 + 1);
        Ok(())
    }
    fn join(&self, _: &mut (u64, u64), _: (u64, u64)) -> Result<()> {
        Err(Error::new(Kind::Bug, "order-dependent digests do not join"))
    }
    fn finish(&self, sum: (u64, u64)) -> Result<(u64, u64)> {
        Ok(sum)
    }
}

pub(super) fn engine(n_workers: usize, channel_bytes: usize) -> Engine {
    let mut engine = Engine::new(n_workers);
    engine.channel_bytes = channel_bytes;
    engine
}

fn numbers(n: u64) -> impl Iterator<Item = Result<Number>> + Send {
    (0..n).map(|i| Ok(Number(i)))
}

#[test]
fn order_and_answer_for_any_workers_and_memory() {
    let (first, second) = (Work::default(), Work::default());
    let mut expected = (0, 0);
    for i in 0..300 {
        Digest.add(&mut expected, Number(i * 9)).expect("adds");
    }
    for n_workers in 1..=8 {
        for channel_bytes in [1, 200, 1 << 20] {
            let got = engine(n_workers, channel_bytes)
                .pass("test", numbers(300), |f| f.map(&first).map(&second).fold(&Digest))
                .expect("no error");
            assert!(got == expected, "{n_workers} workers, {channel_bytes} bytes");
        }
    }
}

#[test]
fn sink_sees_items_in_order() {
    let mut seen = Vec::new();
    let work = Work::default();
    engine(4, 500)
        .pass("test", numbers(200), |f| {
            f.map(&work).for_each(|n| {
                seen.push(n.0);
                Ok(())
            })
        })
        .expect("no error");
    assert_eq!(seen, (0..200).map(|i| i * 3).collect::<Vec<_>>());
}

#[test]
fn first_error_by_position() {
    // The later error comes up in the earlier step, and both often come out of order.
    let first = Work { fails: vec![130, 90, 91], panics: vec![] };
    let second = Work { fails: vec![40 * 3, 170 * 3], panics: vec![] };
    for round in 0..20 {
        let error = engine(1 + round % 8, 100)
            .pass("test", numbers(200), |f| f.map(&first).map(&second).fold(&Digest))
            .expect_err("fails");
        assert_eq!(error.to_string(), "page 120 is torn", "round {round}");
    }
    let broken = numbers(20).chain(std::iter::once(Err(Error::bad_input("torn source"))));
    let error = engine(3, 100)
        .pass("test", broken.chain(numbers(5)), |f| f.map(&first).fold(&Digest))
        .expect_err("fails");
    assert_eq!(error.to_string(), "torn source");
}

#[test]
fn a_panic_ends_the_run_as_a_bug() {
    for n_workers in [1, 4] {
        let work = Work { fails: vec![], panics: vec![17] };
        let error = engine(n_workers, 100)
            .pass("label", numbers(1_000_000_000), |f| f.map(&work).fold(&Digest))
            .expect_err("panics");
        assert_eq!(error.kind(), Kind::Bug);
        assert!(error.to_string().contains("label, item 17: a step panicked: item 17 is unlucky"));
    }
    let source = (0..10).map(|i| if i == 3 { panic!("source fell") } else { Ok(Number(i)) });
    let error = engine(2, 100).pass("read", source, |f| f.fold(&Digest)).expect_err("panics");
    assert_eq!(error.kind(), Kind::Bug);
    let error = engine(2, 100)
        .pass("write", numbers(1_000_000_000), |f| f.for_each(|_| panic!("sink fell")))
        .expect_err("panics");
    assert_eq!(error.kind(), Kind::Bug);
}

#[test]
fn dropping_a_flow_stops_an_endless_source() {
    struct Endless(Arc<AtomicBool>);
    impl Iterator for Endless {
        type Item = Result<Number>;
        fn next(&mut self) -> Option<Self::Item> {
            Some(Ok(Number(1)))
        }
    }
    impl Drop for Endless {
        fn drop(&mut self) {
            self.0.store(true, Ordering::SeqCst);
        }
    }
    let dropped = Arc::new(AtomicBool::new(false));
    let work = Work::default();
    let source = Endless(Arc::clone(&dropped));
    engine(3, 100)
        .pass("test", source, |f| {
            drop(f.map(&work).map(&work));
            Ok(())
        })
        .expect("no error");
    assert!(dropped.load(Ordering::SeqCst));
    // A sink that has enough stops it as well.
    let source = Endless(Arc::clone(&dropped));
    let error = engine(3, 100)
        .pass("test", source, |f| f.map(&work).for_each(|_| Err(Error::bad_input("enough"))))
        .expect_err("enough");
    assert_eq!(error.to_string(), "enough");
}

#[test]
fn cancellation_ends_a_run() {
    let engine = engine(3, 1000);
    let work = Work::default();
    let mut n = 0;
    let error = engine
        .pass("test", numbers(u64::MAX), |f| {
            f.map(&work).for_each(|_| {
                n += 1;
                if n == 50 {
                    engine.cancel.set();
                }
                Ok(())
            })
        })
        .expect_err("cancelled");
    assert_eq!((error.kind(), n), (Kind::Cancelled, 50));
    let error = engine.fan_out("test", vec![1, 2], Ok).expect_err("cancelled");
    assert_eq!(error.kind(), Kind::Cancelled);
}

/// Makes each heavy item anew.
struct Copy;

impl Map for Copy {
    type In = Heavy;
    type Out = Heavy;
    type Scratch = ();
    fn apply(&self, item: Heavy, (): &mut ()) -> Result<Heavy> {
        sleep(Duration::from_micros(mix(item.value) % 500));
        Ok(Heavy::new(item.value, item.bytes, &item.live))
    }
}

#[test]
fn memory_is_bounded_by_bytes() {
    const ITEM: usize = 1000;
    const CHANNEL: usize = 10 * ITEM;
    const N_WORKERS: usize = 4;
    let live = Arc::new(Live::default());
    let source = (0..2000).map(|i| Ok(Heavy::new(i, ITEM, &live)));
    let n = AtomicU64::new(0);
    engine(N_WORKERS, CHANNEL)
        .pass("test", source, |f| {
            f.map(&Copy).map(&Copy).for_each(|item| {
                // A slow consumer, so that everything before it fills up.
                sleep(Duration::from_micros(50));
                n.fetch_add(u64::from(item.value < 2000), Ordering::SeqCst);
                Ok(())
            })
        })
        .expect("no error");
    let peak = live.peak.load(Ordering::SeqCst) as usize;
    // Three windows with one item above, a worker's two items at once, one at source and sink.
    let bound = 3 * (CHANNEL + ITEM) + 2 * N_WORKERS * 2 * ITEM + 2 * ITEM;
    assert!(peak <= bound, "{peak} bytes alive, {bound} allowed");
    assert!(peak > CHANNEL, "{peak} bytes alive: nothing was measured");
    assert_eq!((n.into_inner(), live.now.load(Ordering::SeqCst)), (2000, 0));
}

#[test]
fn an_oversized_item_travels_alone() {
    let live = Arc::new(Live::default());
    let source = (0..50).map(|i| Ok(Heavy::new(i, 1 << 20, &live)));
    engine(2, 1).pass("test", source, |f| f.map(&Copy).for_each(|_| Ok(()))).expect("no error");
    let peak = live.peak.load(Ordering::SeqCst) >> 20;
    assert!(peak <= 8, "{peak} MiB alive");
}

#[test]
fn fan_out_keeps_order_and_finds_the_first_error() {
    for n_workers in 1..=4 {
        let engine = engine(n_workers, 1000);
        let all = engine
            .fan_out("fit", (0..100).collect(), |i: u64| {
                sleep(Duration::from_micros(mix(i) % 300));
                Ok(i * i)
            })
            .expect("no error");
        assert_eq!(all, (0..100).map(|i| i * i).collect::<Vec<_>>());
        for _ in 0..10 {
            let error = engine
                .fan_out("fit", (0..100).collect(), |i: u64| {
                    sleep(Duration::from_micros(mix(i) % 300));
                    if i % 30 == 29 { Err(Error::bad_input(format!("{i}"))) } else { Ok(()) }
                })
                .expect_err("fails");
            assert_eq!(error.to_string(), "29");
        }
        let error = engine
            .fan_out("fit", vec![0, 1, 2], |i: u64| if i == 1 { panic!("fell") } else { Ok(i) })
            .expect_err("panics");
        assert_eq!(error.kind(), Kind::Bug);
        assert!(error.to_string().contains("fit, item 1: a step panicked: fell"));
    }
}

#[test]
fn fan_out_may_use_rayon_inside() {
    let sums = engine(1, 1000)
        .fan_out("fit", vec![10_u64, 20], |n| Ok((0..n).into_par_iter().sum::<u64>()))
        .expect("no error");
    assert_eq!(sums, [45, 190]);
}

#[test]
fn one_by_one_no_item_begins_before_the_last_one_ends() {
    let at_work = AtomicUsize::new(0);
    let mut engine = engine(4, 1000);
    engine.is_narrow = true;
    let sums = engine.fan_out(Task::new("fit").large(), (0..20).collect(), |i: u64| {
        assert_eq!(at_work.fetch_add(1, Ordering::SeqCst), 0);
        let sum: u64 = (0..=i).into_par_iter().sum();
        at_work.fetch_sub(1, Ordering::SeqCst);
        Ok(sum)
    });
    assert_eq!(sums.expect("no error"), (0..20).map(|i| i * (i + 1) / 2).collect::<Vec<u64>>());
}

#[test]
fn progress_counts_what_came_from_the_source() {
    let engine = engine(2, 1000);
    engine.pass("read", numbers(70), |f| f.for_each(|_| Ok(()))).expect("no error");
    engine.fan_out("fit", vec![(); 5], Ok).expect("no error");
    let reports = engine.progress.reports();
    assert_eq!((reports[0].name.as_str(), reports[0].n_items, reports[0].bytes), ("read", 70, 560));
    assert_eq!((reports[1].name.as_str(), reports[1].n_items), ("fit", 5));
}

#[test]
fn what_is_handed_over_comes_in_order_and_bounded() {
    let live = Arc::new(Live::default());
    let mut engine = Engine::new(2);
    engine.channel_bytes = 100;
    let (seen, n) = engine
        .pipe(
            "aside",
            |items: PipedItems<'_, Heavy>| {
                items.map(|item| item.map(|i| i.value)).collect::<Result<Vec<_>>>()
            },
            |hand| {
                (0..500).try_for_each(|i| hand(Heavy::new(i, 30, &live)))?;
                Ok(500)
            },
        )
        .expect("both end");
    assert_eq!((seen, n), ((0..500).collect(), 500));
    // Items in the channel, one that waits for it and one that is being taken.
    assert!(
        live.peak.load(Ordering::SeqCst) <= 160,
        "{live_peak}",
        live_peak = live.peak.load(Ordering::SeqCst)
    );
    assert_eq!(live.now.load(Ordering::SeqCst), 0);
}

#[test]
fn the_side_that_fails_first_says_why() {
    let engine = Engine::new(2);
    let failed = |what: &str| Error::new(Kind::Io, what.to_owned());
    let is = |e: Error, what: &str| assert!(e.to_string().contains(what), "{e}");
    let all = |items: PipedItems<'_, Number>| items.map(|i| i.map(|_| 1)).sum::<Result<u32>>();
    // The one that hands over fails: the other side does not take what came for all.
    let whole = AtomicBool::new(false);
    let aside = |items: PipedItems<'_, Number>| {
        let n = all(items)?;
        whole.store(true, Ordering::SeqCst);
        Ok(n)
    };
    let work = |hand: PipeSender<'_, Number>| {
        hand(Number(1))?;
        Err::<(), _>(failed("disk of the work"))
    };
    is(engine.pipe("aside", aside, work).expect_err("fails"), "disk of the work");
    assert!(!whole.load(Ordering::SeqCst));
    // The other side fails, by itself or by a panic, early or after the last item.
    let work = |hand: PipeSender<'_, Number>| (0..1000).try_for_each(|i| hand(Number(i)));
    let few = |_: PipedItems<'_, Number>| Err::<(), _>(failed("disk of the other"));
    is(engine.pipe("aside", few, work).expect_err("fails"), "disk of the other");
    let late = |items: PipedItems<'_, Number>| {
        all(items)?;
        Err::<(), _>(failed("no sync"))
    };
    is(engine.pipe("aside", late, work).expect_err("fails"), "no sync");
    let panics = |_: PipedItems<'_, Number>| -> Result<()> { panic!("no such thing") };
    is(engine.pipe("aside", panics, work).expect_err("fails"), "no such thing");
    let idle = |_: PipedItems<'_, Number>| Ok(());
    assert_eq!(engine.pipe("aside", idle, work).expect_err("fails").kind(), Kind::Bug);
}
