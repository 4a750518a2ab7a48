//! The shapes of a step. The engine owns threads, order, budget and errors, so that a step stays
//! one screen.

use crate::Result;
use std::sync::{Mutex, PoisonError};

/// How many bytes an item keeps in memory: channels are bounded by it.
pub trait Weigh {
    /// Bytes kept, roughly.
    fn weight_bytes(&self) -> usize;
    /// Points in it, for progress; 0 where it holds none.
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

/// One item in, one item out; remembers nothing.
pub trait Map: Sync {
    /// What comes in.
    type In: Send;
    /// What goes out.
    type Out: Send;
    /// Memory that one worker reuses from item to item; must not change the answer.
    type Scratch: Default;
    /// Makes one item of one item.
    fn apply(&self, item: Self::In, scratch: &mut Self::Scratch) -> Result<Self::Out>;
}

/// Many items in, one answer out.
///
/// # Law
/// Cut the stream anywhere, fold both halves, join in order: the answer is the same.
pub trait Fold {
    /// What comes in.
    type In: Send;
    /// What is kept while items come in.
    type Sum: Send;
    /// What goes out.
    type Out;
    /// The sum of no items.
    fn empty(&self) -> Self::Sum;
    /// Adds one item.
    fn add(&self, sum: &mut Self::Sum, item: Self::In) -> Result<()>;
    /// Joins the sum of later items to that of earlier ones.
    fn join(&self, earlier: &mut Self::Sum, later: Self::Sum) -> Result<()>;
    /// Makes the answer.
    fn finish(&self, sum: Self::Sum) -> Result<Self::Out>;
}

/// Independent pieces of work inside one step: who calls the step says on which threads they are
/// done.
///
/// Steps take it as `&dyn Fan`: were they generic over it, all of their code would be compiled anew
/// in the crate that calls them.
pub trait Fan: Sync {
    /// Does `work` on each number below `n`, once; in any order.
    fn each(&self, n: usize, work: &(dyn Fn(usize) + Sync));
}

impl dyn Fan + '_ {
    /// Does `work` on each item; results in the order of the items, whatever the order of the work.
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

/// All pieces on the calling thread.
#[derive(Debug, Clone, Copy, Default)]
pub struct OneByOne;

impl Fan for OneByOne {
    fn each(&self, n: usize, work: &(dyn Fn(usize) + Sync)) {
        (0..n).for_each(work);
    }
}
