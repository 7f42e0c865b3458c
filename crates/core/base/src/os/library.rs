//! Shared libraries.

#![allow(unsafe_code, reason = "foreign code is loaded")]

use std::path::Path;

use libloading::Library as Loaded;

use crate::Mistake;

/// A shared library, loaded into this process; dropping it unloads it.
#[derive(Debug)]
pub struct Library(Loaded);

impl Library {
    /// Loads the library at `path`; the system searches for a name without a folder. The library's initialisers run:
    /// the caller vouches for the file, as for any program that it starts. All imported symbols are resolved at once,
    /// so that a missing one is an error here and not a crash later; the exports are not visible to other libraries.
    ///
    /// # Errors
    ///
    /// The message of the system's loader, as one line.
    pub fn load(path: &Path) -> Result<Self, String> {
        open(path).map(Self).map_err(|error| {
            let words = words(&error);
            // Windows does not say which file.
            let shown = path.display().to_string();
            if words.contains(&shown) {
                return words;
            }
            format!("{shown}: {words}")
        })
    }

    /// The value of an exported symbol: a function, or the address of a variable. It is valid as long as the
    /// library is loaded.
    ///
    /// # Errors
    ///
    /// There is no such symbol; the message is the loader's.
    ///
    /// # Safety
    ///
    /// `T` must be a pointer or function pointer of the type that the library declares under this name.
    pub unsafe fn symbol<T: Copy>(&self, name: &str) -> Result<T, String> {
        // SAFETY: the caller answers for the type.
        let found = unsafe { self.0.get::<T>(name) };
        found.map(|found| *found).map_err(|error| words(&error))
    }

    /// The function of a vendor's library under one of these names, for [`vendor_functions!`](crate::vendor_functions).
    ///
    /// # Errors
    ///
    /// The library exports none of these names: the message has the first one, and the remedy.
    ///
    /// # Safety
    ///
    /// As [`symbol`](Self::symbol), for each name.
    pub unsafe fn function<T: Copy>(&self, names: &[&str]) -> Result<T, Mistake> {
        // SAFETY: the caller answers for the type.
        let mut found = names.iter().map(|name| unsafe { self.symbol::<T>(name) });
        found.find_map(Result::ok).ok_or_else(|| {
            Mistake::new(
                format!("it does not export {}", names[0]),
                "name the vendor's own library in `library`, in a version for this program's system and word size",
            )
        })
    }

    /// True if the library exports this symbol.
    pub fn has(&self, name: &str) -> bool {
        // SAFETY: any symbol is an address, and nothing is done with it.
        unsafe { self.symbol::<*const ()>(name) }.is_ok()
    }
}

/// Declares a struct of the functions of a vendor's library, with `load`, which finds all of them; further names of a
/// function are tried in their order. The struct keeps the library loaded.
///
/// The file that uses the macro answers for the types, so it must be one that may have unsafe code.
#[macro_export]
macro_rules! vendor_functions {
    ($(#[$doc:meta])* struct $name:ident { $($field:ident: $type:ty = $($symbol:literal)or+,)+ }) => {
        $(#[$doc])*
        #[derive(Debug)]
        struct $name {
            $($field: $type,)+
            #[expect(dead_code, reason = "kept loaded for its functions")]
            loaded: $crate::os::Library,
        }

        impl $name {
            /// Loads the library at `path`.
            fn load(path: &std::path::Path) -> Result<Self, $crate::Mistake> {
                let loaded = $crate::os::Library::load(path).map_err(|error| {
                    $crate::Mistake::new(
                        format!("it cannot be loaded: {error}"),
                        "install the vendor's driver, or name its library in `library`; check that it is made for \
                         this system, and that the libraries it needs are there",
                    )
                })?;
                Ok(Self {
                    // SAFETY: the types are those of the vendor's header, and the struct keeps the library loaded.
                    $($field: unsafe { loaded.function(&[$($symbol),+]) }?,)+
                    loaded,
                })
            }
        }
    };
}

#[cfg(unix)]
fn open(path: &Path) -> Result<Loaded, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: the initialisers of the library run now, its finalisers when it is dropped. They are foreign
    // code, which cannot be checked here; the caller of `load` vouches for them.
    unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(Into::into)
}

#[cfg(windows)]
fn open(path: &Path) -> Result<Loaded, libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library};
    // Imported libraries are also searched for in the library's own folder; a name without a folder is searched for.
    let flags = if path.is_absolute() {
        LOAD_WITH_ALTERED_SEARCH_PATH
    } else {
        0
    };
    // SAFETY: as on other systems.
    unsafe { Library::load_with_flags(path, flags) }.map(Into::into)
}

fn words(error: &libloading::Error) -> String {
    // On some systems only the source error has the loader's message.
    let text =
        std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string);
    one_line(&text)
}

/// `text` with line breaks and other control characters replaced by spaces: messages of panics and of
/// libraries often contain some.
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

    #[cfg(target_os = "linux")]
    #[test]
    fn a_function_is_found_by_any_of_its_names_in_a_library_that_the_system_finds() {
        let library = Library::load(Path::new("libc.so.6")).expect("it is there");
        // SAFETY: nothing is done with the addresses.
        let [other, none] = [&["_getpid@0", "getpid"][..], &["_getpid@0"]]
            .map(|names| unsafe { library.function::<*const ()>(names) });
        assert!(other.is_ok());
        let right = "name the vendor's own library in `library`, in a version for this program's system and word size";
        let mistake = Mistake::new("it does not export _getpid@0", right);
        assert_eq!(none, Err(mistake));
    }
}
