//! The command within the native library, for the launcher (`crates/tools/launcher`), which a release has as its
//! `tickbus` command: so a release has all of this code once.

use std::ffi::c_int;

/// Runs the command with the arguments of the process, and returns its exit code.
#[allow(unsafe_code)]
// SAFETY: no other function has this name.
#[unsafe(no_mangle)]
extern "C" fn tickbus_command() -> c_int {
    super::command(&crate::KINDS, std::env::args_os()).into()
}
