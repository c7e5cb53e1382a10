//! The program as tests start it.

use std::process::Command;

/// `vtrace`, whatever the environment asks of its messages.
pub fn vtrace() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vtrace"));
    command.env_remove("RUST_LOG").env_remove("RUST_BACKTRACE");
    command
}

/// What it printed.
pub fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}
