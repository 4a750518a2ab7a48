//! The engine runs the steps of a pass on threads, keeps the order of items, bounds memory, and
//! handles errors, panics and cancellation. It knows nothing of geometry or files.
//!
//! | promise | how |
//! | --- | --- |
//! | the order of items is kept | results wait in a window, the next one never waits |
//! | memory is bounded | windows count bytes; oversized items pass alone; one item per worker |
//! | results do not depend on workers or memory | folds run in order on one thread |
//! | the reported error is the first by position | only items after a failed one are skipped |
//! | a panic in a step ends the run as `Kind::Bug` | panics are caught per item |
//! | dropping a flow stops its source | a dropped consumer stops its producers, up to the source |

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
mod watched;

pub use amount::Amount;
pub use cancel::Cancel;
pub use flow::Flow;
pub use join::{PipeSender, PipedItems};
pub(crate) use panic_guard::guarded;
pub(crate) use runner::AllThreads;
pub use runner::{CHANNEL_BYTES, Engine, Task};
pub use watched::{Told, WatchedWork, watched};
