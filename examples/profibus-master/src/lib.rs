//! A PROFIBUS master for tests and the demo: profirust as a plug-in, so that `tickbus plc` can run its programs as the
//! PLC of a line.
//!
//! ```toml
//! [fieldbus]
//! kind    = "plugin"
//! library = "libprofibus_master.so"
//! options = { port = "/dev/pts/3", project = "simulated.toml" }
//! ```
//!
//! The project names the station's GSD file and its modules. gsd-parser reads both, so no code of tickbus is on this
//! side of the line.
#![cfg(unix)]

mod abi;
#[path = "../../../tests/peers/dp_phy.rs"]
mod dp_phy;
mod master;
mod project;
