//! The bus of an observer: a serial line that is only read, and the image.

use std::io::Read as _;

use tickbus_base::os::{Interest, Marks, PollSet, SerialEar};
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::{BusError, Cause, Free, Medium, PlcState, Port};
use tickbus_net::is_for_later;
use tickbus_net::serial::{gone, listen};

use super::{News, Observer};
use crate::device::{LineOptions, StationSetup};
use crate::layout::Layout;

/// How often the observer looks at stations that exchange no data.
const LOOK: Nanos = Nanos::from_secs(1);

/// The line's message while no station exchanges data.
const WAITS: &str = "listening";

/// The bytes that are read at once.
const BUFFER: usize = 4096;

/// The bus of kind `profibus-device` at an observer's end. It has a port for reading alone, and no telegram to send.
#[derive(Debug)]
pub(crate) struct ProfibusObserver {
    options: LineOptions,
    stations: Vec<StationSetup>,
}

impl ProfibusObserver {
    /// Observes these stations on the line that `options` describe.
    pub(crate) fn new(options: &LineOptions, stations: Vec<StationSetup>) -> Self {
        Self {
            options: options.clone(),
            stations,
        }
    }
}

impl Free for ProfibusObserver {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let device = &self.options.device;
        let settings = self.options.settings;
        let ear = listen(device, settings, &**port.clock())?;
        port.carried_by(Medium::Serial {
            character: settings.character(),
        });
        port.tell("device", device);
        port.tell("exchanging", "none");
        port.opening(&format!("listening on {device}"));
        let all = self.stations.iter();
        let all = all.map(|setup| (setup.address, setup.identity.clone()));
        let now = port.clock().now();
        let mut listening = Listening {
            options: &self.options,
            observer: Observer::new(settings.baud, all),
            sides: self.stations.iter().map(Side::new).collect(),
            marks: Marks::default(),
            arrived: None,
            next: now + LOOK,
        };
        listening.run(ear, port, stop)
    }
}

/// The driver's side of a station.
#[derive(Debug)]
struct Side {
    address: u8,
    inputs: Layout,
    outputs: Layout,
    /// The bytes of each area in the image.
    sizes: [usize; 2],
    /// When data were last exchanged, as long as they are.
    exchanged: Option<Nanos>,
    /// When data that cannot be read were last exchanged.
    unreadable: Option<Nanos>,
    /// The master is in CLEAR.
    is_cleared: bool,
    /// The last reason why none are, and its cause.
    told: String,
    cause: Cause,
    /// That reason was not reported for the line yet.
    is_news: bool,
    /// The last diagnosis, in words.
    diagnosis: String,
    /// The outputs, and behind them the inputs; and a buffer for one of them.
    frame: Vec<u8>,
    buffer: Vec<u8>,
}

impl Side {
    fn new(setup: &StationSetup) -> Self {
        let [inputs, outputs] = setup.sizes;
        Self {
            address: setup.address,
            inputs: setup.inputs.clone(),
            outputs: setup.outputs.clone(),
            sizes: setup.sizes,
            exchanged: None,
            unreadable: None,
            is_cleared: false,
            told: String::new(),
            cause: Cause::Waiting,
            is_news: false,
            diagnosis: String::new(),
            frame: vec![0; inputs + outputs],
            buffer: vec![0; inputs.max(outputs)],
        }
    }

    /// No data are exchanged, or none that can be read.
    fn hears_nothing(&mut self, why: &str, cause: Cause) {
        why.clone_into(&mut self.told);
        self.cause = cause;
        self.is_news = true;
    }

    /// The frame of the image from the data of an exchange.
    fn frame(&mut self, outputs: &[u8], inputs: &[u8]) -> &[u8] {
        let [of_inputs, of_outputs] = self.sizes;
        let (first, second) = self.frame.split_at_mut(of_outputs);
        let buffer = &mut self.buffer[..of_outputs];
        first.copy_from_slice(self.outputs.receive(outputs, buffer));
        let buffer = &mut self.buffer[..of_inputs];
        second.copy_from_slice(self.inputs.receive(inputs, buffer));
        &self.frame
    }
}

/// A line that is being listened to.
#[derive(Debug)]
struct Listening<'a> {
    options: &'a LineOptions,
    observer: Observer,
    sides: Vec<Side>,
    marks: Marks,
    /// When the last bytes arrived.
    arrived: Option<Nanos>,
    /// When to look at the stations next.
    next: Nanos,
}

impl Listening<'_> {
    fn run(&mut self, mut ear: SerialEar, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let mut set = PollSet::new(stop);
        let lost = |error| BusError::from(gone(&self.options.device, error));
        set.add(0, &ear, Interest::Read).map_err(lost)?;
        let mut bytes = vec![0; BUFFER];
        let mut now = port.clock().now();
        port.begin_to_look(now);
        while !stop.is_stopped() {
            port.look_at_line(now);
            match ear.read(&mut bytes) {
                Ok(0) => return Err(gone(&self.options.device, "it was closed").into()),
                Ok(count) => {
                    if count == bytes.len() {
                        port.look_leaves_some();
                    }
                    self.hear(now, &bytes[..count], port);
                }
                Err(error) if is_for_later(&error) => {}
                Err(error) => return Err(gone(&self.options.device, error).into()),
            }
            self.look(now, port);
            port.observe(now);
            let limit = port.max_age() + Nanos(1);
            let exchanged = self.sides.iter().filter_map(|side| side.exchanged);
            let silent = exchanged.map(|at| at + limit).min().unwrap_or(Nanos::MAX);
            let deadline = self.next.min(silent).min(port.due()).min(port.next_look());
            let waited = set.wait_after(now, &**port.clock(), deadline);
            waited.map_err(|error| BusError::from(gone(&self.options.device, error)))?;
            now = port.clock().now();
        }
        Ok(())
    }

    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) {
        self.arrived = Some(now);
        port.read(0, bytes.len());
        let characters = self.marks.read(bytes);
        port.not_from_peer(bytes.len().saturating_sub(characters.bytes.len()));
        let (sides, next) = (&mut self.sides, &mut self.next);
        let damaged = self.observer.damaged();
        let telegrams = self
            .observer
            .hear(now, characters, |index, news| match news {
                News::Exchange {
                    master,
                    outputs,
                    inputs,
                    is_cleared,
                } => {
                    let side = &mut sides[index];
                    let is_first = side.exchanged.replace(now).is_none();
                    let was_cleared = std::mem::replace(&mut side.is_cleared, is_cleared);
                    if is_first || is_cleared != was_cleared {
                        port.plc_state(index, now, plc_state(is_cleared));
                    }
                    if is_first {
                        side.told.clear();
                        side.is_news = false;
                        port.tell("exchanging", &exchanging(sides));
                        port.running(&format!("observing what master {master} exchanges"));
                    }
                    port.received(index, now, sides[index].frame(outputs, inputs));
                }
                News::Cleared(is_cleared) => {
                    let side = &mut sides[index];
                    side.is_cleared = is_cleared;
                    if side.exchanged.is_some() {
                        port.plc_state(index, now, plc_state(is_cleared));
                    }
                }
                News::Unreadable(why) => {
                    let side = &mut sides[index];
                    side.exchanged = None;
                    side.unreadable = Some(now);
                    if side.told != why {
                        side.hears_nothing(why, Cause::Refused);
                        *next = now;
                    }
                }
                News::Diagnosis(words) => {
                    let side = &mut sides[index];
                    let told = format_args!("station {}: diagnosis {words}", side.address);
                    port.log(log::Level::Info, "diagnosis", told);
                    side.diagnosis = format!("{}: {words}", side.address);
                    let all = sides.iter().map(|side| &*side.diagnosis);
                    let all: Vec<&str> = all.filter(|told| !told.is_empty()).collect();
                    port.tell("diagnosis", &all.join("; "));
                }
            });
        port.read_telegrams(telegrams);
        for _ in damaged..self.observer.damaged() {
            port.count("profibus-device.damaged");
        }
    }

    /// Looks for stations that exchange no data, and reports why.
    fn look(&mut self, now: Nanos, port: &mut Port) {
        let limit = port.max_age();
        let mut is_due = now >= self.next;
        for side in &mut self.sides {
            if side.exchanged.is_some_and(|at| now - at > limit) {
                side.exchanged = None;
                is_due = true;
            }
        }
        if !is_due {
            return;
        }
        self.next = now + LOOK;
        let line = self.trouble(now, limit.min(LOOK));
        for index in 0..self.sides.len() {
            if self.sides[index].exchanged.is_some() {
                continue;
            }
            let (why, cause) = if let Some((why, cause)) = &line {
                (why.clone(), *cause)
            } else {
                let heard = self.sides[index].unreadable;
                let exchanges = heard.is_some_and(|at| now - at <= limit);
                self.observer.trouble(index, exchanges)
            };
            let side = &mut self.sides[index];
            if side.told != why {
                side.hears_nothing(&why, cause);
            }
        }
        let others = exchanging(&self.sides);
        port.tell("exchanging", &others);
        let are_none = self.sides.iter().all(|side| side.exchanged.is_none());
        let mut is_news = false;
        for (index, side) in self.sides.iter_mut().enumerate() {
            if !std::mem::take(&mut side.is_news) {
                continue;
            }
            is_news = true;
            port.station_left(index, now, side.cause, &side.told);
            if !are_none {
                let told = format_args!("{}; data are exchanged with {others}", side.told);
                port.log(log::Level::Warn, "station silent", told);
            }
        }
        if !is_news || !are_none {
            return;
        }
        let mut all: Vec<&str> = self.sides.iter().map(|side| &*side.told).collect();
        all.dedup();
        let why = all.join("; ");
        let error = match self.sides[0].cause {
            Cause::Refused => BusError::Refused(why),
            Cause::Protocol => BusError::Protocol(why),
            _ => BusError::Link(why),
        };
        port.lost(&error, WAITS);
    }

    /// Says what is wrong with the whole line, if nothing has arrived for `limit`, or nothing that is a telegram.
    fn trouble(&self, now: Nanos, limit: Nanos) -> Option<(String, Cause)> {
        let LineOptions {
            device, settings, ..
        } = self.options;
        let is_old = |at: Option<Nanos>| at.is_none_or(|at| now - at > limit);
        if is_old(self.arrived) {
            let why = format!(
                "nothing arrives on {device}; see whether the line is connected, and its master is on"
            );
            return Some((why, Cause::Link));
        }
        (is_old(self.observer.framed()) && self.observer.is_garbled()).then(|| {
            let why = format!(
                "what arrives on {device} is no telegram at {} baud; write the rate of the PLC's project in \"baud\", \
                 and see whether A and B are swapped",
                settings.baud
            );
            (why, Cause::Protocol)
        })
    }
}

const fn plc_state(is_cleared: bool) -> PlcState {
    if is_cleared {
        PlcState::Stop
    } else {
        PlcState::Run
    }
}

/// The addresses of the stations that exchange data, as text.
fn exchanging(sides: &[Side]) -> String {
    let all = sides.iter().filter(|side| side.exchanged.is_some());
    let all: Vec<String> = all.map(|side| side.address.to_string()).collect();
    if all.is_empty() {
        return "none".to_owned();
    }
    all.join(" ")
}
