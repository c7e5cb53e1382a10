//! The end of a process while a driver's threads may be at work.

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
