//! The functions of FMI 2.0 and 3.0: an importing tool calls these in the FMU that `tickbus export --for fmi2` or
//! `fmi3` makes.
//!
//! An instance is a [`tickbus_fmi::made::Instance`]. This module keeps the handles, reads and writes through the
//! caller's pointers, and passes messages to the tool's own log. A function never unwinds into its caller, and never
//! calls back while it holds the instance.

#![allow(
    unsafe_code,
    reason = "exported names and the pointers that an importing tool hands in"
)]

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Once;

use crate::KINDS;
use log::Level;
use tickbus_base::os::{Library, collect_log, has_log, own_file, take_log};
use tickbus_binding::{Handles, closing, panic_message};
use tickbus_driver::Code;
use tickbus_fmi::made::{EventMode, Instance, StepEnd, folder_of};
use tickbus_fmi::{Status, Version};

/// Defines functions that are one call of the instance.
macro_rules! calls {
    ($($name:ident: $work:expr;)+) => {$(
        #[unsafe(no_mangle)]
        extern "C" fn $name(instance: *mut c_void) -> c_int {
            call(instance, $work)
        }
    )+};
}

/// Defines the get and set functions for variables of a type: our own type, and the type in the lists. FMI 3.0 passes
/// the number of values in addition to that of the variables.
macro_rules! numbers {
    ($($get:ident, $set:ident: $own:ty as $outer:ty $(, $length:ident)?;)+) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $get(
            instance: *mut c_void, references: *const u32, count: usize, values: *mut $outer $(, $length: usize)?
        ) -> c_int {
            let [.., length] = [count $(, $length)?];
            // SAFETY: by the standard's header, these are null or lists with the lengths given in the call.
            let (references, values) = unsafe { (list(references, count), room(values, length)) };
            call(instance, |instance| {
                whole([references.len(), values.len()], [count, length])?;
                instance.get(references, length, |at, value: $own| values[at] = value.into())
            })
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $set(
            instance: *mut c_void, references: *const u32, count: usize, values: *const $outer $(, $length: usize)?
        ) -> c_int {
            let [.., length] = [count $(, $length)?];
            // SAFETY: as above.
            let (references, values) = unsafe { (list(references, count), list(values, length)) };
            call(instance, |instance| {
                whole([references.len(), values.len()], [count, length])?;
                instance.set(references, values.iter().map(|&value| <$own as Inner<$outer>>::inner(value)))
            })
        }
    )+};
}

/// Defines functions that the model description declares as missing. In C some of them have more parameters than this;
/// calling them is fine, since the caller removes the parameters.
macro_rules! lacking {
    ($($name:ident,)+) => {$(
        #[unsafe(no_mangle)]
        extern "C" fn $name(instance: *mut c_void) -> c_int {
            lacking(instance, stringify!($name))
        }
    )+};
}

mod three;
mod two;

/// The instances of all FMUs that contain this library.
static INSTANCES: Handles<Box<Tenant>> = Handles::new();

/// `fmi2CallbackLogger`. Its further arguments, those of the format, are never passed.
type LoggerOfTwo = unsafe extern "C" fn(
    env: *mut c_void,
    name: *const c_char,
    status: c_int,
    category: *const c_char,
    format: *const c_char,
    ...
);

/// `fmi3LogMessageCallback`.
type LoggerOfThree = unsafe extern "C" fn(
    env: *mut c_void,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
);

/// The tool's function for messages.
#[derive(Clone, Copy)]
enum Logger {
    Two(LoggerOfTwo),
    Three(LoggerOfThree),
}

/// The tool's log for one instance.
#[derive(Clone)]
struct Journal {
    logger: Option<Logger>,
    env: *mut c_void,
    name: CString,
    /// True if the tool wants every change of the line.
    all: bool,
}

// SAFETY: `env` is only a number to this library, which passes it back to the tool's own function during calls by the
// tool. Both standards allow a tool to call an instance from one thread after another.
unsafe impl Send for Journal {}

/// An instance, and the log of the tool that created it.
struct Tenant {
    instance: Instance,
    journal: Journal,
    /// The message of the panic that ended the instance.
    broken: Option<String>,
}

impl Journal {
    /// Passes one message to the tool.
    fn tell(&self, status: Status, category: &CStr, text: &str) {
        let text = text.replace('\0', " ");
        // The text is used as the format: tools that do not format would show "%s".
        let text = match self.logger {
            None => return eprintln!("tickbus: {text}"),
            Some(Logger::Two(_)) => text.replace('%', "%%"),
            Some(Logger::Three(_)) => text,
        };
        let text = CString::new(text).unwrap_or_default();
        match self.logger {
            None => {}
            // SAFETY: the tool passed this function and this `env`, to be called during its own calls. All texts
            // outlive the call, and the format needs no further argument.
            Some(Logger::Two(logger)) => unsafe {
                logger(
                    self.env,
                    self.name.as_ptr(),
                    status as c_int,
                    category.as_ptr(),
                    text.as_ptr(),
                );
            },
            // SAFETY: as above.
            Some(Logger::Three(logger)) => unsafe {
                logger(self.env, status as c_int, category.as_ptr(), text.as_ptr());
            },
        }
    }

    fn fail(&self, text: &str) {
        self.tell(Status::Error, c"logStatusError", text);
    }

    /// Passes on the lines that tickbus has logged in the meantime, on any thread.
    fn pass_on_log(&self) {
        if !has_log() {
            return;
        }
        for (level, text) in take_log() {
            match level {
                Level::Error | Level::Warn => {
                    self.tell(Status::Warning, c"logStatusWarning", &text);
                }
                _ if self.all => self.tell(Status::Ok, c"logEvents", &text),
                _ => {}
            }
        }
    }
}

/// The result and the log of a call, to report once the instance is released.
type Told = (Result<(), String>, Journal);

/// Calls `work` with an instance, and returns a status.
#[inline]
fn call(handle: *mut c_void, work: impl FnOnce(&mut Instance) -> Result<(), String>) -> c_int {
    let mut work = Some(work);
    call_once(handle, &mut |instance| match work.take() {
        Some(work) => work(instance),
        None => Ok(()),
    })
}

/// Does one step. Returns a status, the way in which the step ended, and the time that the run has reached. The status
/// is "discard" if the bus has ended; no step follows then.
fn step(handle: *mut c_void, from: f64, length: f64) -> (c_int, StepEnd, f64) {
    let (mut is_over, mut end, mut time) = (false, StepEnd::default(), from);
    let status = call(handle, |instance| {
        let stepped = instance.step(from, length);
        is_over = instance.is_over();
        time = instance.time();
        end = stepped?;
        Ok(())
    });
    let status = if is_over && status == Status::Ok as c_int {
        Status::Discard as c_int
    } else {
        status
    };
    (status, end, time)
}

/// As `call`, but compiled only once for all of the functions: there are more than a hundred.
#[inline(never)]
fn call_once(
    handle: *mut c_void,
    work: &mut dyn FnMut(&mut Instance) -> Result<(), String>,
) -> c_int {
    let done = INSTANCES.tick(handle as i64, |tenant| tenant.work(work));
    match done {
        Ok(None) => Status::Ok as c_int,
        Ok(Some(told)) => tell(told),
        Err(code) => unknown(code),
    }
}

impl Tenant {
    #[inline]
    fn work(&mut self, work: impl FnOnce(&mut Instance) -> Result<(), String>) -> Option<Told> {
        if let Some(text) = &self.broken {
            return Some((Err(text.clone()), self.journal.clone()));
        }
        match catch_unwind(AssertUnwindSafe(|| work(&mut self.instance))) {
            Ok(Ok(())) if !has_log() => None,
            Ok(result) => Some((result, self.journal.clone())),
            Err(payload) => {
                let text = panic_message(payload);
                let text = format!("a defect of tickbus: {text}; please report it");
                self.broken = Some(text.clone());
                Some((Err(text), self.journal.clone()))
            }
        }
    }
}

#[cold]
fn tell((result, journal): Told) -> c_int {
    journal.pass_on_log();
    match result {
        Ok(()) => Status::Ok as c_int,
        Err(text) => {
            journal.fail(&text);
            Status::Error as c_int
        }
    }
}

/// Reports a handle without an instance, for which there is no log of a tool.
#[cold]
fn unknown(code: Code) -> c_int {
    let what = match code {
        Code::Busy => "two threads call one instance at once; let one follow the other",
        Code::Closed => "this instance was freed before",
        _ => "there is no such instance",
    };
    eprintln!("tickbus: {what}");
    Status::Error as c_int
}

/// Keeps this library loaded for good: its threads may outlast an instance.
fn pin() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        collect_log();
        if let Ok(library) = own_file().map(|file| Library::load(&file)) {
            std::mem::forget(library);
        }
    });
}

/// Creates an instance. Returns null if that fails, after reporting the reason to the tool.
fn instantiate(
    version: Version,
    named: Option<&Path>,
    token: &str,
    event_mode: EventMode,
    journal: &Journal,
) -> *mut c_void {
    let made = catch_unwind(AssertUnwindSafe(|| {
        pin();
        let place = INSTANCES.reserve().map_err(|refusal| refusal.to_string())?;
        let own = own_file().ok();
        let folder = folder_of(named, own.as_deref()).ok_or(
            "the importing tool names no folder of resources; an FMU of tickbus has its driver.cfg there",
        )?;
        let mut instance = Instance::new(version, &folder, token, &KINDS)?;
        instance.set_event_mode(event_mode);
        let tenant = Box::new(Tenant {
            instance,
            journal: journal.clone(),
            broken: None,
        });
        Ok(place.fill(token, tenant) as *mut c_void)
    }));
    let made = made
        .unwrap_or_else(|payload| Err(format!("a defect of tickbus: {}", panic_message(payload))));
    journal.pass_on_log();
    made.unwrap_or_else(|text: String| {
        journal.fail(&text);
        std::ptr::null_mut()
    })
}

/// Frees an instance.
fn free(handle: *mut c_void) {
    if handle.is_null() {
        return;
    }
    // Closing can panic, like any code that runs a bus.
    let freed = catch_unwind(AssertUnwindSafe(|| {
        closing(|| {
            INSTANCES.close(handle as i64, |mut tenant| {
                tenant.instance.end();
                tenant.journal.clone()
            })
        })
    }));
    match freed {
        Ok(Ok(journal)) => journal.pass_on_log(),
        Ok(Err(code)) => _ = unknown(code),
        Err(payload) => eprintln!("tickbus: {}", panic_message(payload)),
    }
}

/// Sets whether the tool wants every change of the line.
fn set_logging(handle: *mut c_void, all: bool) -> c_int {
    let done = INSTANCES.tick(handle as i64, |tenant| tenant.journal.all = all);
    done.map_or_else(unknown, |()| Status::Ok as c_int)
}

#[expect(clippy::unnecessary_wraps, reason = "all calls have this form")]
fn reset(instance: &mut Instance) -> Result<(), String> {
    instance.reset();
    Ok(())
}

/// Answers a call of a function that this FMU declares as missing.
fn lacking(handle: *mut c_void, name: &str) -> c_int {
    call(handle, |_| {
        Err(format!(
            "{name} is not in this FMU, as its modelDescription.xml says; choose another master algorithm"
        ))
    })
}

/// Returns the text behind a pointer; `None` for NULL and for text that is not UTF-8.
///
/// # Safety
///
/// `text` must be null or point to a C string that exists as long as it is used.
unsafe fn text<'a>(text: *const c_char) -> Option<&'a str> {
    if text.is_null() {
        return None;
    }
    // SAFETY: promised by the caller.
    unsafe { CStr::from_ptr(text) }.to_str().ok()
}

/// Returns the list behind a pointer and a length; empty for NULL.
///
/// # Safety
///
/// `first` must be null or point to `count` initialised values, which nobody changes in the meantime.
#[inline]
unsafe fn list<'a, T>(first: *const T, count: usize) -> &'a [T] {
    if first.is_null() || count == 0 {
        return &[];
    }
    // SAFETY: promised by the caller.
    unsafe { std::slice::from_raw_parts(first, count) }
}

/// Returns the list behind a pointer and a length, for writing.
///
/// # Safety
///
/// As [`list`]; in addition, nobody reads the values in the meantime.
#[inline]
unsafe fn room<'a, T>(first: *mut T, count: usize) -> &'a mut [T] {
    if first.is_null() || count == 0 {
        return &mut [];
    }
    // SAFETY: promised by the caller.
    unsafe { std::slice::from_raw_parts_mut(first, count) }
}

/// Refuses lists that are missing: value references and values, with their lengths and those that the caller states.
#[inline]
fn whole(found: [usize; 2], stated: [usize; 2]) -> Result<(), String> {
    if found == stated {
        return Ok(());
    }
    Err("a list of value references or of values is NULL; hand in both".to_owned())
}

/// Converts a value from its type in a list.
trait Inner<O> {
    fn inner(outer: O) -> Self;
}

impl<T> Inner<T> for T {
    #[inline]
    fn inner(outer: T) -> T {
        outer
    }
}

/// The Boolean of FMI 2.0.
impl Inner<c_int> for bool {
    #[inline]
    fn inner(outer: c_int) -> Self {
        outer != 0
    }
}

/// The Boolean of FMI 3.0, read as a byte: callers may pass values other than 0 and 1, which a Rust `bool` must not
/// have.
impl Inner<u8> for bool {
    #[inline]
    fn inner(outer: u8) -> Self {
        outer != 0
    }
}

/// Sets texts.
///
/// # Safety
///
/// `references` and `values` must be null or point to as many elements as stated; each value is null or a C string.
unsafe fn set_texts(
    handle: *mut c_void,
    (references, count): (*const u32, usize),
    (values, value_count): (*const *const c_char, usize),
) -> c_int {
    // SAFETY: promised by the caller, here and below.
    let (references, values) = unsafe { (list(references, count), list(values, value_count)) };
    call(handle, |instance| {
        whole([references.len(), values.len()], [count, value_count])?;
        instance.check_count(references, value_count)?;
        for (&reference, &value) in references.iter().zip(values) {
            if value.is_null() {
                return Err("a text is NULL; hand in an empty one".to_owned());
            }
            // SAFETY: as above.
            let value = unsafe { CStr::from_ptr(value) };
            instance.set_text(reference, value.to_owned())?;
        }
        Ok(())
    })
}

/// Gets texts, which stay valid until they are set again.
///
/// # Safety
///
/// `references` and `values` must be null or point to as many elements as stated.
unsafe fn get_texts(
    handle: *mut c_void,
    (references, count): (*const u32, usize),
    (values, value_count): (*mut *const c_char, usize),
) -> c_int {
    // SAFETY: promised by the caller.
    let (references, values) = unsafe { (list(references, count), room(values, value_count)) };
    call(handle, |instance| {
        whole([references.len(), values.len()], [count, value_count])?;
        instance.check_count(references, value_count)?;
        instance.refresh_texts();
        for (&reference, value) in references.iter().zip(values) {
            *value = instance.text(reference)?.as_ptr();
        }
        Ok(())
    })
}
