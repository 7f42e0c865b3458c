//! The plug-in bus: a vendor's shared library behind the C interface of `include/tickbus_fieldbus.h`.
//!
//! `direct` calls the library on the bus thread. `isolated` has a helper process
//! call it: the image lies in memory that both share, and short messages say whose turn it is. Either
//! way the same loop (`cycle`) makes the bus cycles, and the same code (`library`) calls the library.

mod abi;
#[cfg(unix)]
mod answer;
mod cycle;
mod direct;
#[cfg(unix)]
mod helper;
#[cfg(unix)]
mod isolated;
mod library;
#[cfg(unix)]
mod locate;
mod options;
mod outcome;
#[cfg(unix)]
mod request;
mod setup;
#[cfg(unix)]
mod wire;

use std::path::{Path, PathBuf};

#[cfg(unix)]
pub use answer::Answer;
#[cfg(unix)]
pub use helper::serve as serve_host;
pub use options::Options;
pub use outcome::Outcome;
pub use setup::{Line, Setup, Station};
#[cfg(unix)]
pub use wire::{Fields, Inbox, Message, WireError};

use tickbus_base::time::Nanos;
use tickbus_fieldbus::Free;

/// The version that host and helper must have in common.
#[cfg(unix)]
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// How long calls into the library may last.
#[derive(Clone, Copy, Debug)]
struct Limits {
    /// Loading it, and opening the bus.
    open: Nanos,
    /// An exchange, beyond the time-out that it is given.
    call: Nanos,
    /// Closing the bus.
    close: Nanos,
}

/// Why there is no such bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Another driver.cfg would help: what was looked for, and what to do.
    Config(String),
    /// This system does not have what the driver.cfg asks for.
    Unsupported(String),
}

/// Makes the bus that `options` describe, for `line`.
///
/// # Errors
///
/// The library's file is not there, or there is no helper for it: what was looked for, and what to do.
pub fn open(options: &Options, line: Line<'_>) -> Result<Box<dyn Free>, Refusal> {
    let library = absolute(line.directory, &options.library);
    if !library.is_file() {
        return Err(Refusal::Config(format!(
            "there is no library {}; check `library`, which begins at the folder of the driver.cfg",
            library.display()
        )));
    }
    let limits = Limits {
        open: options.open_timeout,
        call: options.call_timeout,
        close: options.close_timeout,
    };
    let setup = Setup::new(options, library, line);
    if options.isolated {
        return isolated(options, line.directory, setup, limits);
    }
    Ok(Box::new(direct::Direct::new(setup, limits)))
}

#[cfg(unix)]
fn isolated(
    options: &Options,
    directory: &Path,
    setup: Setup,
    limits: Limits,
) -> Result<Box<dyn Free>, Refusal> {
    let named = options.helper.as_ref();
    let named = named.map(|path| absolute(directory, path));
    let program =
        locate::helper(named, &absolute(directory, Path::new(""))).map_err(Refusal::Config)?;
    Ok(Box::new(isolated::Isolated::new(setup, limits, program)))
}

#[cfg(not(unix))]
fn isolated(_: &Options, _: &Path, _: Setup, _: Limits) -> Result<Box<dyn Free>, Refusal> {
    Err(Refusal::Unsupported(
        "isolated = true is not available on this system; remove it".to_owned(),
    ))
}

/// A path of the driver.cfg, which begins at its folder.
fn absolute(directory: &Path, path: &Path) -> PathBuf {
    let joined = directory.join(path);
    // It fails where the current folder is gone; then the path is as good as it gets.
    std::path::absolute(&joined).unwrap_or(joined)
}
