//! The end of a process while a driver's threads may be at work, and who may ask for it.

/// Ends the process with this exit code and runs no destructors, of this program or of any library.
///
/// `exit` runs those of the driver's libraries while their threads may still draw: three of sixty interrupts of a long draw
/// ended in a segmentation fault.
pub fn end_at_once(code: u8) -> ! {
    #[cfg(unix)]
    // SAFETY: `_exit` takes any number and does not return.
    unsafe {
        libc::_exit(code.into())
    }
    #[cfg(not(unix))]
    std::process::exit(code.into())
}

/// Runs `install`, which takes over signals. Where a hangup was ignored before, it still is: `nohup` asks for that.
pub fn keeping_hangups_ignored<T>(install: impl FnOnce() -> T) -> T {
    #[cfg(unix)]
    {
        // SAFETY: without a new action `sigaction` only writes the old one, a plain struct of which zeros are a value.
        let ignored = unsafe {
            let mut old: libc::sigaction = std::mem::zeroed();
            libc::sigaction(libc::SIGHUP, std::ptr::null(), &raw mut old) == 0
                && old.sa_sigaction == libc::SIG_IGN
        };
        let installed = install();
        if ignored {
            // SAFETY: to ignore a signal runs no code of ours.
            unsafe { libc::signal(libc::SIGHUP, libc::SIG_IGN) };
        }
        installed
    }
    #[cfg(not(unix))]
    install()
}
