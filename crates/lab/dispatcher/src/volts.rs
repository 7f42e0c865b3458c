//! Digital values as voltages of a 24 V input.

/// The value of an output that is on, in volts.
pub const ON_VOLTS: u8 = 24;

/// Below this voltage a digital input is off.
const OFF_BELOW: f64 = 5.0;

/// Above this voltage it is on.
const ON_ABOVE: f64 = 8.0;

/// The level of a digital input at a voltage: on, off, or, between 5 and 8 V, `None`: unchanged.
pub fn level(volts: f64) -> Option<bool> {
    if volts > ON_ABOVE {
        Some(true)
    } else if volts < OFF_BELOW {
        Some(false)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_5_and_8_volts_nothing_changes() {
        for (volts, expected) in [
            (-24.0, Some(false)),
            (4.99, Some(false)),
            (5.0, None),
            (8.0, None),
            (8.01, Some(true)),
            (24.0, Some(true)),
        ] {
            assert_eq!(level(volts), expected, "{volts}");
        }
    }
}
