//! `tickbus bridge bus FILE`: the device behind a bus of any kind as a client of the dispatcher.

mod seat;

use std::path::PathBuf;
use std::sync::Arc;

use super::say;
use crate::cli::Outcome;
use crate::cli::host::{is_news, never_ran, span};
use crate::cli::lab::{dialled, key};
use seat::{Seat, Seating};
use tickbus_base::time::{Clock, Monotonic, Nanos, Pace, Stop};
use tickbus_dispatcher::{Key, PORT};
use tickbus_driver::{Code, Driver, Watch};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_fieldbus::{Link, LinkState};
use tickbus_image::signal::Slot;
use tickbus_net::Address;

/// How often changes of the lines are reported at most.
const LOOK: Nanos = Nanos::from_millis(20);

/// Join a real PLC, or a device at any bus, to a virtual laboratory.
///
/// The signals that FILE reads from the device are outputs of the client, those that it writes are inputs. While the device
/// does not answer, the client leaves the laboratory.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg of the bus, as for a simulation: role "device" for a PLC at the other end, "controller" for a machine.
    file: PathBuf,

    /// The address of the dispatcher.
    #[arg(long, value_name = "HOST:PORT", default_value_t = Address::local(PORT), value_parser = dialled)]
    dispatcher: Address,

    /// The name of the client in the laboratory; stations, if there are several, are NAME.STATION [default: the name in FILE].
    #[arg(long)]
    name: Option<String>,

    /// The file with the key of the laboratory, if it has one.
    #[arg(long, value_name = "FILE", value_parser = key)]
    key_file: Option<Key>,

    /// Use this address of the device instead of the one in FILE.
    #[arg(long, value_name = "HOST:PORT")]
    address: Option<String>,

    /// The interval at which values are passed on.
    #[arg(long, value_name = "TIME", default_value = "5ms", value_parser = span)]
    tick: Nanos,

    /// Stop after this time [default: at Ctrl-C].
    #[arg(long, value_name = "TIME", value_parser = span)]
    duration: Option<Nanos>,
}

/// Why the command ends early.
enum Failed {
    /// The input is wrong; the text is whole lines.
    Input(String),
    Bus(String),
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds, stop: &Stop) -> Outcome {
    match carry(arguments, kinds, stop) {
        Ok(passed) => {
            say(&format!("ok ticks={} stale={}", passed.ticks, passed.stale));
            Outcome::Done
        }
        Err(Failed::Input(text)) => {
            let mistakes = text.lines().count();
            eprintln!("{text}\nbridge: failed mistakes={mistakes}");
            Outcome::WrongInput
        }
        Err(Failed::Bus(reason)) => {
            say(&format!("failed reason={reason:?}"));
            Outcome::BusFailed
        }
    }
}

/// Counts of a run.
#[derive(Default)]
struct Passed {
    ticks: u64,
    /// Ticks in which a station did not answer.
    stale: u64,
}

/// Reads the driver.cfg for this end. The tables for a simulation do not count.
fn configured(arguments: &Arguments, kinds: &'static Kinds) -> Result<Config, Failed> {
    let file = arguments.file.display();
    let wrong = |text: &dyn std::fmt::Display| Failed::Input(format!("{file}: {text}"));
    let config = Config::load(&arguments.file, kinds);
    let mut config = config.map_err(|mistakes| Failed::Input(mistakes.to_string()))?;
    if let Some(address) = &arguments.address {
        let set = config.bus.set_address(address);
        set.map_err(|mistake| wrong(&format_args!("--address: {mistake}")))?;
    }
    config.replies.clear();
    (config.record, config.page) = (None, None);
    Ok(config)
}

fn carry(arguments: &Arguments, kinds: &'static Kinds, stop: &Stop) -> Result<Passed, Failed> {
    let config = configured(arguments, kinds)?;
    let seating = Seating {
        name: arguments.name.as_ref().unwrap_or(&config.name),
        dispatcher: &arguments.dispatcher,
        key: arguments.key_file.as_ref(),
    };
    let seats = seat::all(&config, &seating).map_err(Failed::Input)?;
    let clock: Arc<dyn Clock> = Monotonic::shared();
    let kind = config.bus.kind();
    let failed = |error: tickbus_driver::DriverError| {
        if error.is_wrong_input() {
            Failed::Input(error.to_string())
        } else {
            Failed::Bus(error.to_string())
        }
    };
    let mut driver = Driver::open(config, Arc::clone(&clock)).map_err(failed)?;
    if driver.is_stepped() {
        driver.close();
        return Err(Failed::Input(format!(
            "{}: the bus \"{kind}\" runs in steps, and a laboratory in real time; name a bus that runs freely",
            arguments.file.display()
        )));
    }
    for seat in &seats {
        seat.introduce();
    }
    let mut bridge = Bridge {
        watch: driver.watch(),
        slots: driver.initial_slots(),
        driver,
        seats,
        told: Told::default(),
        passed: Passed::default(),
    };
    let ended = bridge.pass(arguments, &clock, stop);
    // What the laboratory has said last is not the device's for ever.
    let Bridge {
        driver,
        seats,
        passed,
        ..
    } = bridge;
    seats.into_iter().for_each(Seat::close);
    let unmet = driver.has_only_failed().then(|| never_ran(&driver.link()));
    driver.close();
    ended.map_err(|reason| Failed::Bus(format!("the line failed: {reason}")))?;
    unmet.map_or(Ok(passed), |reason| Err(Failed::Bus(reason)))
}

/// The bus, and the clients that its stations are.
struct Bridge {
    driver: Driver,
    watch: Watch,
    slots: Vec<Slot>,
    seats: Vec<Seat>,
    told: Told,
    passed: Passed,
}

/// The reports about a line since it last ran. A device that is switched off for days is called again and again.
#[derive(Default)]
struct Told {
    last: Option<Link>,
    lines: Vec<String>,
}

impl Told {
    /// Reports a change of the line `what`, unless it was reported before.
    fn look(&mut self, what: &str, link: Link) {
        if !is_news(self.last.as_ref(), &link) {
            return;
        }
        let line = format!("{what} {}: {}", link.state.name(), link.reason);
        if link.state == LinkState::Running {
            self.lines.clear();
        }
        if !self.lines.contains(&line) {
            say(&line);
            self.lines.push(line);
        }
        self.last = Some(link);
    }
}

impl Bridge {
    /// Passes values on until stopped. Fails with the reason of a line that failed for good.
    fn pass(
        &mut self,
        arguments: &Arguments,
        clock: &Arc<dyn Clock>,
        stop: &Stop,
    ) -> Result<(), String> {
        let begun = clock.now();
        let end = arguments.duration.map_or(Nanos::MAX, |span| begun + span);
        let mut pace = Pace::new(begun, arguments.tick);
        let mut looked = Pace::new(begun, LOOK);
        while !stop.is_stopped() && clock.now() < end {
            let now = clock.now();
            if pace.take(now) {
                self.tick(clock)?;
            }
            if looked.take(now) {
                self.look();
            }
            clock.wait_until(pace.due().min(end), stop);
        }
        self.look();
        Ok(())
    }

    fn tick(&mut self, clock: &Arc<dyn Clock>) -> Result<(), String> {
        self.watch.ask(false);
        let done = self.driver.exchange(None, &mut self.slots);
        if done.code.code() < 0 {
            return Err(self.driver.link().reason);
        }
        self.passed.ticks += 1;
        self.passed.stale += u64::from(done.code == Code::Stale);
        self.watch.update();
        for seat in &mut self.seats {
            let status = self.watch.view(|view| view.stations[seat.station()].status);
            seat.pass(status != Code::Stale, &mut self.slots, clock)?;
        }
        Ok(())
    }

    /// Reports what has changed at the lines.
    fn look(&mut self) {
        self.told.look("bus", self.driver.link());
        self.seats.iter_mut().for_each(Seat::look);
    }
}
