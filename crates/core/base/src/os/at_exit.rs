//! The end of the process.

#![allow(unsafe_code, reason = "the C library's `atexit`")]

use std::ffi::c_int;
use std::panic::catch_unwind;
use std::sync::{Mutex, PoisonError};

/// A function to call, with the process that registered it: a forked child inherits the list, but none of the threads.
type Call = (u32, fn());

static CALLS: Mutex<Vec<Call>> = Mutex::new(Vec::new());

unsafe extern "C" {
    fn atexit(function: extern "C" fn()) -> c_int;
}

extern "C" fn exiting() {
    let calls = std::mem::take(&mut *CALLS.lock().unwrap_or_else(PoisonError::into_inner));
    for (process, call) in calls {
        if process == std::process::id() {
            // A panic must not unwind into the C library, and nobody is left to report it to.
            drop(catch_unwind(call));
        }
    }
}

/// Calls `call` when this process ends by `exit` or by the end of `main`, or when the library is unloaded. A process that a
/// signal kills does not call it.
pub fn at_exit(call: fn()) {
    let mut calls = CALLS.lock().unwrap_or_else(PoisonError::into_inner);
    if calls.is_empty() {
        // SAFETY: the function is in the library that registers it, which the C library honours when it is unloaded. If there
        // is no memory for the entry, the process ends as it would have without it.
        let _ = unsafe { atexit(exiting) };
    }
    calls.push((std::process::id(), call));
}
