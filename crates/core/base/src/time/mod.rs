//! Time: integer nanoseconds, the injected [`Clock`], and the [`Stop`] token.
//!
//! Nothing outside this room reads a clock of the operating system. Protocol cores take `now` as an argument; adapters
//! and supervision take a [`Clock`], which is [`Monotonic`] in production, and [`Manual`] in tests and with simulation
//! time.

mod clock;
mod histogram;
mod nanos;
mod pace;
mod shared_histogram;
mod simulation;
mod stop;
mod wall;

pub use clock::{Clock, Manual, Monotonic};
pub use histogram::TimeHistogram;
pub use nanos::Nanos;
pub use pace::Pace;
pub use shared_histogram::SharedHistogram;
pub use simulation::{
    Interest, Ready, SimulatedListener, SimulatedSocket, SimulatedStream, Simulation,
};
pub use stop::{Stop, Waker};
pub use wall::{WallClock, system_time};
