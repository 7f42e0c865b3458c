//! Texts on their way into and out of a C library.

#![allow(unsafe_code, reason = "a foreign library's texts are read")]

use std::ffi::{CStr, CString, c_char};

use tickbus_base::os::one_line;

/// A text of a C library.
pub(crate) type Text = *const c_char;

/// A text of the library as one line.
///
/// # Safety
///
/// The pointer is null or points to a text that ends with a zero.
pub(crate) unsafe fn text_of(text: Text) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: by the condition above.
    one_line(&unsafe { CStr::from_ptr(text) }.to_string_lossy())
}

/// A text for the library; the rest behind a zero is left out.
pub(crate) fn c_text(text: &str) -> CString {
    let text = text.split('\0').next().unwrap_or_default();
    CString::new(text).expect("no zero in it")
}
