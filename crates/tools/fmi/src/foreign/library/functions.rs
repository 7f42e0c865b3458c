//! The functions of an FMU's library, as declared in the headers of both standards.

#![allow(unsafe_code, reason = "foreign functions are found by their names")]

use std::ffi::{c_char, c_int, c_void};

pub(super) type Handle = *mut c_void;
pub(super) type Plain = unsafe extern "C" fn(Handle) -> c_int;
pub(super) type SetTwo<T> = unsafe extern "C" fn(Handle, *const u32, usize, *const T) -> c_int;
pub(super) type GetTwo<T> = unsafe extern "C" fn(Handle, *const u32, usize, *mut T) -> c_int;
pub(super) type SetThree<T> =
    unsafe extern "C" fn(Handle, *const u32, usize, *const T, usize) -> c_int;
pub(super) type GetThree<T> =
    unsafe extern "C" fn(Handle, *const u32, usize, *mut T, usize) -> c_int;

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub(super) struct Callbacks {
    pub(super) logger: unsafe extern "C" fn(
        Handle,
        *const c_char,
        c_int,
        *const c_char,
        *const c_char,
        *const c_char,
    ),
    pub(super) allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    pub(super) release: unsafe extern "C" fn(*mut c_void),
    pub(super) step_finished: *const c_void,
    pub(super) env: Handle,
}

impl std::fmt::Debug for Callbacks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Callbacks")
    }
}

/// `fmi2Instantiate`.
pub(super) type InstantiateTwo = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const Callbacks,
    c_int,
    c_int,
) -> Handle;

/// `fmi3InstantiateCoSimulation`.
pub(super) type InstantiateThree = unsafe extern "C" fn(
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
pub(super) type StepThree = unsafe extern "C" fn(
    Handle,
    f64,
    f64,
    bool,
    *mut bool,
    *mut bool,
    *mut bool,
    *mut f64,
) -> c_int;

/// Declares functions of a library, and how they are found by their names.
macro_rules! functions {
    ($name:ident, $prefix:literal: $($field:ident: $own:ty = $function:literal;)+) => {
        #[derive(Debug)]
        pub(super) struct $name {
            $(pub(super) $field: $own,)+
        }

        impl $name {
            pub(super) fn load(library: &tickbus_base::os::Library) -> Result<Self, String> {
                Ok(Self {$(
                    $field: {
                        let name = concat!($prefix, $function);
                        // SAFETY: the types are those of the standard's headers, and a library with these names follows
                        // the headers. The pointer is used only as long as the library exists, which is next to it in
                        // `Instance`.
                        let found = unsafe { library.symbol::<$own>(name) };
                        found.map_err(|_| {
                            format!("its library has no function {name}; export it again, or tell its maker")
                        })?
                    },
                )+})
            }
        }
    };
}

pub(super) use functions;

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
pub(super) enum Functions {
    Two(Two),
    Three(Box<Three>),
}
