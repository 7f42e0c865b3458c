//! The library of a foreign FMU: its functions, and the calls of them. The methods of an instance are safe to call in
//! any order. Whether the FMU can cope with that order is up to the FMU; a helper process contains the damage.

#![allow(unsafe_code, reason = "foreign functions are called")]

mod events;
mod functions;
mod journal;

use std::collections::BTreeSet;
use std::ffi::{CString, OsString, c_char, c_int, c_void};
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tickbus_base::os::Library;

use crate::value::{Number, Status, Value, ValueType, Version};
use events::EventFunctions;
pub(super) use events::Interval;
use functions::{
    Callbacks, Functions, GetThree, GetTwo, Handle, Plain, SetThree, SetTwo, Three, Two,
};
use journal::{Journal, log_of_three, log_of_two};

unsafe extern "C" {
    // Functions that `fmi2CallbackFunctions` must contain.
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// The result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StepEnd {
    pub(super) status: Status,
    /// True if the FMU asks to end the run.
    pub(super) terminate: bool,
    /// True if the FMU asks for its event mode.
    pub(super) event: bool,
    /// The time that the FMU reached, in seconds, if it reports one.
    pub(super) reached: Option<f64>,
}

/// Identifies an FMU, wherever it was unpacked: its token, and the name of its library.
type Identity = (String, OsString);

/// The FMUs that have returned "fatal" in this process. The standards forbid any further call of them, in any instance.
/// Their libraries stay loaded, since unloading a library runs its finalisers.
static DEAD: Mutex<BTreeSet<Identity>> = Mutex::new(BTreeSet::new());

fn dead() -> MutexGuard<'static, BTreeSet<Identity>> {
    DEAD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One instance of an FMU, with its library.
#[derive(Debug)]
pub(super) struct Instance {
    handle: Handle,
    functions: Functions,
    /// The functions of the event mode, if it is used.
    events: Option<EventFunctions>,
    /// True once the FMU has returned "fatal".
    is_dead: bool,
    identity: Identity,
    /// `Some` until the instance is dropped.
    kept: Option<Kept>,
}

/// The parts that must exist as long as the FMU can use them.
#[derive(Debug)]
struct Kept {
    /// Dropped before the fields below, which the library's finalisers may still use for logging.
    library: Library,
    journal: Journal,
    /// Never moved: the FMU may keep its address.
    _callbacks: Option<Box<Callbacks>>,
}

impl Instance {
    /// Loads the library and creates an instance. `file` is the FMU's name in messages. `has_events`: its event mode is
    /// used.
    pub(super) fn new(
        (file, name, token): (&str, &str, &str),
        (version, has_events): (Version, bool),
        library: &Path,
        resources: &Path,
    ) -> Result<Self, String> {
        let own_name = library.file_name().unwrap_or_default();
        let identity = (token.to_owned(), own_name.to_owned());
        if dead().contains(&identity) {
            return Err("an earlier run of it in this process has failed for good (fatal), and it must not be called any more; \
                        give each run a process of its own (isolated = true)".to_owned());
        }
        let loaded = Library::load(library).map_err(|error| {
            format!("its library cannot be loaded: {error}; install what it needs, which its documentation should tell")
        })?;
        let functions = match version {
            Version::Two => Functions::Two(Two::load(&loaded)?),
            Version::Three => Functions::Three(Box::new(Three::load(&loaded)?)),
        };
        let events = has_events.then(|| EventFunctions::load(&loaded));
        let events = events.transpose()?;
        let journal = Journal::of(file);
        journal.begin_call();
        let env = journal.env();
        let (name, token) = (c_string(name), c_string(token));
        let mut callbacks = None;
        let handle = match &functions {
            Functions::Two(two) => {
                let uri = c_string(&uri_of(resources));
                let callbacks = callbacks.insert(Box::new(Callbacks {
                    logger: log_of_two,
                    allocate: calloc,
                    release: free,
                    step_finished: null(),
                    env,
                }));
                // SAFETY: by the standard. All texts outlive the call, and the callbacks outlive the instance.
                unsafe {
                    (two.instantiate)(
                        name.as_ptr(),
                        1,
                        token.as_ptr(),
                        uri.as_ptr(),
                        &raw const **callbacks,
                        0,
                        0,
                    )
                }
            }
            Functions::Three(three) => {
                // The standard requires a separator at the end.
                let path = resources.join("");
                let path = c_string(&path.to_string_lossy());
                // SAFETY: as above.
                unsafe {
                    (three.instantiate)(
                        name.as_ptr(),
                        token.as_ptr(),
                        path.as_ptr(),
                        false,
                        false,
                        has_events,
                        // It returns early for its events.
                        has_events,
                        null(),
                        0,
                        env,
                        log_of_three,
                        null(),
                    )
                }
            }
        };
        let instance = Self {
            handle,
            functions,
            events,
            is_dead: false,
            identity,
            kept: Some(Kept {
                library: loaded,
                journal,
                _callbacks: callbacks,
            }),
        };
        if handle.is_null() {
            return Err(instance.said("it makes no instance of itself"));
        }
        Ok(instance)
    }

    /// Returns a sentence, extended by the FMU's message during its last call.
    pub(super) fn said(&self, what: &str) -> String {
        let kept = self.kept.as_ref();
        let last = kept.map_or_else(String::new, |kept| kept.journal.said());
        if last.is_empty() {
            format!("{what}, and does not say why; ask whoever made it")
        } else {
            format!("{what}; it says: {last}")
        }
    }

    /// Notes that a call is about to begin.
    fn begin_call(&self) {
        if let Some(kept) = &self.kept {
            kept.journal.begin_call();
        }
    }

    fn noted(&mut self, status: c_int) -> Status {
        let status = Status::of(status);
        self.is_dead |= status == Status::Fatal;
        status
    }

    /// Enters the initialisation of a run that begins at `start` seconds and ends at `stop`, if that is known.
    pub(super) fn enter(
        &mut self,
        start: f64,
        tolerance: Option<f64>,
        stop: Option<f64>,
    ) -> Status {
        self.begin_call();
        let (has_tolerance, tolerance) = (tolerance.is_some(), tolerance.unwrap_or(0.0));
        let (has_stop, stop) = (stop.is_some(), stop.unwrap_or(0.0));
        let status = match &self.functions {
            // SAFETY: the handle belongs to this library and is alive, here and below.
            Functions::Two(two) => unsafe {
                let status = (two.setup)(
                    self.handle,
                    has_tolerance.into(),
                    tolerance,
                    start,
                    has_stop.into(),
                    stop,
                );
                if status > Status::Warning as c_int {
                    status
                } else {
                    (two.enter)(self.handle)
                }
            },
            // SAFETY: as above.
            Functions::Three(three) => unsafe {
                (three.enter)(self.handle, has_tolerance, tolerance, start, has_stop, stop)
            },
        };
        self.noted(status)
    }

    /// Leaves the initialisation.
    pub(super) fn exit(&mut self) -> Status {
        self.begin_call();
        let status = match &self.functions {
            // SAFETY: as in `enter`.
            Functions::Two(two) => unsafe { (two.exit)(self.handle) },
            // SAFETY: as above.
            Functions::Three(three) => unsafe { (three.exit)(self.handle) },
        };
        self.noted(status)
    }

    /// Ends the run.
    pub(super) fn terminate(&mut self) -> Status {
        self.begin_call();
        let status = match &self.functions {
            // SAFETY: as in `enter`.
            Functions::Two(two) => unsafe { (two.terminate)(self.handle) },
            // SAFETY: as above.
            Functions::Three(three) => unsafe { (three.terminate)(self.handle) },
        };
        self.noted(status)
    }

    /// Does one step.
    pub(super) fn step(&mut self, from: f64, length: f64) -> StepEnd {
        self.begin_call();
        let (mut terminate, mut reached, mut needs_event) = (false, None, false);
        let status = match &self.functions {
            Functions::Two(two) => {
                // SAFETY: as in `enter`.
                let status = unsafe { (two.step)(self.handle, from, length, 1) };
                if status == Status::Discard as c_int {
                    let (mut ended, mut last) = (0, from);
                    // SAFETY: as above; 3 is fmi2Terminated.
                    let known = unsafe { (two.boolean_status)(self.handle, 3, &raw mut ended) };
                    terminate = known == 0 && ended != 0;
                    let known = if known == Status::Fatal as c_int {
                        known
                    } else {
                        // SAFETY: as above; 2 is fmi2LastSuccessfulTime.
                        unsafe { (two.real_status)(self.handle, 2, &raw mut last) }
                    };
                    reached = (known == 0).then_some(last);
                    // After "fatal" no call is allowed any more, whatever the result of the step.
                    if known == Status::Fatal as c_int {
                        known
                    } else {
                        status
                    }
                } else {
                    status
                }
            }
            Functions::Three(three) => {
                let (mut event, mut early, mut last) = (0_u8, 0_u8, from);
                let mut ends = 0_u8;
                // SAFETY: as in `enter`. The FMU may return values other than 0 and 1, which a Rust `bool` must not
                // have, so they are read as bytes.
                let status = unsafe {
                    (three.step)(
                        self.handle,
                        from,
                        length,
                        true,
                        (&raw mut event).cast(),
                        (&raw mut ends).cast(),
                        (&raw mut early).cast(),
                        &raw mut last,
                    )
                };
                terminate = ends != 0;
                needs_event = event != 0;
                reached = (status == Status::Discard as c_int || early != 0).then_some(last);
                status
            }
        };
        StepEnd {
            status: self.noted(status),
            terminate,
            event: needs_event,
            reached,
        }
    }

    /// Enters or leaves the configuration mode, in which structural parameters are set.
    ///
    /// # Errors
    ///
    /// The library has no function for that.
    pub(super) fn configure(&mut self, enters: bool) -> Result<Status, String> {
        self.begin_call();
        let library = &self.kept.as_ref().expect("it is alive").library;
        let name = if enters {
            "fmi3EnterConfigurationMode"
        } else {
            "fmi3ExitConfigurationMode"
        };
        // SAFETY: the type is that of the standard's header.
        let function = unsafe { library.symbol::<Plain>(name) };
        let function = function.map_err(|_| {
            format!(
                "its library has no function {name}, so its structural parameters cannot be set"
            )
        })?;
        // SAFETY: as in `enter`.
        let status = unsafe { function(self.handle) };
        Ok(self.noted(status))
    }

    /// Sets variables of one type. An array is one reference with several values.
    pub(super) fn set(&mut self, kind: ValueType, references: &[u32], values: &[Value]) -> Status {
        self.begin_call();
        let status = match &self.functions {
            Functions::Two(two) => match kind {
                ValueType::Boolean => self.set_two(two.set_boolean, references, values, |value| {
                    bool::of(value).into()
                }),
                ValueType::Int32 => self.set_two(two.set_integer, references, values, i32::of),
                _ => self.set_two(two.set_real, references, values, f64::of),
            },
            Functions::Three(three) => match kind {
                ValueType::Float32 => self.set_three(three.set_f32, references, values, f32::of),
                ValueType::Float64 | ValueType::String => {
                    self.set_three(three.set_f64, references, values, f64::of)
                }
                ValueType::Int8 => self.set_three(three.set_i8, references, values, i8::of),
                ValueType::UInt8 => self.set_three(three.set_u8, references, values, u8::of),
                ValueType::Int16 => self.set_three(three.set_i16, references, values, i16::of),
                ValueType::UInt16 => self.set_three(three.set_u16, references, values, u16::of),
                ValueType::Int32 => self.set_three(three.set_i32, references, values, i32::of),
                ValueType::UInt32 => self.set_three(three.set_u32, references, values, u32::of),
                ValueType::Int64 => self.set_three(three.set_i64, references, values, i64::of),
                ValueType::UInt64 => self.set_three(three.set_u64, references, values, u64::of),
                ValueType::Boolean => {
                    self.set_three(three.set_boolean, references, values, |value| {
                        bool::of(value).into()
                    })
                }
            },
        };
        self.noted(status)
    }

    /// Sets a variable of type String.
    ///
    /// # Errors
    ///
    /// The library has no function for that.
    pub(super) fn set_text(&mut self, reference: u32, text: &str) -> Result<Status, String> {
        self.begin_call();
        let text = c_string(text);
        let texts = [text.as_ptr()];
        let library = &self.kept.as_ref().expect("it is alive").library;
        let missing = |_| {
            "its library has no function for texts; export it again, or tell its maker".to_owned()
        };
        let status = match &self.functions {
            Functions::Two(_) => {
                // SAFETY: the type is that of the standard's header, here and below.
                let function = unsafe { library.symbol::<SetTwo<*const c_char>>("fmi2SetString") };
                // SAFETY: as in `enter`; the lists have one value and outlive the call.
                unsafe {
                    function.map_err(missing)?(self.handle, &raw const reference, 1, texts.as_ptr())
                }
            }
            Functions::Three(_) => {
                // SAFETY: as above.
                let function =
                    unsafe { library.symbol::<SetThree<*const c_char>>("fmi3SetString") };
                // SAFETY: as above.
                unsafe {
                    function.map_err(missing)?(
                        self.handle,
                        &raw const reference,
                        1,
                        texts.as_ptr(),
                        1,
                    )
                }
            }
        };
        Ok(self.noted(status))
    }

    fn set_two<T>(
        &self,
        function: SetTwo<T>,
        references: &[u32],
        values: &[Value],
        of: fn(Value) -> T,
    ) -> c_int {
        let values: Vec<T> = values.iter().map(|value| of(*value)).collect();
        // SAFETY: as in `enter`; both lists have as many values as the call states, and outlive the call.
        unsafe {
            function(
                self.handle,
                references.as_ptr(),
                references.len(),
                values.as_ptr(),
            )
        }
    }

    fn set_three<T>(
        &self,
        function: SetThree<T>,
        references: &[u32],
        values: &[Value],
        of: fn(Value) -> T,
    ) -> c_int {
        let values: Vec<T> = values.iter().map(|value| of(*value)).collect();
        // SAFETY: as above.
        unsafe {
            function(
                self.handle,
                references.as_ptr(),
                references.len(),
                values.as_ptr(),
                values.len(),
            )
        }
    }

    /// Gets variables of one type, as in [`set`](Self::set).
    pub(super) fn get(
        &mut self,
        kind: ValueType,
        references: &[u32],
        values: &mut [Value],
    ) -> Status {
        self.begin_call();
        let status = match &self.functions {
            Functions::Two(two) => match kind {
                ValueType::Boolean => self.get_two(two.get_boolean, references, values, |value| {
                    Value::Boolean(value != 0)
                }),
                ValueType::Int32 => {
                    self.get_two(two.get_integer, references, values, Number::value)
                }
                _ => self.get_two(two.get_real, references, values, Number::value),
            },
            Functions::Three(three) => match kind {
                ValueType::Float32 => {
                    self.get_three(three.get_f32, references, values, Number::value)
                }
                ValueType::Float64 | ValueType::String => {
                    self.get_three(three.get_f64, references, values, Number::value)
                }
                ValueType::Int8 => self.get_three(three.get_i8, references, values, Number::value),
                ValueType::UInt8 => self.get_three(three.get_u8, references, values, Number::value),
                ValueType::Int16 => {
                    self.get_three(three.get_i16, references, values, Number::value)
                }
                ValueType::UInt16 => {
                    self.get_three(three.get_u16, references, values, Number::value)
                }
                ValueType::Int32 => {
                    self.get_three(three.get_i32, references, values, Number::value)
                }
                ValueType::UInt32 => {
                    self.get_three(three.get_u32, references, values, Number::value)
                }
                ValueType::Int64 => {
                    self.get_three(three.get_i64, references, values, Number::value)
                }
                ValueType::UInt64 => {
                    self.get_three(three.get_u64, references, values, Number::value)
                }
                ValueType::Boolean => {
                    self.get_three(three.get_boolean, references, values, |value| {
                        Value::Boolean(value != 0)
                    })
                }
            },
        };
        self.noted(status)
    }

    fn get_two<T: Copy + Default>(
        &self,
        function: GetTwo<T>,
        references: &[u32],
        values: &mut [Value],
        to: fn(T) -> Value,
    ) -> c_int {
        let mut got = vec![T::default(); references.len()];
        // SAFETY: as in `set_two`.
        let status = unsafe {
            function(
                self.handle,
                references.as_ptr(),
                references.len(),
                got.as_mut_ptr(),
            )
        };
        for (value, got) in values.iter_mut().zip(got) {
            *value = to(got);
        }
        status
    }

    fn get_three<T: Copy + Default>(
        &self,
        function: GetThree<T>,
        references: &[u32],
        values: &mut [Value],
        to: fn(T) -> Value,
    ) -> c_int {
        let mut got = vec![T::default(); values.len()];
        // SAFETY: as above.
        let status = unsafe {
            function(
                self.handle,
                references.as_ptr(),
                references.len(),
                got.as_mut_ptr(),
                got.len(),
            )
        };
        for (value, got) in values.iter_mut().zip(got) {
            *value = to(got);
        }
        status
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.is_dead {
            dead().insert(std::mem::take(&mut self.identity));
            // The FMU's threads may still run and log.
            std::mem::forget(self.kept.take());
            return;
        }
        if self.handle.is_null() {
            return;
        }
        self.begin_call();
        // SAFETY: the handle belongs to this library, is alive, and is not used afterwards.
        unsafe {
            match &self.functions {
                Functions::Two(two) => (two.free)(self.handle),
                Functions::Three(three) => (three.free)(self.handle),
            }
        }
        self.handle = null_mut();
    }
}

fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// Returns the URI of a folder in the form that FMI 2.0 requires.
fn uri_of(folder: &Path) -> String {
    let path = folder.to_string_lossy().replace('\\', "/");
    let mut uri = String::from(if path.starts_with('/') {
        "file://"
    } else {
        "file:///"
    });
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"/-_.~:".contains(&byte) {
            uri.push(byte.into());
        } else {
            // Writing to a string cannot fail.
            let _ = std::fmt::Write::write_fmt(&mut uri, format_args!("%{byte:02X}"));
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::folder_of_uri;

    #[test]
    fn a_uri_leads_back_to_its_folder() {
        for folder in ["/tmp/a b/100%/ä#?", "/tmp/x"] {
            assert_eq!(folder_of_uri(&uri_of(Path::new(folder))), Path::new(folder));
        }
        assert_eq!(uri_of(Path::new("/tmp/a b")), "file:///tmp/a%20b");
    }
}
