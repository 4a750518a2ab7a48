//! Two closures that run at the same time, with or without items that one passes to the other in
//! order and bounded by bytes.

use super::cancel::Cancel;
use super::edge::{Onward, edge};
use super::panic_guard::guarded;
use super::runner::Engine;
use contract::{Error, Kind, Result, Weigh};

/// Items that one closure receives from the other, up to the first error of the sender.
pub type PipedItems<'i, T> = &'i mut dyn Iterator<Item = Result<T>>;
/// Sends an item to the other closure; returns an error where the receiver has ended.
pub type PipeSender<'h, T> = &'h mut dyn FnMut(T) -> Result<()>;

impl Engine {
    /// Runs `aside` on its own thread while `work` runs on the caller's thread. If both fail, the
    /// error of `work` is returned.
    ///
    /// # Errors
    /// The errors of both closures; a panic in either becomes an error of kind `Bug`.
    pub fn join<T: Send, U>(
        &self,
        name: &str,
        aside: impl FnOnce() -> Result<T> + Send,
        work: impl FnOnce() -> Result<U>,
    ) -> Result<(T, U)> {
        std::thread::scope(|scope| {
            let aside = scope.spawn(|| guarded(name, 0, aside));
            let done = guarded(name, 0, work);
            let lost = || Err(Error::new(Kind::Bug, format!("{name} was lost")));
            let aside = aside.join().unwrap_or_else(|_| lost());
            done.and_then(|done| Ok((aside?, done)))
        })
    }

    /// Like [`Engine::join`], and `work` sends items to `aside` through a channel of
    /// `channel_bytes`. If `work` fails, the receiver gets its error; if `aside` stops receiving,
    /// its error is returned.
    ///
    /// # Errors
    /// Those of [`Engine::join`].
    pub fn pipe<I: Weigh + Send, T: Send, U>(
        &self,
        name: &str,
        aside: impl FnOnce(PipedItems<'_, I>) -> Result<T> + Send,
        work: impl FnOnce(PipeSender<'_, I>) -> Result<U>,
    ) -> Result<(T, U)> {
        let (put, take) = edge(self.channel_bytes);
        let mut is_refused = false;
        let refused = &mut is_refused;
        let both = self.join(
            name,
            move || {
                let mut items = std::iter::from_fn(|| take.take().map(|(_, item)| item));
                // Which of the two errors is returned is decided below.
                Ok(guarded(name, 0, || {
                    let done = aside(&mut items)?;
                    items.next().transpose()?.map_or(Ok(done), |_| Err(left_over(name)))
                }))
            },
            move || {
                let mut at = 0;
                let mut hand = |item: I| {
                    let bytes = item.weight_bytes();
                    at += 1;
                    *refused = put.put(at - 1, Ok(item), bytes) == Onward::Stop;
                    if *refused { Err(Cancel::error()) } else { Ok(()) }
                };
                let done = guarded(name, 0, || work(&mut hand));
                if done.is_err() {
                    put.put(at, Err(Cancel::error()), 0);
                }
                Ok(done)
            },
        );
        let (aside, done) = both?;
        match (aside, done) {
            (Err(aside), _) if is_refused => Err(aside),
            (aside, done) => done.and_then(|done| Ok((aside?, done))),
        }
    }
}

/// The error for a receiver that ended before it had taken all items.
fn left_over(name: &str) -> Error {
    Error::new(Kind::Bug, format!("{name} ended before it had received all of its items"))
}
