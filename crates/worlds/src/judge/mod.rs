//! Who judges a world: what each end wrote and when, and what the other end may therefore see.
//!
//! Every value that is written says by whom and in which tick it was written, or follows from one that does. So what is seen
//! can be judged without a look into the drivers. Each promise has a file.

mod age;
mod beats;
mod files;
mod liveness;
mod outputs;
mod reader;
mod recording;
mod stamp;
mod station;
mod writer;

use std::fmt;

pub(crate) use self::age::{held, promise, slack};
pub(crate) use self::files::{Contents, FileRow, area_of, is_count};
pub(crate) use self::reader::{Known, Reader, Seen, Shown};
pub(crate) use self::recording::judge_recording;
pub(crate) use self::stamp::{Stamp, level, real, whole};
pub(crate) use self::writer::Writer;

/// A promise that was broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broken {
    /// Its short name.
    pub promise: &'static str,
    /// What was seen, and what would have been right.
    pub what: String,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.promise, self.what)
    }
}

/// Says that a promise was broken.
fn broken(promise: &'static str, what: String) -> Result<(), Broken> {
    Err(Broken { promise, what })
}
