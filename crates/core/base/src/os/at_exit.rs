//! The end of the process.

#![allow(unsafe_code, reason = "the C library's `atexit`")]

use std::ffi::c_int;
use std::panic::catch_unwind;
use std::sync::{Mutex, PoisonError};

/// A function to call, with the process that registered it: a forked child inherits the list, but none of the threads.
type Call = (u32, fn());

static CALLS: Mutex<Vec<Call>> = Mutex::new(Vec::new());

#[cfg(unix)]
unsafe extern "C" {
    fn atexit(function: extern "C" fn()) -> c_int;
}

/// The function of the C library that the program has, in place of the one that this library has: Windows runs the latter when
/// it has ended all threads. A program with a C library of its own has no such function, and no call is made.
///
/// # Safety
///
/// As for `atexit`.
#[cfg(windows)]
unsafe fn atexit(function: extern "C" fn()) -> c_int {
    use windows_sys::Win32::System::LibraryLoader::{
        GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS, GET_MODULE_HANDLE_EX_FLAG_PIN, GetModuleHandleExW,
        GetModuleHandleW, GetProcAddress,
    };
    use windows_sys::w;

    type Register = unsafe extern "C" fn(extern "C" fn()) -> c_int;

    // SAFETY: the name ends with a zero.
    let library = unsafe { GetModuleHandleW(w!("ucrtbase.dll")) };
    if library.is_null() {
        return -1;
    }
    // SAFETY: the library is loaded, and the name ends with a zero.
    let Some(register) = (unsafe { GetProcAddress(library, c"_crt_atexit".as_ptr().cast()) })
    else {
        return -1;
    };
    // The function must not be unloaded before it is called.
    let flags = GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_PIN;
    let mut own = std::ptr::null_mut();
    // SAFETY: with these flags the second argument is an address in the module that stays loaded.
    if unsafe { GetModuleHandleExW(flags, function as *const u16, &raw mut own) } == 0 {
        return -1;
    }
    // SAFETY: the type is that of the function in the C library's documentation.
    let register = unsafe { std::mem::transmute::<_, Register>(register) };
    // SAFETY: the function stays loaded.
    unsafe { register(function) }
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
