//! Signals of the benches, as sections of a driver.cfg.

use std::fmt::Write as _;

/// 16 bits each way, like the rig's word, each with the key `latch`, or none.
pub(crate) fn bits(latch: &str) -> String {
    let mut text = String::new();
    for area in ['Q', 'I'] {
        for bit in 0..16 {
            let (byte, bit) = (1 - bit / 8, bit % 8);
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {byte}.{bit}\"\naddress = \"%{area}X{byte}.{bit}\"\n{latch}\n"
            );
        }
    }
    text
}

/// As [`bits`], latched.
#[allow(dead_code, reason = "not every bench needs it")]
pub(crate) fn latched_bits() -> String {
    bits("latch = \"rising\"")
}
