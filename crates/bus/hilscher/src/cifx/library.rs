//! The cifX driver's library behind safe functions.

#![allow(unsafe_code, reason = "a vendor's library is called")]

use std::ffi::{CString, c_char, c_void};
use std::path::Path;
use std::ptr::{from_mut, null_mut};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use tickbus_base::{Mistake, vendor_functions};
use tickbus_fieldbus::Failing;

use super::errors::failing;
use super::information::{INFORMATION, Information};

/// The vendor's library on this system.
pub(super) const NAME: &str = if cfg!(windows) {
    "cifx32dll.dll"
} else {
    "libcifx.so.3"
};

type Handle = *mut c_void;
/// With a command, a place for the current state, and a time-out.
type State = unsafe extern "system" fn(Handle, u32, *mut u32, u32) -> i32;
/// Area, offset, length, data, time-out.
type Move = unsafe extern "system" fn(Handle, u32, u32, u32, *mut c_void, u32) -> i32;

vendor_functions! {
    /// The functions that tickbus calls.
    struct Functions {
        driver_open: unsafe extern "system" fn(*mut Handle) -> i32 = "xDriverOpen",
        driver_close: unsafe extern "system" fn(Handle) -> i32 = "xDriverClose",
        channel_open: unsafe extern "system" fn(Handle, *mut c_char, u32, *mut Handle) -> i32 = "xChannelOpen",
        channel_close: unsafe extern "system" fn(Handle) -> i32 = "xChannelClose",
        channel_info: unsafe extern "system" fn(Handle, u32, *mut c_void) -> i32 = "xChannelInfo",
        host_state: State = "xChannelHostState",
        bus_state: State = "xChannelBusState",
        watchdog: unsafe extern "system" fn(Handle, u32, *mut u32) -> i32 = "xChannelWatchdog",
        read: Move = "xChannelIORead",
        write: Move = "xChannelIOWrite",
    }
}

/// The parameters for starting the driver for Linux.
#[cfg(not(windows))]
#[repr(C)]
struct LinuxInit {
    options: std::ffi::c_int,
    base_dir: *const c_char,
    poll_interval: std::ffi::c_ulong,
    poll_priority: std::ffi::c_int,
    trace_level: std::ffi::c_ulong,
    user_card_count: std::ffi::c_int,
    user_cards: *mut c_void,
    card_number: std::ffi::c_int,
    card_locking: std::ffi::c_int,
    poll_stack_size: std::ffi::c_int,
    poll_policy: std::ffi::c_int,
    log: *mut c_void,
}

#[cfg(not(windows))]
vendor_functions! {
    /// The start and the end of the driver for Linux.
    struct Start {
        init: unsafe extern "C" fn(*const LinuxInit) -> i32 = "cifXDriverInit",
        deinit: unsafe extern "C" fn() = "cifXDriverDeinit",
    }
}

/// The loaded library. All drivers of the process share it, since it is started once for all of them.
pub(super) struct Library {
    functions: Functions,
    #[cfg(not(windows))]
    start: Start,
    /// The number of users that have started it.
    #[cfg(not(windows))]
    users: Mutex<usize>,
}

/// The loaded libraries, identified by the address of one of their functions: two paths may lead to one library.
static LOADED: Mutex<Vec<(usize, Weak<Library>)>> = Mutex::new(Vec::new());

impl Library {
    pub(super) fn load(path: &Path) -> Result<Arc<Self>, Mistake> {
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        loaded.retain(|(_, library)| library.strong_count() > 0);
        let functions = Functions::load(path)?;
        let address = functions.driver_open as usize;
        let mut same = loaded.iter().filter(|(of, _)| *of == address);
        if let Some(library) = same.find_map(|(_, library)| library.upgrade()) {
            return Ok(library);
        }
        let library = Arc::new(Self {
            functions,
            #[cfg(not(windows))]
            start: Start::load(path)?,
            #[cfg(not(windows))]
            users: Mutex::new(0),
        });
        loaded.push((address, Arc::downgrade(&library)));
        Ok(library)
    }

    /// Starts the driver, unless another user already has.
    #[cfg(not(windows))]
    fn start(&self) -> Result<(), Failing> {
        let mut users = self.users.lock().unwrap_or_else(PoisonError::into_inner);
        if *users == 0 {
            let init = LinuxInit {
                // Find all cards automatically.
                options: 1,
                base_dir: std::ptr::null(),
                poll_interval: 0,
                poll_priority: 0,
                trace_level: 0,
                user_card_count: 0,
                user_cards: null_mut(),
                card_number: 0,
                card_locking: 0,
                poll_stack_size: 0,
                poll_policy: 0,
                log: null_mut(),
            };
            // SAFETY: the type is that of the vendor's header, and the struct lives until it returns; null and zero
            // ask for the defaults.
            let code = unsafe { (self.start.init)(&raw const init) };
            check("cifXDriverInit", code)?;
        }
        *users += 1;
        Ok(())
    }

    #[cfg(not(windows))]
    fn end(&self) {
        let mut users = self.users.lock().unwrap_or_else(PoisonError::into_inner);
        *users -= 1;
        if *users == 0 {
            // SAFETY: it was started, and nobody has a handle of it any longer.
            unsafe { (self.start.deinit)() };
        }
    }

    #[cfg(windows)]
    #[expect(clippy::unnecessary_wraps, clippy::unused_self, reason = "as on Linux")]
    fn start(&self) -> Result<(), Failing> {
        Ok(())
    }

    #[cfg(windows)]
    #[expect(clippy::unused_self, reason = "as on Linux")]
    fn end(&self) {}
}

fn check(function: &str, code: i32) -> Result<(), Failing> {
    match code {
        0 => Ok(()),
        code => Err(failing(function, code.cast_unsigned())),
    }
}

/// The driver, started and open; dropping it ends it.
pub(super) struct Driver<'l> {
    library: &'l Library,
    handle: Handle,
}

impl<'l> Driver<'l> {
    pub(super) fn open(library: &'l Library) -> Result<Self, Failing> {
        library.start()?;
        let mut handle = null_mut();
        // SAFETY: the types of all functions are those of the vendor's header, and the library stays loaded; the
        // handle lives until it returns.
        let code = unsafe { (library.functions.driver_open)(&raw mut handle) };
        if let Err(failing) = check("xDriverOpen", code) {
            library.end();
            return Err(failing);
        }
        Ok(Self { library, handle })
    }
}

impl Drop for Driver<'_> {
    fn drop(&mut self) {
        // SAFETY: the handle is one that it gave, and nobody has it after this. Its answer changes nothing.
        unsafe { (self.library.functions.driver_close)(self.handle) };
        self.library.end();
    }
}

/// An open channel; dropping it closes it.
pub(super) struct Channel<'l> {
    functions: &'l Functions,
    handle: Handle,
    /// Closed after the channel.
    _driver: Driver<'l>,
}

/// A command of [`Channel::host_state`] and [`Channel::bus_state`].
pub(super) const OFF: u32 = 0;
/// The same.
pub(super) const ON: u32 = 1;

impl<'l> Channel<'l> {
    pub(super) fn open(driver: Driver<'l>, board: &str, number: u32) -> Result<Self, Failing> {
        let functions = &driver.library.functions;
        // NUL characters were refused when the driver.cfg was read.
        let name = CString::new(board).unwrap_or_default();
        let mut handle = null_mut();
        // SAFETY: as for `Driver::open`; the name is not written to.
        let code = unsafe {
            let name = name.as_ptr().cast_mut();
            (functions.channel_open)(driver.handle, name, number, &raw mut handle)
        };
        check("xChannelOpen", code)?;
        Ok(Self {
            functions,
            handle,
            _driver: driver,
        })
    }

    pub(super) fn information(&self) -> Result<Information, Failing> {
        let mut bytes = [0_u8; INFORMATION];
        let size = u32::try_from(INFORMATION).expect("a small struct");
        // SAFETY: as for `Driver::open`; the channel is open, and the buffer has the size that is said.
        let code = unsafe {
            (self.functions.channel_info)(self.handle, size, from_mut(&mut bytes).cast())
        };
        check("xChannelInfo", code)?;
        Ok(Information::parse(&bytes))
    }

    /// Reports to the card whether this program is ready.
    pub(super) fn host_state(&self, command: u32, timeout: u32) -> Result<(), Failing> {
        let mut state = 0;
        // SAFETY: as for `information`.
        let code =
            unsafe { (self.functions.host_state)(self.handle, command, &raw mut state, timeout) };
        check("xChannelHostState", code)
    }

    /// Switches the bus on or off.
    pub(super) fn bus_state(&self, command: u32, timeout: u32) -> Result<(), Failing> {
        let mut state = 0;
        // SAFETY: as for `information`.
        let code =
            unsafe { (self.functions.bus_state)(self.handle, command, &raw mut state, timeout) };
        check("xChannelBusState", code)
    }

    /// Starts or triggers the card's watchdog, or stops it; returns the error code, or 0.
    pub(super) fn watchdog(&self, command: u32) -> u32 {
        let mut trigger = 0;
        // SAFETY: as for `information`.
        let code = unsafe { (self.functions.watchdog)(self.handle, command, &raw mut trigger) };
        code.cast_unsigned()
    }

    /// Writes to the card's process image; returns the error code, or 0.
    pub(super) fn write(&self, offset: u16, data: &[u8], timeout: u32) -> u32 {
        let length = u32::try_from(data.len()).unwrap_or(u32::MAX);
        let from = data.as_ptr().cast_mut().cast();
        // SAFETY: as for `information`; the data are not written to.
        let code =
            unsafe { (self.functions.write)(self.handle, 0, offset.into(), length, from, timeout) };
        code.cast_unsigned()
    }

    /// Reads the card's process image; returns the error code, or 0.
    pub(super) fn read(&self, offset: u16, data: &mut [u8], timeout: u32) -> u32 {
        let length = u32::try_from(data.len()).unwrap_or(u32::MAX);
        let to = data.as_mut_ptr().cast();
        // SAFETY: as for `information`; the buffer has the length that is said.
        let code =
            unsafe { (self.functions.read)(self.handle, 0, offset.into(), length, to, timeout) };
        code.cast_unsigned()
    }
}

impl Drop for Channel<'_> {
    fn drop(&mut self) {
        // SAFETY: as for `information`; nobody has the handle after this. Its answer changes nothing.
        unsafe { (self.functions.channel_close)(self.handle) };
    }
}
