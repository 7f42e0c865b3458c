//! A federate of HELICS that is a client of a run.
//!
//! In the step at time *t* the federate publishes what the client reads, requests *t*, and writes what the federation had
//! published before *t*.

mod find;
mod library;
mod settings;
mod sources;

pub use settings::{HelicsMapping, HelicsSettings};

use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_bus_sdsp::connect;
use tickbus_virtual_time::{Ended, Meeting, Outcome, Step};

use crate::member::{Federation, ended, run};
use crate::opened::{EngineLibrary, Opened};
use crate::value::{Kind, Value};
use crate::watch::Watch;
use library::{Federate, Library, Publication, Subscription};
use sources::Sources;

/// A second, in nanoseconds.
const SECOND: f64 = 1e9;

/// A federation of HELICS as a client of a run.
pub type Helics = Opened<HelicsSettings, Library>;

impl EngineLibrary for Library {
    fn find(named: Option<&Path>) -> Result<Self, Mistake> {
        find::load(named)
    }

    fn version(&self) -> String {
        Self::version(*self)
    }
}

/// The federate in its federation.
struct Joined<'h> {
    helics: &'h Helics,
    watch: Watch,
    federate: Federate,
    publications: Vec<Publication>,
    subscriptions: Vec<Subscription>,
    sources: Sources,
    is_executing: bool,
}

impl Helics {
    /// Joins the federation, waits until it is complete, and takes part in the run of the server at `meeting` until the run
    /// ends. `news` gets a line for people about each stage.
    ///
    /// # Errors
    ///
    /// The broker or the server did not appear, or the run was broken off.
    pub fn take_part(
        &self,
        meeting: &Meeting,
        news: &mut dyn FnMut(&str),
    ) -> Result<Outcome, Ended> {
        let mapping = &self.mapping;
        let mut joined = self.join().map_err(|reason| self.ended(reason))?;
        news(&format!(
            "the federate \"{}\" has joined; the federation is not complete yet",
            mapping.name
        ));
        let complete = joined.complete();
        let outcome = complete
            .map_err(|reason| self.ended(reason))
            .and_then(|()| {
                news("the federation is complete");
                let at = (meeting, &self.clock);
                let timeout = self.options.timeout;
                let connection = connect(at, timeout, &mapping.declaration(), &self.stop)?;
                run(connection, mapping, timeout, &mut joined)
            });
        let Joined { mut federate, .. } = joined;
        if let Err(ended) = &outcome {
            // Otherwise the federation would continue with the last values of the run.
            federate.fail(&format!("the run of tickbus: {ended}"));
        }
        federate.disconnect();
        self.library.close();
        outcome
    }

    fn ended(&self, reason: String) -> Ended {
        ended(&self.stop, &self.mapping.client, reason)
    }

    /// Connects with the broker, and registers everything that the mapping names.
    fn join(&self) -> Result<Joined<'_>, String> {
        let mapping = &self.mapping;
        let library = self.library;
        let watch = Watch::start(&self.clock, &self.stop, move || {
            library.abort("tickbus has given up");
        })?;
        let timeout = self.options.timeout;
        let init = "--federates=1 --loglevel=none";
        let (init, broker) = match &mapping.engine.broker {
            Some(address) => {
                let (host, port) = (&address.host, address.port);
                let init = format!("{init} --broker_address={host} --brokerport={port}");
                (init, format!("at {address}"))
            }
            None => (init.to_owned(), "where HELICS looks for it".to_owned()),
        };
        let what = format!("been joined through a broker {broker}");
        let federate = watch.call(Some(timeout), &what, || {
            library.federate(&mapping.name, &mapping.engine.core, &init)
        });
        let mut federate = federate.map_err(|why| {
            if self.stop.is_stopped() {
                return why;
            }
            format!(
                "the federate \"{}\" cannot join a federation through a broker {broker}: {why}; start helics_broker \
                 first with the core type \"{}\", and give each federate another name",
                mapping.name, mapping.engine.core
            )
        })?;
        let cannot =
            |key: &str, why: String| format!("the key \"{key}\" cannot be registered: {why}");
        let publications = (mapping.publish.iter()).map(|one| {
            let kind = Kind::of(one.data_type);
            (federate.publication(&one.key, kind)).map_err(|why| cannot(&one.key, why))
        });
        let publications = publications.collect::<Result<_, _>>()?;
        let subscriptions = (mapping.subscribe.iter()).map(|one| {
            let initial = Value::of_raw(one.variable.data_type, one.initial)?;
            (federate.subscription(&one.key, initial)).map_err(|why| cannot(&one.key, why))
        });
        let subscriptions = subscriptions.collect::<Result<_, _>>()?;
        Ok(Joined {
            helics: self,
            sources: Sources::new(&mapping.name, self.clock.now()),
            watch,
            federate,
            publications,
            subscriptions,
            is_executing: false,
        })
    }
}

impl Joined<'_> {
    /// Waits until the federation is complete, and checks the types of its publications.
    fn complete(&mut self) -> Result<(), String> {
        let federate = &mut self.federate;
        self.watch.call(None, "", || federate.initialise())?;
        for (one, subscription) in self
            .helics
            .mapping
            .subscribe
            .iter()
            .zip(&self.subscriptions)
        {
            let Some(found) = federate.other_type(subscription) else {
                continue;
            };
            if found == "any" {
                return Err(format!(
                    "no federate publishes \"{}\"; correct the key, or start the federate that publishes it",
                    one.key
                ));
            }
            let data_type = one.variable.data_type;
            return Err(format!(
                "the publication \"{}\" is of the type {found}, but the variable \"{}\" is {data_type}, which takes {}; \
                 write a type that fits",
                one.key,
                one.variable.name,
                Kind::of(data_type).name()
            ));
        }
        Ok(())
    }
}

impl Federation for Joined<'_> {
    /// One step: publishes, requests the time of the step, and takes the values of the federation.
    fn step(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        let mapping = &self.helics.mapping;
        let federate = &mut self.federate;
        for ((one, publication), raw) in mapping.publish.iter().zip(&self.publications).zip(reads) {
            let value = Value::of_raw(one.data_type, *raw);
            let value =
                value.map_err(|why| format!("cannot publish \"{}\": {why}", one.variable))?;
            federate.publish(publication, value)?;
        }
        let timeout = Some(self.helics.options.timeout);
        let time = step.time;
        let what = format!("granted {time}");
        if self.is_executing {
            let granted = self
                .watch
                .call(timeout, &what, || federate.request(seconds(time)))?;
            // Seconds are double numbers: from 52 days on, they are rounded to more than a nanosecond.
            if (granted - seconds(time)).abs() > 0.5 / SECOND {
                return Err(format!(
                    "the federation has granted {granted} s where {time} was requested: it has ended"
                ));
            }
            self.sources
                .check(federate, self.helics.clock.now(), time)?;
        } else {
            // The first step is at time 0.
            self.watch.call(timeout, &what, || federate.execute())?;
            self.sources.find(federate);
            self.is_executing = true;
        }
        for ((one, subscription), raw) in
            (mapping.subscribe.iter().zip(&self.subscriptions)).zip(writes)
        {
            let value = federate.get(subscription)?.raw(one.variable.data_type);
            *raw = value.map_err(|why| format!("cannot take \"{}\": {why}", one.key))?;
        }
        Ok(())
    }
}

/// A virtual time in seconds, as HELICS has it.
#[expect(clippy::cast_precision_loss, reason = "HELICS has double numbers")]
fn seconds(time: Nanos) -> f64 {
    time.0 as f64 / SECOND
}
