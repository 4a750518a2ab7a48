//! The traits of a processing step. The engine that runs steps owns threads, order, memory budget
//! and error handling, so that a step contains only its algorithm.

use crate::Result;
use std::sync::{Mutex, PoisonError};

/// An item that knows how much memory it takes, so that channels can be bounded by bytes.
pub trait Weigh {
    /// Approximate memory of the item, bytes.
    fn weight_bytes(&self) -> usize;
    /// Number of points in it, for progress; 0 where it holds none.
    fn n_points(&self) -> u64 {
        0
    }
}

impl Weigh for () {
    fn weight_bytes(&self) -> usize {
        0
    }
}

impl<T: Weigh> Weigh for Option<T> {
    fn weight_bytes(&self) -> usize {
        self.as_ref().map_or(0, T::weight_bytes)
    }

    fn n_points(&self) -> u64 {
        self.as_ref().map_or(0, T::n_points)
    }
}

impl<A: Weigh, B: Weigh> Weigh for (A, B) {
    fn weight_bytes(&self) -> usize {
        self.0.weight_bytes() + self.1.weight_bytes()
    }

    fn n_points(&self) -> u64 {
        self.0.n_points()
    }
}

/// A step that turns each item into one item and keeps no state.
pub trait Map: Sync {
    /// Type of the items that it takes.
    type In: Send;
    /// Type of the items that it returns.
    type Out: Send;
    /// Memory that one worker reuses from item to item; it must not affect the result.
    type Scratch: Default;
    /// Turns one item into another.
    fn apply(&self, item: Self::In, scratch: &mut Self::Scratch) -> Result<Self::Out>;
}

/// A step that reduces many items to one result.
///
/// # Law
/// If the stream is cut anywhere, both parts are folded apart, and their sums are joined in order,
/// the result is the same.
pub trait Fold {
    /// Type of the items that it takes.
    type In: Send;
    /// State that is kept while items come in.
    type Sum: Send;
    /// Type of the result.
    type Out;
    /// The sum of no items.
    fn empty(&self) -> Self::Sum;
    /// Adds one item to a sum.
    fn add(&self, sum: &mut Self::Sum, item: Self::In) -> Result<()>;
    /// Adds the sum of later items to the sum of earlier ones.
    fn join(&self, earlier: &mut Self::Sum, later: Self::Sum) -> Result<()>;
    /// Computes the result from the sum of all items.
    fn finish(&self, sum: Self::Sum) -> Result<Self::Out>;
}

/// Runs independent pieces of work inside one step; the caller of the step decides on which
/// threads.
///
/// Steps take it as `&dyn Fan`. If they were generic over it, their whole code would be compiled
/// again in the crate that calls them.
pub trait Fan: Sync {
    /// Calls `work` once for each number below `n`, in any order.
    fn each(&self, n: usize, work: &(dyn Fn(usize) + Sync));
}

impl dyn Fan + '_ {
    /// Calls `work` for each item and returns the results in the order of the items.
    pub fn fan<T: Send, U: Send>(&self, items: Vec<T>, work: impl Fn(T) -> U + Sync) -> Vec<U> {
        let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|i| Mutex::new(Some(i))).collect();
        let done: Vec<Mutex<Option<U>>> = items.iter().map(|_| Mutex::new(None)).collect();
        self.each(items.len(), &|at| {
            let item = items[at].lock().unwrap_or_else(PoisonError::into_inner).take();
            let out = item.map(&work);
            *done[at].lock().unwrap_or_else(PoisonError::into_inner) = out;
        });
        let out =
            |slot: Mutex<Option<U>>| slot.into_inner().unwrap_or_else(PoisonError::into_inner);
        done.into_iter().map(|slot| out(slot).expect("each item is done once")).collect()
    }
}

/// A [`Fan`] that runs all pieces on the calling thread, one after the other.
#[derive(Debug, Clone, Copy, Default)]
pub struct OneByOne;

impl Fan for OneByOne {
    fn each(&self, n: usize, work: &(dyn Fn(usize) + Sync)) {
        (0..n).for_each(work);
    }
}
