//! What is at the other end of a bus within this process, and its counters.

use std::sync::Arc;

use tickbus_base::statistics::Statistics;

use crate::replay::ReplayCounters;

use super::{HostCounters, HostThread, ScanCounters};

/// What is at the other end, within this process: a PLC program or a recording.
#[derive(Debug)]
pub(crate) enum Program {
    Thread(Box<HostThread>),
    Stepped(Arc<ScanCounters>),
    Replay(Arc<ReplayCounters>),
}

/// The counters of such a program, readable from any thread.
#[derive(Clone, Debug)]
pub(crate) enum ProgramCounters {
    Thread(HostCounters),
    Stepped(Arc<ScanCounters>),
    Replay(Arc<ReplayCounters>),
}

impl Program {
    pub(crate) fn tally(&self) -> ProgramCounters {
        match self {
            Self::Thread(host) => ProgramCounters::Thread(host.told.clone()),
            Self::Stepped(tally) => ProgramCounters::Stepped(Arc::clone(tally)),
            Self::Replay(tally) => ProgramCounters::Replay(Arc::clone(tally)),
        }
    }
}

impl ProgramCounters {
    /// Adds the counters.
    pub(crate) fn write(&self, statistics: &mut Statistics) {
        match self {
            Self::Thread(host) => host.write(statistics),
            Self::Stepped(tally) => tally.write(statistics),
            Self::Replay(tally) => tally.write(statistics),
        }
    }
}
