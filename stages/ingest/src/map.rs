//! Path in, bytes out: the one place of the program that maps files into memory, inputs and the
//! store alike.
//!
//! A file that is cut short, or a share that goes away, while it is mapped would end the program
//! with a signal (SIGBUS). The signal is caught: the page that is missing is replaced by zeros, so
//! that the reader comes to an end, and the map says that it is no longer whole.
#![allow(unsafe_code)]

use contract::{Error, Result};
use memmap2::Mmap;
use std::fs::File;
use std::ops::Deref;
use std::path::Path;

/// A read-only map of a whole file. After its bytes were used, [`Mapped::check`] says whether they
/// were there.
pub struct Mapped {
    map: Mmap,
    /// The same file, to be read otherwise.
    file: File,
    watch: guard::Watch,
}

/// Maps a whole file, read only.
///
/// # Errors
/// A file that cannot be opened or mapped; an empty one, since it cannot be mapped and holds
/// nothing.
pub fn map(path: &Path) -> Result<Mapped> {
    let file = File::open(path)?;
    if file.metadata()?.len() == 0 {
        return Err(Error::bad_input("the file is empty"));
    }
    // SAFETY: the map is only read. Inputs are never written by us; files of the store are renamed
    // to their place whole and never written again. What remains is another process that shortens
    // the file while it is read: `guard` takes care of that.
    let map = unsafe { Mmap::map(&file)? };
    let watch = guard::Watch::over(&map);
    Ok(Mapped { map, file, watch })
}

impl Mapped {
    /// The file that is mapped, whatever has its name by now.
    #[must_use]
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Whether all that was read of it was there.
    ///
    /// # Errors
    /// The file was cut short, or could not be reached any more: what was read of it is of no use.
    pub fn check(&self) -> Result<()> {
        // Of the page in which a file ends now the rest reads as zeros without a signal: only its
        // length tells.
        let is_as_long = self.file.metadata().is_ok_and(|meta| meta.len() >= self.map.len() as u64);
        if self.watch.is_whole() && is_as_long {
            return Ok(());
        }
        Err(Error::bad_input("the file was cut short or went away while it was read")
            .hint("start again once it is whole"))
    }

    /// Has the system read `n` bytes from `start` on, which will be asked for soon. Advice only:
    /// errors are no harm.
    pub fn will_need(&self, start: usize, n: usize) {
        #[cfg(unix)]
        let _ = self.map.advise_range(memmap2::Advice::WillNeed, start, n);
        #[cfg(not(unix))]
        let _ = (start, n);
    }

    /// Gives its pages back to the system, which reads them again where they are asked for again.
    /// Advice only.
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
