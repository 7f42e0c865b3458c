//! The bus `profibus-master`: the other end of PROFIBUS in worlds. The protocol is profirust's, so the product is not
//! tested against itself; this file carries frames between profirust and the port.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;

use profirust::Baudrate;
use profirust::dp::{DpMaster, Peripheral, PeripheralEvent, PeripheralHandle, PeripheralOptions};
use profirust::fdl::{FdlActiveStation, FdlApplication, ParametersBuilder};
use profirust::phy::ProfibusPhy;
use profirust::time::{Duration, Instant};
use tickbus_base::os::{Marks, Parity, SerialSettings};
use tickbus_base::time::{Nanos, Stop};
use tickbus_base::toml_text::{Key, Table};
use tickbus_fieldbus::tcp::{Call, Caller};
use tickbus_fieldbus::{
    Bus, BusError, BusKind, BusOptions, BusSetup, CYCLE, Free, NamedFile, OpenError, Port, Receipt,
    Role,
};
use tickbus_image::signal::SignalTable;
use tickbus_net::serial::{gone, open_marking};

use crate::wire;

/// The name of the line, for both ends.
pub(crate) const DEVICE: &str = "line";

/// The address of the first station; the others follow.
pub(crate) const FIRST: u8 = 3;

/// The ident of all stations.
pub(crate) const IDENT: u16 = 0x80E0;

/// The master's own address.
const ADDRESS: u8 = 1;

/// A request is repeated once.
pub(crate) const TRIES: i64 = 2;

/// The bits of silence before a telegram, with some to spare.
const PAUSE: u32 = 40;

/// The keys of `[fieldbus]`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Options {
    /// The time within which a station has to answer, in bits.
    slot_bits: u16,
    /// The time after which a station that hears nothing clears its outputs, in ms.
    watchdog_ms: u32,
}

impl BusKind for Options {
    const NAME: &'static str = "profibus-master";
    const KEYS: &'static [&'static [Key]] = &[];

    fn read(_role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let slot_bits = table.require("slot_bits", "write slot_bits = 1000")?;
        let watchdog = table.require("watchdog_ms", "write watchdog_ms = 100")?;
        Some(Self {
            slot_bits: slot_bits.whole(200..=16_383)?.try_into().ok()?,
            watchdog_ms: watchdog.whole(10..=650_000)?.try_into().ok()?,
        })
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        Vec::new()
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        Ok(Bus::Free(Box::new(Master {
            options: self.clone(),
            cycle: setup.cycle.unwrap_or(CYCLE),
        })))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }
}

#[derive(Debug)]
struct Master {
    options: Options,
    cycle: Nanos,
}

impl Free for Master {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let settings = SerialSettings {
            baud: wire::BAUD,
            parity: Parity::Even,
            two_stop_bits: false,
            seven_bits: false,
            rs485: false,
        };
        let mut call = Call::new(open_marking(DEVICE, settings, &**port.clock())?);
        port.opening("looking for the stations");
        let mut line = Line::new(&self.options, self.cycle, port);
        call.run(&mut line, port, stop)
    }
}

/// The characters on their way between profirust and the line.
#[derive(Debug, Default)]
struct Characters {
    heard: Vec<u8>,
    to_write: Vec<u8>,
    written: usize,
    /// A telegram was made since this was asked last.
    is_new: bool,
}

impl ProfibusPhy for Characters {
    fn poll_transmission(&mut self, _now: Instant) -> bool {
        self.written < self.to_write.len()
    }

    fn transmit_data<F, R>(&mut self, _now: Instant, f: F) -> R
    where
        F: FnOnce(&mut [u8]) -> (usize, R),
    {
        let mut buffer = [0; 256];
        let (length, result) = f(&mut buffer);
        if length > 0 {
            // An answer that comes so late is not taken for that of the new request.
            self.heard.clear();
            self.to_write = buffer[..length].to_vec();
            (self.written, self.is_new) = (0, true);
        }
        result
    }

    fn receive_data<F, R>(&mut self, _now: Instant, f: F) -> R
    where
        F: FnOnce(&[u8]) -> (usize, R),
    {
        let (taken, result) = f(&self.heard);
        self.heard.drain(..taken);
        result
    }
}

/// The telegram that the master sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sent {
    /// Nobody answers.
    Unanswered,
    /// The outputs of the station at this address.
    Outputs(u8),
    /// Another request to this address.
    Request(u8),
}

impl Sent {
    /// As the first bytes of a telegram tell it (IEC 61158-4-3: start delimiter, addresses, function code).
    fn of(telegram: &[u8]) -> Self {
        let header: Option<&Range<usize>> = match telegram.first() {
            Some(0x10 | 0xA2) => Some(&(1..4)),
            Some(0x68) => Some(&(4..7)),
            _ => None,
        };
        let Some([to, _, function]) = header.and_then(|place| telegram.get(place.clone())) else {
            return Self::Unanswered;
        };
        match (to & 0x7F, function & 0x0F) {
            (0x7F, _) => Self::Unanswered,
            // To the default service access point, with high priority.
            (_, 0x0D) if to & 0x80 == 0 => Self::Outputs(*to),
            (address, _) => Self::Request(address),
        }
    }
}

/// A slave, with a master for it alone: profirust 0.6 panics where two slaves of one stop answering in the same turn.
struct Side {
    dp: DpMaster<'static>,
    address: u8,
    handle: PeripheralHandle,
    /// When its outputs were taken, with the receipt.
    taken: Nanos,
    receipt: Option<Receipt>,
    /// When the current request was sent first. A station answers one that is repeated as it did the first time.
    asked: Option<Nanos>,
    exchanges: bool,
    /// The slave had its turn in this bus cycle.
    is_done: bool,
}

/// The master at work.
struct Line {
    options: Options,
    characters: Characters,
    marks: Marks,
    fdl: FdlActiveStation,
    stations: Vec<Side>,
    cycle: Nanos,
    slot: Nanos,
    /// When the next bus cycle begins.
    next: Nanos,
    is_in_cycle: bool,
    /// When profirust is polled next.
    due: Nanos,
}

/// The identifiers of modules with this many bytes of inputs and of outputs. profirust keeps a reference to them, so they
/// are kept for ever: one list for each pair of sizes.
fn modules(inputs: usize, outputs: usize) -> &'static [u8] {
    thread_local! {
        static KNOWN: RefCell<BTreeMap<(usize, usize), &'static [u8]>> = RefCell::default();
    }
    let identifiers = |bytes: usize, direction: u8| {
        let sizes = (0..bytes)
            .step_by(16)
            .map(move |first| (bytes - first).min(16));
        sizes.map(move |size| direction | u8::try_from(size - 1).expect("at most 15"))
    };
    KNOWN.with_borrow_mut(|known| {
        let modules = known.entry((inputs, outputs)).or_insert_with(|| {
            let modules = identifiers(inputs, 0x10).chain(identifiers(outputs, 0x20));
            modules.collect::<Vec<u8>>().leak()
        });
        *modules
    })
}

impl Line {
    fn new(options: &Options, cycle: Nanos, port: &Port) -> Self {
        let options = options.clone();
        let stations = (0..port.stations()).zip(FIRST..).map(|(index, address)| {
            let (outputs, inputs) = port.sizes(index);
            let mut dp = DpMaster::new(vec![]);
            dp.enter_operate();
            let peripheral = PeripheralOptions {
                ident_number: IDENT,
                user_parameters: Some(&[]),
                config: Some(modules(inputs, outputs)),
                max_tsdr: options.slot_bits - 15,
                ..PeripheralOptions::default()
            };
            let station = Peripheral::new(address, peripheral, vec![0; inputs], vec![0; outputs]);
            Side {
                address,
                handle: dp.add(station.with_diag_buffer(vec![0; 64])),
                dp,
                receipt: None,
                taken: Nanos(i64::MIN / 2),
                asked: None,
                exchanges: false,
                is_done: false,
            }
        });
        let stations = stations.collect();
        let mut parameters = ParametersBuilder::new(ADDRESS, Baudrate::B500000);
        parameters
            .slot_bits(options.slot_bits)
            .highest_station_address(ADDRESS + 1)
            // The token is held for a whole bus cycle: after each token, profirust spends a slot time on other masters.
            .token_rotation_bits(16_000_000)
            .watchdog_timeout(Duration::from_millis(options.watchdog_ms.into()));
        let mut fdl = FdlActiveStation::new(parameters.build());
        fdl.set_online();
        let now = port.clock().now();
        let slot = Nanos(wire::bits(options.slot_bits.into()));
        Self {
            options,
            characters: Characters::default(),
            marks: Marks::default(),
            fdl,
            stations,
            cycle,
            slot,
            next: now,
            is_in_cycle: false,
            due: now,
        }
    }

    /// Takes the frames of stations without a pending request; returns false if there are none in this cycle. Outputs that
    /// were taken before parameters and configuration were sent would be old.
    fn take(&mut self, now: Nanos, port: &mut Port) -> bool {
        for (index, side) in self.stations.iter_mut().enumerate() {
            if side.asked.is_some() || now - side.taken < Nanos(self.cycle.0 / 2) {
                continue;
            }
            let Some(mut frames) = port.take(index..index + 1, now) else {
                return false;
            };
            let outputs = side.dp.get_mut(side.handle).pi_q_mut();
            outputs.copy_from_slice(frames.frame(index));
            (side.receipt, side.taken) = (Some(frames.receipt()), now);
        }
        true
    }

    fn poll(&mut self, now: Nanos, port: &mut Port) {
        if !self.is_in_cycle && now < self.next {
            self.due = self.next;
            return;
        }
        let is_up = port.is_up(now);
        if !is_up && self.stations.iter().any(|side| side.asked.is_some()) {
            // No request of before may be repeated when the line is up again: its outputs are old.
            *self = Self::new(&self.options, self.cycle, port);
        }
        if !is_up || !self.take(now, port) {
            self.next = now + self.cycle;
            self.due = self.next;
            self.is_in_cycle = false;
            return;
        }
        if !self.is_in_cycle {
            self.is_in_cycle = true;
            self.next = (self.next + self.cycle).max(now);
        }
        let time = Instant::from_micros(now.0 / 1_000);
        let masters = self.stations.iter_mut();
        let masters = masters.map(|side| &mut side.dp as &mut dyn FdlApplication);
        let masters = &mut masters.collect::<Vec<_>>();
        self.fdl.poll_multi(time, &mut self.characters, masters);
        let pause = Nanos(wire::bits(PAUSE));
        self.due = if std::mem::take(&mut self.characters.is_new) {
            let sent = Sent::of(&self.characters.to_write);
            for side in &mut self.stations {
                match sent {
                    Sent::Outputs(address) if side.address == address => {
                        side.asked.get_or_insert(now);
                    }
                    // The station has left the data exchange, or was asked for its diagnosis.
                    Sent::Request(address) if side.address == address => side.asked = None,
                    _ => {}
                }
            }
            let end = now + Nanos(wire::characters(self.characters.to_write.len()));
            end + if sent == Sent::Unanswered {
                pause
            } else {
                self.slot + pause
            }
        } else if self.fdl.is_in_ring() {
            now + pause
        } else {
            now + self.slot
        };
        for index in 0..self.stations.len() {
            let side = &mut self.stations[index];
            let events = side.dp.take_last_events();
            side.is_done |= events.cycle_completed;
            if let Some((_, event)) = events.peripheral {
                self.event(index, event, now, port);
            }
        }
        if self.stations.iter().all(|side| side.is_done) {
            self.stations
                .iter_mut()
                .for_each(|side| side.is_done = false);
            self.is_in_cycle = false;
            self.due = self.next;
        }
    }

    fn event(&mut self, index: usize, event: PeripheralEvent, now: Nanos, port: &mut Port) {
        let side = &mut self.stations[index];
        match event {
            PeripheralEvent::DataExchanged => {
                if let Some(asked) = side.asked.take() {
                    port.came_at(asked);
                }
                if let Some(receipt) = side.receipt.take() {
                    port.sent(&receipt);
                }
                port.received(index, now, side.dp.get_mut(side.handle).pi_i());
                side.exchanges = true;
                port.running("data are exchanged");
            }
            PeripheralEvent::Offline
            | PeripheralEvent::ConfigError
            | PeripheralEvent::ParameterError => {
                (side.asked, side.receipt) = (None, None);
                let address = side.address;
                if std::mem::take(&mut side.exchanges)
                    && !self.stations.iter().any(|side| side.exchanges)
                {
                    let why = format!("station {address}: {event:?}");
                    port.lost(&BusError::Link(why), "looking for the stations");
                }
            }
            _ => {}
        }
    }
}

impl Caller for Line {
    fn hear(&mut self, _now: Nanos, bytes: &[u8], _port: &mut Port) -> Result<(), BusError> {
        let characters = self.marks.read(bytes);
        self.characters.heard.extend(characters.bytes);
        // A telegram with a damaged character is lost.
        if !characters.damaged.is_empty() {
            self.characters.heard.clear();
        }
        self.due = Nanos(i64::MIN);
        Ok(())
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        if now >= self.due {
            self.poll(now, port);
        }
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        &self.characters.to_write[self.characters.written..]
    }

    fn wrote(&mut self, _now: Nanos, count: usize, _port: &mut Port) {
        self.characters.written += count;
    }

    fn deadline(&self, _port: &Port) -> Nanos {
        self.due
    }

    fn left(&mut self) -> BusError {
        gone(DEVICE, "it was unplugged").into()
    }

    fn broke(&mut self, error: &std::io::Error) -> BusError {
        gone(DEVICE, error).into()
    }
}
