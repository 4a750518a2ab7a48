//! The engine runs the steps of a pass on threads, keeps the order of items, bounds memory, and
//! handles errors, panics and cancellation. It knows nothing of geometry or files.
//!
//! | promise | how |
//! | --- | --- |
//! | order in is order out | results wait in a window; the holder of the next one never waits |
//! | memory is bounded | windows by bytes; an oversized item travels alone; one item a worker besides |
//! | the answer does not depend on workers or memory | folds run in order on one thread |
//! | the error reported is the first by position | later items are skipped only once an earlier one has failed |
//! | a panic in a step ends the run as `Kind::Bug` | caught per item |
//! | dropping a flow stops its source | the consumer's end tells the producers when it goes, all the way up |

mod amount;
mod cancel;
mod edge;
mod flow;
mod join;
#[cfg(test)]
mod laws;
mod panic_guard;
pub mod progress;
mod runner;
#[cfg(test)]
mod tests;

pub use amount::Amount;
pub use cancel::Cancel;
pub use flow::Flow;
pub use join::{PipeSender, PipedItems};
pub(crate) use panic_guard::guarded;
pub(crate) use runner::AllThreads;
pub use runner::{CHANNEL_BYTES, Engine, Task};
