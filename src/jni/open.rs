//! Opens a driver for Java, and describes its signals to a `tickbus.Layout`, which allocates the shared buffer.

#![allow(unsafe_code, reason = "the shared buffer is memory that the JVM gives")]

use std::path::{Path, PathBuf};
use std::ptr::NonNull;

use jni::objects::{JByteBuffer, JObject, JValue};
use jni::refs::Global;
use jni::{Env, jni_sig, jni_str};

use tickbus_base::percent_decoded;
use tickbus_binding::{Device, Shared, SignalDescription, SlotKind};
use tickbus_driver::{Code, Driver, SlotMap};
use tickbus_driver_cfg::Config;

use super::failure::Failure;
use crate::KINDS;
use crate::page::{self, Place};

/// Keeps the memory of a shared buffer alive, and its driver on the live page.
pub(super) struct Keep {
    _buffer: Global<JByteBuffer<'static>>,
    _place: Option<Place>,
}

/// Returns the file named by Java: a path, or a `file:` URI for a path that the JVM cannot represent as text. The URI
/// has the bytes of the name as percent escapes.
pub(super) fn file_of(name: &str) -> PathBuf {
    let Some(escaped) = name.strip_prefix("file://") else {
        return PathBuf::from(name);
    };
    let bytes = percent_decoded(escaped);
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStringExt as _;

        std::ffi::OsString::from_vec(bytes).into()
    }
    #[cfg(not(unix))]
    {
        // On this system names are text, and a path starts after the slash: /C:/cell.
        let name = String::from_utf8_lossy(&bytes).into_owned();
        PathBuf::from(name.strip_prefix('/').unwrap_or(&name))
    }
}

/// Opens the driver that the file describes, with `tables` in place of its own, and describes it to `layout`.
pub(super) fn open(
    env: &mut Env<'_>,
    path: &Path,
    tables: &str,
    layout: &JObject<'_>,
) -> Result<Device<Keep>, Failure> {
    let mut driver = tickbus_binding::open(path, tables, &KINDS)?;
    let place = page::show_driver(&mut driver)?;
    let shared = describe(env, &driver, place, layout)?;
    Ok(Device::new(driver, shared))
}

fn describe(
    env: &mut Env<'_>,
    driver: &Driver,
    place: Option<Place>,
    layout: &JObject<'_>,
) -> Result<Shared<Keep>, Failure> {
    describe_driver(env, driver.config(), driver.slots(), layout)?;
    buffer(env, driver.slots().count, place, layout)
}

/// Describes the driver of the file to `layout` without opening it.
pub(super) fn look(env: &mut Env<'_>, path: &Path, layout: &JObject<'_>) -> Result<(), Failure> {
    let config = tickbus_binding::load(path, "", &KINDS)?;
    let slots = SlotMap::new(&config.table, config.role);
    describe_driver(env, &config, &slots, layout)
}

fn describe_driver(
    env: &mut Env<'_>,
    config: &Config,
    slots: &SlotMap,
    layout: &JObject<'_>,
) -> Result<(), Failure> {
    let name = env.new_string(&config.name)?;
    env.call_method(
        layout,
        jni_str!("driver"),
        jni_sig!((id: jint, name: JString) -> void),
        &[JValue::Int(config.id), JValue::Object(&name)],
    )?;
    for index in 0..config.table.signals.len() {
        let signal = SignalDescription::in_config(config, slots, index);
        // One frame per signal, because local references would accumulate otherwise.
        env.with_local_frame(8, |env| describe_signal(env, layout, &signal))?;
    }
    Ok(())
}

fn describe_signal(
    env: &mut Env<'_>,
    layout: &JObject<'_>,
    signal: &SignalDescription<'_>,
) -> Result<(), Failure> {
    let name = env.new_string(signal.name)?;
    let address = env.new_string(&signal.address)?;
    let data_type = env.new_string(signal.data_type)?;
    let unit = env.new_string(signal.unit)?;
    let station = env.new_string(signal.station)?;
    env.call_method(
        layout,
        jni_str!("signal"),
        jni_sig!((
            name: JString, address: JString, data_type: JString, unit: JString, station: JString,
            written: jboolean, integer: jboolean, slot: jint, edges: jint
        ) -> void),
        &[
            JValue::Object(&name),
            JValue::Object(&address),
            JValue::Object(&data_type),
            JValue::Object(&unit),
            JValue::Object(&station),
            JValue::Bool(signal.is_written),
            JValue::Bool(signal.kind != SlotKind::Real),
            JValue::Int(index(signal.slot)?),
            JValue::Int(signal.edges.map_or(Ok(-1), index)?),
        ],
    )?;
    Ok(())
}

/// Converts a number to an int, with which Java counts bytes and slots.
fn index(number: usize) -> Result<i32, Failure> {
    i32::try_from(number).map_err(|_| {
        Failure::coded(
            Code::BadConfig,
            format!("{number} is more than an image can have"),
        )
    })
}

fn buffer(
    env: &mut Env<'_>,
    slots: usize,
    place: Option<Place>,
    layout: &JObject<'_>,
) -> Result<Shared<Keep>, Failure> {
    let bytes = Shared::<Keep>::bytes(slots);
    let buffer = env
        .call_method(
            layout,
            jni_str!("allocate"),
            jni_sig!((bytes: jint) -> java.nio.ByteBuffer),
            &[JValue::Int(index(bytes)?)],
        )?
        .l()?;
    let buffer = env.cast_local::<JByteBuffer>(buffer)?;
    let unusable = |what| Failure::coded(Code::Internal, format!("the shared buffer {what}"));
    let capacity = env.get_direct_buffer_capacity(&buffer)?;
    if capacity < bytes {
        return Err(unusable(format!("has {capacity} bytes, expected {bytes}")));
    }
    let address = env.get_direct_buffer_address(&buffer)?;
    let address = NonNull::new(address).ok_or_else(|| unusable("has no address".into()))?;
    let keep = Keep {
        _buffer: env.new_global_ref(buffer)?,
        _place: place,
    };
    // SAFETY: a direct buffer's address stays valid for its capacity, which was checked above, as long as the buffer is
    // reachable, which `keep` ensures; the JVM zeroes the memory. Only the package `tickbus` has the Java end. Its
    // signals access slots outside the native call, on the one thread that ticks the driver, as its documentation
    // demands. No slot is ever an address, index or length.
    unsafe { Shared::new(address, slots, keep) }
        .ok_or_else(|| unusable("is not aligned for 8-byte words".into()))
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::ffi::OsStrExt as _;

    use super::*;

    #[test]
    fn a_file_whose_name_is_no_text_to_the_jvm_comes_as_a_uri() {
        let bytes = |name: &str| file_of(name).as_os_str().as_bytes().to_vec();
        assert_eq!(bytes("cell/100%.cfg"), b"cell/100%.cfg");
        assert_eq!(
            bytes("file:///a%20b/pr%FCfung/%zz%2"),
            b"/a b/pr\xfcfung/%zz%2"
        );
    }
}
