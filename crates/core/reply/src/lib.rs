//! Replies of a machine: signals that the driver makes itself, because no model does.
//!
//! A PLC program waits for feedback that a model of motion does not have: a motor runs, oil is warm, a cylinder is out.
//! A `[[reply]]` table of a driver.cfg, or a `[[machine.reply]]` of a test file, describes such feedback by its
//! [kind](REPLY_KINDS), and a `[[drive]]` the words of a drive. [`Replies`] makes the signals at every tick. Nothing here does any I/O or reads a clock: time
//! and values come in, values go out. Random numbers come from a seed, so the same values in give the same ones out.

mod awake;
mod behaviour;
mod condition;
mod delay;
mod drive;
mod integrator;
mod io;
mod lag;
mod levels;
mod motor;
mod numbers;
mod order;
mod part;
mod pulses;
mod replies;
mod rule;
mod section;
mod setting;
mod signal;
mod track;
mod travel;

pub use behaviour::Reply;
pub use condition::{Condition, Demand};
pub use replies::Replies;
pub use rule::{Course, Ramp, Rule, Values};
pub use section::{
    Drive, LIMIT, OneOf, REPLY_KEYS, REPLY_KINDS, Scope, Signals, drives, one_of, read_rule,
    read_sections, texts,
};
pub use setting::Setting;
pub use signal::real;

#[cfg(test)]
mod tests;
