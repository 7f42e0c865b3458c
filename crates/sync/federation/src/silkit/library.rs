//! The C interface of SIL Kit 5 behind safe functions; the types are those of its `silkit/capi`.

#![allow(unsafe_code, reason = "a foreign library is called")]

use std::ffi::{CString, c_void};
use std::path::Path;
use std::ptr::null_mut;
use std::sync::Arc;

use tickbus_base::{Mistake, vendor_functions};

use super::inbox::Inbox;
use super::scalar;
use super::settings::Topic;
use crate::text::{Text, c_text, text_of};

type Handle = *mut c_void;
type Code = i32;
type OfHandle = unsafe extern "C" fn(Handle) -> Code;
type Create = unsafe extern "C" fn(*mut Handle, Handle) -> Code;
type Why = unsafe extern "C" fn(Handle, Text) -> Code;
type Ready = unsafe extern "C" fn(Handle, Handle);
type Step = unsafe extern "C" fn(Handle, Handle, u64, u64);
type Message = unsafe extern "C" fn(Handle, Handle, *const MessageEvent);
type OnSystem = unsafe extern "C" fn(Handle, Handle, i16);
type OnParticipant = unsafe extern "C" fn(Handle, Handle, Text, *const Status);

vendor_functions! {
    /// The functions that tickbus calls.
    struct Functions {
        major: unsafe extern "C" fn(*mut u32) -> Code = "SilKit_Version_Major",
        version: unsafe extern "C" fn(*mut Text) -> Code = "SilKit_Version_String",
        last_error: unsafe extern "C" fn() -> Text = "SilKit_GetLastErrorString",
        configuration: unsafe extern "C" fn(*mut Handle, Text) -> Code = "SilKit_ParticipantConfiguration_FromString",
        free_configuration: OfHandle = "SilKit_ParticipantConfiguration_Destroy",
        create: unsafe extern "C" fn(*mut Handle, Handle, Text, Text) -> Code = "SilKit_Participant_Create",
        destroy: OfHandle = "SilKit_Participant_Destroy",
        lifecycle: unsafe extern "C" fn(*mut Handle, Handle, *const Lifecycle) -> Code = "SilKit_LifecycleService_Create",
        on_ready: unsafe extern "C" fn(Handle, Handle, Ready) -> Code = "SilKit_LifecycleService_SetCommunicationReadyHandlerAsync",
        complete_ready: OfHandle = "SilKit_LifecycleService_CompleteCommunicationReadyHandlerAsync",
        start: OfHandle = "SilKit_LifecycleService_StartLifecycle",
        stop: Why = "SilKit_LifecycleService_Stop",
        report_error: Why = "SilKit_LifecycleService_ReportError",
        time: Create = "SilKit_TimeSyncService_Create",
        on_step: unsafe extern "C" fn(Handle, Handle, Step, u64) -> Code = "SilKit_TimeSyncService_SetSimulationStepHandlerAsync",
        complete_step: OfHandle = "SilKit_TimeSyncService_CompleteSimulationStep",
        monitor: Create = "SilKit_SystemMonitor_Create",
        on_system: unsafe extern "C" fn(Handle, Handle, OnSystem, *mut u64) -> Code = "SilKit_SystemMonitor_AddSystemStateHandler",
        on_participant: unsafe extern "C" fn(Handle, Handle, OnParticipant, *mut u64) -> Code = "SilKit_SystemMonitor_AddParticipantStatusHandler",
        controller: Create = "SilKit_Experimental_SystemController_Create",
        abort: OfHandle = "SilKit_Experimental_SystemController_AbortSimulation",
        publisher: unsafe extern "C" fn(*mut Handle, Handle, Text, *const DataSpec, u8) -> Code = "SilKit_DataPublisher_Create",
        publish: unsafe extern "C" fn(Handle, *const Bytes) -> Code = "SilKit_DataPublisher_Publish",
        subscriber: unsafe extern "C" fn(*mut Handle, Handle, Text, *const DataSpec, Handle, Message) -> Code = "SilKit_DataSubscriber_Create",
    }
}

/// The services of [`Header::of`].
const DATA: u64 = 5;
const PARTICIPANT: u64 = 7;

/// `SilKit_OperationMode_Coordinated`.
const COORDINATED: i8 = 10;

/// No log on stdout, and one attempt at the registry: tickbus itself repeats it.
const CONFIGURATION: &str = "{Logging: {Sinks: []}, Middleware: {ConnectAttempts: 1}}";

/// `SilKit_StructHeader`.
#[repr(C)]
struct Header {
    version: u64,
    reserved: [u64; 3],
}

impl Header {
    /// `SK_ID_MAKE`, for version 1 of a type.
    const fn of(service: u64, data_type: u64) -> Self {
        Self {
            version: 83 << 56 | 75 << 48 | service << 40 | data_type << 32 | 1 << 24,
            reserved: [0; 3],
        }
    }
}

#[repr(C)]
struct Lifecycle {
    header: Header,
    mode: i8,
}

#[repr(C)]
struct Label {
    key: Text,
    value: Text,
    kind: u32,
}

#[repr(C)]
struct DataSpec {
    header: Header,
    topic: Text,
    media_type: Text,
    label_count: usize,
    labels: *const Label,
}

#[repr(C)]
struct Bytes {
    data: *const u8,
    size: usize,
}

#[repr(C)]
struct MessageEvent {
    header: Header,
    timestamp: u64,
    data: Bytes,
}

#[repr(C)]
struct Status {
    header: Header,
    name: Text,
    state: i16,
    reason: Text,
    times: [u64; 2],
}

/// The loaded library. It is never unloaded: its threads may outlive the participant.
#[derive(Clone, Copy, Debug)]
pub struct Library(&'static Functions);

/// A publisher of our participant.
#[derive(Debug)]
pub(super) struct Publisher(Handle);

/// A subscription's place in the inbox, for the library's thread.
#[derive(Debug)]
struct Subscriber {
    inbox: Arc<Inbox>,
    slot: usize,
}

/// A participant that has connected with the registry; dropping it disconnects it.
#[derive(Debug)]
pub(super) struct Participant {
    functions: &'static Functions,
    handle: Handle,
}

// SAFETY: the library allows calls from any thread.
unsafe impl Send for Participant {}

/// A participant with its services. The library's thread fills the inbox.
#[derive(Debug)]
pub(super) struct Member {
    lifecycle: Handle,
    time: Handle,
    controller: Handle,
    // Dropped first: from then on the library's thread is gone, and with it all uses of the contexts below.
    participant: Participant,
    inbox: Arc<Inbox>,
    #[expect(clippy::vec_box, reason = "the library has their addresses")]
    subscribers: Vec<Box<Subscriber>>,
}

impl Library {
    /// Loads the library at `path`.
    pub(super) fn load(path: &Path) -> Result<Self, Mistake> {
        let right = "install a release of Vector SIL Kit 5 (vectorgrp/sil-kit), and name its libSilKit by --library or \
                     SILKIT_LIBRARY";
        let functions =
            Functions::load(path).map_err(|mistake| Mistake::new(mistake.what, right))?;
        let library = Self(Box::leak(Box::new(functions)));
        let mut major = 0;
        // SAFETY: the function fills in the number.
        let is_known = unsafe { (library.0.major)(&raw mut major) } == 0 && major == 5;
        if !is_known {
            let version = library.version();
            let what =
                format!("it is SIL Kit {version}, and tickbus knows the interface of SIL Kit 5");
            return Err(Mistake::new(what, right));
        }
        Ok(library)
    }

    /// The version that the library reports.
    pub(super) fn version(self) -> String {
        let mut text: Text = std::ptr::null();
        // SAFETY: the function sets the pointer to a static text.
        unsafe {
            (self.0.version)(&raw mut text);
            text_of(text)
        }
    }

    /// Connects a participant with the registry; blocks until all participants that are there have answered.
    pub(super) fn participant(self, name: &str, registry: &str) -> Result<Participant, String> {
        let [name, registry, text] = [name, registry, CONFIGURATION].map(c_text);
        let functions = self.0;
        // SAFETY: the types are those of the header, all texts outlive the calls, and the configuration is freed once.
        unsafe {
            let configuration =
                functions.made(|made| (functions.configuration)(made, text.as_ptr()))?;
            let created = functions.made(|made| {
                (functions.create)(made, configuration, name.as_ptr(), registry.as_ptr())
            });
            (functions.free_configuration)(configuration);
            let handle = created?;
            Ok(Participant { functions, handle })
        }
    }
}

impl Functions {
    /// Makes a call, and returns the library's message if it fails.
    fn checked(&self, code: Code) -> Result<(), String> {
        if code == 0 {
            return Ok(());
        }
        // SAFETY: the message belongs to the library, and is valid until its next call on this thread.
        let message = unsafe { text_of((self.last_error)()) };
        Err(format!("SIL Kit reports: {message} ({code})"))
    }

    /// Makes a call that makes something.
    fn made(&self, call: impl FnOnce(*mut Handle) -> Code) -> Result<Handle, String> {
        let mut made = null_mut();
        self.checked(call(&raw mut made))?;
        Ok(made)
    }
}

impl Participant {
    /// Creates the services of a coordinated participant whose steps have this length, in nanoseconds.
    pub(super) fn join(self, step: u64, inbox: &Arc<Inbox>) -> Result<Member, String> {
        let (functions, handle) = (self.functions, self.handle);
        let context = Arc::as_ptr(inbox).cast_mut().cast::<c_void>();
        let coordinated = Lifecycle {
            header: Header::of(PARTICIPANT, 2),
            mode: COORDINATED,
        };
        let mut id = 0;
        // SAFETY: the types are those of the header; the participant is valid, and so are its services as long as it is;
        // the inbox, which is the context of the handlers, lives in the member until the participant is destroyed.
        unsafe {
            let lifecycle = functions
                .made(|made| (functions.lifecycle)(made, handle, &raw const coordinated))?;
            functions.checked((functions.on_ready)(lifecycle, context, on_ready))?;
            let time = functions.made(|made| (functions.time)(made, lifecycle))?;
            functions.checked((functions.on_step)(time, context, on_step, step))?;
            let monitor = functions.made(|made| (functions.monitor)(made, handle))?;
            let member = Member {
                lifecycle,
                time,
                controller: functions.made(|made| (functions.controller)(made, handle))?,
                participant: self,
                inbox: Arc::clone(inbox),
                subscribers: Vec::new(),
            };
            let on_participant: OnParticipant = on_participant;
            functions.checked((functions.on_participant)(
                monitor,
                context,
                on_participant,
                &raw mut id,
            ))?;
            functions.checked((functions.on_system)(
                monitor,
                context,
                on_system,
                &raw mut id,
            ))?;
            Ok(member)
        }
    }
}

impl Drop for Participant {
    fn drop(&mut self) {
        // SAFETY: the handle is valid, and is not used afterwards.
        unsafe { (self.functions.destroy)(self.handle) };
    }
}

impl Member {
    const fn functions(&self) -> &'static Functions {
        self.participant.functions
    }

    /// Creates a publisher; a participant that comes late gets its last value.
    pub(super) fn publisher(&mut self, name: &str, topic: &Topic) -> Result<Publisher, String> {
        let functions = self.functions();
        let name = c_text(name);
        with_spec(topic, |spec| {
            // SAFETY: as in `join`; the texts outlive the call.
            functions.made(|made| unsafe {
                (functions.publisher)(made, self.participant.handle, name.as_ptr(), spec, 1)
            })
        })
        .map(Publisher)
    }

    /// Creates the subscriber of a slot of the inbox.
    pub(super) fn subscriber(
        &mut self,
        name: &str,
        topic: &Topic,
        slot: usize,
    ) -> Result<(), String> {
        let functions = self.functions();
        let name = c_text(name);
        let inbox = Arc::clone(&self.inbox);
        let subscriber = Box::new(Subscriber { inbox, slot });
        let context = (&raw const *subscriber).cast_mut().cast::<c_void>();
        self.subscribers.push(subscriber);
        with_spec(topic, |spec| {
            // SAFETY: as in `join`; the texts outlive the call, and the context lives in the member.
            functions.made(|made| unsafe {
                (functions.subscriber)(
                    made,
                    self.participant.handle,
                    name.as_ptr(),
                    spec,
                    context,
                    on_message,
                )
            })
        })
        .map(|_| ())
    }

    /// Begins: the participant waits for all others.
    pub(super) fn start(&mut self) -> Result<(), String> {
        // SAFETY: as in `join`.
        self.functions()
            .checked(unsafe { (self.functions().start)(self.lifecycle) })
    }

    /// Our initial values are published: the simulation may begin.
    pub(super) fn complete_ready(&mut self) -> Result<(), String> {
        // SAFETY: as in `join`.
        self.functions()
            .checked(unsafe { (self.functions().complete_ready)(self.lifecycle) })
    }

    /// Our step is over.
    pub(super) fn complete_step(&mut self) -> Result<(), String> {
        // SAFETY: as in `join`.
        self.functions()
            .checked(unsafe { (self.functions().complete_step)(self.time) })
    }

    /// Publishes a message.
    pub(super) fn publish(&mut self, at: &Publisher, message: &[u8]) -> Result<(), String> {
        let bytes = Bytes {
            data: message.as_ptr(),
            size: message.len(),
        };
        // SAFETY: as in `join`; the library copies the message.
        self.functions()
            .checked(unsafe { (self.functions().publish)(at.0, &raw const bytes) })
    }

    /// Stops the simulation for all.
    pub(super) fn stop(&mut self, reason: &str) {
        let reason = c_text(reason);
        // SAFETY: as in `join`. If it fails, the simulation has ended already.
        unsafe { (self.functions().stop)(self.lifecycle, reason.as_ptr()) };
    }

    /// Ends the simulation for all: our participant has the reason as its error, and the others are aborted.
    pub(super) fn fail(&mut self, reason: &str) {
        let reason = c_text(reason);
        // SAFETY: as in `join`. If it fails, the simulation has ended already.
        unsafe {
            (self.functions().report_error)(self.lifecycle, reason.as_ptr());
            (self.functions().abort)(self.controller);
        }
    }
}

/// Lets `call` use a topic as the library has it.
fn with_spec<T>(topic: &Topic, call: impl FnOnce(*const DataSpec) -> T) -> T {
    let [name, media_type] = [&*topic.name, scalar::MEDIA_TYPE].map(c_text);
    let texts: Vec<[CString; 2]> = (topic.labels.iter())
        .map(|label| [&*label.key, &*label.value].map(c_text))
        .collect();
    let labels: Vec<Label> = (texts.iter().zip(&topic.labels))
        .map(|([key, value], label)| Label {
            key: key.as_ptr(),
            value: value.as_ptr(),
            kind: if label.optional { 1 } else { 2 },
        })
        .collect();
    let spec = DataSpec {
        header: Header::of(DATA, 2),
        topic: name.as_ptr(),
        media_type: media_type.as_ptr(),
        label_count: labels.len(),
        labels: labels.as_ptr(),
    };
    call(&raw const spec)
}

/// The inbox behind the context of a handler.
///
/// # Safety
///
/// The context is that of [`Participant::join`], whose member is alive.
unsafe fn inbox_of<'a>(context: Handle) -> &'a Inbox {
    // SAFETY: by the condition above.
    unsafe { &*context.cast::<Inbox>() }
}

unsafe extern "C" fn on_ready(context: Handle, _: Handle) {
    // SAFETY: as in `Participant::join`.
    unsafe { inbox_of(context) }.ready();
}

unsafe extern "C" fn on_step(context: Handle, _: Handle, now: u64, _: u64) {
    // SAFETY: as in `Participant::join`.
    unsafe { inbox_of(context) }.step(now);
}

unsafe extern "C" fn on_system(context: Handle, _: Handle, state: i16) {
    // SAFETY: as in `Participant::join`.
    unsafe { inbox_of(context) }.system(state);
}

unsafe extern "C" fn on_participant(context: Handle, _: Handle, name: Text, status: *const Status) {
    // SAFETY: as in `Participant::join`; the status and its texts are valid during the call.
    unsafe {
        let status = &*status;
        inbox_of(context).participant(&text_of(name), status.state, &text_of(status.reason));
    }
}

unsafe extern "C" fn on_message(context: Handle, _: Handle, event: *const MessageEvent) {
    // SAFETY: as in `Member::subscriber`; the event and its data are valid during the call.
    unsafe {
        let Subscriber { inbox, slot } = &*context.cast::<Subscriber>();
        let MessageEvent {
            timestamp, data, ..
        } = &*event;
        let message = match data.size {
            0 => &[],
            size => std::slice::from_raw_parts(data.data, size),
        };
        inbox.message(*slot, timestamp.cast_signed(), message);
    }
}
