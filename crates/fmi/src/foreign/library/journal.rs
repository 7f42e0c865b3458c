//! What an FMU says: the loggers of both versions.

#![allow(unsafe_code, reason = "an FMU hands in its texts as pointers")]

use std::borrow::Cow;
use std::ffi::{CStr, c_char, c_int};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tickbus_base::os::is_told;

use super::functions::Handle;
use crate::value::Status;

/// What the FMU has said.
#[derive(Debug, Default)]
pub(super) struct Journal {
    file: String,
    lines: AtomicU64,
    /// What it has said since its last call began.
    last: Mutex<String>,
}

impl Journal {
    /// That of the FMU which messages call `file`.
    pub(super) fn of(file: &str) -> Self {
        Self {
            file: file.to_owned(),
            ..Self::default()
        }
    }

    fn last(&self) -> MutexGuard<'_, String> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The FMU is about to be called: what it has said before is not about this call.
    pub(super) fn begin_call(&self) {
        self.last().clear();
    }

    /// What it has said last in the present call, of what is not right; empty for nothing.
    pub(super) fn said(&self) -> String {
        self.last().clone()
    }

    fn take(&self, status: c_int, text: &str) {
        let text = text.trim();
        if status > Status::Ok as c_int {
            text.clone_into(&mut self.last());
        }
        let times = self.lines.fetch_add(1, Ordering::Relaxed) + 1;
        if is_told(times) {
            match Status::of(status) {
                Status::Ok => log::info!("{} says: {text}", self.file),
                _ => log::warn!("{} says: {text}", self.file),
            }
        }
    }
}

/// A text of the FMU's, for the length of a call.
///
/// # Safety
///
/// Null, or a C string that stays while it is used.
unsafe fn words<'a>(text: *const c_char) -> Cow<'a, str> {
    if text.is_null() {
        return "".into();
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy()
}

/// What nobody knows the FMU of is of no use.
fn take(journal: Option<&Journal>, status: c_int, text: &str) {
    if let Some(journal) = journal {
        journal.take(status, text);
    }
}

/// The logger of FMI 3.0.
pub(super) unsafe extern "C" fn log_of_three(
    env: Handle,
    status: c_int,
    _: *const c_char,
    message: *const c_char,
) {
    // SAFETY: `env` is the journal that the instance was made with and that outlives it, or null where an FMU does not hand it back. The
    // message is the FMU's C string.
    let (journal, text) = unsafe { (env.cast::<Journal>().as_ref(), words(message)) };
    take(journal, status, &text);
}

/// The logger of FMI 2.0, which by the standard has any number of further arguments. Rust cannot write such a function; where the
/// first of them is passed as that of a plain function is, it is taken for the one format that consists of it.
pub(super) unsafe extern "C" fn log_of_two(
    env: Handle,
    _: *const c_char,
    status: c_int,
    _: *const c_char,
    format: *const c_char,
    first: *const c_char,
) {
    // SAFETY: as above.
    let (journal, format) = unsafe { (env.cast::<Journal>().as_ref(), words(format)) };
    // On Apple's arm64 further arguments are on the stack.
    let has_first = !cfg!(all(target_vendor = "apple", target_arch = "aarch64"));
    if has_first && matches!(format.trim_end(), "%s") {
        // SAFETY: by its format, the first further argument is a C string. The calling conventions of x86-64 (System V and
        // Windows) and of arm64 Linux pass it where they pass the sixth parameter of a plain function.
        take(journal, status, &unsafe { words(first) });
    } else {
        take(journal, status, &format);
    }
}
