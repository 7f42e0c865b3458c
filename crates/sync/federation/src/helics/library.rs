//! The C interface of HELICS 3 behind safe functions; the types are those of its `helics.h`.

#![allow(unsafe_code, reason = "a foreign library is called")]

use std::ffi::{c_int, c_void};
use std::path::Path;
use std::ptr::null;

use tickbus_base::{Mistake, vendor_functions};

use crate::text::{Text, c_text, text_of};
use crate::value::{Kind, Value};

type Handle = *mut c_void;
type SetText = unsafe extern "C" fn(Handle, Text, *mut Failure);
type Step = unsafe extern "C" fn(Handle, *mut Failure);
type End = unsafe extern "C" fn(Handle);

/// `HelicsError`.
#[repr(C)]
#[derive(Debug)]
struct Failure {
    code: i32,
    message: Text,
}

vendor_functions! {
    /// The functions that tickbus calls.
    struct Functions {
        version: unsafe extern "C" fn() -> Text = "helicsGetVersion",
        abort: unsafe extern "C" fn(c_int, Text) = "helicsAbort",
        close: unsafe extern "C" fn() = "helicsCloseLibrary",
        create_info: unsafe extern "C" fn() -> Handle = "helicsCreateFederateInfo",
        info_core_type: SetText = "helicsFederateInfoSetCoreTypeFromString",
        info_core_init: SetText = "helicsFederateInfoSetCoreInitString",
        info_flag: unsafe extern "C" fn(Handle, c_int, c_int, *mut Failure) = "helicsFederateInfoSetFlagOption",
        info_integer: unsafe extern "C" fn(Handle, c_int, c_int, *mut Failure) = "helicsFederateInfoSetIntegerProperty",
        free_info: End = "helicsFederateInfoFree",
        create: unsafe extern "C" fn(Text, Handle, *mut Failure) -> Handle = "helicsCreateValueFederate",
        publication: unsafe extern "C" fn(Handle, Text, c_int, Text, *mut Failure) -> Handle = "helicsFederateRegisterGlobalPublication",
        subscription: unsafe extern "C" fn(Handle, Text, Text, *mut Failure) -> Handle = "helicsFederateRegisterSubscription",
        input_option: unsafe extern "C" fn(Handle, c_int, c_int, *mut Failure) = "helicsInputSetOption",
        default_double: unsafe extern "C" fn(Handle, f64, *mut Failure) = "helicsInputSetDefaultDouble",
        default_integer: unsafe extern "C" fn(Handle, i64, *mut Failure) = "helicsInputSetDefaultInteger",
        default_boolean: unsafe extern "C" fn(Handle, c_int, *mut Failure) = "helicsInputSetDefaultBoolean",
        source_type: unsafe extern "C" fn(Handle) -> c_int = "helicsInputGetPublicationDataType",
        source_type_name: unsafe extern "C" fn(Handle) -> Text = "helicsInputGetPublicationType",
        initialise: Step = "helicsFederateEnterInitializingMode",
        execute: Step = "helicsFederateEnterExecutingMode",
        request: unsafe extern "C" fn(Handle, f64, *mut Failure) -> f64 = "helicsFederateRequestTime",
        publish_double: unsafe extern "C" fn(Handle, f64, *mut Failure) = "helicsPublicationPublishDouble",
        publish_integer: unsafe extern "C" fn(Handle, i64, *mut Failure) = "helicsPublicationPublishInteger",
        publish_boolean: unsafe extern "C" fn(Handle, c_int, *mut Failure) = "helicsPublicationPublishBoolean",
        get_double: unsafe extern "C" fn(Handle, *mut Failure) -> f64 = "helicsInputGetDouble",
        get_integer: unsafe extern "C" fn(Handle, *mut Failure) -> i64 = "helicsInputGetInteger",
        get_boolean: unsafe extern "C" fn(Handle, *mut Failure) -> c_int = "helicsInputGetBoolean",
        create_query: unsafe extern "C" fn(Text, Text) -> Handle = "helicsCreateQuery",
        ask: unsafe extern "C" fn(Handle, Handle, *mut Failure) -> Text = "helicsQueryExecute",
        free_query: End = "helicsQueryFree",
        global_error: unsafe extern "C" fn(Handle, c_int, Text, *mut Failure) = "helicsFederateGlobalError",
        disconnect: Step = "helicsFederateDisconnect",
    }
}

/// Grants are for the requested time, even if values arrive before.
const UNINTERRUPTIBLE: c_int = 1;
/// An error of any federate is one of all.
const TERMINATE_ON_ERROR: c_int = 72;
/// The level of the federate's log on stdout, and the one that logs nothing.
const CONSOLE_LOG: (c_int, c_int) = (274, -4);
/// An input without its publication is an error.
const CONNECTION_REQUIRED: c_int = 397;
/// The code of a federation that tickbus ends.
const ENDED: c_int = -101;

/// The loaded library. It is never unloaded: its threads may outlive the federate.
#[derive(Clone, Copy, Debug)]
pub struct Library(&'static Functions);

/// A publication of our federate.
#[derive(Debug)]
pub(super) struct Publication(Handle);

/// A subscription of our federate, with the type that is expected.
#[derive(Debug)]
pub(super) struct Subscription(Handle, Kind);

/// A federate with values.
#[derive(Debug)]
pub(super) struct Federate {
    functions: &'static Functions,
    handle: Handle,
}

impl Library {
    /// Loads the library at `path`.
    pub(super) fn load(path: &Path) -> Result<Self, Mistake> {
        let right = "install HELICS 3 (pip install helics), or name its library by --library or HELICS_LIBRARY";
        let functions =
            Functions::load(path).map_err(|mistake| Mistake::new(mistake.what, right))?;
        // SAFETY: the function has no conditions, and its text is static.
        let version = unsafe { text_of((functions.version)()) };
        if !version.starts_with("3.") {
            let what =
                format!("it is HELICS {version}, and tickbus knows the interface of HELICS 3");
            return Err(Mistake::new(what, right));
        }
        Ok(Self(Box::leak(Box::new(functions))))
    }

    /// The version that the library reports.
    pub(super) fn version(self) -> String {
        // SAFETY: as in `load`.
        unsafe { text_of((self.0.version)()) }
    }

    /// Ends all calls of the library in this process with an error.
    pub(super) fn abort(self, reason: &str) {
        let reason = c_text(reason);
        // SAFETY: the library allows this call from any thread, and copies the text.
        unsafe { (self.0.abort)(ENDED, reason.as_ptr()) };
    }

    /// Ends the library's threads; no federate may be used afterwards.
    pub(super) fn close(self) {
        // SAFETY: the federate is gone: its owner calls this last.
        unsafe { (self.0.close)() };
    }

    /// Creates a federate, and connects it with the broker.
    pub(super) fn federate(self, name: &str, core: &str, init: &str) -> Result<Federate, String> {
        let [name, core, init] = [name, core, init].map(c_text);
        let functions = self.0;
        // SAFETY: the types are those of the header, all texts outlive the calls, and the information is freed once.
        unsafe {
            let info = (functions.create_info)();
            let created =
                checked(|failure| (functions.info_core_type)(info, core.as_ptr(), failure))
                    .and_then(|()| {
                        checked(|failure| (functions.info_core_init)(info, init.as_ptr(), failure))
                    })
                    .and_then(|()| {
                        checked(|failure| (functions.info_flag)(info, UNINTERRUPTIBLE, 1, failure))
                    })
                    .and_then(|()| {
                        checked(|failure| {
                            (functions.info_flag)(info, TERMINATE_ON_ERROR, 1, failure);
                        })
                    })
                    .and_then(|()| {
                        checked(|failure| {
                            (functions.info_integer)(info, CONSOLE_LOG.0, CONSOLE_LOG.1, failure);
                        })
                    })
                    .and_then(|()| {
                        checked(|failure| (functions.create)(name.as_ptr(), info, failure))
                    });
            (functions.free_info)(info);
            let handle = created?;
            Ok(Federate { functions, handle })
        }
    }
}

impl Federate {
    /// Registers a publication under exactly this key.
    pub(super) fn publication(&mut self, key: &str, kind: Kind) -> Result<Publication, String> {
        let key = c_text(key);
        // SAFETY: as for all calls of a federate: the handle is valid until it is disconnected, which takes the federate,
        // the federate is used by one thread at a time, and the texts outlive the call.
        let handle = checked(|failure| unsafe {
            (self.functions.publication)(
                self.handle,
                key.as_ptr(),
                code(kind),
                c"".as_ptr(),
                failure,
            )
        })?;
        Ok(Publication(handle))
    }

    /// Registers a subscription, which must find its publication; it has the value `initial` until something comes.
    pub(super) fn subscription(
        &mut self,
        key: &str,
        initial: Value,
    ) -> Result<Subscription, String> {
        let key = c_text(key);
        let functions = self.functions;
        // SAFETY: as in `publication`.
        unsafe {
            let handle = checked(|failure| {
                (functions.subscription)(self.handle, key.as_ptr(), c"".as_ptr(), failure)
            })?;
            checked(|failure| (functions.input_option)(handle, CONNECTION_REQUIRED, 1, failure))?;
            let kind = match initial {
                Value::Double(number) => {
                    checked(|failure| (functions.default_double)(handle, number, failure))?;
                    Kind::Double
                }
                Value::Integer(number) => {
                    checked(|failure| (functions.default_integer)(handle, number, failure))?;
                    Kind::Integer
                }
                Value::Boolean(on) => {
                    checked(|failure| (functions.default_boolean)(handle, on.into(), failure))?;
                    Kind::Boolean
                }
            };
            Ok(Subscription(handle, kind))
        }
    }

    /// Waits until the federation is complete; its values can be published then.
    pub(super) fn initialise(&mut self) -> Result<(), String> {
        // SAFETY: as in `publication`.
        checked(|failure| unsafe { (self.functions.initialise)(self.handle, failure) })
    }

    /// Waits until all federates begin; the time is 0 then.
    pub(super) fn execute(&mut self) -> Result<(), String> {
        // SAFETY: as in `publication`.
        checked(|failure| unsafe { (self.functions.execute)(self.handle, failure) })
    }

    /// Requests a time in seconds, and returns the time that is granted.
    pub(super) fn request(&mut self, time: f64) -> Result<f64, String> {
        // SAFETY: as in `publication`.
        checked(|failure| unsafe { (self.functions.request)(self.handle, time, failure) })
    }

    /// The type of the publication behind a subscription if it is another one than expected; `any` where nothing is
    /// published.
    pub(super) fn other_type(&self, of: &Subscription) -> Option<String> {
        // SAFETY: as in `publication`; the text is the library's, and copied at once.
        unsafe {
            let found = (self.functions.source_type)(of.0);
            (found != code(of.1)).then(|| text_of((self.functions.source_type_name)(of.0)))
        }
    }

    /// Publishes a value of the publication's type.
    pub(super) fn publish(&mut self, at: &Publication, value: Value) -> Result<(), String> {
        let functions = self.functions;
        // SAFETY: as in `publication`.
        checked(|failure| unsafe {
            match value {
                Value::Double(number) => (functions.publish_double)(at.0, number, failure),
                Value::Integer(number) => (functions.publish_integer)(at.0, number, failure),
                Value::Boolean(on) => (functions.publish_boolean)(at.0, on.into(), failure),
            }
        })
    }

    /// The value of a subscription.
    pub(super) fn get(&mut self, of: &Subscription) -> Result<Value, String> {
        let functions = self.functions;
        // SAFETY: as in `publication`.
        checked(|failure| unsafe {
            match of.1 {
                Kind::Double => Value::Double((functions.get_double)(of.0, failure)),
                Kind::Integer => Value::Integer((functions.get_integer)(of.0, failure)),
                Kind::Boolean => Value::Boolean((functions.get_boolean)(of.0, failure) != 0),
            }
        })
    }

    /// The answer of `target` to a query, as JSON or one word.
    pub(super) fn ask(&mut self, target: &str, query: &str) -> Result<String, String> {
        let [target, query] = [target, query].map(c_text);
        let functions = self.functions;
        // SAFETY: as in `publication`; the answer belongs to the query, which is freed after it was copied.
        unsafe {
            let query = (functions.create_query)(target.as_ptr(), query.as_ptr());
            let answer = checked(|failure| (functions.ask)(query, self.handle, failure));
            let answer = answer.map(|answer| text_of(answer));
            (functions.free_query)(query);
            answer
        }
    }

    /// Ends the federation for all, for this reason.
    pub(super) fn fail(&mut self, reason: &str) {
        let reason = c_text(reason);
        // SAFETY: as in `publication`. If it fails, the federation has ended already.
        let _ = checked(|failure| unsafe {
            (self.functions.global_error)(self.handle, ENDED, reason.as_ptr(), failure);
        });
    }

    /// Leaves the federation.
    pub(super) fn disconnect(self) {
        // SAFETY: as in `publication`. If it fails, the federation has ended already.
        let _ = checked(|failure| unsafe { (self.functions.disconnect)(self.handle, failure) });
    }
}

/// `HelicsDataTypes`.
const fn code(kind: Kind) -> c_int {
    match kind {
        Kind::Double => 1,
        Kind::Integer => 2,
        Kind::Boolean => 7,
    }
}

/// Makes a call, and checks the error that it fills in.
fn checked<T>(call: impl FnOnce(*mut Failure) -> T) -> Result<T, String> {
    let mut failure = Failure {
        code: 0,
        message: null(),
    };
    let result = call(&raw mut failure);
    if failure.code == 0 {
        return Ok(result);
    }
    // SAFETY: the message belongs to the library, and is valid until its next call on this thread.
    let message = unsafe { text_of(failure.message) };
    Err(format!("HELICS reports: {message} ({})", failure.code))
}
