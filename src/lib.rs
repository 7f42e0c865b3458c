//! Puts a simulated machine on a real PLC's fieldbus.
//!
//! A simulator exchanges one *process image* with the PLC at every simulation tick. The rooms of this crate
//! follow the data flow, and each uses only the rooms above it in this list (a test checks that;
//! `docs/ARCHITECTURE.md` explains why):
//!
//! | room | what lives there |
//! |---|---|
//! | [`time`] | integer nanoseconds, the injected clock, the stop token |
//! | [`os`] | what only the operating system can do: waiting for sockets, and time |
//! | [`config`] | reading configuration text: spans, collected mistakes, nearest names |
//! | [`signal`] | IEC addresses and types, scaling, byte order; the codec plan made from them |
//! | [`axis`] | axes: their command and feedback structures, motion profiles, what a command means |
//! | [`faults`] | injected faults: wrong values, and trouble on the line |
//! | [`image`] | the process image: wait-free hand-over, edge counters, age, event ring |
//! | [`record`] | recordings: what every tick saw, written to VCD or CSV and read again |
//! | [`report`] | one HTML page about one run |
//! | [`plc`] | IEC 61131-3 function blocks, and PLC programs on an injected clock |
//! | [`fieldbus`] | the bus traits, and one room per bus |
//! | [`driver`] | one device: configuration, open, exchange, statistics, close |
//! | [`export`] | the PLC's half of a driver.cfg: sources for PLC editors |
//! | [`import`] | lists of PLC tags, made into a driver.cfg |
//! | [`testing`] | tests of PLC programs from files, on simulation time |
//! | `jni` | the native methods of the Java class `tickbus.Tickbus` |
//! | [`cli`] | the `tickbus` command |
//!
//! Directions are named from the PLC, as everywhere in the field: `%I` is a PLC input, which the
//! simulation writes; `%Q` is a PLC output, which the simulation reads.

pub mod axis;
pub mod cli;
pub mod config;
pub mod driver;
pub mod export;
pub mod faults;
pub mod fieldbus;
pub mod image;
pub mod import;
mod jni;
pub mod os;
pub mod plc;
pub mod record;
pub mod report;
pub mod signal;
pub mod testing;
pub mod time;
