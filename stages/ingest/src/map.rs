//! Path in, bytes out: the one place of this room that maps files into memory.
//!
//! A file that is cut short, or a share that goes away, while it is mapped would end the program with a signal (SIGBUS). The
//! signal is caught: the page that is missing is replaced by zeros, so that the reader comes to an end, and the map says
//! that it is no longer whole.
#![allow(unsafe_code)]

use contract::{Error, Result};
use memmap2::Mmap;
use std::fs::File;
use std::ops::{Deref, Range};
use std::path::Path;

/// Bytes that are given back to the system at a time: pages that were read count as resident memory of the program.
const GIVEN_BACK: usize = 32 << 20;
/// Pages of the largest systems: what is given back begins and ends at their bounds.
const PAGE: usize = 1 << 16;

/// A file larger than this part of the machine's memory leaves the system's cache behind its reader: it would be gone before
/// it is read once more, and pages that the cache has to find anew cost more than reading does.
#[cfg(target_os = "linux")]
const CACHED: usize = 4;
/// So far behind the reader, bytes: another may sum the file up beside him.
#[cfg(target_os = "linux")]
const BEHIND: usize = 512 << 20;

/// A read-only map of a whole file.
pub(crate) struct Mapped {
    map: Mmap,
    /// To be taken out of the system's cache once it is read.
    #[cfg(target_os = "linux")]
    leaving: Option<File>,
    watch: guard::Watch,
}

/// Maps a whole file, read only. An empty file is refused, since it cannot be mapped and holds nothing.
pub(crate) fn map(path: &Path) -> Result<Mapped> {
    let file = File::open(path)?;
    if file.metadata()?.len() == 0 {
        return Err(Error::bad_input("the file is empty"));
    }
    // SAFETY: the map is private to this room and only read, and inputs are never written by us. What remains is
    // another process that shortens the file while it is read: `guard` takes care of that.
    let map = unsafe { Mmap::map(&file)? };
    let watch = guard::Watch::over(&map);
    Ok(Mapped {
        #[cfg(target_os = "linux")]
        leaving: (map.len() > guard::memory_bytes() / CACHED).then_some(file),
        map,
        watch,
    })
}

impl Mapped {
    /// Whether all that was read of it was there.
    ///
    /// # Errors
    /// The file was cut short, or could not be reached any more: what was read of it is of no use.
    pub(crate) fn check(&self) -> Result<()> {
        if self.watch.is_whole() {
            return Ok(());
        }
        Err(Error::bad_input("the file was cut short or went away while it was read")
            .hint("start again once it is whole"))
    }

    /// To be told how far a reader of consecutive bytes has come; `given` is what it has given back so far.
    pub(crate) fn passed(&self, to: usize, given: &mut usize) {
        if to >= *given + GIVEN_BACK {
            let end = to / PAGE * PAGE;
            self.turn(*given..end);
            *given = end;
        }
    }

    #[cfg(not(unix))]
    fn turn(&self, _: Range<usize>) {}

    /// Gives back a range, and has the system read what comes after it: disks are slow to answer, not to read.
    #[cfg(unix)]
    fn turn(&self, range: Range<usize>) {
        // SAFETY: the map is read-only and of a file: a page that is dropped is read again, with the same bytes.
        let advised = unsafe {
            let dont_need = memmap2::UncheckedAdvice::DontNeed;
            self.map.unchecked_advise_range(dont_need, range.start, range.len())
        };
        let next = range.end + GIVEN_BACK..(range.end + 2 * GIVEN_BACK).min(self.map.len());
        // Advice only: where the system does not take it, the pages stay until it needs them, or come when asked for.
        let _ = advised;
        if !next.is_empty() {
            let _ = self.map.advise_range(memmap2::Advice::WillNeed, next.start, next.len());
        }
        #[cfg(target_os = "linux")]
        if let (Some(file), Some(end)) = (&self.leaving, range.end.checked_sub(BEHIND)) {
            let start = range.start.saturating_sub(BEHIND);
            let n = std::num::NonZero::new((end - start) as u64);
            let _ = rustix::fs::fadvise(file, start as u64, n, rustix::fs::Advice::DontNeed);
        }
    }
}

impl Deref for Mapped {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.map
    }
}

#[cfg(not(unix))]
mod guard {
    /// Elsewhere a mapped file cannot be cut short.
    pub(super) struct Watch;

    impl Watch {
        pub(super) fn over(_: &[u8]) -> Self {
            Self
        }

        pub(super) fn is_whole(&self) -> bool {
            true
        }
    }
}

#[cfg(unix)]
mod guard {
    use std::sync::Once;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};

    /// Most maps that are watched at the same time; one more is read unguarded.
    const MAX: usize = 1024;

    /// Addresses of a map, and whether a page of it was missing. Free where it begins at 0.
    struct Slot {
        begin: AtomicUsize,
        end: AtomicUsize,
        is_torn: AtomicBool,
    }

    static SLOTS: [Slot; MAX] = [const {
        Slot {
            begin: AtomicUsize::new(0),
            end: AtomicUsize::new(0),
            is_torn: AtomicBool::new(false),
        }
    }; MAX];
    /// Size of the system's pages, bytes.
    static PAGE: AtomicUsize = AtomicUsize::new(4096);

    /// Watches the addresses of a map while it lives.
    pub(super) struct Watch(Option<&'static Slot>);

    impl Watch {
        pub(super) fn over(bytes: &[u8]) -> Self {
            static ONCE: Once = Once::new();
            ONCE.call_once(install);
            let begin = bytes.as_ptr() as usize;
            let is_free =
                |slot: &&Slot| slot.begin.compare_exchange(0, begin, SeqCst, SeqCst).is_ok();
            let slot = SLOTS.iter().find(is_free);
            if let Some(slot) = slot {
                slot.is_torn.store(false, SeqCst);
                slot.end.store(begin + bytes.len(), SeqCst);
            }
            Self(slot)
        }

        pub(super) fn is_whole(&self) -> bool {
            self.0.is_none_or(|slot| !slot.is_torn.load(SeqCst))
        }
    }

    impl Drop for Watch {
        fn drop(&mut self) {
            if let Some(slot) = self.0 {
                slot.end.store(0, SeqCst);
                slot.begin.store(0, SeqCst);
            }
        }
    }

    /// Memory of the machine, bytes; very large where the system does not tell.
    #[cfg(target_os = "linux")]
    pub(super) fn memory_bytes() -> usize {
        // SAFETY: plain calls that only return numbers.
        let [pages, page] =
            unsafe { [libc::sysconf(libc::_SC_PHYS_PAGES), libc::sysconf(libc::_SC_PAGESIZE)] };
        let bytes = usize::try_from(pages).ok().zip(usize::try_from(page).ok());
        bytes.map_or(usize::MAX, |(pages, page)| pages.saturating_mul(page))
    }

    fn install() {
        // SAFETY: plain calls of the system with arguments of the right kind; the handler only touches atomics and calls
        // what may be called in a handler.
        unsafe {
            let page = libc::sysconf(libc::_SC_PAGESIZE);
            PAGE.store(usize::try_from(page).unwrap_or(4096).max(1), SeqCst);
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = on_missing_page as *const () as usize;
            action.sa_flags = libc::SA_SIGINFO;
            libc::sigemptyset(&raw mut action.sa_mask);
            libc::sigaction(libc::SIGBUS, &raw const action, std::ptr::null_mut());
        }
    }

    extern "C" fn on_missing_page(
        signal: libc::c_int,
        info: *mut libc::siginfo_t,
        _: *mut libc::c_void,
    ) {
        // SAFETY: the system gives a valid `info`; a page within a map of ours is replaced by one of zeros, which only
        // readers of that map see; anything else ends as it would have without us.
        unsafe {
            let at = (*info).si_addr() as usize;
            let within = |s: &&Slot| (s.begin.load(SeqCst)..s.end.load(SeqCst)).contains(&at);
            let page = PAGE.load(SeqCst);
            let start = at / page * page;
            if let Some(slot) = SLOTS.iter().find(within) {
                slot.is_torn.store(true, SeqCst);
                let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_FIXED;
                let place = start as *mut libc::c_void;
                if libc::mmap(place, page, libc::PROT_READ, flags, -1, 0) != libc::MAP_FAILED {
                    return;
                }
            }
            libc::signal(signal, libc::SIG_DFL);
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_cut_short_says_so_and_the_program_lives() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("scan.las");
        let bytes: Vec<u8> = (0..1 << 20).map(|i| i as u8 | 1).collect();
        std::fs::write(&path, &bytes).expect("writes");
        let [cut, whole] = [map(&path).expect("maps"), map(&path).expect("maps")];
        assert_eq!(whole[..1000], bytes[..1000]);
        File::options().write(true).open(&path).and_then(|f| f.set_len(8192)).expect("cuts");
        assert!(cut[..8192].iter().all(|b| b & 1 == 1) && cut.check().is_ok());
        let sum: u64 = cut.iter().map(|b| u64::from(*b)).sum();
        assert_eq!(sum, bytes[..8192].iter().map(|b| u64::from(*b)).sum::<u64>());
        assert!(cut.check().expect_err("torn").to_string().contains("cut short"));
        assert!(whole.check().is_ok());
    }
}
