//! Maps files into memory, inputs and the tile store alike; nothing else in the program does.
//!
//! If a file is truncated or a network share vanishes while it is mapped, an access raises a signal
//! (SIGBUS), which would end the program. The signal is caught: the missing page is replaced by
//! zeros, so that the reader can finish, and [`Mapped::check`] then reports the loss.
#![allow(unsafe_code)]

use contract::{Error, Result};
use memmap2::Mmap;
use std::fs::File;
use std::ops::Deref;
use std::path::Path;

/// A read-only map of a whole file. [`Mapped::check`] tells, after its bytes were used, whether
/// they were all there.
pub struct Mapped {
    map: Mmap,
    /// The same file, for reading without the map.
    file: File,
    watch: guard::Watch,
}

/// Maps a whole file for reading.
///
/// # Errors
/// If the file cannot be opened or mapped, or if it is empty.
pub fn map(path: &Path) -> Result<Mapped> {
    let file = File::open(path)?;
    if file.metadata()?.len() == 0 {
        return Err(Error::bad_input("the file is empty"));
    }
    // SAFETY: the map is only read. This program never writes inputs, and renames files of the
    // store to their place when they are complete. Another process may truncate the file while it
    // is read: `guard` handles that.
    let map = unsafe { Mmap::map(&file)? };
    let watch = guard::Watch::over(&map);
    Ok(Mapped { map, file, watch })
}

impl Mapped {
    /// The mapped file, even if another file has its name by now.
    #[must_use]
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Checks that all bytes that were read were there.
    ///
    /// # Errors
    /// If the file was truncated or became unreachable, so that what was read is invalid.
    pub fn check(&self) -> Result<()> {
        // The rest of the page in which a truncated file ends reads as zeros without a signal, so
        // the length is checked, too.
        let is_as_long = self.file.metadata().is_ok_and(|meta| meta.len() >= self.map.len() as u64);
        if self.watch.is_whole() && is_as_long {
            return Ok(());
        }
        Err(Error::bad_input("the file was cut short or became unreadable while it was read")
            .hint("start again when it is complete"))
    }

    /// Asks the operating system to read `n` bytes from `start` on ahead of their use. It is only
    /// advice, so errors are ignored.
    pub fn will_need(&self, start: usize, n: usize) {
        #[cfg(unix)]
        let _ = self.map.advise_range(memmap2::Advice::WillNeed, start, n);
        #[cfg(not(unix))]
        let _ = (start, n);
    }

    /// Releases the map's pages; the operating system reads them again when they are used. It is
    /// only advice, so errors are ignored.
    pub fn give_back(&self) {
        // SAFETY: the map is shared and read-only, so that a dropped page is read again from the
        // file with the same bytes; a page of zeros in the place of a missing one is private and
        // becomes zeros again.
        #[cfg(unix)]
        let _ = unsafe { self.map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
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
    /// Does nothing: on other systems a mapped file cannot be truncated.
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

    /// Largest number of maps that are watched at a time; further maps are not watched.
    const MAX: usize = 1024;

    /// Addresses of a map, and whether one of its pages was missing. The slot is free where it
    /// begins at 0.
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
    /// Page size of the operating system, bytes.
    static PAGE: AtomicUsize = AtomicUsize::new(4096);

    /// Watches the addresses of a map as long as it lives.
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

    fn install() {
        // SAFETY: plain calls of the system with arguments of the right kind; the handler only
        // touches atomics and calls what may be called in a handler.
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
        // SAFETY: the system gives a valid `info`; a page within a map of ours is replaced by one
        // of zeros, which only readers of that map see; anything else ends as it would have
        // without us.
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
        let other = dir.path().join("other.las");
        let mapped = [&path, &other].map(|path| {
            std::fs::write(path, &bytes).expect("writes");
            map(path).expect("maps")
        });
        let [cut, whole] = mapped;
        assert_eq!(whole[..1000], bytes[..1000]);
        assert!(cut.check().is_ok());
        let shorten = |n| File::options().write(true).open(&path).and_then(|f| f.set_len(n));
        // Within its last page there is no signal.
        shorten((1 << 20) - 10).expect("cuts");
        assert!(cut[(1 << 20) - 1] == 0 && cut.check().is_err());
        shorten(8192).expect("cuts");
        assert!(cut[..8192].iter().all(|b| b & 1 == 1));
        let sum: u64 = cut.iter().map(|b| u64::from(*b)).sum();
        assert_eq!(sum, bytes[..8192].iter().map(|b| u64::from(*b)).sum::<u64>());
        assert!(cut.check().expect_err("torn").to_string().contains("cut short"));
        assert!(whole.check().is_ok());
        // Pages that were given back are read again; missing ones stay missing.
        cut.give_back();
        assert!(cut[..8192].iter().all(|b| b & 1 == 1) && cut[8192] == 0 && cut.check().is_err());
    }
}
