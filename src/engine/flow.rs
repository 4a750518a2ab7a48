//! A flow carries numbered items through the steps of one pass. Maps run on groups of threads;
//! folds and sinks run on the caller's thread, in the order of the items.

use super::cancel::Cancel;
use super::edge::{Onward, Put, Take, edge};
use super::panic_guard::guarded;
use super::progress::Stage;
use contract::{Error, Fold, Kind, Map, Result, Weigh};
use std::sync::Arc;
use std::thread::{Builder, Scope};

/// Scope, engine and cancellation that all steps of a pass share.
pub(super) struct Pass<'scope, 'env: 'scope> {
    pub(super) scope: &'scope Scope<'scope, 'env>,
    pub(super) name: Arc<str>,
    pub(super) n_workers: usize,
    pub(super) channel_bytes: usize,
    pub(super) cancel: Cancel,
}

/// Numbered items between two steps of a pass. Dropping a flow stops all steps before it, including
/// the source.
pub struct Flow<'scope, 'env: 'scope, T> {
    pass: Pass<'scope, 'env>,
    take: Take<T>,
}

impl<'scope, 'env, T: Send + 'env> Flow<'scope, 'env, T> {
    /// Starts a thread that reads `source`.
    pub(super) fn source<S>(pass: Pass<'scope, 'env>, source: S, stage: Stage) -> Self
    where
        S: Iterator<Item = Result<T>> + Send + 'env,
        T: Weigh,
    {
        let (put, mut take) = edge(pass.channel_bytes);
        take.tally(stage, |item: &T| (item.n_points(), item.weight_bytes() as u64));
        let (name, cancel) = (Arc::clone(&pass.name), pass.cancel.clone());
        let spare = put.clone();
        let spawned = Builder::new()
            .name(format!("{name} source"))
            .spawn_scoped(pass.scope, move || read(source, &put, &name, &cancel));
        if let Err(e) = spawned {
            refuse(&spare, e);
        }
        drop(spare);
        Self { pass, take }
    }

    /// Applies `stage` to each item on the engine's worker threads. The order of the items is kept.
    pub fn map<M>(self, stage: &'env M) -> Flow<'scope, 'env, M::Out>
    where
        M: Map<In = T>,
        M::Out: Weigh + 'env,
    {
        let (put, out) = edge(self.pass.channel_bytes);
        let take = Arc::new(self.take);
        for i in 0..self.pass.n_workers.max(1) {
            let (my_take, my_put) = (Arc::clone(&take), put.clone());
            let (name, cancel) = (Arc::clone(&self.pass.name), self.pass.cancel.clone());
            let spawned = Builder::new()
                .name(format!("{name} {i}"))
                .spawn_scoped(self.pass.scope, move || {
                    work(stage, &my_take, &my_put, &name, &cancel)
                });
            // With fewer workers than asked for the pass is slower; without any it cannot run.
            if let (0, Err(e)) = (i, spawned) {
                refuse(&put, e);
            }
        }
        Flow { pass: self.pass, take: out }
    }

    /// Folds all items, in order, into one value.
    ///
    /// # Errors
    /// The first error by position.
    pub fn fold<F: Fold<In = T>>(self, stage: &F) -> Result<F::Out> {
        let name = Arc::clone(&self.pass.name);
        let mut sum = guarded(&name, 0, || Ok(stage.empty()))?;
        self.for_each(|item| stage.add(&mut sum, item))?;
        guarded(&name, 0, || stage.finish(sum))
    }

    /// Passes each item, in order, to `sink` on the caller's thread.
    ///
    /// # Errors
    /// The first error by position, or that of `sink`.
    pub fn for_each(self, mut sink: impl FnMut(T) -> Result<()>) -> Result<()> {
        let name = Arc::clone(&self.pass.name);
        for (at, item) in self.items().enumerate() {
            let item = item?;
            guarded(&name, at as u64, || sink(item))?;
        }
        Ok(())
    }

    /// All items, in order, up to the first error, as an iterator for a sink that pulls.
    pub fn items(self) -> impl Iterator<Item = Result<T>> {
        let mut ended = false;
        std::iter::from_fn(move || {
            if ended {
                return None;
            }
            let (_, item) = self.take.take()?;
            let item = self.pass.cancel.check().and(item);
            ended = item.is_err();
            Some(item)
        })
    }

    /// Collects all items, in order. The memory is not bounded: use it only where the result is
    /// small.
    ///
    /// # Errors
    /// The first error by position.
    pub fn collect(self) -> Result<Vec<T>> {
        self.items().collect()
    }
}

/// Body of the thread that reads the source.
fn read<T: Weigh>(
    mut source: impl Iterator<Item = Result<T>>,
    put: &Put<T>,
    name: &str,
    cancel: &Cancel,
) {
    for at in 0.. {
        let item = if cancel.is_set() {
            Err(Cancel::error())
        } else {
            match guarded(name, at, || source.next().transpose()).transpose() {
                Some(item) => item,
                None => return,
            }
        };
        let bytes = item.as_ref().map_or(0, Weigh::weight_bytes);
        let failed = item.is_err();
        if put.put(at, item, bytes) == Onward::Stop || failed {
            return;
        }
    }
}

/// Body of a worker thread of a map.
fn work<M: Map>(stage: &M, take: &Take<M::In>, put: &Put<M::Out>, name: &str, cancel: &Cancel)
where
    M::Out: Weigh,
{
    let mut scratch = None;
    while let Some((at, item)) = take.take() {
        let out = match item {
            Ok(_) if cancel.is_set() => Err(Cancel::error()),
            Ok(item) => guarded(name, at, || {
                stage.apply(item, scratch.get_or_insert_with(M::Scratch::default))
            }),
            Err(error) => Err(error),
        };
        let bytes = out.as_ref().map_or(0, Weigh::weight_bytes);
        if put.put(at, out, bytes) == Onward::Stop {
            take.stop();
            return;
        }
    }
}

/// Ends a pass for which the system could not start a thread.
fn refuse<T>(put: &Put<T>, cause: std::io::Error) {
    let error = Error::new(Kind::Io, "a thread could not be started").because(cause);
    put.put(0, Err(error), 0);
}
