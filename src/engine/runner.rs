//! The engine itself: passes over a source and fan-outs over a list, with threads, order, memory
//! bounds, errors and cancellation.

use super::amount::Amount;
use super::cancel::Cancel;
use super::flow::{Flow, Pass};
use super::panic_guard::guarded;
use super::progress::{Pieces, Progress};
use contract::{Error, Fan, Kind, Result, Weigh};
use rayon::prelude::*;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Default of [`Engine::channel_bytes`]: a few dozen strips or tiles, which keeps all workers busy.
pub const CHANNEL_BYTES: usize = 32 << 20;

/// Runs steps. Threads are started for a pass and joined before it returns.
pub struct Engine {
    /// Number of threads of each map and of [`Engine::fan_out`].
    pub n_workers: usize,
    /// Most bytes that wait in each channel between two steps of a pass.
    pub channel_bytes: usize,
    /// Whether there is memory for one large item at a time only (see [`Task::large`]).
    pub is_narrow: bool,
    /// Cancellation flag of the run.
    pub cancel: Cancel,
    /// Receives the progress of all stages.
    pub progress: Progress,
    pool: OnceLock<rayon::ThreadPool>,
}

/// Name and size of a pass or fan-out, for progress.
#[derive(Clone, Default)]
pub struct Task {
    name: String,
    total: Amount,
    pieces: Pieces,
    is_large: bool,
}

impl Task {
    /// A task of unknown size.
    #[must_use]
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Marks a task whose items each take much memory, such as all views of a region. On a narrow
    /// engine they run one after the other, each on all threads.
    #[must_use]
    pub fn large(mut self) -> Self {
        self.is_large = true;
        self
    }

    /// Shows `pieces` of the items beside the progress of the task.
    #[must_use]
    pub fn showing(mut self, pieces: &Pieces) -> Self {
        self.pieces = pieces.clone();
        self
    }

    /// Sets the total amount of work; zero means not known.
    #[must_use]
    pub fn of(mut self, total: Amount) -> Self {
        self.total = total;
        self
    }
}

impl From<&str> for Task {
    fn from(name: &str) -> Self {
        Self::new(name)
    }
}

impl Engine {
    /// An engine with `n_workers` threads per step (at least one), default channels and no output.
    #[must_use]
    pub fn new(n_workers: usize) -> Self {
        Self {
            n_workers: n_workers.max(1),
            channel_bytes: CHANNEL_BYTES,
            is_narrow: false,
            cancel: Cancel::new(),
            progress: Progress::silent(),
            pool: OnceLock::new(),
        }
    }

    /// An engine with the same threads, memory and cancellation that shows no progress.
    #[must_use]
    pub fn quiet(&self) -> Self {
        Self {
            channel_bytes: self.channel_bytes,
            is_narrow: self.is_narrow,
            cancel: self.cancel.clone(),
            ..Self::new(self.n_workers)
        }
    }

    /// An engine for work that mostly waits for the disk: it has four times the threads, since a
    /// disk serves several files at once faster than one after the other.
    #[must_use]
    pub(crate) fn for_disks(&self) -> Self {
        Self {
            n_workers: 4 * self.n_workers,
            channel_bytes: self.channel_bytes,
            is_narrow: self.is_narrow,
            cancel: self.cancel.clone(),
            progress: self.progress.clone(),
            pool: OnceLock::new(),
        }
    }

    /// Runs one pass: a source, some maps, one fold or sink.
    ///
    /// `source` is read on a thread of its own; its errors take part in the order of errors.
    pub fn pass<'env, T, S, Out>(
        &self,
        task: impl Into<Task>,
        source: S,
        plan: impl for<'scope> FnOnce(Flow<'scope, 'env, T>) -> Result<Out>,
    ) -> Result<Out>
    where
        T: Weigh + Send + 'env,
        S: Iterator<Item = Result<T>> + Send + 'env,
    {
        self.cancel.check()?;
        let task = task.into();
        let stage = self.progress.stage(&task.name, task.total);
        let out = std::thread::scope(|scope| {
            let pass = Pass {
                scope,
                name: task.name.as_str().into(),
                n_workers: self.n_workers,
                channel_bytes: self.channel_bytes,
                cancel: self.cancel.clone(),
            };
            guarded(&task.name, 0, || plan(Flow::source(pass, source, stage.clone())))
        });
        stage.finish();
        out
    }

    /// Applies `f` to each item on a pool of `n_workers` threads and returns the results in the
    /// order of the items. `f` may use rayon itself, but must not wait for a channel.
    ///
    /// # Errors
    /// The first error by position.
    pub fn fan_out<T, U>(
        &self,
        task: impl Into<Task>,
        items: Vec<T>,
        f: impl Fn(T) -> Result<U> + Sync,
    ) -> Result<Vec<U>>
    where
        T: Send,
        U: Send,
    {
        let mut task = task.into();
        task.total.items = items.len() as u64;
        let stage = self.progress.stage_of(&task.name, task.total, task.pieces.clone());
        // Items after a failed one are skipped, since the error with the lowest position is
        // returned.
        let failed = AtomicUsize::new(usize::MAX);
        let one = |(at, item): (usize, T)| {
            if at > failed.load(Ordering::SeqCst) {
                return None;
            }
            let out = match self.cancel.check() {
                Ok(()) => guarded(&task.name, at as u64, || f(item)),
                Err(cancelled) => Err(cancelled),
            };
            match &out {
                Ok(_) => stage.add(1, 0, 0),
                Err(_) => {
                    failed.fetch_min(at, Ordering::SeqCst);
                }
            }
            Some(out)
        };
        let items: Vec<(usize, T)> = items.into_iter().enumerate().collect();
        let threads = PoolThreads { pool: self.pool()?, in_turn: task.is_large && self.is_narrow };
        let all: Vec<Option<Result<U>>> = (&threads as &dyn Fan).fan(items, one);
        stage.finish();
        // A skipped item always follows an error, and `collect` stops at that error.
        all.into_iter()
            .map(|out| out.unwrap_or_else(|| Err(Error::new(Kind::Bug, "an item was skipped"))))
            .collect()
    }

    /// Like [`Engine::fan_out`], without progress, for work that takes a moment.
    ///
    /// # Errors
    /// The first error by position.
    pub(crate) fn each<T: Send, U: Send>(
        &self,
        items: Vec<T>,
        f: impl Fn(T) -> Result<U> + Sync + Send,
    ) -> Result<Vec<U>> {
        let f = |(at, item): (usize, T)| guarded("small work", at as u64, || f(item));
        let items = items.into_iter().enumerate().collect();
        let threads = PoolThreads { pool: self.pool()?, in_turn: false };
        (&threads as &dyn Fan).fan(items, f).into_iter().collect()
    }

    /// A pool of threads for pieces of a step that mostly wait for the disk.
    ///
    /// # Errors
    /// The system could not start the threads.
    pub(crate) fn disks(&self) -> Result<Threads> {
        let engine = self.for_disks();
        engine.pool()?;
        Ok(Threads(engine.pool))
    }

    /// The pool of [`Engine::fan_out`], for steps that use rayon by themselves.
    pub fn pool(&self) -> Result<&rayon::ThreadPool> {
        if let Some(pool) = self.pool.get() {
            return Ok(pool);
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.n_workers)
            .thread_name(|i| format!("task {i}"))
            .build()
            .map_err(|e| Error::new(Kind::Io, "threads could not be started").because(e))?;
        Ok(self.pool.get_or_init(|| pool))
    }
}

/// Runs the pieces of a step on their own threads.
pub(crate) struct Threads(OnceLock<rayon::ThreadPool>);

impl Fan for Threads {
    fn each(&self, n: usize, work: &(dyn Fn(usize) + Sync)) {
        match self.0.get() {
            Some(pool) => PoolThreads { pool, in_turn: false }.each(n, work),
            None => AllThreads.each(n, work),
        }
    }
}

/// Runs the pieces of a pass on the threads of a pool or, on a narrow engine, one after the other
/// with all threads for each.
struct PoolThreads<'p> {
    pool: &'p rayon::ThreadPool,
    in_turn: bool,
}

impl Fan for PoolThreads<'_> {
    fn each(&self, n: usize, work: &(dyn Fn(usize) + Sync)) {
        self.pool.install(|| match self.in_turn {
            true => (0..n).for_each(work),
            false => AllThreads.each(n, work),
        });
    }
}

/// Runs the pieces of a step on the threads of the pool that the step itself runs in.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct AllThreads;

impl Fan for AllThreads {
    /// Pieces start in their order, each on the next free thread: where the largest come first, no
    /// thread ends long after the others. This is the only such use of rayon in the crate, since
    /// rayon is compiled anew for each closure.
    fn each(&self, n: usize, work: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        // Items are few and large, so each is scheduled by itself.
        let pieces = (0..n).into_par_iter().with_max_len(1);
        pieces.for_each(|_| work(next.fetch_add(1, Ordering::Relaxed)));
    }
}
