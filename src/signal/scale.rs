//! Linear scaling between raw PLC values and engineering units.

/// `value = raw × gain + offset`, unclamped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Engineering units per raw count; never zero, always finite.
    pub gain: f64,
    /// The value at raw zero, in engineering units; always finite.
    pub offset: f64,
}
