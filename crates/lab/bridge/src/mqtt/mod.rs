//! MQTT topics as the channels of a client of the dispatcher.
//!
//! [`Map`] assigns topics to channels, [`Mapping`] implements a map without I/O, and `run` connects it with the broker
//! and the dispatcher.

mod access;
mod map_file;
mod mapping;
#[cfg(feature = "mqtt")]
mod run;
#[cfg(feature = "mqtt")]
mod tls;

pub use access::{Access, Login, Tls};
pub use map_file::{Entry, Format, Map};
pub use mapping::{Mapping, Publish, Traffic};
#[cfg(feature = "mqtt")]
pub use run::{Hosting, run};
