//! The base of all tickbus crates: injected time, the operating system's corner, and reading TOML.
//!
//! | room | contents |
//! |---|---|
//! | [`time`] | integer nanoseconds, the injected clock, the stop token |
//! | [`net`] | TCP sockets, of the operating system or simulated |
//! | [`os`] | what only the operating system can do, such as waiting for sockets and time |
//! | [`parallel`] | the same work for many items, on several cores |
//! | [`thread`] | threads whose end can be awaited with a time limit |
//! | [`statistics`] | counts, times and facts with their keys, and their text |
//! | [`toml_text`] | reading configuration text: spans, collected mistakes, nearest names |

mod mistake;
pub mod net;
pub mod os;
pub mod parallel;
mod percent;
mod quick_clock;
mod real_time;
mod secret;
pub mod statistics;
pub mod thread;
mod threshold;
pub mod time;
pub mod toml_text;

pub use mistake::Mistake;
pub use percent::percent_decoded;
pub use quick_clock::QuickClock;
pub use real_time::RealTime;
pub use secret::is_same_secret;
pub use threshold::Threshold;
