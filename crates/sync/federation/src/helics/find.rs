//! Where the library of HELICS is.

use std::path::{Path, PathBuf};
use std::process::Command;

use tickbus_base::Mistake;

use super::library::Library;
use crate::find::load_named;

/// The library as the system's package has it.
const NAME: &str = if cfg!(windows) {
    "helics.dll"
} else if cfg!(target_os = "macos") {
    "libhelics.3.dylib"
} else {
    "libhelics.so.3"
};

/// Prints the folder of the Python package, without loading it.
const SCRIPT: &str =
    "import importlib.util as u; print(u.find_spec('helics').submodule_search_locations[0])";

/// Loads the library that is named, or the first one that is found.
pub(super) fn load(named: Option<&Path>) -> Result<Library, Mistake> {
    let asked = (named, "HELICS_LIBRARY");
    if let Some(loaded) = load_named("HELICS", asked, Library::load) {
        return loaded;
    }
    if let Some(path) = of_python() {
        return Library::load(&path);
    }
    Library::load(Path::new(NAME)).map_err(|mistake| {
        let what = format!(
            "HELICS is neither a package of the Python on the path nor on this system: {}",
            mistake.what
        );
        Mistake::new(what, mistake.right)
    })
}

/// The library in the Python package, if that is installed.
fn of_python() -> Option<PathBuf> {
    let python = if cfg!(windows) { "python" } else { "python3" };
    let printed = Command::new(python).args(["-c", SCRIPT]).output().ok()?;
    let folder = String::from_utf8(printed.stdout).ok()?;
    let install = Path::new(folder.trim()).join("install");
    let folders = ["lib64", "lib", "bin"].map(|folder| install.join(folder).join(NAME));
    folders.into_iter().find(|library| library.exists())
}
