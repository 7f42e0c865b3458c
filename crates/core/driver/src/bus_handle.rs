//! How the bus of a driver runs.

use std::sync::Arc;

use tickbus_base::time::Manual;
use tickbus_fieldbus::{Bus, Free, Lead, Port, Stepped};

use super::line::FreeLine;
use super::replay::Replay;

/// A bus that is open but does not run yet.
pub(super) enum OpenBus {
    /// Needs a thread.
    Free(Box<dyn Free>),
    /// Runs on the tick.
    Stepped(SteppedBus),
}

/// A bus that runs on the tick.
pub(super) enum SteppedBus {
    Any(Box<dyn Stepped>),
    /// Knows the values that the tick shows, not only frames.
    Replay(Box<Replay>),
}

/// How the bus runs.
#[expect(clippy::large_enum_variant, reason = "there is one in a driver")]
pub(super) enum BusHandle {
    /// Runs on its own thread; dropping this ends it.
    Free(FreeLine),
    /// On the tick, in simulation time.
    Stepped {
        bus: SteppedBus,
        port: Port,
        time: Arc<Manual>,
    },
}

impl From<Bus> for OpenBus {
    fn from(bus: Bus) -> Self {
        match bus {
            Bus::Free(bus) => Self::Free(bus),
            Bus::Stepped(bus) => Self::Stepped(SteppedBus::Any(bus)),
        }
    }
}

impl SteppedBus {
    #[inline]
    pub(super) fn as_stepped(&mut self) -> &mut dyn Stepped {
        match self {
            Self::Any(bus) => &mut **bus,
            Self::Replay(replay) => &mut **replay,
        }
    }

    /// Returns who hands out the time.
    pub(super) fn lead(&self) -> Lead {
        match self {
            Self::Any(bus) => bus.lead(),
            Self::Replay(replay) => replay.lead(),
        }
    }
}

impl std::fmt::Debug for BusHandle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Free(_) => "Free",
            Self::Stepped { .. } => "Stepped",
        })
    }
}
