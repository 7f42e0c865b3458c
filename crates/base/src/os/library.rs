//! Shared libraries.

#![allow(unsafe_code, reason = "foreign code is loaded")]

use std::path::Path;

use libloading::Library as Loaded;

/// A shared library, loaded into this process; dropping it takes it out again.
#[derive(Debug)]
pub struct Library(Loaded);

impl Library {
    /// Loads the library at `path`. Its initialisers run: whoever names the path vouches for them, as for
    /// any program that they start. Every symbol that it needs is looked up at once, so that one that is
    /// missing is an error here, not a crash later; its own are offered to no other library.
    ///
    /// # Errors
    ///
    /// What the system's loader says, in one line.
    pub fn load(path: &Path) -> Result<Self, String> {
        open(path).map(Self).map_err(|error| words(&error))
    }

    /// What stands under an exported symbol: a function, or the address of a variable. It is good as long
    /// as the library is loaded.
    ///
    /// # Errors
    ///
    /// There is no such symbol, in the loader's words.
    ///
    /// # Safety
    ///
    /// `T` is a pointer or a function pointer, of the type that the library has under this name.
    pub unsafe fn symbol<T: Copy>(&self, name: &str) -> Result<T, String> {
        // SAFETY: the caller answers for the type.
        let found = unsafe { self.0.get::<T>(name) };
        found.map(|found| *found).map_err(|error| words(&error))
    }

    /// Whether it exports this symbol.
    pub fn has(&self, name: &str) -> bool {
        // SAFETY: any symbol is an address, and nothing is done with it.
        unsafe { self.symbol::<*const ()>(name) }.is_ok()
    }
}

#[cfg(unix)]
fn open(path: &Path) -> Result<Loaded, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: the initialisers of the library run, and its finalisers when it is dropped. They are foreign
    // code, which nobody can check here; `load` says who vouches for them.
    unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(Into::into)
}

#[cfg(windows)]
fn open(path: &Path) -> Result<Loaded, libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library};
    // SAFETY: as on other systems. The libraries that it needs itself may lie beside it.
    unsafe { Library::load_with_flags(path, LOAD_WITH_ALTERED_SEARCH_PATH) }.map(Into::into)
}

fn words(error: &libloading::Error) -> String {
    // On some systems the words stand in the source alone.
    let text =
        std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string);
    one_line(&text)
}

/// A text with its line breaks and other control characters as spaces: that of a panic or of a library often
/// has some.
pub fn one_line(text: &str) -> String {
    let words = text.split(|c: char| c.is_whitespace() || c.is_control());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loader_s_own_words_tell_why_a_file_is_no_library() {
        let error = Library::load(Path::new("/no/such/library")).expect_err("refused");
        assert!(error.contains("/no/such/library"), "{error}");
        assert!(!error.contains('\n'), "{error}");
    }
}
