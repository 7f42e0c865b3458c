//! The shape of a driver's tick: what a tick does besides carrying values.
//!
//! The tick is written once, in [`exchange`](super::exchange), and compiled once for each shape, without the parts that
//! the shape does not need. The shape is chosen when the driver is opened, and again at the end of a tick that may have
//! changed it. So a driver without a recorder, axes or faults does not ask in each tick whether it has any.

/// The shape of a driver's next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// See [`Plain`].
    Plain,
    /// See [`Extended`].
    Extended,
    /// See [`InStep`].
    InStep,
}

/// The parts of a tick, as constants, so that each shape is compiled without what it lacks.
pub(super) trait Work {
    /// The bus runs on the tick, in simulation time, and can refuse a tick.
    const IS_STEPPED: bool;
    /// There can be extra work, a recorder, or a first tick.
    const HAS_EXTRAS: bool;
}

/// Carries the values of one station over a free bus, and does nothing else: most ticks of most drivers.
pub(super) struct Plain;

/// Any tick on a free bus.
pub(super) struct Extended;

/// Any tick on a stepped bus.
pub(super) struct InStep;

impl Work for Plain {
    const IS_STEPPED: bool = false;
    const HAS_EXTRAS: bool = false;
}

impl Work for Extended {
    const IS_STEPPED: bool = false;
    const HAS_EXTRAS: bool = true;
}

impl Work for InStep {
    const IS_STEPPED: bool = true;
    const HAS_EXTRAS: bool = true;
}
