//! How the bus of a driver runs.

use std::sync::Arc;

use tickbus_base::time::Manual;
use tickbus_fieldbus::{Port, Stepped};

use super::supervise::BusThread;

/// How the bus runs.
#[expect(clippy::large_enum_variant, reason = "there is one in a driver")]
pub(super) enum BusHandle {
    /// On its own thread; dropping this ends it.
    #[expect(dead_code, reason = "kept for its drop")]
    Free(BusThread),
    /// On the tick, in simulation time.
    Stepped {
        bus: Box<dyn Stepped>,
        port: Port,
        time: Arc<Manual>,
    },
}

impl std::fmt::Debug for BusHandle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Free(_) => "Free",
            Self::Stepped { .. } => "Stepped",
        })
    }
}
