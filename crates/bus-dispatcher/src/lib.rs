//! A dispatcher as a bus: `kind = "dispatcher"` makes a simulation a virtual process of a virtual laboratory, or a PLC
//! program a virtual controller.
//!
//! Each signal is a channel: those that this end writes are its outputs, those that it reads its inputs. Values go out when
//! they change, looked at once per bus cycle; a line of values that comes in is one frame. What the laboratory connects them
//! with is its own matter: an input that has lost its source has its fail-safe value, and a station none of whose inputs
//! has a source is stale.

mod bus;
mod channels;
mod inputs;
mod kind;
mod options;
mod outputs;

pub use bus::DispatcherBus;
pub use channels::Channels;
pub use options::Options;
