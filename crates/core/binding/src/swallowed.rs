//! Swallowed changes as text for other languages.

use std::fmt::Write as _;

use tickbus_driver::Driver;

/// A line for each signal whose changes were swallowed: its index, a tab, and how often, where, and what to do. Empty, and
/// without an allocation, if there are none.
pub fn swallowed(driver: &Driver) -> String {
    let mut text = String::new();
    for (signal, sentence) in driver.swallowed().sentences() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{signal}\t{sentence}");
    }
    text
}
