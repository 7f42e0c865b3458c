//! Finds the tickbus command for starting helper processes.

use std::env;
use std::path::{Path, PathBuf};

use tickbus_base::Mistake;
use tickbus_base::os;

/// The variable that names the command.
const VARIABLE: &str = "TICKBUS_HELPER";

/// Where the command may be: a description, and its path, or why there is no path.
type Candidate = (&'static str, Result<PathBuf, String>);

/// The tickbus command.
///
/// `named` is the key in the driver.cfg in the folder `directory`. Without it, the executable of this process
/// cannot be used: it may be a Java VM.
///
/// # Errors
///
/// The message has every place that was searched, and the remedy.
pub(super) fn helper(named: Option<PathBuf>, directory: &Path) -> Result<PathBuf, Mistake> {
    search(places(named, directory))
}

/// A named command is the only candidate: running any other would ignore the user's choice.
fn places(named: Option<PathBuf>, directory: &Path) -> Vec<Candidate> {
    if let Some(path) = named {
        return vec![("`helper` in the driver.cfg", Ok(path))];
    }
    if let Some(path) = env::var_os(VARIABLE) {
        return vec![("the variable TICKBUS_HELPER", Ok(path.into()))];
    }
    let command = format!("tickbus{}", env::consts::EXE_SUFFIX);
    let beside = |path: PathBuf| path.with_file_name(&command);
    let mut places = vec![
        ("beside the driver.cfg", Ok(directory.join(&command))),
        (
            "beside the native library",
            os::own_file()
                .map(beside)
                .map_err(|error| error.to_string()),
        ),
        (
            "beside this program",
            env::current_exe()
                .map(beside)
                .map_err(|error| error.to_string()),
        ),
    ];
    let path = env::var_os("PATH").unwrap_or_default();
    let folders = env::split_paths(&path).filter(|folder| folder.is_absolute());
    places.extend(folders.map(|folder| ("in the PATH", Ok(folder.join(&command)))));
    places
}

fn search(places: Vec<Candidate>) -> Result<PathBuf, Mistake> {
    let mut tried = Vec::new();
    for (name, place) in places {
        let why = match place {
            Ok(path) if is_program(&path) => return Ok(path),
            Ok(path) => format!("{} is not there, or no program", path.display()),
            Err(why) => why,
        };
        tried.push(format!("{name} ({why})"));
    }
    Err(Mistake::new(
        format!(
            "isolated = true needs the tickbus command to start helper processes with, and it was not found: {}",
            tried.join(", ")
        ),
        format!("name it as `helper` in the driver.cfg, or in the variable {VARIABLE}"),
    ))
}

#[cfg(unix)]
fn is_program(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt as _;

    path.metadata()
        .is_ok_and(|data| data.is_file() && data.permissions().mode() & 0o111 != 0)
}

/// Files have no mark of a program on this system.
#[cfg(not(unix))]
fn is_program(path: &Path) -> bool {
    path.is_file()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a file; the mode counts only where files have one.
    fn file(path: &Path, mode: u32) {
        use std::fs::OpenOptions;

        let mut options = OpenOptions::new();
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, mode);
        let _ = mode;
        let file = options.write(true).create_new(true).open(path);
        file.expect("a new file");
    }

    #[test]
    fn the_first_program_is_taken_and_what_is_no_program_is_passed_by() {
        let folder = tempfile::tempdir().expect("a folder");
        let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
        if cfg!(unix) {
            file(&first, 0o600);
        }
        file(&second, 0o700);
        let places = vec![
            ("a", Err("nothing".to_owned())),
            ("b", Ok(folder.path().to_owned())),
            ("c", Ok(first)),
            ("d", Ok(second.clone())),
        ];
        assert_eq!(search(places), Ok(second));
    }

    #[test]
    fn the_error_lists_every_place() {
        let places = vec![
            ("here", Err("it has no name".to_owned())),
            ("there", Ok("/no/such/tickbus".into())),
        ];
        assert_eq!(
            search(places).expect_err("not there").to_string(),
            "isolated = true needs the tickbus command to start helper processes with, and it was not found: \
             here (it has no name), there (/no/such/tickbus is not there, or no program); name it as `helper` \
             in the driver.cfg, or in the variable TICKBUS_HELPER"
        );
    }

    #[test]
    fn what_is_named_counts_alone() {
        let error =
            helper(Some("/no/such/tickbus".into()), Path::new("/opt")).expect_err("not there");
        assert!(
            error
                .what
                .contains("`helper` in the driver.cfg (/no/such/tickbus"),
            "{error}"
        );
        assert!(!error.what.contains("PATH"), "{error}");
    }
}
