//! The functions of FMI 2.0, `fmi2Functions.h`.
#![allow(non_snake_case, reason = "the names are the standard's")]

use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::ptr::null_mut;

use tickbus_fmi::made::{EventMode, Instance, folder_of_uri};
use tickbus_fmi::{Status, Version};

use super::{
    Inner, Journal, Logger, LoggerOfTwo, call, free, get_texts, instantiate, lacking, list, reset,
    room, set_logging, set_texts, step, text, whole,
};

/// `fmi2Error`.
const ERROR: c_int = Status::Error as c_int;

/// `fmi2CallbackFunctions`; functions that this library does not call have no types here.
#[repr(C)]
struct Callbacks {
    logger: Option<LoggerOfTwo>,
    allocate: *const c_void,
    release: *const c_void,
    step_finished: *const c_void,
    env: *mut c_void,
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// # Safety
///
/// As `fmi2Functions.h` requires, as for all functions here: texts are C strings or null, lists have as many values as
/// the call states, and `callbacks` exists as long as the instance.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    logging: c_int,
) -> *mut c_void {
    // SAFETY: promised by the caller, here and below.
    let (name, guid, resources) = unsafe { (text(name), text(guid), text(resources)) };
    // SAFETY: as above.
    let callbacks = unsafe { callbacks.as_ref() };
    let journal = Journal {
        logger: callbacks.and_then(|all| all.logger).map(Logger::Two),
        env: callbacks.map_or(null_mut(), |all| all.env),
        name: CString::new(name.unwrap_or("tickbus")).unwrap_or_default(),
        all: logging != 0,
    };
    if kind != 1 {
        journal.fail("this FMU is for co-simulation alone; choose that in the importing tool");
        return null_mut();
    }
    let folder = resources.map(folder_of_uri);
    instantiate(
        Version::Two,
        folder.as_deref(),
        guid.unwrap_or_default(),
        EventMode::Unused,
        &journal,
    )
}

#[unsafe(no_mangle)]
extern "C" fn fmi2FreeInstance(instance: *mut c_void) {
    free(instance);
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging(
    instance: *mut c_void,
    logging: c_int,
    _count: usize,
    _categories: *const *const c_char,
) -> c_int {
    set_logging(instance, logging != 0)
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetupExperiment(
    instance: *mut c_void,
    _has_tolerance: c_int,
    _tolerance: f64,
    start: f64,
    has_stop: c_int,
    stop: f64,
) -> c_int {
    call(instance, |instance| {
        instance.setup(start, (has_stop != 0).then_some(stop))
    })
}

calls! {
    fmi2EnterInitializationMode: Instance::enter_initialization;
    fmi2ExitInitializationMode: Instance::open;
    fmi2Terminate: Instance::terminate;
    fmi2Reset: reset;
}

numbers! {
    fmi2GetReal, fmi2SetReal: f64 as f64;
    fmi2GetInteger, fmi2SetInteger: i32 as c_int;
    fmi2GetBoolean, fmi2SetBoolean: bool as c_int;
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetString(
    instance: *mut c_void,
    references: *const c_uint,
    count: usize,
    values: *mut *const c_char,
) -> c_int {
    // SAFETY: promised by the caller, as for `fmi2Instantiate`.
    unsafe { get_texts(instance, (references, count), (values, count)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetString(
    instance: *mut c_void,
    references: *const c_uint,
    count: usize,
    values: *const *const c_char,
) -> c_int {
    // SAFETY: promised by the caller, as for `fmi2Instantiate`.
    unsafe { set_texts(instance, (references, count), (values, count)) }
}

#[unsafe(no_mangle)]
extern "C" fn fmi2DoStep(
    instance: *mut c_void,
    from: f64,
    length: f64,
    _no_set_prior: c_int,
) -> c_int {
    step(instance, from, length).0
}

/// `fmi2LastSuccessfulTime` of `fmi2StatusKind`.
const LAST_SUCCESSFUL_TIME: c_int = 2;

/// `fmi2Terminated`.
const TERMINATED: c_int = 3;

/// No step is ever pending, and a step is discarded only if the bus has ended.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetBooleanStatus(
    instance: *mut c_void,
    kind: c_int,
    value: *mut c_int,
) -> c_int {
    if value.is_null() {
        return ERROR;
    }
    let mut is_over = false;
    let status = call(instance, |instance| {
        is_over = instance.is_over();
        Ok(())
    });
    // SAFETY: promised by the caller, as for `fmi2Instantiate`.
    unsafe { value.write((kind == TERMINATED && is_over).into()) };
    status
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealStatus(
    instance: *mut c_void,
    kind: c_int,
    value: *mut f64,
) -> c_int {
    if value.is_null() || kind != LAST_SUCCESSFUL_TIME {
        return ERROR;
    }
    let mut time = 0.0;
    let status = call(instance, |instance| {
        time = instance.time();
        Ok(())
    });
    // SAFETY: promised by the caller, as for `fmi2Instantiate`.
    unsafe { value.write(time) };
    status
}

lacking! {
    fmi2GetFMUstate,
    fmi2SetFMUstate,
    fmi2FreeFMUstate,
    fmi2SerializedFMUstateSize,
    fmi2SerializeFMUstate,
    fmi2DeSerializeFMUstate,
    fmi2GetDirectionalDerivative,
    fmi2SetRealInputDerivatives,
    fmi2GetRealOutputDerivatives,
    fmi2CancelStep,
    fmi2GetStatus,
    fmi2GetIntegerStatus,
    fmi2GetStringStatus,
}
