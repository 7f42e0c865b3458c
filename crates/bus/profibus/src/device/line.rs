//! The stations of a device on a serial line.

use std::io;

use tickbus_base::os::Marks;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_fieldbus::tcp::{Call, Caller};
use tickbus_fieldbus::{BusError, Medium, Port};
use tickbus_net::serial::{gone, open_marking};

use super::diagnosis::diagnosed;
use super::{LineOptions, Machine, StationSetup, Stations};
use crate::segment::{Segment, Taken};
use crate::station::Station;

/// A wait for an answer up to this long is spent polling the clock: sleeping and waking take a thread as long, while
/// the master's slot time runs. The value is the shortest wait at 500 kbit/s plus a margin.
const NO_SLEEP: Nanos = Nanos::from_micros(30);

/// The most clock reads per wait, in case the clock stands still; on a fast computer that many take longer than
/// [`NO_SLEEP`].
const LOOKS: u32 = 3_000;

/// Serves the stations until `stop`.
///
/// # Errors
///
/// The serial port does not exist or has disappeared, or an address is taken.
pub(super) fn serve(
    options: &LineOptions,
    setups: &[StationSetup],
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let mut call = Call::new(open_marking(
        &options.device,
        options.settings,
        &**port.clock(),
    )?);
    port.carried_by(Medium::Serial {
        character: options.settings.character(),
    });
    port.tell("device", &options.device);
    port.opening(&format!("listening on {}", options.device));
    let stations = setups
        .iter()
        .map(|setup| Station::new(setup.address, setup.identity.clone()));
    let mut line = Line {
        options,
        setups,
        marks: Marks::default(),
        segment: Segment::new(options.settings.baud, stations.collect()),
        stations: Stations::new(setups, port),
        reply: Vec::new(),
        written: 0,
        not_before: Nanos(0),
        not_after: Nanos(0),
        is_offered: false,
    };
    // Restarted stations have neither masters nor diagnoses.
    port.tell("exchanging", "none");
    port.report_diagnoses_anew();
    let ended = call.run(&mut line, port, stop);
    if let Err(error) = &ended {
        // The stations begin again without their master's watchdog, which would have cleared the outputs.
        line.stations.lost(port, &error.to_string());
    }
    ended
}

struct Line<'a> {
    options: &'a LineOptions,
    /// In the order of the signal table.
    setups: &'a [StationSetup],
    marks: Marks,
    segment: Segment,
    stations: Stations,
    /// The answer being sent, and how much of it the system has accepted.
    reply: Vec<u8>,
    written: usize,
    /// The earliest and the latest time for its first byte.
    not_before: Nanos,
    not_after: Nanos,
    /// True if the system could have taken its first byte.
    is_offered: bool,
}

/// Polls the clock until `time`. In a simulation time does not pass meanwhile.
fn comes_at_once(time: Nanos, clock: &dyn Clock) -> bool {
    let looks = if clock.simulation().is_some() {
        0
    } else {
        LOOKS
    };
    (0..looks).any(|_| {
        std::hint::spin_loop();
        clock.now() >= time
    })
}

impl Line<'_> {
    fn begins(&self) -> bool {
        self.written == 0 && !self.reply.is_empty()
    }
}

impl Caller for Line<'_> {
    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        let characters = self.marks.read(bytes);
        port.not_from_peer(bytes.len().saturating_sub(characters.bytes.len()));
        // An injected fault has taken the line down; nothing passes.
        if !port.is_up(now) {
            return Ok(());
        }
        if let Some(all) = port.take_diagnoses(now) {
            for (index, setup) in self.setups.iter().enumerate() {
                let own = all.iter().filter(|diagnosis| diagnosis.station == index);
                let told = diagnosed(&setup.identity.configuration, own);
                let station = self.segment.station_mut(setup.address);
                station.expect("it is one of them").diagnose(&told);
            }
        }
        let mut machine = Machine {
            stations: &mut self.stations,
            port,
        };
        // Any new telegram means that nobody waits for the last answer any more.
        self.reply.clear();
        self.written = 0;
        let heard = self
            .segment
            .hear(now, characters, &mut machine, &mut self.reply);
        let heard = heard.map_err(|Taken { address }| {
            BusError::Link(format!(
                "another device on {} answers at address {address}; give the station another address, or take that \
                 device off the line",
                self.options.device
            ))
        })?;
        port.read_telegrams(heard.telegrams);
        for _ in 0..heard.damaged {
            port.count("profibus-device.damaged");
        }
        if let Some((_, wait)) = heard.answer {
            self.not_before = now + wait;
            self.not_after = now + wait.max(self.segment.bits(self.options.max_tsdr.into()));
        }
        Ok(())
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        if self.begins() && now > self.not_after {
            port.count("profibus-device.late");
            self.reply.clear();
        }
        let mut machine = Machine {
            stations: &mut self.stations,
            port,
        };
        self.segment.turn(now, &mut machine);
        self.is_offered = now >= self.not_before
            || self.begins()
                && self.not_before - now <= NO_SLEEP
                && comes_at_once(self.not_before, &**port.clock());
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        if self.begins() && !self.is_offered {
            return &[];
        }
        &self.reply[self.written..]
    }

    fn wrote(&mut self, _now: Nanos, count: usize, _port: &mut Port) {
        self.written += count;
        if self.written == self.reply.len() {
            self.reply.clear();
            self.written = 0;
        }
    }

    fn deadline(&self, port: &Port) -> Nanos {
        let stale = port.stale_at(port.clock().now());
        let deadline = self.segment.deadline().min(stale);
        if self.begins() {
            // An answer that the system was offered but did not take waits until it is late.
            deadline.min(if self.is_offered {
                self.not_after + Nanos(1)
            } else {
                self.not_before
            })
        } else {
            deadline
        }
    }

    fn left(&mut self) -> BusError {
        gone(&self.options.device, "it was closed").into()
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        gone(&self.options.device, error).into()
    }
}
