//! One station of the bus as a client of the dispatcher.

use std::sync::Arc;

use super::{Told, say};
use tickbus_base::time::{Clock, Nanos};
use tickbus_bus_dispatcher::Options;
use tickbus_dispatcher::{Key, Kind, LONGEST_NAME, is_name};
use tickbus_driver::Driver;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{Events, LifeSigns, Outputs, Role};
use tickbus_image::signal::{Area, ByteOrder, DataType, Signal, SignalTable, Slot, Width};
use tickbus_net::Address;

/// Each signal has this many bytes on the dispatcher's side, whatever its type.
const PLACE: usize = 8;

/// The shortest time within which the dispatcher's side notices a silence: bridges share busy computers.
const LEAST_MAX_AGE: Nanos = Nanos::from_secs(1);

/// The pause before a lost dispatcher is called again.
const PAUSE: Nanos = Nanos::from_secs(1);

/// How the stations join the laboratory.
pub(super) struct Seating<'a> {
    /// The name; stations, if there are several, have theirs behind it.
    pub(super) name: &'a str,
    pub(super) dispatcher: &'a Address,
    pub(super) key: Option<&'a Key>,
}

/// The clients of all stations of `bus` that have signals to share. Fails with whole lines of text.
pub(super) fn all(bus: &Config, seating: &Seating<'_>) -> Result<Vec<Seat>, String> {
    let mut seats: Vec<Seat> = Vec::new();
    for station in 0..bus.table.stations.len() {
        let Some(seat) = Seat::new(bus, station, seating)? else {
            continue;
        };
        let name = &seat.config.name;
        if let Some(other) = seats.iter().find(|other| other.config.name == *name) {
            let [one, two] = [other.station, station].map(|at| &*bus.table.stations[at].name);
            return Err(format!(
                "{}: the stations \"{one}\" and \"{two}\" would both be the client {name}, because a client has letters, \
                 digits, _, - and . in its name; rename one of the stations",
                bus.path.display()
            ));
        }
        seats.push(seat);
    }
    Ok(seats)
}

/// A station of the bus as a client.
pub(super) struct Seat {
    station: usize,
    /// The client, as the driver.cfg of its own bus.
    config: Config,
    /// For each of its signals, the slot on the bus's side.
    signals: Vec<usize>,
    /// `None` while the device does not answer, and before it did.
    driver: Option<Driver>,
    slots: Vec<Slot>,
    told: Told,
}

impl Seat {
    /// The client for a station of `bus`; `None` if the station has no signals to share. Fails with whole lines of text.
    fn new(bus: &Config, station: usize, seating: &Seating<'_>) -> Result<Option<Self>, String> {
        let name = name_of(bus, station, seating.name)?;
        let signals = shared(bus, station);
        if signals.is_empty() {
            return Ok(None);
        }
        let list = signals.iter().enumerate();
        let list = list.map(|(at, index)| moved(&bus.table.signals[*index], at));
        let bytes = PLACE * signals.len();
        let config = Config {
            name,
            role: Role::Device,
            table: SignalTable::of_one_station(bytes, bytes, list.collect()),
            axes: Vec::new(),
            replies: Vec::new(),
            events: Events::None,
            life_signs: LifeSigns::default(),
            faults: Vec::new(),
            ..bus.clone()
        };
        // The client is what the bus has at its other end.
        let role = match bus.role {
            Role::Device | Role::Observer => Role::Controller,
            Role::Controller => Role::Device,
        };
        let text = format!(
            "[fieldbus]\nkind = \"dispatcher\"\nrole = \"{}\"\n",
            role.name()
        );
        let overlaid = config.overlaid(&bus.path.display().to_string(), &text);
        let mut config = overlaid.map_err(|mistakes| mistakes.to_string())?;
        // Values stay what the device has said, until it is gone: what an input gets then is the laboratory's decision.
        (config.timing.at_close, config.timing.while_stale) = (Outputs::Hold, Outputs::Hold);
        config.timing.watchdog = None;
        config.timing.cycle = None;
        config.timing.max_age = config.timing.max_age.max(LEAST_MAX_AGE);
        config.timing.reconnect = vec![PAUSE];
        if let Some(options) = config.bus.downcast_mut::<Options>() {
            options.address = seating.dispatcher.clone();
            options.name = Some(config.name.clone());
            // Read once: a station that comes back does not wait for a disk, and a file that is replaced meanwhile does not
            // lock it out.
            options.key_file = None;
            options.key = seating.key.cloned();
        }
        Ok(Some(Self {
            station,
            config,
            signals,
            driver: None,
            slots: Vec::new(),
            told: Told::default(),
        }))
    }

    /// The station on the bus.
    pub(super) fn station(&self) -> usize {
        self.station
    }

    /// Prints the channel of each signal.
    pub(super) fn introduce(&self) {
        let Some(options) = self.config.bus.downcast_ref::<Options>() else {
            return;
        };
        let table = &self.config.table;
        let channels = options.channels(table);
        let counts =
            Kind::ALL.map(|kind| format!("{}{:02}", kind.letters(), channels.counts.of(kind)));
        say(&format!("{} has {}", self.config.name, counts.join(" ")));
        let mut list: Vec<_> = channels.list.iter().zip(&table.signals).collect();
        list.sort_by_key(|(channel, _)| **channel);
        for (channel, signal) in list {
            say(&format!(
                "{}:{channel} is \"{}\"",
                self.config.name, signal.name
            ));
        }
    }

    /// Passes values between the slots of the bus and the laboratory. A device that is not there leaves it. Fails if the
    /// client cannot join any more.
    pub(super) fn pass(
        &mut self,
        is_there: bool,
        bus: &mut [Slot],
        clock: &Arc<dyn Clock>,
    ) -> Result<(), String> {
        let table = &self.config.table;
        let (says, hears) = self.config.role.areas();
        if !is_there {
            if let Some(driver) = self.driver.take() {
                driver.close();
                self.told = Told::default();
                say(&format!(
                    "{} has left: its data are stale",
                    self.config.name
                ));
            }
            // When the device is back, it is not to get what others have said before.
            for (index, signal) in self.signals.iter().zip(&table.signals) {
                if signal.area == hears {
                    bus[*index] = signal.fail_safe;
                }
            }
            return Ok(());
        }
        let driver = match &mut self.driver {
            Some(driver) => driver,
            none => {
                let opened = Driver::open(self.config.clone(), Arc::clone(clock));
                let driver = opened.map_err(|error| error.to_string())?;
                self.slots = driver.initial_slots();
                none.insert(driver)
            }
        };
        let signals = || self.signals.iter().zip(&table.signals).enumerate();
        for (own, (index, _)) in signals().filter(|(_, (_, signal))| signal.area == says) {
            self.slots[own] = bus[*index];
        }
        if driver.exchange(None, &mut self.slots).code.code() < 0 {
            return Err(driver.link().reason);
        }
        for (own, (index, _)) in signals().filter(|(_, (_, signal))| signal.area == hears) {
            bus[*index] = self.slots[own];
        }
        Ok(())
    }

    /// Reports what has changed at the line to the dispatcher.
    pub(super) fn look(&mut self) {
        let Some(driver) = &self.driver else {
            return;
        };
        self.told.look(&self.config.name, driver.link());
    }

    /// Leaves the laboratory.
    pub(super) fn close(self) {
        if let Some(driver) = self.driver {
            driver.close();
        }
    }
}

/// The name of a station's client.
fn name_of(bus: &Config, station: usize, name: &str) -> Result<String, String> {
    let name = match &*bus.table.stations {
        [_] => name.to_owned(),
        all => format!("{name}.{}", all[station].name),
    };
    let fits = |sign: char| sign.is_ascii_alphanumeric() || "_-.".contains(sign);
    let name = name.replace(|sign| !fits(sign), "_");
    if is_name(&name) {
        return Ok(name);
    }
    let file = bus.path.display();
    Err(format!(
        "{file}: \"{name}\" cannot be the name of a client; give --name one of 1 to {LONGEST_NAME} letters, digits, _, - and ."
    ))
}

/// The signals of a station that a laboratory can share: all but those that the driver makes automatically.
fn shared(bus: &Config, station: usize) -> Vec<usize> {
    let made = bus.made_signals();
    let (writes, _) = bus.role.areas();
    let table = bus.table.signals.iter().enumerate();
    let of_station = table.filter(|(index, signal)| {
        let is_made = signal.area == writes && made.iter().any(|(other, _)| other == index);
        signal.station == station && !is_made
    });
    let mut list: Vec<_> = of_station.collect();
    // Channels are counted in this order.
    list.sort_by_key(|(_, signal)| (signal.area == Area::Output, signal.byte, signal.bit));
    list.into_iter().map(|(index, _)| index).collect()
}

/// The same signal at its place on the dispatcher's side, where a scaled value is in engineering units.
fn moved(signal: &Signal, at: usize) -> Signal {
    Signal {
        station: 0,
        byte: PLACE * at,
        bit: 0,
        order: ByteOrder::Abcd,
        // A REAL has more digits than a scaled word, and shows 0.1 as such.
        data_type: match (&signal.scale, signal.data_type.width()) {
            (None, _) => signal.data_type,
            (Some(_), Width::Byte | Width::Word) => DataType::Real,
            (Some(_), _) => DataType::Lreal,
        },
        scale: None,
        in_plc: None,
        ..signal.clone()
    }
}
