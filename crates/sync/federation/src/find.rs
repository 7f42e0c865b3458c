//! The library that the user names.

use std::path::{Path, PathBuf};

use tickbus_base::Mistake;

/// Loads the library of `engine` that is named, or that the environment variable names; `None` if neither names one.
pub(crate) fn load_named<L>(
    engine: &str,
    (named, variable): (Option<&Path>, &str),
    load: impl FnOnce(&Path) -> Result<L, Mistake>,
) -> Option<Result<L, Mistake>> {
    let environment = || std::env::var_os(variable).filter(|path| !path.is_empty());
    let path = named
        .map(Path::to_owned)
        .or_else(|| environment().map(PathBuf::from))?;
    Some(load(&path).map_err(|mistake| {
        let what = format!("{engine}, {}: {}", path.display(), mistake.what);
        Mistake::new(what, mistake.right)
    }))
}
