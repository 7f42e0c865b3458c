//! The plug-in bus: a vendor's shared library behind the C interface of `include/tickbus_fieldbus.h`.
//!
//! `direct` calls the library on the bus thread. `isolated` lets a helper process call it: the image is in
//! shared memory, and short messages pass the turn. In both cases the same code (`library`) calls the library.

mod abi;
mod answer;
mod direct;
mod helper;
mod isolated;
mod kind;
mod library;
mod locate;
mod options;
mod outcome;
mod request;
mod setup;

use std::path::{Path, PathBuf};

pub use answer::Answer;
pub use helper::serve as serve_host;
pub use options::Options;
pub use outcome::Outcome;
pub use setup::{Setup, Station};

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusSetup, Free, OpenError};

/// The version that host and helper must share.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The time limits of library calls.
#[derive(Clone, Copy, Debug)]
struct Limits {
    /// Loading the library, and opening the bus.
    open: Nanos,
    /// An exchange, in addition to its own time-out.
    call: Nanos,
    /// Closing the bus.
    close: Nanos,
}

/// Makes the bus that `options` describe, for `line`.
///
/// # Errors
///
/// The library's file does not exist, or there is no helper for it: the message has the places searched, and the
/// remedy.
pub fn open(options: &Options, line: &BusSetup<'_>) -> Result<Box<dyn Free>, OpenError> {
    let library = absolute(line.folder, &options.library);
    if !library.is_file() {
        return Err(OpenError::Config(Mistake::new(
            format!("there is no library {}", library.display()),
            "check `library`, which begins at the folder of the driver.cfg",
        )));
    }
    let limits = Limits {
        open: options.open_timeout,
        call: options.call_timeout,
        close: options.close_timeout,
    };
    let setup = Setup::new(options, library, line);
    if options.isolated {
        return isolated(options, line.folder, setup, limits);
    }
    Ok(Box::new(direct::Direct::new(setup, limits)))
}

fn isolated(
    options: &Options,
    directory: &Path,
    setup: Setup,
    limits: Limits,
) -> Result<Box<dyn Free>, OpenError> {
    let named = options.helper.as_ref();
    let named = named.map(|path| absolute(directory, path));
    // A driver.cfg of the current folder has an empty one, and an empty path cannot be made absolute.
    let folder = absolute(directory, Path::new("."));
    let program = locate::helper(named, &folder).map_err(OpenError::Config)?;
    Ok(Box::new(isolated::Isolated::new(setup, limits, program)))
}

/// A path in the driver.cfg, relative to its folder.
fn absolute(directory: &Path, path: &Path) -> PathBuf {
    let joined = directory.join(path);
    // Fails if the current folder was deleted; then the path stays relative.
    std::path::absolute(&joined).unwrap_or(joined)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_of_a_driver_cfg_in_the_current_folder_is_absolute() {
        let folder = absolute(Path::new(""), Path::new("."));
        assert_eq!(Some(folder), std::env::current_dir().ok());
    }
}
