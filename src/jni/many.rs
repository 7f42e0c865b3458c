//! The native method of the Java class `tickbus.DriverVector`.

use jni::EnvUnowned;
use jni::objects::{JClass, JIntArray, JLongArray};
use jni::sys::jint;

use tickbus_binding::Device;

use super::DRIVERS;
use super::failure::{Failure, ThrowFieldbusException};

/// How many drivers are ticked between two copies of the lists: the copies are on the stack.
const CHUNK: usize = 128;

/// `static native int tickNative(int half, long[] handles, long[] times, int[] statuses)`
///
/// `half` is 0 for an exchange, 1 to receive, 2 to send; `times` can be null. Returns the number of failed drivers.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_DriverVector_tickNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    half: jint,
    handles: JLongArray<'local>,
    times: JLongArray<'local>,
    statuses: JIntArray<'local>,
) -> jint {
    env.with_env(|env| {
        let count = handles.len(env)?;
        let mut numbers = [0; CHUNK];
        let mut nanos = [0; CHUNK];
        let mut codes = [0; CHUNK];
        let mut failed = 0;
        for begin in (0..count).step_by(CHUNK) {
            let length = CHUNK.min(count - begin);
            // An array of Java has no longer length.
            let begin = jint::try_from(begin).unwrap_or(jint::MAX);
            handles.get_region(env, begin, &mut numbers[..length])?;
            if !times.is_null() {
                times.get_region(env, begin, &mut nanos[..length])?;
            }
            let work = |at: usize, device: &mut Device<_>| {
                if !times.is_null() {
                    device.set_time(nanos[at]);
                }
                match half {
                    0 => device.exchange(),
                    1 => device.receive(),
                    _ => device.send(),
                }
            };
            // A vector has each driver once, so the chunks have no driver in common.
            DRIVERS.tick_each(numbers[..length].iter().copied(), work, |at, code| {
                codes[at] = code.code();
                failed += jint::from(code.code() < 0);
            });
            statuses.set_region(env, begin, &codes[..length])?;
        }
        Ok::<_, Failure>(failed)
    })
    .resolve::<ThrowFieldbusException>()
}
