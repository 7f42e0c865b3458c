//! The CIF driver's library behind safe functions.

#![allow(unsafe_code, reason = "a vendor's library is called")]

use std::ffi::c_void;
use std::path::Path;
use std::ptr::{from_mut, null_mut};

use tickbus_base::{Mistake, vendor_functions};
use tickbus_fieldbus::Failing;

use super::errors::failing;

// On 32-bit Windows, a library may export only the decorated names.
vendor_functions! {
    /// The functions that tickbus calls.
    struct Functions {
        open_driver: unsafe extern "system" fn(u16) -> i16 = "DevOpenDriver" or "_DevOpenDriver@4",
        close_driver: unsafe extern "system" fn(u16) -> i16 = "DevCloseDriver" or "_DevCloseDriver@4",
        init_board: unsafe extern "system" fn(u16, *mut c_void) -> i16 = "DevInitBoard" or "_DevInitBoard@8",
        exit_board: unsafe extern "system" fn(u16) -> i16 = "DevExitBoard" or "_DevExitBoard@4",
        info: unsafe extern "system" fn(u16, u16, u16, *mut c_void) -> i16 = "DevGetInfo" or "_DevGetInfo@16",
        reset: unsafe extern "system" fn(u16, u16, u32) -> i16 = "DevReset" or "_DevReset@12",
        host_state: unsafe extern "system" fn(u16, u16, u32) -> i16 = "DevSetHostState" or "_DevSetHostState@12",
        exchange: unsafe extern "system" fn(u16, u16, u16, *mut c_void, u16, u16, *mut c_void, u32) -> i16 =
            "DevExchangeIO" or "_DevExchangeIO@32",
        watchdog: unsafe extern "system" fn(u16, u16, *mut u16) -> i16 = "DevTriggerWatchDog" or "_DevTriggerWatchDog@12",
    }
}

/// The loaded library.
pub(super) struct Library(Functions);

impl Library {
    pub(super) fn load(path: &Path) -> Result<Self, Mistake> {
        Functions::load(path).map(Self)
    }
}

fn check(function: &str, code: i16) -> Result<(), Failing> {
    match code {
        0 => Ok(()),
        code => Err(failing(function, code.into())),
    }
}

/// The driver, open for one card; dropping it closes it.
pub(super) struct Driver<'l> {
    functions: &'l Functions,
    device: u16,
}

impl<'l> Driver<'l> {
    pub(super) fn open(library: &'l Library, device: u16) -> Result<Self, Failing> {
        let functions = &library.0;
        // SAFETY: the types of all functions are those of the vendor's header, and the library stays loaded.
        check("DevOpenDriver", unsafe { (functions.open_driver)(device) })?;
        Ok(Self { functions, device })
    }
}

impl Drop for Driver<'_> {
    fn drop(&mut self) {
        // SAFETY: as for `open`. Its answer changes nothing.
        unsafe { (self.functions.close_driver)(self.device) };
    }
}

/// An area of information.
#[derive(Clone, Copy)]
pub(super) enum Area {
    Firmware = 3,
    Device = 6,
}

/// A card in use; dropping it frees it.
pub(super) struct Board<'l>(Driver<'l>);

impl<'l> Board<'l> {
    pub(super) fn init(driver: Driver<'l>) -> Result<Self, Failing> {
        // SAFETY: as for `Driver::open`; null lets the driver find the card's address.
        let code = unsafe { (driver.functions.init_board)(driver.device, null_mut()) };
        check("DevInitBoard", code)?;
        Ok(Self(driver))
    }

    /// Information of `N` bytes; `None` if the driver has none.
    pub(super) fn information<const N: usize>(&self, area: Area) -> Option<[u8; N]> {
        let mut bytes = [0; N];
        let (size, to) = (u16::try_from(N).ok()?, from_mut(&mut bytes).cast());
        // SAFETY: as for `Driver::open`; the buffer has the size that is said.
        let code = unsafe { (self.0.functions.info)(self.0.device, area as u16, size, to) };
        (code == 0).then_some(bytes)
    }

    pub(super) fn reset(&self, mode: u16, timeout: u32) -> Result<(), Failing> {
        // SAFETY: as for `Driver::open`.
        check("DevReset", unsafe {
            (self.0.functions.reset)(self.0.device, mode, timeout)
        })
    }

    /// Reports to the card whether this program is ready.
    pub(super) fn host_state(&self, ready: bool, timeout: u32) -> Result<(), Failing> {
        // SAFETY: as for `Driver::open`.
        let code = unsafe { (self.0.functions.host_state)(self.0.device, ready.into(), timeout) };
        check("DevSetHostState", code)
    }

    /// Starts or triggers the card's watchdog, or stops it.
    pub(super) fn watchdog(&self, start: bool) -> Result<(), Failing> {
        let mut trigger = 0;
        // SAFETY: as for `Driver::open`; the variable lives until it returns.
        let code =
            unsafe { (self.0.functions.watchdog)(self.0.device, start.into(), &raw mut trigger) };
        check("DevTriggerWatchDog", code)
    }

    /// Exchanges the process images, each from its offset on; returns the error code, or 0.
    pub(super) fn exchange(
        &self,
        [write_offset, read_offset]: [u16; 2],
        output: &[u8],
        input: &mut [u8],
        timeout: u32,
    ) -> i32 {
        let size = |bytes: usize| u16::try_from(bytes).unwrap_or(u16::MAX);
        let from = output.as_ptr().cast_mut().cast();
        let (sends, receives) = (size(output.len()), size(input.len()));
        let to = input.as_mut_ptr().cast();
        // SAFETY: as for `Driver::open`. Both buffers have at least the sizes that are said; the first one is not
        // written to.
        let code = unsafe {
            let call = self.0.functions.exchange;
            call(
                self.0.device,
                write_offset,
                sends,
                from,
                read_offset,
                receives,
                to,
                timeout,
            )
        };
        code.into()
    }
}

impl Drop for Board<'_> {
    fn drop(&mut self) {
        // SAFETY: as for `Driver::open`. Its answer changes nothing.
        unsafe { (self.0.functions.exit_board)(self.0.device) };
    }
}
