//! The other end of a bus within this process, and its counters.

use std::sync::Arc;

use tickbus_base::statistics::Statistics;

use crate::replay::ReplayCounters;

use super::{HostCounters, HostThread, ScanCounters};

/// The other end of a bus within this process: a PLC program or a recording.
#[derive(Debug)]
pub(crate) enum Program {
    Thread(Box<HostThread>),
    Stepped(Arc<ScanCounters>),
    Replay(Arc<ReplayCounters>),
}

/// The counters of the other end, readable from any thread.
#[derive(Clone, Debug)]
pub(crate) enum ProgramCounters {
    Thread(HostCounters),
    Stepped(Arc<ScanCounters>),
    Replay(Arc<ReplayCounters>),
}

impl Program {
    pub(crate) fn counters(&self) -> ProgramCounters {
        match self {
            Self::Thread(host) => ProgramCounters::Thread(host.counters.clone()),
            Self::Stepped(scan_counters) => ProgramCounters::Stepped(Arc::clone(scan_counters)),
            Self::Replay(scan_counters) => ProgramCounters::Replay(Arc::clone(scan_counters)),
        }
    }
}

impl ProgramCounters {
    /// Adds the counters.
    pub(crate) fn write(&self, statistics: &mut Statistics) {
        match self {
            Self::Thread(host) => host.write(statistics),
            Self::Stepped(scan_counters) => scan_counters.write(statistics),
            Self::Replay(scan_counters) => scan_counters.write(statistics),
        }
    }
}
