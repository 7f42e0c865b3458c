//! The functions of FMI 3.0, `fmi3Functions.h`.
#![allow(non_snake_case, reason = "the names are the standard's")]

use std::ffi::{CString, c_char, c_int, c_void};
use std::path::PathBuf;
use std::ptr::null_mut;

use tickbus_fmi::made::{EventMode, Instance, Updated, folder_of_uri};
use tickbus_fmi::{Status, Version};

use super::{
    Inner, Journal, Logger, LoggerOfThree, call, free, get_texts, instantiate, lacking, list,
    reset, room, set_logging, set_texts, step, text, whole,
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
    uses_events: bool,
    early_return: bool,
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
    let event_mode = if uses_events {
        EventMode::Used { early_return }
    } else {
        EventMode::Unused
    };
    instantiate(
        Version::Three,
        folder.as_deref(),
        token.unwrap_or_default(),
        event_mode,
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
    has_stop: bool,
    stop: f64,
) -> c_int {
    call(instance, |instance| {
        instance.setup(start, has_stop.then_some(stop))?;
        instance.enter_initialization()
    })
}

calls! {
    fmi3ExitInitializationMode: Instance::open;
    fmi3EnterEventMode: Instance::enter_events;
    fmi3EnterStepMode: Instance::leave_events;
    fmi3Terminate: Instance::terminate;
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
/// `references` and `values` must be null or point to as many elements as stated.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetClock(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut u8,
) -> c_int {
    // SAFETY: promised by the caller.
    let (references, values) = unsafe { (list(references, count), room(values, count)) };
    call(instance, |instance| {
        whole([references.len(), values.len()], [count, count])?;
        for (&reference, value) in references.iter().zip(values) {
            *value = instance.ticks(reference)?.into();
        }
        Ok(())
    })
}

/// Writes to a pointer that may be null.
///
/// # Safety
///
/// `place` must be null or point to room for a value.
unsafe fn put<T>(place: *mut T, value: T) {
    if !place.is_null() {
        // SAFETY: promised by the caller.
        unsafe { place.write(value) };
    }
}

/// # Safety
///
/// Each pointer must be null or point to a value.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3UpdateDiscreteStates(
    instance: *mut c_void,
    needs_update: *mut bool,
    terminate: *mut bool,
    nominals_changed: *mut bool,
    states_changed: *mut bool,
    has_next: *mut bool,
    next: *mut f64,
) -> c_int {
    let mut updated = Updated::default();
    let status = call(instance, |instance| {
        updated = instance.update()?;
        Ok(())
    });
    // SAFETY: promised by the caller.
    unsafe {
        put(needs_update, false);
        put(terminate, updated.terminate);
        put(nominals_changed, false);
        put(states_changed, false);
        put(has_next, updated.next.is_some());
        put(next, updated.next.unwrap_or_default());
    }
    status
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
    let (status, end, time) = step(instance, from, length);
    // SAFETY: promised by the caller.
    unsafe {
        put(event, end.event);
        put(terminate, status == Status::Discard as c_int);
        put(early_return, end.early);
        put(last, time);
    }
    status
}

lacking! {
    fmi3GetBinary,
    fmi3SetBinary,
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
