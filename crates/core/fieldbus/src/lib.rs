//! The bus traits, and the parts that buses share.

mod alive;
mod at;
mod bus;
mod card;
mod changes;
mod cyclic;
mod dead_band;
mod error;
mod events;
mod kind;
mod link;
mod port;
mod rarely;
mod renewal;
mod role;
mod swallowed;
mod traffic;
mod validity;
mod write_guard;

pub mod faults;
pub mod loopback;
pub mod tcp;

pub use alive::{Alive, Heartbeat, LifeSigns, Watch, Written};
pub use at::{ADDRESS_LIMIT, At, both_ways};
pub use bus::{Bus, CYCLE, Free, Lead, Stepped};
pub use card::{Card, CardBus, CardOptions, Failing, Meaning, Moved, Vendor, Verdict};
pub use changes::ChangeEvents;
pub use cyclic::{Cycles, Exchange, Exchanged};
pub use dead_band::DeadBands;
pub use error::BusError;
pub use events::Events;
pub use kind::{AnyOptions, BusKind, BusOptions, BusSetup, Hosted, NamedFile, OpenError};
pub use link::{Cause, Link, LinkState, LinkStatus};
pub use port::{CallWatch, Farewell, Frames, Outputs, Port, Receipt};
pub use rarely::{Rarely, Times, Topic};
pub use renewal::Renewal;
pub use role::{OBSERVES, Role};
pub use swallowed::{Steps, SwallowedSignals};
pub use tickbus_image::is_stale;
pub use traffic::Medium;
pub use validity::{PlcState, Validity};
pub use write_guard::WriteGuard;
