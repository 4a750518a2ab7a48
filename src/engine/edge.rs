//! An edge joins two steps: numbered items in, in any order; the same items out, in order. Bounded
//! by bytes.
//!
//! One window serves as channel and as reordering buffer. Whoever holds the item that is next out
//! never waits, so that the window cannot lock up; everybody else waits while the window is full.
//! It therefore keeps at most `cap_bytes` and one more item. An item heavier than the window
//! travels alone.

use super::progress::Stage;
use contract::{Error, Kind, Result};
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Least weight of an item, bytes: its place in the window is not free, so that weightless items
/// are bounded too.
const LEAST_WEIGHT_BYTES: usize = 64;

struct Edge<T> {
    state: Mutex<EdgeState<T>>,
    /// The window has become emptier, or the next item another.
    room: Condvar,
    /// The next item has come, or no more will.
    ready: Condvar,
    cap_bytes: usize,
}

struct EdgeState<T> {
    /// Items from position `next` on, with their weights; `None` where not yet come.
    window: VecDeque<Option<(Result<T>, usize)>>,
    /// Position of the next item out.
    next: u64,
    /// Weight of the window.
    bytes: usize,
    /// Producers that may still put.
    n_producers: usize,
    /// The lowest position that failed; items after it are of no use.
    failed: u64,
    /// The consumer has gone.
    gone: bool,
}

impl<T> Edge<T> {
    /// Nothing panics while it holds this lock (items are dropped outside), so poison means
    /// nothing.
    fn lock(&self) -> MutexGuard<'_, EdgeState<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The producer's end; a clone is another producer.
pub(super) struct Put<T>(Arc<Edge<T>>);

/// The consumer's end; when the last clone of its `Arc` is dropped, producers are told to stop.
pub(super) struct Take<T> {
    edge: Arc<Edge<T>>,
    tally: Option<(Stage, Measure<T>)>,
}

/// Points and bytes of an item.
pub(super) type Measure<T> = fn(&T) -> (u64, u64);

/// A new edge that keeps about `cap_bytes`.
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

/// Whether a producer should go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Onward {
    /// More is welcome.
    Yes,
    /// The consumer has gone, or an earlier item has failed.
    Stop,
}

impl<T> Put<T> {
    /// Hands over the item of position `at`, waiting for room. Each position is put once.
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
    /// Tells `stage` of each item that is taken: what only waits in the window is not done.
    pub(super) fn tally(&mut self, stage: Stage, measure: Measure<T>) {
        self.tally = Some((stage, measure));
    }

    /// The next item with its position, waiting for it; `None` after the last one or a failed one.
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
                // The next item may already be there: another consumer may have it.
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

    /// Takes nothing more: producers stop, what waits is dropped.
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
