//! Where the library of SIL Kit is.

use std::path::Path;

use tickbus_base::Mistake;

use super::library::Library;
use crate::find::load_named;

/// The library as the release has it.
const NAME: &str = if cfg!(windows) {
    "SilKit.dll"
} else if cfg!(target_os = "macos") {
    "libSilKit.dylib"
} else {
    "libSilKit.so"
};

/// Loads the library that is named, or the system's.
pub(super) fn load(named: Option<&Path>) -> Result<Library, Mistake> {
    let asked = (named, "SILKIT_LIBRARY");
    load_named("SIL Kit", asked, Library::load).unwrap_or_else(|| {
        Library::load(Path::new(NAME)).map_err(|mistake| {
            let what = format!("SIL Kit is not on this system: {}", mistake.what);
            Mistake::new(what, mistake.right)
        })
    })
}
