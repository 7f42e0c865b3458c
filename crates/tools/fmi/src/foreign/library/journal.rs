//! The messages of an FMU: the loggers of both versions.

#![allow(unsafe_code, reason = "an FMU hands in its texts as pointers")]

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::ffi::{CStr, c_char, c_int};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::os::is_told;

use super::functions::Handle;
use crate::value::Status;

/// The journals of all instances that can still log, by the addresses that their FMUs received. An FMU can pass any
/// pointer as its environment, so the address is compared with these and never dereferenced.
static LIVING: Mutex<BTreeMap<usize, Arc<Entry>>> = Mutex::new(BTreeMap::new());

fn living() -> MutexGuard<'static, BTreeMap<usize, Arc<Entry>>> {
    LIVING.lock().unwrap_or_else(PoisonError::into_inner)
}

thread_local! {
    /// The address of the journal of the FMU that this thread called last.
    static CALLED: Cell<usize> = const { Cell::new(0) };
}

/// The messages of an FMU.
#[derive(Debug, Default)]
struct Entry {
    file: String,
    lines: AtomicU64,
    /// The last message since the FMU's last call began.
    last: Mutex<String>,
}

impl Entry {
    fn last(&self) -> MutexGuard<'_, String> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
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

/// The journal of one instance, which receives messages until it is dropped.
#[derive(Debug)]
pub(super) struct Journal(Arc<Entry>);

impl Journal {
    /// Creates the journal of the FMU that messages call `file`.
    pub(super) fn of(file: &str) -> Self {
        let journal = Self(Arc::new(Entry {
            file: file.to_owned(),
            ..Entry::default()
        }));
        living().insert(journal.env().addr(), Arc::clone(&journal.0));
        journal
    }

    /// Returns the pointer that the FMU must pass with each message.
    pub(super) fn env(&self) -> Handle {
        Arc::as_ptr(&self.0).cast_mut().cast()
    }

    /// Notes that the FMU is about to be called: earlier messages are not about this call.
    pub(super) fn begin_call(&self) {
        CALLED.set(self.env().addr());
        self.0.last().clear();
    }

    /// Returns the last warning or error of the present call; empty if there was none.
    pub(super) fn said(&self) -> String {
        self.0.last().clone()
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        living().remove(&self.env().addr());
    }
}

/// Reads a text of the FMU, valid for the length of a call.
///
/// # Safety
///
/// Null, or a C string that exists as long as it is used.
unsafe fn words<'a>(text: *const c_char) -> Cow<'a, str> {
    if text.is_null() {
        return "".into();
    }
    // SAFETY: promised by the caller.
    unsafe { CStr::from_ptr(text) }.to_string_lossy()
}

/// Takes a message of the instance with this environment. Some FMUs pass another environment: the message then goes to
/// the FMU that this thread is calling. A message that fits neither is dropped.
fn take(env: Handle, status: c_int, text: &str) {
    let journal = {
        let living = living();
        let called = || living.get(&CALLED.get());
        living.get(&env.addr()).or_else(called).cloned()
    };
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
    // SAFETY: the message is a C string from the FMU.
    take(env, status, &unsafe { words(message) });
}

#[cfg(all(target_arch = "x86_64", unix))]
pub(super) use formatted::log_of_two;

/// The logger of FMI 2.0, which accepts any number of further arguments. Rust cannot express such a function. The
/// System V convention for x86-64 is simple enough to collect the arguments in a few instructions.
#[cfg(all(target_arch = "x86_64", unix))]
mod formatted {
    use std::arch::naked_asm;
    use std::ffi::{c_char, c_int};

    use super::{take, words};
    use crate::foreign::library::functions::Handle;

    /// The most bytes of a message; longer ones are cut.
    const MOST: usize = 4096;

    /// `va_list`, as the thunk below fills it.
    #[repr(C)]
    struct Arguments {
        next_general: u32,
        next_vector: u32,
        on_stack: *const u8,
        registers: *const u8,
    }

    unsafe extern "C" {
        fn vsnprintf(
            text: *mut c_char,
            size: usize,
            format: *const c_char,
            arguments: *mut Arguments,
        ) -> c_int;
    }

    /// Saves the registers that carry further arguments, builds a `va_list` from them and the stack, and calls
    /// [`take_formatted`].
    #[unsafe(naked)]
    pub(in super::super) unsafe extern "C" fn log_of_two(
        env: Handle,
        name: *const c_char,
        status: c_int,
        category: *const c_char,
        format: *const c_char,
        first: *const c_char,
    ) {
        naked_asm!(
            // At rsp: the va_list, 24 bytes. At rsp + 32: the registers, 6 of 8 bytes and 8 of 16 bytes, the latter at
            // multiples of 16. At rsp + 216: the return address, followed by the arguments passed on the stack.
            "sub rsp, 216",
            // Five of the six general registers contain the named parameters.
            "mov [rsp + 72], r9",
            "test al, al",
            "je 2f",
            "movaps [rsp + 80], xmm0",
            "movaps [rsp + 96], xmm1",
            "movaps [rsp + 112], xmm2",
            "movaps [rsp + 128], xmm3",
            "movaps [rsp + 144], xmm4",
            "movaps [rsp + 160], xmm5",
            "movaps [rsp + 176], xmm6",
            "movaps [rsp + 192], xmm7",
            "2:",
            "mov dword ptr [rsp], 40",
            "mov dword ptr [rsp + 4], 48",
            "lea rax, [rsp + 224]",
            "mov [rsp + 8], rax",
            "lea rax, [rsp + 32]",
            "mov [rsp + 16], rax",
            "mov esi, edx",
            "mov rdx, r8",
            "mov rcx, rsp",
            "call {take}",
            "add rsp, 216",
            "ret",
            take = sym take_formatted,
        )
    }

    unsafe extern "C" fn take_formatted(
        env: Handle,
        status: c_int,
        format: *const c_char,
        arguments: *mut Arguments,
    ) {
        let mut text: [c_char; MOST] = [0; MOST];
        if !format.is_null() {
            // SAFETY: the function writes at most MOST bytes and ends them with a zero. The format is the FMU's, and
            // the arguments are those that the FMU passed with it.
            unsafe { vsnprintf(text.as_mut_ptr(), MOST, format, arguments) };
        }
        // SAFETY: the text ends with a zero.
        take(env, status, &unsafe { words(text.as_ptr()) });
    }
}

/// The logger of FMI 2.0, which accepts any number of further arguments. Rust cannot express such a function. Where the
/// first of these arguments is passed like that of a plain function, it is read for the one format that consists of it.
#[cfg(not(all(target_arch = "x86_64", unix)))]
pub(super) unsafe extern "C" fn log_of_two(
    env: Handle,
    _: *const c_char,
    status: c_int,
    _: *const c_char,
    format: *const c_char,
    first: *const c_char,
) {
    // SAFETY: the format is a C string from the FMU.
    let format = unsafe { words(format) };
    // Apple's arm64 passes further arguments on the stack.
    let has_first = !cfg!(all(target_vendor = "apple", target_arch = "aarch64"));
    if has_first && matches!(format.trim_end(), "%s") {
        // SAFETY: by its format, the first further argument is a C string. The calling conventions of x86-64 Windows
        // and arm64 Linux pass it in the place of a plain function's sixth parameter.
        take(env, status, &unsafe { words(first) });
    } else {
        take(env, status, &format);
    }
}
