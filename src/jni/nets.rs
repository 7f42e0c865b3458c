//! The native methods of the Java class `tickbus.LiveNets`: Petri nets on the page of this process.

#![allow(unsafe_code, reason = "exported names")]

use jni::EnvUnowned;
use jni::objects::{JClass, JString};
use jni::sys::{jboolean, jlong};

use tickbus_base::time::Nanos;

use super::failure::answer;
use crate::nets;

/// `static native long openNative(String address, String title)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_LiveNets_openNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    address: JString<'local>,
    title: JString<'local>,
) -> jlong {
    answer(env, |env| {
        let (address, title) = (address.try_to_string(env)?, title.try_to_string(env)?);
        Ok(nets::open(&address, &title)?)
    })
}

/// `static native String pageNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_LiveNets_pageNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) -> JString<'local> {
    answer(env, |env| Ok(env.new_string(nets::url(handle)?)?))
}

/// `static native void drawNative(long handle, String json)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_LiveNets_drawNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
    json: JString<'local>,
) {
    answer(env, |env| {
        Ok(nets::draw(handle, &json.try_to_string(env)?)?)
    });
}

/// `static native boolean wantedNative(long handle, long nanos)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_LiveNets_wantedNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
    nanos: jlong,
) -> jboolean {
    answer(env, |_| Ok(nets::wanted(handle, Nanos(nanos))?))
}

/// `static native void putNative(long handle, String json)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_LiveNets_putNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
    json: JString<'local>,
) {
    answer(env, |env| Ok(nets::put(handle, &json.try_to_string(env)?)?));
}

/// `static native void closeNative(long handle)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_LiveNets_closeNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    handle: jlong,
) {
    answer(env, |_| Ok(nets::close(handle)?));
}
