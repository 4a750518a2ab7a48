//! Property tests of the engine on random passes: their lengths, workers, memory bounds, failures
//! and panics are drawn.

use super::tests::{Digest, Heavy, Live, Number, Work, engine};
use contract::{Error, Fold, Kind, Result};
use proptest::prelude::*;
use std::sync::Arc;

/// Number of random passes for each property. Each pass starts threads and takes about a
/// millisecond.
const N_CASES: u32 = 96;

/// Positions of items that fail or panic: mostly none, else a few.
fn unlucky(n: u64) -> impl Strategy<Value = Vec<u64>> {
    prop::collection::vec(0..n.max(1), 0..4)
}

fn case() -> impl Strategy<Value = (u64, usize, usize)> {
    (0_u64..120, 1_usize..7, prop::sample::select(vec![1_usize, 30, 200, 1 << 20]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(N_CASES))]

    #[test]
    fn order_is_kept_and_the_first_fault_by_position_is_told(
        (n, n_workers, channel_bytes) in case(),
        faults in (0_u64..120).prop_flat_map(|n| (unlucky(n), unlucky(n))),
        source_ends in prop::option::of(0_u64..120),
    ) {
        let (fails, panics) = faults;
        let work = Work { fails: fails.clone(), panics: panics.clone() };
        let torn = source_ends.filter(|at| *at < n);
        let source = (0..n).map(|i| match torn {
            Some(at) if at == i => Err(Error::bad_input(format!("source is torn at {i}"))),
            _ => Ok(Number(i)),
        });
        let digest = Digest;
        let done = engine(n_workers, channel_bytes).pass("work", source, |f| f.map(&work).fold(&digest));
        // The expected result: that of one thread that handles item after item.
        let first = (0..n).find(|i| torn == Some(*i) || panics.contains(i) || fails.contains(i));
        match (done, first) {
            (Ok(found), None) => {
                let mut expected = digest.empty();
                for i in 0..n {
                    digest.add(&mut expected, Number(i * 3)).expect("adds");
                }
                prop_assert_eq!(found, expected);
            }
            (Err(error), Some(at)) => {
                let text = error.to_string();
                if torn == Some(at) {
                    prop_assert!(text.contains(&format!("torn at {at}")), "{}", text);
                } else if panics.contains(&at) {
                    prop_assert_eq!(error.kind(), Kind::Bug);
                    prop_assert!(text.contains(&format!("item {at} is unlucky")), "{}", text);
                } else {
                    prop_assert!(text.contains(&format!("page {at} is torn")), "{}", text);
                }
            }
            (done, first) => prop_assert!(false, "{:?} where {:?} is the first fault", done, first),
        }
    }

    #[test]
    fn what_is_alive_stays_within_channels_and_workers(
        n in 0_u64..80,
        n_workers in 1_usize..6,
        channel_bytes in 1_usize..4000,
        sizes in prop::collection::vec(1_usize..900, 1..9),
    ) {
        struct Pass;
        impl contract::Map for Pass {
            type In = Heavy;
            type Out = Heavy;
            type Scratch = ();
            fn apply(&self, item: Heavy, (): &mut ()) -> Result<Heavy> {
                Ok(item)
            }
        }
        let live = Arc::new(Live::default());
        let size = |i: u64| sizes[i as usize % sizes.len()];
        let largest = sizes.iter().copied().max().unwrap_or(0);
        let source = (0..n).map(|i| Ok(Heavy::new(i, size(i), &live)));
        let mut seen = Vec::new();
        engine(n_workers, channel_bytes)
            .pass("heavy", source, |f| {
                f.map(&Pass).for_each(|item| {
                    seen.push(item.value);
                    Ok(())
                })
            })
            .expect("passes");
        prop_assert_eq!(seen, (0..n).collect::<Vec<_>>());
        let (now, peak) = live.both();
        prop_assert_eq!(now, 0);
        // Bound of the memory: two channels, each exceeded by one item at most; one item per
        // worker; one item held by the source and one by the sink.
        let most = 2 * channel_bytes.max(largest) + (n_workers + 4) * largest;
        prop_assert!(peak <= most as i64, "{} bytes alive, {} allowed", peak, most);
    }

    #[test]
    fn fan_out_gives_answers_in_order(items in prop::collection::vec(0_u64..9, 0..60), n_workers in 1_usize..6) {
        let found = engine(n_workers, 1).fan_out("fan", items.clone(), |i| Ok(i * 2));
        prop_assert_eq!(found.expect("no fault"), items.iter().map(|i| i * 2).collect::<Vec<_>>());
        let fault = items.iter().position(|i| *i == 7);
        let at = engine(n_workers, 1).fan_out("fan", (0..items.len()).collect(), |i: usize| {
            if items[i] == 7 { Err(Error::bad_input(format!("item {i}"))) } else { Ok(i) }
        });
        match fault {
            None => prop_assert!(at.is_ok()),
            Some(fault) => {
                let text = at.expect_err("it has a fault").to_string();
                prop_assert!(text.contains(&format!("item {fault}")), "{} is the first, not {}", fault, text);
            }
        }
    }
}
