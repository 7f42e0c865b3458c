//! A dispatcher as a bus: `kind = "dispatcher"` makes a simulation a virtual process of a virtual laboratory, or a PLC
//! program a virtual controller.
//!
//! Each signal is a channel: those that this end writes are its outputs, those that it reads its inputs. Values are
//! sent when they change, checked once per bus cycle; a received line of values is one frame. The laboratory decides
//! about the connections. An input that has lost its source has its fail-safe value, and a station none of whose inputs
//! has a source is stale.

mod bus;
mod channels;
mod examine;
mod inputs;
mod kind;
mod options;
mod outputs;

pub use bus::DispatcherBus;
pub use channels::Channels;
pub use options::Options;
