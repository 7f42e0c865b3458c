//! The messages of panics.

use std::any::Any;

use tickbus_driver::panic_text;

/// The message of a panic.
pub fn panic_message(payload: Box<dyn Any + Send>) -> String {
    let text = panic_text(&*payload).to_owned();
    // Dropping a payload of unknown type could panic again.
    std::mem::forget(payload);
    text
}
