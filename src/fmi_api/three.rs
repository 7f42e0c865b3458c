//! The functions of FMI 3.0, `fmi3Functions.h`.
#![allow(non_snake_case, reason = "the names are the standard's")]

use std::ffi::{CString, c_char, c_int, c_void};
use std::path::PathBuf;
use std::ptr::null_mut;

use tickbus_fmi::made::{Instance, folder_of_uri};
use tickbus_fmi::{Status, Version};

use super::{
    Inner, Journal, Logger, LoggerOfThree, call, free, get_texts, instantiate, lacking, list,
    reset, room, same, set_logging, set_texts, step, terminate, text,
};

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// # Safety
///
/// As `fmi3Functions.h` requires, as for all functions here: texts are C strings or null, lists have as many values as
/// the call states, and `env` exists as long as the instance.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    logging: bool,
    _event_mode: bool,
    _early_return: bool,
    _intermediate: *const u32,
    _intermediate_count: usize,
    env: *mut c_void,
    logger: Option<LoggerOfThree>,
    _intermediate_update: *const c_void,
) -> *mut c_void {
    // SAFETY: promised by the caller.
    let (name, token, resources) = unsafe { (text(name), text(token), text(resources)) };
    let journal = Journal {
        logger: logger.map(Logger::Three),
        env,
        name: CString::new(name.unwrap_or("tickbus")).unwrap_or_default(),
        all: logging,
    };
    // By the standard this is a path; some tools pass a URI, as in 2.0.
    let folder = resources.map(|path| {
        if path.starts_with("file:") {
            folder_of_uri(path)
        } else {
            PathBuf::from(path)
        }
    });
    instantiate(
        Version::Three,
        folder.as_deref(),
        token.unwrap_or_default(),
        &journal,
    )
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateModelExchange() -> *mut c_void {
    eprintln!("tickbus: this FMU is for co-simulation alone; choose that in the importing tool");
    null_mut()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateScheduledExecution() -> *mut c_void {
    fmi3InstantiateModelExchange()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3FreeInstance(instance: *mut c_void) {
    free(instance);
}

#[unsafe(no_mangle)]
extern "C" fn fmi3SetDebugLogging(
    instance: *mut c_void,
    logging: bool,
    _count: usize,
    _categories: *const *const c_char,
) -> c_int {
    set_logging(instance, logging)
}

#[unsafe(no_mangle)]
extern "C" fn fmi3EnterInitializationMode(
    instance: *mut c_void,
    _has_tolerance: bool,
    _tolerance: f64,
    start: f64,
    _has_stop: bool,
    _stop: f64,
) -> c_int {
    call(instance, |instance| instance.begin_at(start))
}

calls! {
    fmi3ExitInitializationMode: Instance::open;
    fmi3Terminate: terminate;
    fmi3Reset: reset;
}

numbers! {
    fmi3GetFloat32, fmi3SetFloat32: f32 as f32, value_count;
    fmi3GetFloat64, fmi3SetFloat64: f64 as f64, value_count;
    fmi3GetInt8, fmi3SetInt8: i8 as i8, value_count;
    fmi3GetUInt8, fmi3SetUInt8: u8 as u8, value_count;
    fmi3GetInt16, fmi3SetInt16: i16 as i16, value_count;
    fmi3GetUInt16, fmi3SetUInt16: u16 as u16, value_count;
    fmi3GetInt32, fmi3SetInt32: i32 as i32, value_count;
    fmi3GetUInt32, fmi3SetUInt32: u32 as u32, value_count;
    fmi3GetInt64, fmi3SetInt64: i64 as i64, value_count;
    fmi3GetUInt64, fmi3SetUInt64: u64 as u64, value_count;
    fmi3GetBoolean, fmi3SetBoolean: bool as u8, value_count;
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetString(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut *const c_char,
    value_count: usize,
) -> c_int {
    // SAFETY: promised by the caller, as for `fmi3InstantiateCoSimulation`.
    unsafe { get_texts(instance, (references, count), (values, value_count)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetString(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const *const c_char,
    value_count: usize,
) -> c_int {
    // SAFETY: promised by the caller, as for `fmi3InstantiateCoSimulation`.
    unsafe { set_texts(instance, (references, count), (values, value_count)) }
}

/// # Safety
///
/// Each pointer must be null or point to a value.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: *mut c_void,
    from: f64,
    length: f64,
    _no_set_prior: bool,
    event: *mut bool,
    terminate: *mut bool,
    early_return: *mut bool,
    last: *mut f64,
) -> c_int {
    let status = step(instance, from, length);
    let is_over = status == Status::Discard as c_int;
    for (flag, value) in [(event, false), (terminate, is_over), (early_return, false)] {
        if !flag.is_null() {
            // SAFETY: promised by the caller.
            unsafe { flag.write(value) };
        }
    }
    if !last.is_null() {
        let done = if status == Status::Ok as c_int {
            from + length
        } else {
            from
        };
        // SAFETY: promised by the caller.
        unsafe { last.write(done) };
    }
    status
}

lacking! {
    fmi3GetBinary,
    fmi3SetBinary,
    fmi3GetClock,
    fmi3SetClock,
    fmi3GetFMUState,
    fmi3SetFMUState,
    fmi3FreeFMUState,
    fmi3SerializedFMUStateSize,
    fmi3SerializeFMUState,
    fmi3DeserializeFMUState,
    fmi3GetVariableDependencies,
    fmi3GetNumberOfVariableDependencies,
    fmi3GetDirectionalDerivative,
    fmi3GetAdjointDerivative,
    fmi3GetIntervalDecimal,
    fmi3GetIntervalFraction,
    fmi3GetShiftDecimal,
    fmi3GetShiftFraction,
    fmi3SetIntervalDecimal,
    fmi3SetIntervalFraction,
    fmi3SetShiftDecimal,
    fmi3SetShiftFraction,
    fmi3EvaluateDiscreteStates,
    fmi3UpdateDiscreteStates,
    fmi3EnterEventMode,
    fmi3EnterStepMode,
    fmi3EnterConfigurationMode,
    fmi3ExitConfigurationMode,
    fmi3EnterContinuousTimeMode,
    fmi3CompletedIntegratorStep,
    fmi3SetTime,
    fmi3SetContinuousStates,
    fmi3GetContinuousStateDerivatives,
    fmi3GetEventIndicators,
    fmi3GetContinuousStates,
    fmi3GetNominalsOfContinuousStates,
    fmi3GetNumberOfEventIndicators,
    fmi3GetNumberOfContinuousStates,
    fmi3GetOutputDerivatives,
    fmi3ActivateModelPartition,
}
