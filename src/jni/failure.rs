//! Failures in Java: one exception class, one policy.

use std::any::Any;

use jni::errors::{Error, ErrorPolicy};
use jni::objects::{JClass, JThrowable, JValue};
use jni::refs::Global;
use jni::{Env, EnvUnowned, jni_sig, jni_str};
use once_cell::sync::OnceCell;

use tickbus_binding::{Refusal, panic_message};
use tickbus_driver::Code;

/// Says why a native method failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum Failure {
    /// A status code, and what happened.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// A call into the JVM failed; if it threw, the exception is still pending.
    #[error(transparent)]
    Jni(#[from] Error),
}

impl Failure {
    /// Creates a failure with its own description.
    pub(super) fn coded(code: Code, what: impl std::fmt::Display) -> Self {
        Refusal::new(code, what).into()
    }
}

/// `tickbus.FieldbusException`.
///
/// A global reference keeps its class, its class loader and thus this library from being unloaded: no bus
/// thread can lose the code it is running.
static EXCEPTION: OnceCell<Global<JClass<'static>>> = OnceCell::new();

/// Finds the exception class. Must be called while the library is being loaded, when the JVM looks up classes in the
/// class loader that loads it.
pub(super) fn find_exception(env: &mut Env<'_>) -> Result<(), Error> {
    let find = || {
        let class = env.find_class(jni_str!("tickbus/FieldbusException"))?;
        env.new_global_ref(class)
    };
    // If the library is loaded again, the class has been found already.
    EXCEPTION.get_or_try_init(find).map(|_| ())
}

/// Throws `tickbus.FieldbusException`, unless an exception is pending already.
pub(super) struct ThrowFieldbusException;

/// Runs a native method: returns its result, or throws its failure.
pub(super) fn answer<'local, R: Default + 'local>(
    mut env: EnvUnowned<'local>,
    work: impl FnOnce(&mut Env<'local>) -> Result<R, Failure>,
) -> R {
    env.with_env(work).resolve::<ThrowFieldbusException>()
}

impl<T: Default> ErrorPolicy<T, Failure> for ThrowFieldbusException {
    type Captures<'local: 'native, 'native> = ();

    fn on_error<'local: 'native, 'native>(
        env: &mut Env<'local>,
        (): &mut (),
        failure: Failure,
    ) -> Result<T, Error> {
        let failure = match failure {
            Failure::Jni(Error::NullPtr(what)) => {
                Failure::coded(Code::BadArgument, format!("null: {what}"))
            }
            Failure::Jni(error) => Failure::coded(
                Code::Internal,
                format!("a call into the JVM failed: {error}"),
            ),
            refused @ Failure::Refused(_) => refused,
        };
        throw(env, &failure)?;
        Ok(T::default())
    }

    fn on_panic<'local: 'native, 'native>(
        env: &mut Env<'local>,
        (): &mut (),
        payload: Box<dyn Any + Send>,
    ) -> Result<T, Error> {
        throw(
            env,
            &Failure::coded(Code::Internal, format!("panic: {}", panic_message(payload))),
        )?;
        Ok(T::default())
    }
}

fn throw(env: &mut Env<'_>, failure: &Failure) -> Result<(), Error> {
    if env.exception_check() {
        return Ok(());
    }
    let code = match failure {
        Failure::Refused(refusal) => refusal.code.code(),
        Failure::Jni(_) => Code::Internal.code(),
    };
    let class = EXCEPTION
        .get()
        .ok_or(Error::NullPtr("FieldbusException, found in JNI_OnLoad"))?;
    let text = env.new_string(failure.to_string())?;
    let arguments = [JValue::Int(code), JValue::Object(&text)];
    let exception = env.new_object(
        class,
        jni_sig!((code: jint, message: JString) -> void),
        &arguments,
    )?;
    let exception = env.cast_local::<JThrowable>(exception)?;
    match env.throw(exception) {
        // The jni crate reports in this way that the exception is now pending, as intended.
        Err(Error::JavaException) => Ok(()),
        other => other,
    }
}
