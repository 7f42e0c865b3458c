//! The DDI's library behind safe functions.

#![allow(unsafe_code, reason = "a vendor's library is called")]

use std::ffi::{CString, c_char};
use std::path::Path;
use std::ptr::from_mut;

use tickbus_base::{Mistake, vendor_functions};
use tickbus_fieldbus::BusError;

use super::errors::{NO_MESSAGE, failing, low};
use super::state::State;

/// An access to process data, packed as in the vendor's header.
#[repr(C, packed(2))]
struct Access {
    length: u16,
    address: u16,
    consistency: u16,
    data: *mut u8,
}

/// A message, likewise.
#[repr(C, packed(2))]
struct Message {
    kind: u16,
    length: u16,
    user: u16,
    block: *mut u8,
}

type OfHandle = unsafe extern "system" fn(u32) -> u32;
type OfData = unsafe extern "system" fn(u32, *mut Access) -> u32;
type OfMessage = unsafe extern "system" fn(u32, *mut Message) -> u32;

vendor_functions! {
    /// The functions that tickbus calls. Handles and results have 32 bits, with or without a sign.
    struct Functions {
        open: unsafe extern "system" fn(*mut c_char, i16, *mut u32) -> u32 = "DDI_DevOpenNode",
        close: OfHandle = "DDI_DevCloseNode",
        read: OfData = "DDI_DTI_ReadData",
        write: OfData = "DDI_DTI_WriteData",
        send: OfMessage = "DDI_MXI_SndMessage",
        receive: OfMessage = "DDI_MXI_RcvMessage",
        diagnostic: unsafe extern "system" fn(u32, *mut u16) -> u32 = "GetIBSDiagnostic",
        enable_watchdog: OfHandle = "EnableWatchDog",
        trigger_watchdog: OfHandle = "TriggerWatchDog",
        clear_watchdog: OfHandle = "ClearWatchDog",
    }
}

/// The loaded library.
pub(super) struct Library(Functions);

impl Library {
    pub(super) fn load(path: &Path) -> Result<Self, Mistake> {
        Functions::load(path).map(Self)
    }
}

fn check(function: &str, code: u32) -> Result<(), BusError> {
    match code {
        0 => Ok(()),
        code => Err(failing(function, code).error()),
    }
}

/// Reading and writing.
const BOTH: i16 = 3;

/// The transfer of data: word by word, or byte by byte.
const WORDS: u16 = 0;
/// The same.
const BYTES: u16 = 2;

/// Octets of a message.
pub(super) const BLOCK: usize = 128;

/// A call for the watchdog.
#[derive(Clone, Copy)]
pub(super) enum WatchDog {
    Enable,
    Trigger,
    Clear,
}

/// An open node; dropping it closes it.
pub(super) struct Node<'l> {
    functions: &'l Functions,
    handle: u32,
}

impl<'l> Node<'l> {
    pub(super) fn open(library: &'l Library, name: &str) -> Result<Self, BusError> {
        let functions = &library.0;
        // NUL characters were refused when the driver.cfg was read.
        let name = CString::new(name).unwrap_or_default();
        let mut handle = 0;
        // SAFETY: the types of all functions are those of the vendor's header, and the library stays loaded. Name and
        // handle live until it returns, and the name is not written to.
        let code = unsafe { (functions.open)(name.as_ptr().cast_mut(), BOTH, &raw mut handle) };
        check("DDI_DevOpenNode", code)?;
        Ok(Self { functions, handle })
    }

    /// Sends a message of these words.
    pub(super) fn send(&self, words: &[u16]) -> Result<(), BusError> {
        let mut block: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
        let mut message = Message {
            kind: 0,
            length: u16::try_from(block.len()).unwrap_or(u16::MAX),
            user: 0,
            block: block.as_mut_ptr(),
        };
        // SAFETY: as for `open`; the block has the length that is said.
        check("DDI_MXI_SndMessage", unsafe {
            (self.functions.send)(self.handle, &raw mut message)
        })
    }

    /// The words of the next message, if there is one.
    pub(super) fn receive(&self) -> Result<Option<Vec<u16>>, BusError> {
        let mut block = [0; BLOCK];
        let mut message = Message {
            kind: 0,
            length: u16::try_from(BLOCK).expect("a small block"),
            user: 0,
            block: from_mut(&mut block).cast(),
        };
        // SAFETY: as for `send`.
        let code = unsafe { (self.functions.receive)(self.handle, &raw mut message) };
        if low(code) == NO_MESSAGE {
            return Ok(None);
        }
        check("DDI_MXI_RcvMessage", code)?;
        let length = usize::from(message.length).min(BLOCK);
        let words = block[..length].chunks_exact(2);
        Ok(Some(
            words
                .map(|word| u16::from_be_bytes([word[0], word[1]]))
                .collect(),
        ))
    }

    pub(super) fn state(&self) -> Result<State, BusError> {
        // Two words, three with a later firmware.
        let mut words = [0_u16; 8];
        // SAFETY: as for `open`; there is room for more than it writes.
        let code = unsafe { (self.functions.diagnostic)(self.handle, words.as_mut_ptr()) };
        check("GetIBSDiagnostic", code)?;
        Ok(State {
            bits: words[0],
            parameter: words[1],
        })
    }

    pub(super) fn watchdog(&self, call: WatchDog) -> Result<(), BusError> {
        let Functions {
            enable_watchdog,
            trigger_watchdog,
            clear_watchdog,
            ..
        } = self.functions;
        let (name, function) = match call {
            WatchDog::Enable => ("EnableWatchDog", enable_watchdog),
            WatchDog::Trigger => ("TriggerWatchDog", trigger_watchdog),
            WatchDog::Clear => ("ClearWatchDog", clear_watchdog),
        };
        // SAFETY: as for `open`.
        check(name, unsafe { function(self.handle) })
    }

    /// Writes process data from `address` on.
    pub(super) fn write(&self, address: u16, data: &[u8]) -> Result<(), BusError> {
        let mut access = access(address, data.len(), data.as_ptr().cast_mut());
        // SAFETY: as for `open`; the data have the length that is said, and are not written to.
        check("DDI_DTI_WriteData", unsafe {
            (self.functions.write)(self.handle, &raw mut access)
        })
    }

    /// Reads process data from `address` on.
    pub(super) fn read(&self, address: u16, data: &mut [u8]) -> Result<(), BusError> {
        let mut access = access(address, data.len(), data.as_mut_ptr());
        // SAFETY: as for `open`; the buffer has the length that is said.
        check("DDI_DTI_ReadData", unsafe {
            (self.functions.read)(self.handle, &raw mut access)
        })
    }
}

fn access(address: u16, length: usize, data: *mut u8) -> Access {
    let length = u16::try_from(length).unwrap_or(u16::MAX);
    let is_even = (address | length) & 1 == 0;
    Access {
        length,
        address,
        consistency: if is_even { WORDS } else { BYTES },
        data,
    }
}

impl Drop for Node<'_> {
    fn drop(&mut self) {
        // SAFETY: as for `open`; nobody has the handle after this. Its answer changes nothing.
        unsafe { (self.functions.close)(self.handle) };
    }
}
