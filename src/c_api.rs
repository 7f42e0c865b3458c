//! The functions of `include/tickbus.h`: the interface for simulators in C.
//!
//! As in [`jni`](super::jni), the tick and its halves take no lock, make no system call and allocate nothing. A
//! function never unwinds into its caller.

#![allow(
    unsafe_code,
    reason = "exported names and the pointers that a caller in C hands in"
)]

mod many;
mod nets;

use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::ffi::{CStr, CString, c_char};
use std::panic::catch_unwind;
use std::path::Path;
use std::ptr::{NonNull, null_mut};
use std::sync::Once;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::KINDS;
use crate::page::{self, Place};
use once_cell::sync::Lazy;
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_base::toml_text::nearest;
use tickbus_binding::{
    Device, EVENT_WORDS, EVENTS, Handles, Refusal, SPARE_SLOT, Shared, SlotKind, closing, faults,
    open, read_fault,
};
use tickbus_driver::Code;
use tickbus_image::signal::Signal;

/// The drivers that are open through this interface.
static DRIVERS: Handles<Opened> = Handles::new();

/// The buffers of closed drivers. Their memory is reused and never freed, so that a caller that moves values after
/// closing still accesses valid memory.
static RETIRED: Mutex<Vec<Buffer>> = Mutex::new(Vec::new());

/// The texts handed out so far: their pointers stay valid.
static TEXTS: Lazy<Mutex<HashSet<&'static CStr>>> = Lazy::new(Mutex::default);

/// Registers the exit handler, once, with the first driver.
static AT_EXIT: Once = Once::new();

thread_local! {
    /// The reason why this thread's last failed call failed.
    static LAST: RefCell<CString> = RefCell::default();
    /// The driver and code of the last failed call, if it was a tick. The text is built only on request. The type has
    /// no destructor, since the tick would have to allocate memory to register one.
    static LAST_TICK: Cell<Option<(i64, Code)>> = const { Cell::new(None) };
}

/// `tb_signal` of the header.
#[repr(C)]
struct CSignal {
    name: *const c_char,
    address: *const c_char,
    data_type: *const c_char,
    unit: *const c_char,
    station: *const c_char,
    slot: i32,
    edges: i32,
    is_written: i32,
    kind: i32,
    fail_safe: u64,
}

/// `tb_model_fault` of the header.
#[repr(C)]
struct CModelFault {
    fault: i32,
    is_on: i32,
    value: f64,
}

impl CSignal {
    /// A signal that does not exist: reads 0 and cannot be set.
    const NONE: Self = Self {
        name: c"".as_ptr(),
        address: c"".as_ptr(),
        data_type: c"".as_ptr(),
        unit: c"".as_ptr(),
        station: c"".as_ptr(),
        slot: SPARE_SLOT,
        edges: -1,
        is_written: 0,
        kind: SlotKind::Real as i32,
        fail_safe: 0,
    };
}

/// The memory of a buffer: a number of words that are never freed. Not a slice, since a caller can write to it at any
/// time.
struct Buffer {
    words: NonNull<u64>,
    length: usize,
}

// SAFETY: the memory is not bound to a thread; only the device that owns it and the caller access it.
unsafe impl Send for Buffer {}

/// An open driver; closing it returns its buffer to [`RETIRED`].
struct Opened {
    device: Device<Option<Place>>,
    buffer: Buffer,
}

impl Opened {
    fn close(self) {
        drop(self.device.close());
        retired().push(self.buffer);
    }
}

fn retired() -> MutexGuard<'static, Vec<Buffer>> {
    RETIRED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns a buffer of at least this many bytes: a free one, or a new one.
fn buffer_of(bytes: usize) -> Buffer {
    let length = bytes.div_ceil(size_of::<u64>());
    let mut retired = retired();
    let fitting = (0..retired.len()).filter(|&at| retired[at].length >= length);
    match fitting.min_by_key(|&at| retired[at].length) {
        Some(at) => retired.swap_remove(at),
        None => Buffer {
            words: NonNull::from(vec![0_u64; length].leak()).cast(),
            length,
        },
    }
}

/// Returns the text as a C string that is never freed; the text ends at its first zero.
fn permanent(text: &str) -> *const c_char {
    let bytes: Vec<u8> = text.bytes().take_while(|&byte| byte != 0).collect();
    let text = CString::new(bytes).unwrap_or_default();
    let mut texts = TEXTS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = texts.get(&*text) {
        return known.as_ptr();
    }
    let kept: &'static CStr = Box::leak(text.into_boxed_c_str());
    texts.insert(kept);
    kept.as_ptr()
}

/// Closes the drivers that are still open when the process ends.
fn close_all() {
    closing(|| DRIVERS.close_all(Opened::close));
}

/// Stores why a call failed, and returns the code.
fn failed(refusal: &Refusal) -> i32 {
    let text = refusal.to_string().replace('\0', " ");
    let text = CString::new(text).unwrap_or_default();
    // A thread that is ending, as in a handler of `atexit`, may have no storage left.
    let _ = LAST.try_with(|last| last.replace(text));
    LAST_TICK.set(None);
    refusal.code.code()
}

/// Does `work`, which can fail, and returns a count or a status.
fn answer(work: impl FnOnce() -> Result<i32, Refusal>) -> i32 {
    Refusal::instead_of_panic(work).unwrap_or_else(|refusal| failed(&refusal))
}

fn tick(driver: i64, work: impl FnOnce(&mut Device<Option<Place>>) -> Code) -> i32 {
    let code = DRIVERS.tick(driver, |opened| work(&mut opened.device));
    let code = code.unwrap_or_else(|refused| refused);
    if code.code() < 0 {
        LAST_TICK.set(Some((driver, code)));
    }
    code.code()
}

/// Reads the text behind a pointer.
///
/// # Safety
///
/// `text` must be null or point to a C string that exists as long as it is used.
unsafe fn text<'a>(text: *const c_char, what: &str) -> Result<&'a str, Refusal> {
    if text.is_null() {
        return Err(Refusal::new(Code::BadArgument, format!("{what} is NULL")));
    }
    // SAFETY: promised by the caller.
    let bytes = unsafe { CStr::from_ptr(text) };
    let wrong = |why| Refusal::new(Code::BadArgument, format!("{what} is not UTF-8: {why}"));
    bytes.to_str().map_err(wrong)
}

/// Writes as much of a text as fits, with a final 0, and returns the length of the whole text.
///
/// # Safety
///
/// `into` must be null or have room for `room` bytes.
unsafe fn hand_over(text: &str, into: *mut c_char, room: usize) -> i32 {
    if !into.is_null() && room > 0 {
        let count = text.len().min(room - 1);
        // SAFETY: promised by the caller; `count` + 1 is at most `room`.
        unsafe {
            into.cast::<u8>()
                .copy_from_nonoverlapping(text.as_ptr(), count);
            into.add(count).write(0);
        }
    }
    i32::try_from(text.len()).unwrap_or(i32::MAX)
}

/// Returns why a tick failed, with the line's own reason if there is one.
fn why(driver: i64, code: Code) -> Refusal {
    if code == Code::BadArgument {
        return Refusal::new(
            code,
            "a driver is in the list of one call twice, and was ticked once",
        );
    }
    // No other code depends on the line, so the thread that is using the driver is left alone.
    if code != Code::BusFailed {
        return DRIVERS.reason(driver, code);
    }
    match DRIVERS.visit(driver, |opened| opened.device.snapshot()) {
        Ok(snapshot) => Refusal::of_tick(code, &snapshot),
        Err(_) => Refusal::plain(code),
    }
}

/// # Safety
///
/// `path` must be a C string, `tables` one or null; `driver` must be null or point to an `int64_t`.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_open(path: *const c_char, tables: *const c_char, driver: *mut i64) -> i32 {
    answer(|| {
        tickbus_base::os::log_to_stderr(log::LevelFilter::Warn);
        if driver.is_null() {
            return Err(Refusal::new(Code::BadArgument, "driver is NULL"));
        }
        // SAFETY: promised by the caller, here and below.
        unsafe { driver.write(0) };
        let place = DRIVERS.reserve()?;
        // SAFETY: as above.
        let path = unsafe { text(path, "path") }?;
        let tables = if tables.is_null() {
            ""
        } else {
            // SAFETY: as above.
            unsafe { text(tables, "tables") }?
        };
        let mut opened = open(Path::new(path), tables, &KINDS)?;
        let shown = page::show_driver(&mut opened)?;
        let slots = opened.slots().count;
        let buffer = buffer_of(Shared::<Option<Place>>::bytes(slots));
        // SAFETY: this memory is never freed, has at least this size, is initialised, and has no other user until this
        // driver is closed. The header requires callers to leave the slots alone during a call.
        let shared = unsafe { Shared::new(buffer.words.cast(), slots, shown) };
        let shared =
            shared.ok_or_else(|| Refusal::new(Code::Internal, "the buffer is not aligned"))?;
        let device = Device::new(opened, shared);
        AT_EXIT.call_once(|| tickbus_base::os::at_exit(close_all));
        let name = device.config().name.clone();
        let handle = place.fill(&name, Opened { device, buffer });
        // SAFETY: as above.
        unsafe { driver.write(handle) };
        Ok(Code::Fresh.code())
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_close(driver: i64) -> i32 {
    answer(|| {
        closing(|| DRIVERS.close(driver, Opened::close)).map_err(Refusal::plain)?;
        Ok(Code::Fresh.code())
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_exchange(driver: i64) -> i32 {
    tick(driver, Device::exchange)
}

#[unsafe(no_mangle)]
extern "C" fn tb_receive(driver: i64) -> i32 {
    tick(driver, Device::receive)
}

#[unsafe(no_mangle)]
extern "C" fn tb_send(driver: i64) -> i32 {
    tick(driver, Device::send)
}

#[unsafe(no_mangle)]
extern "C" fn tb_reset(driver: i64) -> i32 {
    answer(|| {
        DRIVERS.visit(driver, |opened| opened.device.reset())??;
        Ok(Code::Fresh.code())
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_reload(driver: i64) -> i32 {
    answer(|| {
        let reload = DRIVERS.visit(driver, |opened| opened.device.reload())?;
        let code = if reload.run()? {
            Code::Fresh
        } else {
            Code::Unchanged
        };
        Ok(code.code())
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_buffer_of(driver: i64) -> *mut u64 {
    let mut words = null_mut();
    answer(|| {
        words = DRIVERS.visit(driver, |opened| opened.buffer.words.as_ptr())?;
        Ok(0)
    });
    words
}

#[unsafe(no_mangle)]
extern "C" fn tb_signal_count(driver: i64) -> i32 {
    answer(|| {
        let config = DRIVERS.visit(driver, |opened| opened.device.config())?;
        Ok(i32::try_from(config.table.signals.len()).unwrap_or(i32::MAX))
    })
}

/// # Safety
///
/// `signal` must be null or point to a `tb_signal`.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_signal_at(driver: i64, index: i32, signal: *mut CSignal) -> i32 {
    answer(|| {
        let find = |signals: &[Signal]| {
            let found = usize::try_from(index).ok().filter(|&at| at < signals.len());
            let last = signals.len().saturating_sub(1);
            found.ok_or_else(|| {
                no_signal(format!("there is no signal {index}; expected 0 to {last}"))
            })
        };
        // SAFETY: promised by the caller.
        unsafe { describe(driver, signal, find) }
    })
}

/// # Safety
///
/// `name` must be a C string, `signal` null or point to a `tb_signal`.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_find(driver: i64, name: *const c_char, signal: *mut CSignal) -> i32 {
    answer(|| {
        let find = |signals: &[Signal]| {
            // SAFETY: promised by the caller.
            let name = unsafe { text(name, "name") }?;
            let found = signals.iter().position(|signal| signal.name == name);
            let names = signals.iter().map(|signal| &*signal.name);
            found.ok_or_else(|| {
                no_signal(match nearest(name, names) {
                    Some(near) => {
                        format!("there is no signal \"{name}\"; did you mean \"{near}\"?")
                    }
                    None => format!("there is no signal \"{name}\""),
                })
            })
        };
        // SAFETY: promised by the caller.
        unsafe { describe(driver, signal, find) }
    })
}

fn no_signal(text: String) -> Refusal {
    Refusal::new(Code::BadArgument, text)
}

/// Describes the signal whose index `find` returns.
///
/// # Safety
///
/// `into` must be null or point to a `tb_signal`.
unsafe fn describe(
    driver: i64,
    into: *mut CSignal,
    find: impl FnOnce(&[Signal]) -> Result<usize, Refusal>,
) -> Result<i32, Refusal> {
    if into.is_null() {
        return Err(Refusal::new(Code::BadArgument, "signal is NULL"));
    }
    // For a caller that does not check the status.
    // SAFETY: promised by the caller.
    unsafe { into.write(CSignal::NONE) };
    let config = DRIVERS.visit(driver, |opened| opened.device.config())?;
    let index = find(&config.table.signals)?;
    let number = |slot| i32::try_from(slot).unwrap_or(i32::MAX);
    let description = DRIVERS.visit(driver, |opened| {
        opened.device.describe(index, |signal| CSignal {
            name: permanent(signal.name),
            address: permanent(&signal.address),
            data_type: permanent(signal.data_type),
            unit: permanent(signal.unit),
            station: permanent(signal.station),
            slot: number(signal.slot),
            edges: signal.edges.map_or(-1, number),
            is_written: signal.is_written.into(),
            kind: signal.kind as i32,
            fail_safe: signal.fail_safe.0,
        })
    })?;
    // SAFETY: as above.
    unsafe { into.write(description) };
    Ok(Code::Fresh.code())
}

/// # Safety
///
/// `into` must be null or have room for `room` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_statistics(driver: i64, into: *mut c_char, room: usize) -> i32 {
    answer(|| {
        let snapshot = DRIVERS.visit(driver, |opened| opened.device.snapshot())?;
        // SAFETY: promised by the caller.
        Ok(unsafe { hand_over(&snapshot.to_string(), into, room) })
    })
}

/// # Safety
///
/// `into` must be null or have room for `room` events.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_events(driver: i64, into: *mut i64, room: usize) -> i32 {
    answer(|| {
        if into.is_null() {
            return Err(Refusal::new(Code::BadArgument, "events is NULL"));
        }
        let mut words = [0; EVENTS * EVENT_WORDS];
        let room = room.min(EVENTS) * EVENT_WORDS;
        let count = DRIVERS.visit(driver, |opened| opened.device.events(&mut words[..room]))?;
        // SAFETY: promised by the caller; an event is three words.
        unsafe { into.copy_from_nonoverlapping(words.as_ptr(), count * EVENT_WORDS) };
        Ok(i32::try_from(count).unwrap_or(i32::MAX))
    })
}

/// # Safety
///
/// `fault` must be a C string.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_inject(driver: i64, fault: *const c_char) -> i32 {
    answer(|| {
        // SAFETY: promised by the caller.
        let fault = unsafe { text(fault, "fault") }?;
        let config = DRIVERS.visit(driver, |opened| opened.device.config())?;
        let fault = read_fault(fault, &config)?;
        let id = DRIVERS.visit(driver, |opened| opened.device.inject(&fault))??;
        Ok(i32::try_from(id).unwrap_or(i32::MAX))
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_end_fault(driver: i64, fault: i32) -> i32 {
    answer(|| {
        let id = u32::try_from(fault).unwrap_or_default();
        Ok(DRIVERS
            .visit(driver, |opened| opened.device.end_fault(id))?
            .into())
    })
}

/// # Safety
///
/// `names` must be null or have `count` C strings.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_declare_faults(
    driver: i64,
    names: *const *const c_char,
    count: usize,
) -> i32 {
    answer(|| {
        if names.is_null() && count > 0 {
            return Err(Refusal::new(Code::BadArgument, "names is NULL"));
        }
        // SAFETY: promised by the caller.
        let name = |at| unsafe { text(*names.add(at), "a name") }.map(str::to_owned);
        let names = (0..count).map(name).collect::<Result<Vec<_>, _>>()?;
        DRIVERS.visit(driver, |opened| opened.device.declare_model_faults(names))??;
        Ok(Code::Fresh.code())
    })
}

/// # Safety
///
/// `into` must be null or have room for `room` changes.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_model_faults(driver: i64, into: *mut CModelFault, room: usize) -> i32 {
    answer(|| {
        if into.is_null() {
            return Err(Refusal::new(Code::BadArgument, "faults is NULL"));
        }
        let count = DRIVERS.visit(driver, |opened| {
            let mut count = 0;
            while count < room
                && let Some((place, value)) = opened.device.next_model_change()
            {
                let change = CModelFault {
                    fault: i32::try_from(place).unwrap_or(i32::MAX),
                    is_on: value.is_some().into(),
                    value: value.unwrap_or_default(),
                };
                // SAFETY: there is room, promised by the caller.
                unsafe { into.add(count).write(change) };
                count += 1;
            }
            count
        })?;
        Ok(i32::try_from(count).unwrap_or(i32::MAX))
    })
}

/// # Safety
///
/// `into` must be null or have room for `room` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_faults(driver: i64, into: *mut c_char, room: usize) -> i32 {
    answer(|| {
        let board = DRIVERS.visit(driver, |opened| opened.device.board())?;
        // SAFETY: promised by the caller.
        Ok(unsafe { hand_over(&faults(&board), into, room) })
    })
}

/// # Safety
///
/// `into` must be null or have room for `room` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_page(driver: i64, into: *mut c_char, room: usize) -> i32 {
    answer(|| {
        let config = DRIVERS.visit(driver, |opened| opened.device.config())?;
        let url = config.page.is_some().then(page::url).flatten();
        // SAFETY: promised by the caller.
        Ok(unsafe { hand_over(&url.unwrap_or_default(), into, room) })
    })
}

/// `tb_turn` of the header.
#[repr(C)]
struct Turn {
    time: i64,
    lag: i64,
    missed: i64,
    /// When the first turn began, by the process's clock; 0 before it.
    begun: i64,
    /// When the next turn is due, by the process's clock.
    due: i64,
}

/// # Safety
///
/// `turn` must be null or point to a `tb_turn`.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_every(period: i64, turn: *mut Turn) -> i32 {
    answer(|| {
        // SAFETY: promised by the caller.
        let turn = unsafe { turn.as_mut() }
            .filter(|_| period > 0)
            .ok_or_else(|| {
                let text = "turn is NULL, or period is not above 0";
                Refusal::new(Code::BadArgument, text)
            })?;
        let clock = Monotonic::shared();
        if turn.begun == 0 {
            // The clock begins at 0, so a turn could begin then.
            turn.begun = clock.now().0.max(1);
            turn.due = turn.begun;
        }
        let due = Nanos(turn.due);
        clock.wait_until(due, &Stop::new());
        let late = (clock.now() - due).max(Nanos::ZERO);
        turn.missed = late.0 / period;
        turn.lag = late.0 % period;
        let due = due + Nanos(turn.missed.saturating_mul(period));
        turn.time = due.0 - turn.begun;
        turn.due = (due + Nanos(period)).0;
        Ok(Code::Fresh.code())
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_is_over(driver: i64) -> i32 {
    answer(|| {
        Ok(DRIVERS
            .visit(driver, |opened| opened.device.is_over())?
            .into())
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

#[unsafe(no_mangle)]
extern "C" fn tb_last_error() -> *const c_char {
    let text = catch_unwind(|| {
        if let Some((driver, code)) = LAST_TICK.get() {
            failed(&why(driver, code));
        }
        let told = LAST.try_with(|last| last.borrow().as_ptr());
        told.unwrap_or(c"".as_ptr())
    });
    text.unwrap_or(c"a panic while the reason was looked for".as_ptr())
}
