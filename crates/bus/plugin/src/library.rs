//! A vendor's shared library behind safe functions.
//!
//! This is the only place where the plug-in bus calls foreign code. Everything that can be checked is checked here: the
//! symbols, the version, the return codes, the texts, and the bytes after `out`. For everything else (such as damage to
//! the rest of the process) there is `isolated = true`.

#![allow(unsafe_code, reason = "a vendor's library is loaded and called")]

use std::ffi::{CString, c_char};
use std::path::Path;
use std::ptr::{NonNull, null_mut};

use super::abi;
use super::outcome::{Function, Outcome, failure};
use super::setup::Setup;
use tickbus_base::os::{self, one_line};
use tickbus_fieldbus::{BusError, Role};

/// Bytes after `out` that a library must not change.
const GUARD: usize = 256;

/// The longest text accepted from a library, in bytes.
const TEXT_LIMIT: usize = 1000;

// The five functions of the header.
type AbiVersion = unsafe extern "C" fn() -> u32;
type Open = unsafe extern "C" fn(*const abi::Config, *const abi::Layout, *mut *mut abi::Bus) -> i32;
type Exchange = unsafe extern "C" fn(*mut abi::Bus, *const u8, *mut u8, u32) -> i32;
type LastError = unsafe extern "C" fn(*mut abi::Bus) -> *const c_char;
type Close = unsafe extern "C" fn(*mut abi::Bus);

/// A loaded library and its functions, which are valid only while it is loaded.
#[derive(Debug)]
pub(super) struct Library {
    open: Open,
    exchange: Exchange,
    last_error: LastError,
    close: Close,
    name: String,
    #[expect(dead_code, reason = "kept loaded for its functions")]
    loaded: os::Library,
}

impl Library {
    /// Loads the library at `path` and looks up its functions.
    ///
    /// # Errors
    ///
    /// [`BusError::Link`] with the loader's message, or [`BusError::Protocol`] if it is not a plug-in, or one
    /// for another version.
    pub(super) fn load(path: &Path) -> Result<Self, BusError> {
        let name = path.file_name().unwrap_or(path.as_os_str());
        let name = name.to_string_lossy().into_owned();
        let loaded = os::Library::load(path).map_err(|error| {
            BusError::Link(format!(
                "{name} cannot be loaded: {error}; check that it is made for this system and that the \
                 libraries it needs are there"
            ))
        })?;
        let version: AbiVersion = symbol(&loaded, &name, "tickbus_abi_version")?;
        // SAFETY: the header declares this symbol with this type, and demands that it can be called first.
        let version = unsafe { version() };
        if version != abi::VERSION {
            return Err(BusError::Protocol(format!(
                "{name} is made for version {version} of the plug-in interface, this tickbus has version \
                 {}; rebuild it with the include/tickbus_fieldbus.h of this tickbus",
                abi::VERSION
            )));
        }
        Ok(Self {
            open: symbol(&loaded, &name, "tickbus_open")?,
            exchange: symbol(&loaded, &name, "tickbus_exchange")?,
            last_error: symbol(&loaded, &name, "tickbus_last_error")?,
            close: symbol(&loaded, &name, "tickbus_close")?,
            name,
            loaded,
        })
    }

    /// Opens a bus.
    ///
    /// # Errors
    ///
    /// The error that the library reports, by its code.
    pub(super) fn open(&self, setup: &Setup) -> Result<Bus<'_>, BusError> {
        let texts = Texts::new(setup);
        let options = texts.options();
        let option_pointers: Vec<*const abi::Option> =
            options.iter().map(std::ptr::from_ref).collect();
        let stations = texts.stations(setup);
        let station_pointers: Vec<*const abi::Station> =
            stations.iter().map(std::ptr::from_ref).collect();
        let config = abi::Config {
            size: abi::size_of::<abi::Config>(),
            role: match setup.role {
                Role::Device | Role::Observer => abi::ROLE_DEVICE,
                Role::Controller => abi::ROLE_CONTROLLER,
            },
            name: texts.name.as_ptr(),
            directory: texts.directory.as_ptr(),
            options: option_pointers.as_ptr(),
            option_count: count(options.len()),
            timeout_ms: setup.timeout_ms,
            cycle_ns: setup.cycle_ns,
            max_age_ns: setup.max_age_ns,
        };
        let layout = abi::Layout {
            size: abi::size_of::<abi::Layout>(),
            in_size: count(setup.tx()),
            out_size: count(setup.rx()),
            station_count: count(stations.len()),
            stations: station_pointers.as_ptr(),
        };
        let mut bus = null_mut();
        // SAFETY: the function is of the library that `self` keeps loaded, and has this type by the header.
        // Both structs and all that they point to live until it returns, and it may keep none of it.
        let code = unsafe { (self.open)(&raw const config, &raw const layout, &raw mut bus) };
        if code != abi::OK {
            let text = self.last_error(null_mut());
            return Err(failure(&self.name, Function::Open, code, text.as_deref()));
        }
        let handle = NonNull::new(bus).ok_or_else(|| {
            BusError::Protocol(format!(
                "{}: tickbus_open returned TICKBUS_OK and no bus; this is a mistake of the library",
                self.name
            ))
        })?;
        Ok(Bus {
            library: self,
            handle,
            // At least one byte, so that the pointer is valid even if there is nothing to send.
            input: vec![0; setup.tx().max(1)].into(),
            tx: setup.tx(),
            output: (0..setup.rx())
                .map(|_| 0)
                .chain((0..GUARD).map(guard))
                .collect(),
            rx: setup.rx(),
        })
    }

    /// The text of the last error, copied.
    fn last_error(&self, bus: *mut abi::Bus) -> Option<String> {
        // SAFETY: as for `open`; `bus` is one that the library gave and that is not closed, or null after
        // an open that failed, as the header allows.
        let text = unsafe { (self.last_error)(bus) };
        let text = NonNull::new(text.cast_mut())?;
        let mut bytes = Vec::new();
        for at in 0..TEXT_LIMIT {
            // SAFETY: the header demands a text that ends with a 0 byte and stays until the next call; the
            // bytes up to and including the first 0 are read, one by one, and none behind it.
            let byte = unsafe { text.add(at).read() };
            if byte == 0 {
                break;
            }
            let [byte] = byte.to_ne_bytes();
            bytes.push(byte);
        }
        let text = one_line(&String::from_utf8_lossy(&bytes));
        (!text.is_empty()).then_some(text)
    }
}

/// A function of the library, with the type declared by the header.
fn symbol<T: Copy>(library: &os::Library, name: &str, symbol: &str) -> Result<T, BusError> {
    // SAFETY: `T` is the type of the mirror in `abi`, which a test compares with the header, for this
    // symbol. The caller keeps the library together with the function.
    let found = unsafe { library.symbol::<T>(symbol) };
    found.map_err(|error| {
        BusError::Protocol(format!(
            "{name} does not export {symbol} ({error}); a plug-in exports the five functions of \
             include/tickbus_fieldbus.h"
        ))
    })
}

/// An open bus; dropping it closes it.
#[derive(Debug)]
pub(super) struct Bus<'l> {
    library: &'l Library,
    handle: NonNull<abi::Bus>,
    input: Box<[u8]>,
    tx: usize,
    /// The buffer that the library fills, and the guard behind it.
    output: Box<[u8]>,
    rx: usize,
}

impl Bus<'_> {
    /// The bytes to send in the next exchange.
    pub(super) fn input(&mut self) -> &mut [u8] {
        &mut self.input[..self.tx]
    }

    /// The bytes received by the last exchange, if its outcome was fresh.
    pub(super) fn output(&self) -> &[u8] {
        &self.output[..self.rx]
    }

    /// Performs one bus cycle.
    ///
    /// # Errors
    ///
    /// The error that the library reports, by its code, or a violation of the interface.
    pub(super) fn exchange(&mut self, timeout_ms: u32) -> Result<Outcome, BusError> {
        let (input, output) = (self.input.as_ptr(), self.output.as_mut_ptr());
        // SAFETY: the function is of the library that `self.library` keeps loaded, with the type of the header;
        // the bus is one that it gave and that is not closed. `input` has `in_size` bytes to read, `output`
        // has `out_size` bytes to write and the guard behind; both live until it returns.
        let code =
            unsafe { (self.library.exchange)(self.handle.as_ptr(), input, output, timeout_ms) };
        self.check_guard()?;
        Outcome::from_code(code).ok_or_else(|| {
            let text = (code < 0).then(|| self.library.last_error(self.handle.as_ptr()));
            let text = text.flatten();
            failure(
                &self.library.name,
                Function::Exchange,
                code,
                text.as_deref(),
            )
        })
    }

    /// Checks that the bytes after `out` are unchanged, and restores them, so that the next exchange is checked on its
    /// own.
    fn check_guard(&mut self) -> Result<(), BusError> {
        let behind = &mut self.output[self.rx..];
        let last = behind
            .iter()
            .enumerate()
            .rposition(|(at, byte)| *byte != guard(at));
        let Some(last) = last else {
            return Ok(());
        };
        for (at, byte) in behind.iter_mut().enumerate() {
            *byte = guard(at);
        }
        Err(BusError::Protocol(format!(
            "{}: tickbus_exchange wrote at least {} bytes behind the {} bytes of `out`; this is a mistake of \
             the library, and the process may be damaged: tell its maker, and use isolated = true meanwhile",
            self.library.name,
            last + 1,
            self.rx
        )))
    }
}

impl Drop for Bus<'_> {
    fn drop(&mut self) {
        // SAFETY: as for `exchange`; nobody has the bus after this.
        unsafe { (self.library.close)(self.handle.as_ptr()) };
    }
}

/// Byte `at` of the guard: adjacent bytes differ, so that no constant fill looks like it.
fn guard(at: usize) -> u8 {
    u8::try_from((at * 37 + 0xA5) % 251).expect("below 251")
}

fn count(number: usize) -> u32 {
    u32::try_from(number).expect("an image is far below 4 GiB")
}

/// The texts of a setup as C strings.
struct Texts {
    name: CString,
    directory: CString,
    options: Vec<(CString, CString)>,
    stations: Vec<CString>,
}

impl Texts {
    fn new(setup: &Setup) -> Self {
        let c = |text: &str| {
            // NUL characters were refused when the driver.cfg was read.
            CString::new(text.replace('\0', "")).expect("no NUL is left")
        };
        Self {
            name: c(&setup.name),
            directory: c(&setup.directory),
            options: setup
                .options
                .iter()
                .map(|(key, value)| (c(key), c(value)))
                .collect(),
            stations: setup
                .stations
                .iter()
                .map(|station| c(&station.name))
                .collect(),
        }
    }

    fn options(&self) -> Vec<abi::Option> {
        let pointer = |text: &CString| -> *const c_char { text.as_ptr() };
        self.options
            .iter()
            .map(|(key, value)| abi::Option {
                size: abi::size_of::<abi::Option>(),
                key: pointer(key),
                value: pointer(value),
            })
            .collect()
    }

    fn stations(&self, setup: &Setup) -> Vec<abi::Station> {
        let (mut in_offset, mut out_offset) = (0, 0);
        let mut stations = Vec::new();
        for (station, name) in setup.stations.iter().zip(&self.stations) {
            stations.push(abi::Station {
                size: abi::size_of::<abi::Station>(),
                in_offset,
                in_size: station.tx,
                out_offset,
                out_size: station.rx,
                name: name.as_ptr(),
            });
            in_offset += station.tx;
            out_offset += station.rx;
        }
        stations
    }
}

#[cfg(all(test, unix, not(no_cc)))]
mod tests {
    use super::*;
    use crate::Station;
    use std::path::PathBuf;
    use std::process::Command;

    /// A folder that contains the misbehaving plug-in.
    struct Plugin(tempfile::TempDir);

    impl Plugin {
        fn build(switches: &[&str]) -> Self {
            let folder = tempfile::tempdir().expect("a folder");
            let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../.."));
            let built = Command::new("cc")
                .args([
                    "-std=c99", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared",
                ])
                .args(switches)
                .arg("-I")
                .arg(root.join("include"))
                .arg("-o")
                .arg(folder.path().join("libx.so"))
                .arg(root.join("tests/plugins/misbehave.c"))
                .status();
            assert!(built.expect("cc runs").success());
            Self(folder)
        }

        fn path(&self) -> PathBuf {
            self.0.path().join("libx.so")
        }

        fn load(&self) -> Library {
            Library::load(&self.path()).expect("loads")
        }

        fn setup(&self, options: &[(&str, &str)]) -> Setup {
            let options = options.iter();
            Setup {
                library: self.path().into(),
                name: "Cell".to_owned(),
                directory: "/opt".to_owned(),
                role: Role::Controller,
                options: options
                    .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
                    .collect(),
                stations: vec![
                    Station {
                        name: "left".to_owned(),
                        tx: 2,
                        rx: 3,
                    },
                    Station {
                        name: "right".to_owned(),
                        tx: 1,
                        rx: 1,
                    },
                ],
                timeout_ms: 10,
                cycle_ns: 2_000_000,
                max_age_ns: 250_000_000,
            }
        }
    }

    #[test]
    fn a_good_library_opens_and_exchanges() {
        let plugin = Plugin::build(&[]);
        let library = plugin.load();
        let mut bus = library.open(&plugin.setup(&[])).expect("opens");
        for round in 0..3 {
            bus.input().copy_from_slice(&[1, 2, round]);
            let outcome = bus.exchange(10).expect("exchanges");
            assert!(outcome.is_taken() && outcome.is_fresh());
            assert_eq!(bus.output(), [1, 2, round, 0]);
        }
    }

    #[test]
    fn the_library_is_told_everything() {
        let plugin = Plugin::build(&[]);
        let library = plugin.load();
        let error = library.open(&plugin.setup(&[("tell", "ä 1")]));
        let told = "libx.so: Cell ä 1 role 1, 10 ms, 2000000 ns, 2 stations, right: 2+1 3+1 of 3 4";
        assert_eq!(error.err(), Some(BusError::Refused(told.to_owned())));
    }

    #[test]
    fn what_is_no_plug_in_is_refused_with_what_it_lacks() {
        let error = |plugin: &Plugin| {
            Library::load(&plugin.path())
                .expect_err("no plug-in")
                .to_string()
        };
        let version = error(&Plugin::build(&["-DVERSION=7"]));
        assert!(
            version.contains("libx.so is made for version 7 of the plug-in interface"),
            "{version}"
        );
        let without = error(&Plugin::build(&["-DWITHOUT_EXCHANGE"]));
        assert!(
            without.contains("does not export tickbus_exchange"),
            "{without}"
        );
        let unresolved = error(&Plugin::build(&["-DUNRESOLVED"]));
        assert!(unresolved.contains("nobody_has_this"), "{unresolved}");
        let text = Plugin::build(&[]);
        std::fs::write(text.path(), "no library").expect("written");
        assert!(error(&text).contains("cannot be loaded: "));
    }

    #[test]
    fn writing_behind_out_is_found_and_the_next_exchange_is_judged_for_itself() {
        let plugin = Plugin::build(&[]);
        let library = plugin.load();
        for bytes in ["1", "256"] {
            let options = [("exchange", "beyond"), ("bytes", bytes), ("good", "1")];
            let mut bus = library.open(&plugin.setup(&options)).expect("opens");
            bus.exchange(10).expect("a good one");
            let error = bus.exchange(10).expect_err("found");
            let said = format!("wrote at least {bytes} bytes behind the 4 bytes of `out`");
            assert!(
                matches!(&error, BusError::Protocol(text) if text.contains(&said)),
                "{error}"
            );
        }
    }

    #[test]
    fn a_bus_that_is_none_is_a_mistake_of_the_library() {
        let plugin = Plugin::build(&[]);
        let library = plugin.load();
        let error = library.open(&plugin.setup(&[("open", "no-bus")]));
        assert!(matches!(error, Err(BusError::Protocol(text)) if text.contains("no bus")));
    }

    #[test]
    fn texts_of_any_kind_are_told_in_one_line() {
        let plugin = Plugin::build(&[]);
        let library = plugin.load();
        let told = |text| {
            let options = [("exchange", "link"), ("text", text)];
            let mut bus = library.open(&plugin.setup(&options)).expect("opens");
            bus.exchange(10).expect_err("fails").to_string()
        };
        assert_eq!(told("no cable"), "the link failed: libx.so: no cable");
        let silent = "the link failed: libx.so: tickbus_exchange returned TICKBUS_E_LINK (-1) and gave no reason; \
                      check card, cable and peer";
        assert_eq!(told("null"), silent);
        assert_eq!(told("empty"), silent);
        assert_eq!(
            told("invalid"),
            "the link failed: libx.so: caf\u{FFFD} \u{FFFD}\u{FFFD} card 3"
        );
        assert_eq!(
            told("lines"),
            "the link failed: libx.so: first second [31m third"
        );
        assert_eq!(
            told("long").len(),
            "the link failed: libx.so: ".len() + TEXT_LIMIT
        );
    }
}
