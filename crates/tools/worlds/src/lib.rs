//! Simulated worlds: two drivers at the ends of a line. One seed controls their threads, the network and the clock. The
//! judge relies on values that show when they were written.
//!
//! [`Plan::draw`] draws a world from a seed: its bus, its keys of driver.cfg, the misfortunes that exist, and when they
//! happen. [`Plan::run`] runs it within some milliseconds, and returns the first promise that was broken. The same seed
//! gives the same world on every machine, to the last bit. See `docs/testing-tickbus.md`.

#![allow(
    clippy::float_cmp,
    reason = "values are compared with what was written, to the last bit"
)]

mod broken;
mod bus;
mod clock;
mod config;
mod delivery;
mod disk;
mod end;
mod faults;
mod features;
mod files;
mod injector;
mod judge;
mod kinds;
mod known;
mod laboratory;
mod master;
mod neighbours;
mod network;
mod page;
mod pairs;
mod plan;
mod pulses;
mod random;
mod recording;
mod replay;
mod run;
mod scheduler;
mod seed;
mod shrink;
mod silence;

mod stamp;
mod tape;
mod typed;
mod wire;
mod world;

pub use broken::Broken;
pub use faults::{Effect, FaultPlan, Way};
pub use features::{Features, RecordPlan, Times};
pub use neighbours::Neighbour;
pub use network::Conditions;
pub use page::Page;
pub use pairs::Pairs;
pub use plan::{BETWEEN, Bus, EndPlan, Event, LaboratoryPlan, Misfortune, Plan, Watchdog};
pub use run::{Finding, Run};
pub use scheduler::Habits;
pub use seed::Seed;
pub use typed::Typed;
