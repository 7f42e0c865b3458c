//! Puts a simulated machine on a real PLC's fieldbus.
//!
//! A simulator exchanges one *process image* with the PLC at every simulation tick. The rooms are separate crates under
//! `crates/`, and each can be used without the others. This crate is the native library of the Java driver, the
//! `tickbus` command, and one name for all of the rooms. The rooms are listed in the order in which data pass through
//! them. Each manifest lists the rooms that a room uses, and `docs/ARCHITECTURE.md` explains why:
//!
//! | room | contents |
//! |---|---|
//! | [`time`] | integer nanoseconds, the injected clock, the stop token |
//! | [`os`] | the work of the operating system: waiting for sockets, and time |
//! | [`statistics`] | counts, times and facts with their keys, and their text |
//! | [`toml_text`] | reading configuration text: spans, collected mistakes, nearest names |
//! | [`net`] | addresses, dialling and listening, serial lines, the messages of helper processes |
//! | [`signal`] | IEC addresses and types, scaling, byte order; the codec plan made from them |
//! | [`axis`] | axes: their command and feedback structures, motion profiles, the meaning of a command |
//! | [`faults`] | injected faults: wrong values, and trouble on the line |
//! | [`image`] | the process image: wait-free hand-over, edge counters, age, event ring |
//! | [`record`] | recordings: the values that every tick saw, written to VCD or CSV and read again |
//! | [`reply`] | signals that a driver makes where no model of the machine does |
//! | [`report`] | one HTML page about one run |
//! | [`compare`] | the recording of a machine beside that of its model, and fitting the model |
//! | [`plc`] | IEC 61131-3 function blocks, and PLC programs on an injected clock |
//! | [`programs`] | the PLC programs of demos and measurements |
//! | [`fieldbus`] | the bus traits, and one room per bus |
//! | [`prepare`] | PLC programs put on virtual time, and taken off it byte for byte |
//! | [`driver_cfg`] | the contents of a driver.cfg |
//! | [`KINDS`] | the bus kinds that it can name |
//! | [`driver`] | one device: open, exchange, statistics, close |
//! | [`dispatcher`] | the dispatcher of a virtual laboratory: clients, patch, routing |
//! | [`bridge`] | bridges to it: serial lines, MQTT |
//! | [`export`] | the PLC's half of a driver.cfg: sources for PLC editors |
//! | [`fmi`] | FMI both ways: a driver.cfg as an FMU, foreign FMUs as machines |
//! | [`function_blocks`] | a small controller whose program is a plan of function blocks |
//! | [`import`] | lists of PLC tags, converted to a driver.cfg |
//! | [`testing`] | tests of PLC programs from files, on simulation time |
//! | [`virtual_time`] | lock-step by virtual time (SDSP): server, clients, trace hash |
//! | [`federation`] | a federation of another engine as a client of a run |
//! | [`gateway`] | a real PLC, on its own bus, as a client of a run |
//! | `jni` | the native methods of the Java classes `tickbus.Tickbus`, `DriverVector`, `SweepSession` and `LiveNets` |
//! | `c_api` | the functions of `include/tickbus.h` |
//! | `fmi_api` | the functions of FMI, for the FMU made from a driver.cfg |
//! | [`cli`] | the `tickbus` command |
//!
//! Directions are named from the PLC, as everywhere in the field: `%I` is a PLC input, which the
//! simulation writes; `%Q` is a PLC output, which the simulation reads.

#[cfg(feature = "doors")]
mod c_api;
pub mod cli;
pub mod fieldbus;
#[cfg(feature = "doors")]
mod fmi_api;
#[cfg(feature = "doors")]
mod jni;
#[cfg(feature = "doors")]
mod nets;
/// The live page of this process, for the Python package.
#[doc(hidden)]
pub mod page;

pub use tickbus_axis as axis;
pub use tickbus_base::{Mistake, os, statistics, time, toml_text};
pub use tickbus_bridge as bridge;
pub use tickbus_compare as compare;
pub use tickbus_dispatcher as dispatcher;
pub use tickbus_driver as driver;
pub use tickbus_driver_cfg as driver_cfg;
pub use tickbus_export as export;
pub use tickbus_federation as federation;
pub use tickbus_fieldbus::faults;
pub use tickbus_fmi as fmi;
pub use tickbus_function_blocks as function_blocks;
pub use tickbus_gateway as gateway;
pub use tickbus_image as image;
pub use tickbus_image::signal;
pub use tickbus_import as import;
pub use tickbus_kinds::KINDS;
pub use tickbus_net as net;
pub use tickbus_plc as plc;
pub use tickbus_prepare as prepare;
pub use tickbus_programs as programs;
pub use tickbus_record as record;
pub use tickbus_reply as reply;
pub use tickbus_report as report;
pub use tickbus_testing as testing;
pub use tickbus_virtual_time as virtual_time;
