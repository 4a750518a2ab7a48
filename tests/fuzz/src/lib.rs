//! Bytes from the fuzzer in; a panic where a reader breaks a law of the house, out. Laws that hold
//! for every target: no panic, no more than [`MOST_BYTES`] of memory and [`MOST_SECONDS`] of
//! processor time a case, and no error that calls itself a fault of the program. What else a target
//! checks stands beside it.

pub mod clouds;
pub mod own;
#[cfg(feature = "program")]
pub mod program;
pub mod robots;
mod seeds;
pub mod words;

use contract::{Error, Kind, fence};
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Most memory that one case may take, bytes. Inputs have some kilobytes.
pub const MOST_BYTES: usize = 512 << 20;
/// Most processor time that one case may take, all threads together, seconds. Instrumented code is
/// several times slower than the program's.
pub const MOST_SECONDS: f64 = 2.0;

/// Counts what is allocated, since the fuzzer itself only samples it.
struct Counted;

static LIVE: AtomicUsize = AtomicUsize::new(0);
/// What was allocated when the case began.
static BEFORE: AtomicUsize = AtomicUsize::new(0);

fn grow(n: usize) {
    let live = LIVE.fetch_add(n, Relaxed) + n;
    if live > BEFORE.load(Relaxed).saturating_add(MOST_BYTES) {
        // The allocator is no place to panic. Raised again, it may, while the words are written.
        BEFORE.store(usize::MAX / 2, Relaxed);
        eprintln!("a case takes more than {MOST_BYTES} bytes, the last piece has {n}");
        std::process::abort();
    }
}

// SAFETY: the system's allocator does all the work.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        grow(size);
        LIVE.fetch_sub(layout.size(), Relaxed);
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counted = Counted;

/// Once, before the first case: panics that a fence of the program catches are no findings, all
/// others are. Where `STILLPOINT_FUZZ_SEEDS` names a folder, the seeds of all targets are written
/// there instead, and the process ends.
pub fn begin() {
    if let Some(out) = std::env::var_os("STILLPOINT_FUZZ_SEEDS") {
        seeds::write(out.into());
        std::process::exit(0);
    }
    let end = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let file = panic.location().map_or("", |at| at.file());
        let is_foreign = file.contains("/registry/") || file.contains("/library/");
        if fence::is_fenced() && is_foreign {
            fence::note(panic);
        } else {
            end(panic);
            std::process::abort();
        }
    }));
}

/// Runs a case within its bounds of memory and time.
pub fn case(work: impl FnOnce()) {
    let start = seconds();
    BEFORE.store(LIVE.load(Relaxed), Relaxed);
    work();
    let taken = seconds() - start;
    assert!(taken <= MOST_SECONDS, "a case takes {taken:.1} s of processor time");
}

/// Processor time of all threads so far.
fn seconds() -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the system writes one time into the place that it is given.
    let done = unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &raw mut time) };
    assert_eq!(done, 0, "processor time is known on every system that fuzzes");
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// An error is fine as long as it is of the input, and says where.
pub(crate) fn refused(error: &Error) {
    assert_ne!(error.kind(), Kind::Bug, "{error}");
    let text = error.to_string();
    assert!(!text.is_empty() && !text.contains("a step panicked"), "{error}");
}

/// The folder of this process: in memory where the system has such a place.
pub(crate) fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let above =
            std::env::var_os("STILLPOINT_FUZZ_DIR").map_or_else(std::env::temp_dir, PathBuf::from);
        let folder = above.join(std::process::id().to_string());
        std::fs::create_dir_all(&folder).expect("the folder of a fuzzer can be made");
        folder
    })
}

/// A file of the process with these bytes.
pub(crate) fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder().join(name);
    let above = path.parent().expect("files lie in a folder");
    if std::fs::write(&path, bytes).is_err() {
        std::fs::create_dir_all(above).expect("a folder can be made");
        std::fs::write(&path, bytes).expect("a file can be written");
    }
    path
}
