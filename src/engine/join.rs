//! Work beside other work: two closures in, what both came to out. One may hand items to the other,
//! in order, bounded by bytes.

use super::cancel::Cancel;
use super::edge::{Onward, edge};
use super::panic_guard::guarded;
use super::runner::Engine;
use contract::{Error, Kind, Result, Weigh};

/// Items as they are handed over, up to an error of whom they come from.
pub type PipedItems<'i, T> = &'i mut dyn Iterator<Item = Result<T>>;
/// Hands an item over; an error where nobody takes any more.
pub type PipeSender<'h, T> = &'h mut dyn FnMut(T) -> Result<()>;

impl Engine {
    /// Does `aside` on a thread of its own while `work` is done on this one; the error of the work
    /// goes first.
    ///
    /// # Errors
    /// Those of both; a panic of either is a bug.
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

    /// The same, and `aside` is handed items by `work`: as many wait as a channel holds. Where the
    /// work fails, so does what comes to `aside`; where `aside` stops taking, its error is the
    /// one.
    ///
    /// # Errors
    /// As of [`Engine::join`].
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
                // Whose error goes first is decided below.
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

/// An end before the last item.
fn left_over(name: &str) -> Error {
    Error::new(Kind::Bug, format!("{name} did not take all that it was given"))
}
