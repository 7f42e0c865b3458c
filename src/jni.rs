//! The native methods of the Java class `tickbus.Tickbus`, and in modules those of others.
//!
//! Each is one line that calls into the rooms above. `xChangeData` is the tick; `receiveNative` and `sendNative` are
//! its halves; `countNative` and `hasNative` say after it whether there is something to ask for. They are raw functions
//! that take no lock, make no system call, allocate nothing and never throw. All others use the jni crate and throw `tickbus.FieldbusException`.

#![allow(
    unsafe_code,
    reason = "exported names and the pointers that the JVM hands in"
)]

mod failure;
mod many;
mod nets;
mod open;
mod sweep;

use std::ffi::c_void;
use std::panic::catch_unwind;
use std::path::Path;
use std::sync::Once;

use jni::objects::{JClass, JDoubleArray, JLongArray, JObject, JString};
use jni::sys::{JNI_ERR, JNI_VERSION_1_8, jboolean, jclass, jint, jlong};
use jni::vm::JavaVM;
use jni::{Env, EnvUnowned};

use tickbus_binding::{Device, EVENT_WORDS, EVENTS, Handles, Refusal, closing, faults, read_fault};
use tickbus_driver::Code;
use tickbus_report::page_beside;

use crate::page;
use failure::{Failure, ThrowFieldbusException};

/// The drivers that this process has open.
static DRIVERS: Handles<Device<open::Keep>> = Handles::new();

/// The most changes of the model's faults handed over in one call.
const MODEL_FAULTS: usize = 32;

/// Registers the exit handler, once, with the first driver.
static AT_EXIT: Once = Once::new();

/// Closes the drivers that are still open when the process ends, after the JVM's shutdown hooks.
fn close_all() {
    // The JVM has ended and no longer accepts the release of references.
    closing(|| DRIVERS.close_all(|device| std::mem::forget(device.close())));
}

/// The JVM calls this function when it loads the library.
///
/// # Safety
///
/// `vm` must be the pointer that the JVM passes.
#[unsafe(no_mangle)]
unsafe extern "system" fn JNI_OnLoad(vm: *mut jni::sys::JavaVM, _reserved: *mut c_void) -> jint {
    let found = catch_unwind(|| {
        tickbus_base::os::log_to_stderr(log::LevelFilter::Warn);
        // SAFETY: promised by the caller.
        unsafe { JavaVM::from_raw(vm) }.attach_current_thread(failure::find_exception)
    });
    if matches!(found, Ok(Ok(()))) {
        JNI_VERSION_1_8
    } else {
        JNI_ERR
    }
}

/// `static native long initializeNative(String driverCfg, String tables, Layout layout)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_initializeNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    driver_cfg: JString<'local>,
    tables: JString<'local>,
    layout: JObject<'local>,
) -> jlong {
    env.with_env(|env| initialize(env, &driver_cfg, &tables, &layout))
        .resolve::<ThrowFieldbusException>()
}

/// `static native void lookNative(String driverCfg, Layout layout)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_lookNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    driver_cfg: JString<'local>,
    layout: JObject<'local>,
) {
    env.with_env(|env| {
        let path = driver_cfg.try_to_string(env)?;
        open::look(env, &open::file_of(&path), &layout)
    })
    .resolve::<ThrowFieldbusException>();
}

/// `static native int xChangeData(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_xChangeData(
    _env: *mut jni::sys::JNIEnv,
    _class: jclass,
    handle: jlong,
) -> jint {
    // The handle table catches a panic of the driver; nothing else here can panic.
    DRIVERS
        .tick(handle, Device::exchange)
        .unwrap_or_else(|refused| refused)
        .code()
}

/// `static native int receiveNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_receiveNative(
    _env: *mut jni::sys::JNIEnv,
    _class: jclass,
    handle: jlong,
) -> jint {
    DRIVERS
        .tick(handle, Device::receive)
        .unwrap_or_else(|refused| refused)
        .code()
}

/// `static native int sendNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_sendNative(
    _env: *mut jni::sys::JNIEnv,
    _class: jclass,
    handle: jlong,
) -> jint {
    DRIVERS
        .tick(handle, Device::send)
        .unwrap_or_else(|refused| refused)
        .code()
}

/// `static native void resetNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_resetNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) {
    env.with_env(|_| Ok::<(), Failure>(with(handle, Device::reset)??))
        .resolve::<ThrowFieldbusException>();
}

/// `static native boolean reloadNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_reloadNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) -> jboolean {
    env.with_env(|_| {
        let reload = with(handle, |device| device.reload())?;
        Ok::<jboolean, Failure>(reload.run()?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native void finalizeNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_finalizeNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) {
    env.with_env(|_| {
        let closed = closing(|| DRIVERS.close(handle, |device| drop(device.close())));
        Ok::<(), Failure>(closed.map_err(Refusal::plain)?)
    })
    .resolve::<ThrowFieldbusException>();
}

/// `static native void forgottenNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_forgottenNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) {
    env.with_env(|_| {
        let close = |device: Device<_>| {
            let config = device.config();
            drop(device.close());
            log::warn!(
                "driver \"{}\" of {} was never closed, and nothing refers to it any more; it is closed now; \
                 open it in a try-with-resources, or call close()",
                config.name,
                config.path.display()
            );
        };
        Ok::<(), Failure>(DRIVERS.close(handle, close).map_err(Refusal::plain)?)
    })
    .resolve::<ThrowFieldbusException>();
}

/// `static native String statisticsNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_statisticsNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) -> JString<'local> {
    env.with_env(|env| {
        let snapshot = with(handle, |device| device.snapshot())?;
        Ok(env.new_string(snapshot.to_string())?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native long countNative(long handle)` of `SwallowedChanges`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SwallowedChanges_countNative(
    _env: *mut jni::sys::JNIEnv,
    _class: jclass,
    handle: jlong,
) -> jlong {
    // As in a tick. A driver that cannot be looked at has -1.
    let count = DRIVERS.tick(handle, |device| device.swallowed_changes());
    count.map_or(-1, |count| jlong::try_from(count).unwrap_or(jlong::MAX))
}

/// `static native String linesNative(long handle)` of `SwallowedChanges`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SwallowedChanges_linesNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) -> JString<'local> {
    env.with_env(|env| {
        let swallowed = with(handle, |device| device.swallowed())?;
        Ok(env.new_string(swallowed)?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native int eventsNative(long handle, long[] into)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_eventsNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
    into: JLongArray<'local>,
) -> jint {
    env.with_env(|env| events(env, handle, &into))
        .resolve::<ThrowFieldbusException>()
}

/// `static native int injectNative(long handle, String fault)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_injectNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
    fault: JString<'local>,
) -> jint {
    env.with_env(|env| inject(env, handle, &fault))
        .resolve::<ThrowFieldbusException>()
}

/// `static native boolean endFaultNative(long handle, int id)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_endFaultNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
    id: jint,
) -> jboolean {
    env.with_env(|_| {
        let id = u32::try_from(id).unwrap_or_default();
        with(handle, |device| device.end_fault(id))
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native void declareNative(long handle, String names)` of `ModelFaults`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_ModelFaults_declareNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
    names: JString<'local>,
) {
    env.with_env(|env| {
        let names = names.try_to_string(env)?;
        let names = names.lines().map(str::to_owned).collect();
        Ok::<(), Failure>(with(handle, |device| device.declare_model_faults(names))??)
    })
    .resolve::<ThrowFieldbusException>();
}

/// `static native boolean hasNative(long handle)` of `ModelFaults`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_ModelFaults_hasNative(
    _env: *mut jni::sys::JNIEnv,
    _class: jclass,
    handle: jlong,
) -> jboolean {
    // As in a tick. For a driver that cannot be looked at, `takeNative` says why.
    let has = DRIVERS.tick(handle, |device| device.has_model_change());
    jboolean::from(has.unwrap_or(true))
}

/// `static native int takeNative(long handle, double[] into)` of `ModelFaults`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_ModelFaults_takeNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
    into: JDoubleArray<'local>,
) -> jint {
    env.with_env(|env| model_faults(env, handle, &into))
        .resolve::<ThrowFieldbusException>()
}

/// `static native String faultsNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_faultsNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) -> JString<'local> {
    env.with_env(|env| {
        let board = with(handle, |device| device.board())?;
        Ok(env.new_string(faults(&board))?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native boolean overNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_overNative(
    mut env: EnvUnowned<'_>,
    _class: JClass<'_>,
    handle: jlong,
) -> jboolean {
    env.with_env(|_| with(handle, |device| device.is_over()))
        .resolve::<ThrowFieldbusException>()
}

/// `static native String pageNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_pageNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) -> JString<'local> {
    env.with_env(|env| {
        let config = with(handle, |device| device.config())?;
        let url = config.page.is_some().then(page::url).flatten();
        Ok(env.new_string(url.unwrap_or_default())?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native String reportNative(String recording, String title, String statistics, String text)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_reportNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    recording: JString<'local>,
    title: JString<'local>,
    statistics: JString<'local>,
    text: JString<'local>,
) -> JString<'local> {
    env.with_env(|env| report(env, [&recording, &title, &statistics, &text]))
        .resolve::<ThrowFieldbusException>()
}

/// `static native int emptyNative()`: the cost of a call through JNI, the baseline of the benchmarks.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_Tickbus_emptyNative(
    _env: *mut jni::sys::JNIEnv,
    _class: jclass,
) -> jint {
    0
}

fn initialize(
    env: &mut Env<'_>,
    driver_cfg: &JString<'_>,
    tables: &JString<'_>,
    layout: &JObject<'_>,
) -> Result<jlong, Failure> {
    let place = DRIVERS.reserve()?;
    let path = driver_cfg.try_to_string(env)?;
    let tables = if tables.is_null() {
        String::new()
    } else {
        tables.try_to_string(env)?
    };
    let device = open::open(env, &open::file_of(&path), &tables, layout)?;
    AT_EXIT.call_once(|| tickbus_base::os::at_exit(close_all));
    let name = device.config().name.clone();
    Ok(place.fill(&name, device))
}

fn events(env: &mut Env<'_>, handle: jlong, into: &JLongArray<'_>) -> Result<jint, Failure> {
    let mut words = [0; EVENTS * EVENT_WORDS];
    let room = into.len(env)?.min(words.len());
    let count = with(handle, |device| device.events(&mut words[..room]))?;
    into.set_region(env, 0, &words[..count * EVENT_WORDS])?;
    Ok(jint::try_from(count).unwrap_or(jint::MAX))
}

/// Writes changes of the model's faults to an array: of each the place of the fault, and its value.
fn model_faults(
    env: &mut Env<'_>,
    handle: jlong,
    into: &JDoubleArray<'_>,
) -> Result<jint, Failure> {
    let mut changes = [0.0; 2 * MODEL_FAULTS];
    let most = into.len(env)?.min(changes.len());
    let count = with(handle, |device| {
        let mut count = 0;
        while let Some(room) = changes[..most].get_mut(2 * count..2 * count + 2)
            && let Some((place, value)) = device.next_model_change()
        {
            #[expect(clippy::cast_precision_loss, reason = "a place is far below 2^53")]
            room.copy_from_slice(&[place as f64, value.unwrap_or_default()]);
            count += 1;
        }
        count
    })?;
    if count > 0 {
        into.set_region(env, 0, &changes[..2 * count])?;
    }
    Ok(jint::try_from(count).unwrap_or(jint::MAX))
}

fn inject(env: &mut Env<'_>, handle: jlong, fault: &JString<'_>) -> Result<jint, Failure> {
    let text = fault.try_to_string(env)?;
    let config = with(handle, |device| device.config())?;
    let fault = read_fault(&text, &config)?;
    let id = with(handle, |device| device.inject(&fault))??;
    Ok(jint::try_from(id).unwrap_or(jint::MAX))
}

fn report<'local>(
    env: &mut Env<'local>,
    [recording, title, statistics, text]: [&JString<'_>; 4],
) -> Result<JString<'local>, Failure> {
    let recording = recording.try_to_string(env)?;
    let (title, statistics) = (title.try_to_string(env)?, statistics.try_to_string(env)?);
    let text = text.try_to_string(env)?;
    let (heading, text) = text.split_once('\n').unwrap_or((&text, ""));
    let texts = [(heading.to_owned(), text.to_owned())];
    let texts = if text.is_empty() { &[] } else { &texts[..] };
    let page = page_beside(Path::new(&recording), &title, Some(&statistics), texts)
        .map_err(|error| Failure::coded(Code::BadArgument, error))?;
    Ok(env.new_string(page.to_string_lossy())?)
}

/// Calls `work` with the driver of `handle`.
fn with<R>(handle: jlong, work: impl FnOnce(&mut Device<open::Keep>) -> R) -> Result<R, Failure> {
    Ok(DRIVERS.visit(handle, work)?)
}
