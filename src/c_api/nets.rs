//! Petri nets on the page of this process.

#![allow(
    unsafe_code,
    reason = "exported names and the pointers that a caller in C hands in"
)]

use std::ffi::c_char;

use tickbus_base::time::Nanos;
use tickbus_binding::Refusal;
use tickbus_driver::Code;

use super::{answer, hand_over, text};
use crate::nets;

/// # Safety
///
/// `address` and `title` must be C strings; `into` must be null or point to an `int64_t`.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_nets_open(
    address: *const c_char,
    title: *const c_char,
    into: *mut i64,
) -> i32 {
    answer(|| {
        tickbus_base::os::log_to_stderr(log::LevelFilter::Warn);
        if into.is_null() {
            return Err(Refusal::new(Code::BadArgument, "nets is NULL"));
        }
        // SAFETY: promised by the caller, here and below.
        unsafe { into.write(0) };
        // SAFETY: as above.
        let (address, title) = unsafe { (text(address, "address")?, text(title, "title")?) };
        let handle = nets::open(address, title)?;
        // SAFETY: as above.
        unsafe { into.write(handle) };
        Ok(Code::Fresh.code())
    })
}

/// # Safety
///
/// `into` must be null or have room for `room` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_nets_page(handle: i64, into: *mut c_char, room: usize) -> i32 {
    answer(|| {
        let url = nets::url(handle)?;
        // SAFETY: promised by the caller.
        Ok(unsafe { hand_over(&url, into, room) })
    })
}

/// # Safety
///
/// `json` must be a C string.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_nets_draw(handle: i64, json: *const c_char) -> i32 {
    answer(|| {
        // SAFETY: promised by the caller.
        nets::draw(handle, unsafe { text(json, "json") }?)?;
        Ok(Code::Fresh.code())
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_nets_wanted(handle: i64, patience: i64) -> i32 {
    answer(|| Ok(nets::wanted(handle, Nanos(patience))?.into()))
}

/// # Safety
///
/// `json` must be a C string.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_nets_put(handle: i64, json: *const c_char) -> i32 {
    answer(|| {
        // SAFETY: promised by the caller.
        nets::put(handle, unsafe { text(json, "json") }?)?;
        Ok(Code::Fresh.code())
    })
}

#[unsafe(no_mangle)]
extern "C" fn tb_nets_close(handle: i64) -> i32 {
    answer(|| {
        nets::close(handle)?;
        Ok(Code::Fresh.code())
    })
}
