//! The judge of a world: what each end wrote and when, and what the other end may therefore see.
//!
//! Every value shows who wrote it and in which tick, or follows from one that does. The judge therefore needs no look
//! into the drivers. Each promise has a file.

mod age;
mod beats;
mod liveness;
mod outputs;
mod reader;
mod seen;
mod station;
mod writer;

pub(crate) use self::age::{held, promise, slack};
pub(crate) use self::reader::Reader;
pub(crate) use self::seen::{Known, Seen, Shown};
pub(crate) use self::writer::Writer;

use crate::broken::{Broken, broken};
use crate::stamp::Stamp;
