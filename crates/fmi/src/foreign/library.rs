//! The library of somebody else's FMU: its functions, and the calls of them. What can be done with an instance is safe to call in
//! any order; whether the FMU bears it is its own affair, and a helper process keeps what it does to itself.

#![allow(unsafe_code, reason = "foreign functions are called")]

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use libloading::Library;
use tickbus_base::os::is_told;

use crate::value::{Number, Status, Value, ValueType, Version};

type Handle = *mut c_void;
type Plain = unsafe extern "C" fn(Handle) -> c_int;
type SetTwo<T> = unsafe extern "C" fn(Handle, *const u32, usize, *const T) -> c_int;
type GetTwo<T> = unsafe extern "C" fn(Handle, *const u32, usize, *mut T) -> c_int;
type SetThree<T> = unsafe extern "C" fn(Handle, *const u32, usize, *const T, usize) -> c_int;
type GetThree<T> = unsafe extern "C" fn(Handle, *const u32, usize, *mut T, usize) -> c_int;

unsafe extern "C" {
    // What `fmi2CallbackFunctions` has to have.
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// `fmi2CallbackFunctions`.
#[repr(C)]
struct Callbacks {
    logger: unsafe extern "C" fn(
        Handle,
        *const c_char,
        c_int,
        *const c_char,
        *const c_char,
        *const c_char,
    ),
    allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    release: unsafe extern "C" fn(*mut c_void),
    step_finished: *const c_void,
    env: Handle,
}

/// `fmi2Instantiate`.
type InstantiateTwo = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const Callbacks,
    c_int,
    c_int,
) -> Handle;

/// `fmi3InstantiateCoSimulation`.
type InstantiateThree = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    bool,
    bool,
    *const u32,
    usize,
    Handle,
    unsafe extern "C" fn(Handle, c_int, *const c_char, *const c_char),
    *const c_void,
) -> Handle;

/// `fmi3DoStep`.
type StepThree = unsafe extern "C" fn(
    Handle,
    f64,
    f64,
    bool,
    *mut bool,
    *mut bool,
    *mut bool,
    *mut f64,
) -> c_int;

/// How a step has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StepEnd {
    pub(super) status: Status,
    /// Whether the FMU wants the run to end.
    pub(super) terminate: bool,
    /// How far it got, in seconds, if it says so.
    pub(super) reached: Option<f64>,
}

/// What the FMU has said.
#[derive(Debug, Default)]
struct Journal {
    file: String,
    lines: AtomicU64,
    last: Mutex<String>,
}

impl Journal {
    fn take(&self, status: c_int, text: &str) {
        let text = text.trim();
        if status > Status::Ok as c_int {
            *self.last.lock().unwrap_or_else(PoisonError::into_inner) = text.to_owned();
        }
        let times = self.lines.fetch_add(1, Ordering::Relaxed) + 1;
        if is_told(times) {
            match Status::of(status) {
                Status::Ok => log::info!("{} says: {text}", self.file),
                _ => log::warn!("{} says: {text}", self.file),
            }
        }
    }
}

/// A text of the FMU's, for the length of a call.
///
/// # Safety
///
/// Null, or a C string that stays while it is used.
unsafe fn words<'a>(text: *const c_char) -> std::borrow::Cow<'a, str> {
    if text.is_null() {
        return "".into();
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy()
}

/// The logger of FMI 3.0.
unsafe extern "C" fn log_of_three(
    env: Handle,
    status: c_int,
    _: *const c_char,
    message: *const c_char,
) {
    // SAFETY: `env` is the journal that the instance was made with and that outlives it; the message is the FMU's C string.
    let (journal, text) = unsafe { (&*env.cast::<Journal>(), words(message)) };
    journal.take(status, &text);
}

/// The logger of FMI 2.0, which by the standard has any number of further arguments. Rust cannot write such a function; where the
/// first of them is passed as that of a plain function is, it is taken for the one format that consists of it.
unsafe extern "C" fn log_of_two(
    env: Handle,
    _: *const c_char,
    status: c_int,
    _: *const c_char,
    format: *const c_char,
    first: *const c_char,
) {
    // SAFETY: as above.
    let (journal, format) = unsafe { (&*env.cast::<Journal>(), words(format)) };
    // On Apple's arm64 further arguments are on the stack.
    let has_first = !cfg!(all(target_vendor = "apple", target_arch = "aarch64"));
    if has_first && matches!(format.trim_end(), "%s") {
        // SAFETY: by its format, the first further argument is a C string. The calling conventions of x86-64 (System V and
        // Windows) and of arm64 Linux pass it where they pass the sixth parameter of a plain function.
        journal.take(status, &unsafe { words(first) });
    } else {
        journal.take(status, &format);
    }
}

macro_rules! functions {
    ($name:ident, $prefix:literal: $($field:ident: $own:ty = $function:literal;)+) => {
        #[derive(Debug)]
        struct $name {
            $($field: $own,)+
        }

        impl $name {
            fn load(library: &Library) -> Result<Self, String> {
                Ok(Self {$(
                    $field: {
                        let name = concat!($prefix, $function);
                        // SAFETY: the types are those of the standard's headers, which a library that has these names follows.
                        // The pointer is used only as long as the library, which is beside it in `Loaded`.
                        let found = unsafe { library.get::<$own>(name) };
                        *found.map_err(|_| format!("its library has no function {name}; export it again, or tell its maker"))?
                    },
                )+})
            }
        }
    };
}

functions! { Two, "fmi2":
    instantiate: InstantiateTwo = "Instantiate";
    free: unsafe extern "C" fn(Handle) = "FreeInstance";
    setup: unsafe extern "C" fn(Handle, c_int, f64, f64, c_int, f64) -> c_int = "SetupExperiment";
    enter: Plain = "EnterInitializationMode";
    exit: Plain = "ExitInitializationMode";
    terminate: Plain = "Terminate";
    set_real: SetTwo<f64> = "SetReal";
    set_integer: SetTwo<i32> = "SetInteger";
    set_boolean: SetTwo<c_int> = "SetBoolean";
    get_real: GetTwo<f64> = "GetReal";
    get_integer: GetTwo<i32> = "GetInteger";
    get_boolean: GetTwo<c_int> = "GetBoolean";
    step: unsafe extern "C" fn(Handle, f64, f64, c_int) -> c_int = "DoStep";
    boolean_status: unsafe extern "C" fn(Handle, c_int, *mut c_int) -> c_int = "GetBooleanStatus";
    real_status: unsafe extern "C" fn(Handle, c_int, *mut f64) -> c_int = "GetRealStatus";
}

functions! { Three, "fmi3":
    instantiate: InstantiateThree = "InstantiateCoSimulation";
    free: unsafe extern "C" fn(Handle) = "FreeInstance";
    enter: unsafe extern "C" fn(Handle, bool, f64, f64, bool, f64) -> c_int = "EnterInitializationMode";
    exit: Plain = "ExitInitializationMode";
    terminate: Plain = "Terminate";
    set_f32: SetThree<f32> = "SetFloat32";
    set_f64: SetThree<f64> = "SetFloat64";
    set_i8: SetThree<i8> = "SetInt8";
    set_u8: SetThree<u8> = "SetUInt8";
    set_i16: SetThree<i16> = "SetInt16";
    set_u16: SetThree<u16> = "SetUInt16";
    set_i32: SetThree<i32> = "SetInt32";
    set_u32: SetThree<u32> = "SetUInt32";
    set_i64: SetThree<i64> = "SetInt64";
    set_u64: SetThree<u64> = "SetUInt64";
    set_boolean: SetThree<u8> = "SetBoolean";
    get_f32: GetThree<f32> = "GetFloat32";
    get_f64: GetThree<f64> = "GetFloat64";
    get_i8: GetThree<i8> = "GetInt8";
    get_u8: GetThree<u8> = "GetUInt8";
    get_i16: GetThree<i16> = "GetInt16";
    get_u16: GetThree<u16> = "GetUInt16";
    get_i32: GetThree<i32> = "GetInt32";
    get_u32: GetThree<u32> = "GetUInt32";
    get_i64: GetThree<i64> = "GetInt64";
    get_u64: GetThree<u64> = "GetUInt64";
    get_boolean: GetThree<u8> = "GetBoolean";
    step: StepThree = "DoStep";
}

#[derive(Debug)]
enum Functions {
    Two(Two),
    Three(Box<Three>),
}

/// One instance of an FMU, with its library.
#[derive(Debug)]
pub(super) struct Instance {
    handle: Handle,
    functions: Functions,
    journal: Box<Journal>,
    /// Kept where it is: the FMU may keep its address.
    _callbacks: Option<Box<Callbacks>>,
    /// After a fatal answer, nothing of it may be called.
    is_dead: bool,
    /// Dropped last.
    _library: Library,
}

impl std::fmt::Debug for Callbacks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Callbacks")
    }
}

impl Instance {
    /// Loads the library and makes an instance. `file` is the FMU's name in messages.
    pub(super) fn new(
        (file, name, token): (&str, &str, &str),
        version: Version,
        library: &Path,
        resources: &Path,
    ) -> Result<Self, String> {
        // SAFETY: the user has named this FMU to be run; its initialisers are a part of it.
        let loaded = unsafe { Library::new(library) };
        let loaded = loaded.map_err(|error| {
            let error = tickbus_base::os::one_line(&error.to_string());
            format!("its library cannot be loaded: {error}; install what it needs, which its documentation should tell")
        })?;
        let functions = match version {
            Version::Two => Functions::Two(Two::load(&loaded)?),
            Version::Three => Functions::Three(Box::new(Three::load(&loaded)?)),
        };
        let journal = Box::new(Journal {
            file: file.to_owned(),
            ..Journal::default()
        });
        let env = std::ptr::from_ref(&*journal).cast_mut().cast::<c_void>();
        let c = |text: &str| CString::new(text.replace('\0', " ")).unwrap_or_default();
        let (name, token) = (c(name), c(token));
        let has_resources = resources.is_dir();
        let mut callbacks = None;
        let handle = match &functions {
            Functions::Two(two) => {
                let uri = c(&uri_of(resources));
                let callbacks = callbacks.insert(Box::new(Callbacks {
                    logger: log_of_two,
                    allocate: calloc,
                    release: free,
                    step_finished: null(),
                    env,
                }));
                // SAFETY: by the standard; all texts outlive the call, callbacks and journal the instance.
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
                // With a separator at its end, as the standard says.
                let path = resources.join("");
                let path = c(&path.to_string_lossy());
                let path = if has_resources { path.as_ptr() } else { null() };
                // SAFETY: as above.
                unsafe {
                    (three.instantiate)(
                        name.as_ptr(),
                        token.as_ptr(),
                        path,
                        false,
                        false,
                        false,
                        false,
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
            journal,
            _callbacks: callbacks,
            is_dead: false,
            _library: loaded,
        };
        if handle.is_null() {
            return Err(instance.said("it makes no instance of itself"));
        }
        Ok(instance)
    }

    /// A sentence, with what the FMU has said last.
    pub(super) fn said(&self, what: &str) -> String {
        let last = self
            .journal
            .last
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if last.is_empty() {
            format!("{what}, and does not say why; ask whoever made it")
        } else {
            format!("{what}; it says: {last}")
        }
    }

    fn noted(&mut self, status: c_int) -> Status {
        let status = Status::of(status);
        self.is_dead |= status == Status::Fatal;
        status
    }

    /// Enters the initialisation, for a run that begins at `start` seconds.
    pub(super) fn enter(&mut self, start: f64) -> Status {
        // SAFETY: the handle is of this library, and alive, here and below.
        let status = match &self.functions {
            Functions::Two(two) => unsafe {
                let status = (two.setup)(self.handle, 0, 0.0, start, 0, 0.0);
                if status > Status::Warning as c_int {
                    status
                } else {
                    (two.enter)(self.handle)
                }
            },
            // SAFETY: as above.
            Functions::Three(three) => unsafe {
                (three.enter)(self.handle, false, 0.0, start, false, 0.0)
            },
        };
        self.noted(status)
    }

    /// Leaves the initialisation.
    pub(super) fn exit(&mut self) -> Status {
        // SAFETY: as in `enter`.
        let status = match &self.functions {
            Functions::Two(two) => unsafe { (two.exit)(self.handle) },
            // SAFETY: as above.
            Functions::Three(three) => unsafe { (three.exit)(self.handle) },
        };
        self.noted(status)
    }

    /// Ends the run.
    pub(super) fn terminate(&mut self) -> Status {
        // SAFETY: as in `enter`.
        let status = match &self.functions {
            Functions::Two(two) => unsafe { (two.terminate)(self.handle) },
            // SAFETY: as above.
            Functions::Three(three) => unsafe { (three.terminate)(self.handle) },
        };
        self.noted(status)
    }

    /// One step.
    pub(super) fn step(&mut self, from: f64, length: f64) -> StepEnd {
        let (mut terminate, mut reached) = (false, None);
        let status = match &self.functions {
            Functions::Two(two) => {
                // SAFETY: as in `enter`.
                let status = unsafe { (two.step)(self.handle, from, length, 1) };
                if status == Status::Discard as c_int {
                    let (mut ended, mut last) = (0, from);
                    // SAFETY: as above; 3 is fmi2Terminated, 2 fmi2LastSuccessfulTime.
                    unsafe {
                        let known = (two.boolean_status)(self.handle, 3, &raw mut ended);
                        terminate = known == 0 && ended != 0;
                        let known = (two.real_status)(self.handle, 2, &raw mut last);
                        reached = (known == 0).then_some(last);
                    }
                }
                status
            }
            Functions::Three(three) => {
                let (mut event, mut early, mut last) = (0_u8, 0_u8, from);
                let mut ends = 0_u8;
                // SAFETY: as in `enter`. What comes back need not be 0 or 1, as a `bool` of Rust has to be: it is read as a byte.
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
                reached = (status == Status::Discard as c_int || early != 0).then_some(last);
                status
            }
        };
        StepEnd {
            status: self.noted(status),
            terminate,
            reached,
        }
    }

    /// Sets variables of one type.
    pub(super) fn set(&mut self, kind: ValueType, references: &[u32], values: &[Value]) -> Status {
        debug_assert_eq!(references.len(), values.len());
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

    fn set_two<T>(
        &self,
        function: SetTwo<T>,
        references: &[u32],
        values: &[Value],
        of: fn(Value) -> T,
    ) -> c_int {
        let values: Vec<T> = values.iter().map(|value| of(*value)).collect();
        // SAFETY: as in `enter`; both lists have as many values as the call says, and outlive it.
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

    /// Gets variables of one type.
    pub(super) fn get(
        &mut self,
        kind: ValueType,
        references: &[u32],
        values: &mut [Value],
    ) -> Status {
        debug_assert_eq!(references.len(), values.len());
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
        let mut got = vec![T::default(); references.len()];
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
        if self.is_dead || self.handle.is_null() {
            return;
        }
        // SAFETY: the handle is of this library, alive, and used no more.
        unsafe {
            match &self.functions {
                Functions::Two(two) => (two.free)(self.handle),
                Functions::Three(three) => (three.free)(self.handle),
            }
        }
        self.handle = null_mut();
    }
}

/// The URI of a folder, as FMI 2.0 wants it.
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
