//! The plug-in bus that calls the library on the bus thread.

use std::sync::Arc;

use super::Limits;
use super::library::{Bus, Library};
use super::setup::Setup;
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::{BusError, Exchange, Exchanged, Free, Port};

/// Calls the library on the bus thread.
#[derive(Debug)]
pub(super) struct Direct {
    setup: Setup,
    limits: Limits,
    calls: Calls,
    /// Stays loaded between attempts, since many libraries cannot be loaded twice in a process.
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

impl Free for Direct {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let name = self.setup.name.clone();
        port.watching_calls(&name, |port| self.run_watched(port, stop))
    }

    fn close_timeout(&self) -> Nanos {
        // A call in progress may use its time first.
        self.setup.timeout() + self.limits.close
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
        let ended = setup.cycles().serve(&mut line, port, stop);
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

    fn exchange(&mut self, port: &Port, _stop: &Stop) -> Result<Exchanged, BusError> {
        let call = || self.bus.exchange(self.timeout_ms);
        Ok(port.calling(self.call, self.limit, call)?.exchanged())
    }

    fn output(&self) -> &[u8] {
        self.bus.output()
    }
}
