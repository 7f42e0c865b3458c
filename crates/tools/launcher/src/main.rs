//! The `tickbus` command of a release. The command's code is in the native library, which a release has anyway: this
//! program loads it from its own folder.

use std::ffi::c_int;
use std::path::Path;
use std::process::ExitCode;

use libloading::{Library, Symbol, library_filename};

/// The function of the native library that runs the command.
const ENTRY: &str = "tickbus_command";
/// The exit code if the library cannot be loaded: that of a shell for a command that it cannot run.
const CANNOT_RUN: u8 = 126;

fn main() -> ExitCode {
    let own = std::env::current_exe()
        .map_err(|error| format!("the folder of this program is unknown: {error}"));
    match own.and_then(|own| run(&own)) {
        Ok(code) => code.into(),
        Err(message) => {
            eprintln!("tickbus: {message}");
            CANNOT_RUN.into()
        }
    }
}

/// Runs the command in the library beside the program `own`.
fn run(own: &Path) -> Result<u8, String> {
    let library = library_filename("tickbus");
    let beside = own.with_file_name(&library);
    // A symbolic link to the program is followed.
    let linked = own.canonicalize().map(|own| own.with_file_name(&library));
    if let Some(file) = [Ok(&beside), linked.as_ref()]
        .into_iter()
        .flatten()
        .find(|file| file.is_file())
    {
        return call(file);
    }
    Err(format!(
        "{} is missing: the command needs the native library in its own folder; copy both, or make a symbolic link to \
         the command",
        beside.display()
    ))
}

fn call(file: &Path) -> Result<u8, String> {
    let wrong = |error: libloading::Error| {
        format!(
            "{} cannot be used: {error}; unpack command and library from one release for this platform",
            file.display()
        )
    };
    // SAFETY: the library's initialisers are those of Rust's standard library and of the operating system.
    #[allow(unsafe_code)]
    let library = unsafe { Library::new(file) }.map_err(wrong)?;
    // SAFETY: in every version of the library that has it, the function has this signature.
    #[allow(unsafe_code)]
    let command: Symbol<'_, extern "C" fn() -> c_int> =
        unsafe { library.get(ENTRY) }.map_err(wrong)?;
    let code = command();
    // Threads of the library may still run; the end of the process ends them.
    std::mem::forget(library);
    Ok(u8::try_from(code).unwrap_or(u8::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what the launcher says in a folder with these bytes as the library, and the path of the library.
    fn said(name: &str, bytes: Option<&[u8]>) -> (String, String) {
        let folder =
            std::env::temp_dir().join(format!("tickbus launcher {} {name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let library = folder.join(library_filename("tickbus"));
        if let Some(bytes) = bytes {
            std::fs::write(&library, bytes).unwrap();
        }
        let message = run(&folder.join("tickbus")).unwrap_err();
        std::fs::remove_dir_all(&folder).unwrap();
        (message, library.display().to_string())
    }

    #[test]
    fn a_command_without_the_library_says_what_to_copy() {
        let (message, library) = said("alone", None);
        let expected = format!("{library} is missing: the command needs the native library");
        assert!(message.starts_with(&expected), "{message}");
        assert!(message.contains("copy both"), "{message}");
    }

    #[test]
    fn a_library_that_is_none_is_named_with_the_cure() {
        let (message, library) = said("with a text", Some(b"no library"));
        let expected = format!("{library} cannot be used: ");
        assert!(message.starts_with(&expected), "{message}");
        assert!(
            message.ends_with("from one release for this platform"),
            "{message}"
        );
    }
}
