//! The tests of whole programs that need no third-party software and no process of their own, in one program.
#![allow(missing_docs, reason = "tests")]

mod axis;
mod bridge;
mod bridge_bus;
mod c_api;
mod check;
mod codec;
#[cfg(unix)]
#[path = "../peers/commands.rs"]
mod commands;
mod compare;
mod dispatch;
mod doctor;
#[cfg(all(unix, feature = "page"))]
#[path = "../peers/edited.rs"]
mod edited;
mod ending;
mod export;
mod exports;
mod faults;
mod find;
mod fmi;
mod import;
mod installed;
#[cfg(all(unix, feature = "page"))]
mod invitation;
mod logo;
mod loopback;
mod machines;
mod new;
mod observer;
mod own_program;
mod peeler;
mod play;
mod record;
mod replies;
mod report;
mod sessions;
#[cfg(feature = "page")]
mod show;
mod sweep;
mod sync;
#[cfg(all(unix, feature = "page"))]
mod taken;
mod testing;
