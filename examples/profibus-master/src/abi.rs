//! The five functions of `include/tickbus_fieldbus.h`.
#![allow(
    unsafe_code,
    missing_docs,
    reason = "the header is the contract, and says what is safe"
)]

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::path::Path;
use std::time::Duration;

use crate::master::Master;

const VERSION: u32 = 1;
const TAKEN: i32 = 1;
const FRESH: i32 = 2;
const ROLE_CONTROLLER: u32 = 1;

/// The result of a data exchange.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exchanged {
    /// True if the station has the outputs of this very exchange.
    pub(crate) is_sent: bool,
}

/// Says why the bus cannot continue.
#[derive(Debug)]
pub(crate) enum Failure {
    Link(String),
    Refused(String),
    Config(String),
}

#[repr(C)]
struct BusOption {
    size: u32,
    key: *const c_char,
    value: *const c_char,
}

#[repr(C)]
struct Config {
    size: u32,
    role: u32,
    name: *const c_char,
    directory: *const c_char,
    options: *const *const BusOption,
    option_count: u32,
}

#[repr(C)]
struct Layout {
    size: u32,
    in_size: u32,
    out_size: u32,
    station_count: u32,
}

pub(crate) struct Bus {
    master: Master,
    in_size: usize,
    out_size: usize,
}

thread_local! {
    /// One thread makes all calls of a bus, so this is the bus's last error.
    static ERROR: RefCell<CString> = RefCell::default();
}

fn failed(failure: Failure) -> i32 {
    let (code, text) = match failure {
        Failure::Link(text) => (-1, text),
        Failure::Refused(text) => (-3, text),
        Failure::Config(text) => (-4, text),
    };
    let line = text.replace(['\n', '\0'], " ");
    ERROR.set(CString::new(line).unwrap_or_default());
    code
}

/// # Safety
///
/// The text ends with a 0 byte.
unsafe fn text<'a>(text: *const c_char) -> Result<&'a str, Failure> {
    // SAFETY: promised by the caller, to whom the host promises it.
    let text = unsafe { CStr::from_ptr(text) }.to_str();
    text.map_err(|_| Failure::Config("a text is no UTF-8".into()))
}

/// # Safety
///
/// As the header requires for `tickbus_open`.
unsafe fn open(config: &Config, layout: &Layout) -> Result<Bus, Failure> {
    let (mut port, mut project) = (None, None);
    for index in 0..config.option_count as usize {
        // SAFETY: there are option_count pointers to options.
        let option = unsafe { &**config.options.add(index) };
        // SAFETY: texts of the host end with a 0 byte.
        let (key, value) = unsafe { (text(option.key)?, text(option.value)?) };
        match key {
            "port" => port = Some(value),
            "project" => project = Some(value),
            other => {
                let what = format!("there is no option \"{other}\"; write port and project");
                return Err(Failure::Config(what));
            }
        }
    }
    let (Some(port), Some(project)) = (port, project) else {
        return Err(Failure::Config("write the options port and project".into()));
    };
    if config.role != ROLE_CONTROLLER || layout.station_count != 1 {
        return Err(Failure::Config(
            "this is a master of one station; write role = \"controller\"".into(),
        ));
    }
    // SAFETY: as above.
    let folder = Path::new(unsafe { text(config.directory)? });
    let (in_size, out_size) = (layout.in_size as usize, layout.out_size as usize);
    let sizes = (out_size, in_size);
    Ok(Bus {
        master: Master::open(&folder.join(port), &folder.join(project), sizes)?,
        in_size,
        out_size,
    })
}

#[unsafe(no_mangle)]
extern "C" fn tickbus_abi_version() -> u32 {
    VERSION
}

#[unsafe(no_mangle)]
unsafe extern "C" fn tickbus_open(
    config: *const Config,
    layout: *const Layout,
    bus: *mut *mut Bus,
) -> i32 {
    // SAFETY: the host's structs are valid during the call.
    match unsafe { open(&*config, &*layout) } {
        Ok(opened) => {
            // SAFETY: the host passes a place for the pointer.
            unsafe { *bus = Box::into_raw(Box::new(opened)) };
            0
        }
        Err(failure) => failed(failure),
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn tickbus_exchange(
    bus: *mut Bus,
    input: *const u8,
    output: *mut u8,
    timeout_ms: u32,
) -> i32 {
    // SAFETY: the bus was opened and is not closed, and no other thread uses it.
    let bus = unsafe { &mut *bus };
    // SAFETY: the host passes in_size bytes to read and out_size bytes to write, which do not overlap.
    let (sends, receives) = unsafe {
        (
            std::slice::from_raw_parts(input, bus.in_size),
            std::slice::from_raw_parts_mut(output, bus.out_size),
        )
    };
    let patience = Duration::from_millis(timeout_ms.into());
    match bus.master.exchange(sends, receives, patience) {
        Ok(Some(Exchanged { is_sent: true })) => TAKEN | FRESH,
        Ok(Some(Exchanged { is_sent: false })) => FRESH,
        Ok(None) => 0,
        Err(failure) => failed(failure),
    }
}

#[unsafe(no_mangle)]
extern "C" fn tickbus_last_error(_bus: *mut Bus) -> *const c_char {
    ERROR.with_borrow(|error| error.as_ptr())
}

#[unsafe(no_mangle)]
unsafe extern "C" fn tickbus_close(bus: *mut Bus) {
    // SAFETY: `tickbus_open` created the bus, and this is the last call with it.
    drop(unsafe { Box::from_raw(bus) });
}
