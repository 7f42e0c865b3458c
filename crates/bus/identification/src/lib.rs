//! The IVI protocol of Pepperl+Fuchs over a serial line: a reader with up to four heads reads and writes the code
//! carriers in front of them, on pallets and the like.
//!
//! The core knows no port and no image. A [`Command`] is a request to a reader; a [`Client`] sends commands, one at a
//! time; a [`Reader`] is a simulated reader, with [`Head`]s and [`Carrier`]s.
//!
//! ```
//! use tickbus_base::time::Nanos;
//! use tickbus_bus_identification::{
//!     Access, Carrier, CarrierType, Client, Command, Head, Outcome, Reader, Timing,
//! };
//!
//! let timing = Timing { baud: 9600, timeout: Nanos::from_secs(1) };
//! let mut reader = Reader::new(Default::default(), timing);
//! *reader.head_mut(1) = Head {
//!     is_connected: true,
//!     carrier: Some(Carrier::new(CarrierType::Idc1K, b"pallet 7")),
//!     ..Head::default()
//! };
//! let mut client = Client::new(CarrierType::Idc1K, timing);
//! let now = Nanos::from_secs(1);
//! client.ask(now, &Command::once(1, Access::Read { address: 0, length: 8 }));
//! reader.hear(now, client.to_write());
//! client.hear(now, reader.to_write());
//! assert!(matches!(client.poll(now), Some(Outcome::Answered(answer)) if answer.status.is_done()));
//! assert_eq!(client.data(), b"pallet 7");
//! ```

mod answer;
mod carrier;
mod client;
mod client_bus;
mod command;
mod heads;
mod hex;
mod kind;
mod line;
mod reader;
mod reader_bus;
mod status;

pub use answer::Answer;
pub use carrier::{CarrierType, Family};
pub use client::{Client, Outcome, Timing};
pub use client_bus::{ClientOptions, NO_ANSWER};
pub use command::{Access, COMMAND_LIMIT, Command, ETX, Heads, PAGE, Refused, checksum};
pub use line::LineOptions;
pub use reader::{Carrier, HEADS, Head, Heard, Reader, VERSION};
pub use reader_bus::ReaderOptions;
pub use status::Status;
