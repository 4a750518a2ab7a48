//! An edge joins two steps of a pass. Producers put numbered items into it in any order, and the
//! consumer takes them in ascending order. The bytes of the items that wait are bounded.
//!
//! One window serves both as channel and as reordering buffer. A producer that holds the next item
//! to be taken never waits, so the window cannot deadlock; all other producers wait while the
//! window is full. The window therefore keeps at most `cap_bytes` and one more item. An item
//! heavier than the window is passed on alone.

use super::progress::Stage;
use contract::{Error, Kind, Result};
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Least weight of an item, bytes. An item without weight occupies a slot of the window, too, so
/// the number of such items must be bounded.
const LEAST_WEIGHT_BYTES: usize = 64;

struct Edge<T> {
    state: Mutex<EdgeState<T>>,
    /// Signalled when the window has more room, or when another item is the next.
    room: Condvar,
    /// Signalled when the next item is there, or when no more items will come.
    ready: Condvar,
    cap_bytes: usize,
}

struct EdgeState<T> {
    /// Items from position `next` on, with their weights in bytes; `None` where an item is still
    /// missing.
    window: VecDeque<Option<(Result<T>, usize)>>,
    /// Position of the next item to be taken.
    next: u64,
    /// Sum of the weights in the window, bytes.
    bytes: usize,
    /// Number of producers that are still alive.
    n_producers: usize,
    /// The lowest position whose item is an error; items after it are dropped.
    failed: u64,
    /// Whether the consumer was dropped.
    gone: bool,
}

impl<T> Edge<T> {
    /// Poisoning is ignored: no thread panics while it holds this lock, since items are dropped
    /// outside of it.
    fn lock(&self) -> MutexGuard<'_, EdgeState<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The producer's end of an edge. A clone is another producer.
pub(super) struct Put<T>(Arc<Edge<T>>);

/// The consumer's end of an edge. When the last clone of its `Arc` is dropped, the producers stop.
pub(super) struct Take<T> {
    edge: Arc<Edge<T>>,
    tally: Option<(Stage, Measure<T>)>,
}

/// Points and bytes of an item.
pub(super) type Measure<T> = fn(&T) -> (u64, u64);

/// Makes an edge whose window keeps about `cap_bytes`.
pub(super) fn edge<T>(cap_bytes: usize) -> (Put<T>, Take<T>) {
    let state = EdgeState {
        window: VecDeque::new(),
        next: 0,
        bytes: 0,
        n_producers: 1,
        failed: u64::MAX,
        gone: false,
    };
    let edge = Arc::new(Edge {
        state: Mutex::new(state),
        room: Condvar::new(),
        ready: Condvar::new(),
        cap_bytes,
    });
    (Put(Arc::clone(&edge)), Take { edge, tally: None })
}

/// Whether a producer should put more items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Onward {
    /// The edge accepts more items.
    Yes,
    /// The consumer has gone, or an earlier item has failed.
    Stop,
}

impl<T> Put<T> {
    /// Puts the item of position `at`, of `weight_bytes` bytes, and waits while the window is full.
    /// Each position must be put exactly once.
    pub(super) fn put(&self, at: u64, item: Result<T>, weight_bytes: usize) -> Onward {
        let weight = weight_bytes.max(LEAST_WEIGHT_BYTES);
        let mut state = self.0.lock();
        while !state.gone
            && at <= state.failed
            && at != state.next
            && state.bytes + weight > self.0.cap_bytes
        {
            state = self.0.room.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.gone || at > state.failed {
            drop(state);
            return Onward::Stop;
        }
        if item.is_err() {
            state.failed = at;
            self.0.room.notify_all();
        }
        let slot = usize::try_from(at - state.next).expect("a window fits into memory");
        while state.window.len() <= slot {
            state.window.push_back(None);
        }
        state.window[slot] = Some((item, weight));
        state.bytes += weight;
        if slot == 0 {
            self.0.ready.notify_all();
        }
        Onward::Yes
    }
}

impl<T> Clone for Put<T> {
    fn clone(&self) -> Self {
        self.0.lock().n_producers += 1;
        Self(Arc::clone(&self.0))
    }
}

impl<T> Drop for Put<T> {
    fn drop(&mut self) {
        self.0.lock().n_producers -= 1;
        self.0.ready.notify_all();
    }
}

impl<T> Take<T> {
    /// Counts each item that is taken as progress of `stage`. Items that only wait in the window
    /// are not counted.
    pub(super) fn tally(&mut self, stage: Stage, measure: Measure<T>) {
        self.tally = Some((stage, measure));
    }

    /// Waits for the next item and returns it with its position; `None` after the last item or
    /// after an error.
    pub(super) fn take(&self) -> Option<(u64, Result<T>)> {
        let taken = self.next();
        if let (Some((stage, measure)), Some((_, Ok(item)))) = (&self.tally, &taken) {
            let (points, bytes) = measure(item);
            stage.add(1, points, bytes);
        }
        taken
    }

    fn next(&self) -> Option<(u64, Result<T>)> {
        let mut state = self.edge.lock();
        loop {
            if state.gone || state.next > state.failed {
                return None;
            }
            let at = state.next;
            if matches!(state.window.front(), Some(Some(_))) {
                let (item, weight) = state.window.pop_front().flatten().expect("just seen");
                state.next += 1;
                state.bytes -= weight;
                // The next item may be in the window already, and another consumer may be waiting
                // for it.
                self.edge.room.notify_all();
                if matches!(state.window.front(), Some(Some(_))) {
                    self.edge.ready.notify_one();
                }
                return Some((at, item));
            }
            if state.n_producers == 0 {
                if state.window.is_empty() {
                    return None;
                }
                state.failed = at;
                state.next += 1;
                return Some((at, Err(Error::new(Kind::Bug, format!("item {at} was lost")))));
            }
            state = self.edge.ready.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Ends the edge: producers stop, and items in the window are dropped.
    pub(super) fn stop(&self) {
        let mut state = self.edge.lock();
        state.gone = true;
        state.bytes = 0;
        let dropped = std::mem::take(&mut state.window);
        drop(state);
        self.edge.room.notify_all();
        self.edge.ready.notify_all();
        drop(dropped);
    }
}

impl<T> Drop for Take<T> {
    fn drop(&mut self) {
        self.stop();
    }
}
