//! The plug-in bus that calls the library on the bus thread.

use std::sync::Arc;

use super::Limits;
use super::cycle::{self, Exchange};
use super::library::{Bus, Library};
use super::outcome::Outcome;
use super::setup::Setup;
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_fieldbus::{BusError, Free, Port};

/// Calls the library on the bus thread.
#[derive(Debug)]
pub(super) struct Direct {
    setup: Setup,
    limits: Limits,
    calls: Calls,
    /// Stays loaded between attempts: many libraries cannot be loaded twice in a process.
    library: Option<Library>,
}

/// The names of the calls in the statistics.
#[derive(Debug)]
struct Calls {
    load: Arc<str>,
    open: Arc<str>,
    exchange: Arc<str>,
    close: Arc<str>,
    unload: Arc<str>,
}

impl Direct {
    pub(super) fn new(setup: Setup, limits: Limits) -> Self {
        let name = setup.library_name();
        let call = |what: &str| format!("{what} {name}").into();
        Self {
            calls: Calls {
                load: call("loading of"),
                open: call("tickbus_open() of"),
                exchange: call("tickbus_exchange() of"),
                close: call("tickbus_close() of"),
                unload: call("unloading of"),
            },
            setup,
            limits,
            library: None,
        }
    }
}

/// How often a call in progress is checked.
const LOOK: Nanos = Nanos::from_millis(250);

impl Free for Direct {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let cannot =
            |error: std::io::Error| BusError::Link(format!("the system refused a thread: {error}"));
        // A call that does not return cannot report itself. Its watchdog uses the system's time, whatever
        // clock the driver has, and is left behind with the bus thread if need be.
        let real = Monotonic::shared();
        let (watch, over) = (port.call_watch(), Stop::new());
        std::thread::scope(|scope| {
            std::thread::Builder::new()
                .name(format!("watch {}", self.setup.name))
                .spawn_scoped(scope, || {
                    while !over.is_stopped() {
                        real.wait_until(real.now() + LOOK, &over);
                        watch.look();
                    }
                })
                .map_err(cannot)?;
            let _end = StopOnDrop(&over);
            self.run_watched(port, stop)
        })
    }

    fn close_timeout(&self) -> Nanos {
        // A call in progress may use its time first.
        self.setup.timeout() + self.limits.close
    }
}

/// Ends the watchdog even if the bus panics.
struct StopOnDrop<'a>(&'a Stop);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.stop();
    }
}

impl Direct {
    fn run_watched(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let (setup, limits, calls) = (&self.setup, self.limits, &self.calls);
        port.tell("library", &setup.library.to_string_lossy());
        let library = match &self.library {
            Some(library) => library,
            None => self
                .library
                .insert(port.calling(&calls.load, limits.open, || {
                    Library::load(setup.library.as_ref())
                })?),
        };
        let bus = port.calling(&calls.open, limits.open, || library.open(setup))?;
        let mut line = OpenBus {
            bus,
            timeout_ms: setup.timeout_ms,
            call: &calls.exchange,
            limit: setup.timeout() + limits.call,
        };
        let ended = cycle::serve(&mut line, setup, port, stop);
        port.calling(&calls.close, limits.close, || drop(line));
        if stop.is_stopped() {
            // Here, while the watchdog is running: unloading also runs code of the library.
            let library = self.library.take();
            port.calling(&calls.unload, limits.close, || drop(library));
        }
        ended
    }
}

/// An open bus of the library.
struct OpenBus<'a> {
    bus: Bus<'a>,
    timeout_ms: u32,
    call: &'a Arc<str>,
    limit: Nanos,
}

impl Exchange for OpenBus<'_> {
    fn input(&mut self) -> &mut [u8] {
        self.bus.input()
    }

    fn exchange(&mut self, port: &Port, _stop: &Stop) -> Result<Option<Outcome>, BusError> {
        let call = || self.bus.exchange(self.timeout_ms);
        port.calling(self.call, self.limit, call).map(Some)
    }

    fn output(&self) -> &[u8] {
        self.bus.output()
    }
}
