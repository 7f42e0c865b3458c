//! A program scanned by the tick, in simulation time.

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{BusError, Port, Role, Stepped, Validity};
use tickbus_image::{Arrival, DirectStream, StationStreams, Swallowed, copy_frame, is_stale};
use tickbus_plc::Program;

use super::ScanCounters;
use super::unit::{Unit, units};
use crate::frames::directions;

/// The most scans that one exchange makes up for: 1,000 s of scans every 10 ms. A longer step is treated as a wrong
/// time, since scanning through it would block the tick for too long.
const MOST_SCANS: i64 = 100_000;

/// A hosted program scanned by the tick, in simulation time.
pub(crate) struct SteppedHost {
    /// The program and its instances for further stations, each with its end of the line.
    stations: Vec<(Unit, Line)>,
    validity: Validity,
    max_age: Nanos,
    scan_counters: Arc<ScanCounters>,
    interval: Nanos,
    /// The time of the next scan; `None` before the first exchange.
    due: Option<Nanos>,
    /// A time that was refused because it is too far ahead. If the next time is near it, the jump was intended.
    refused: Option<Nanos>,
    delivered: Delivered,
}

/// The streams of one station. Machine and program share a thread, so nothing is handed over between threads.
struct Line {
    inputs: DirectStream,
    outputs: DirectStream,
}

/// The frames that the program received.
#[derive(Default)]
struct Delivered {
    /// The number of frames.
    frames: u64,
    /// The last time that the machine was heard.
    heard: Option<Nanos>,
    /// True if the machine's latest values have been delivered.
    is_latest: bool,
    /// True if no scan has seen the last frame yet.
    is_fresh: bool,
}

impl SteppedHost {
    pub(crate) fn new(
        program: Box<dyn Program>,
        config: &Config,
        interval: Nanos,
        swallowed: &Swallowed,
    ) -> (Self, Arc<ScanCounters>) {
        let (role, max_age, table) = (Role::Controller, config.timing.max_age, &config.table);
        let scan_counters = Arc::new(ScanCounters::new(table));
        let units = units(program, (config, role), &scan_counters);
        let lines = directions(table, role).into_iter();
        let lines = lines.map(|streams| Line::new(streams, swallowed));
        let mut validity = Validity::new(table.stations.len());
        validity.watch(config.life_signs.watches(table, role, max_age));
        let host = Self {
            stations: units.into_iter().zip(lines).collect(),
            validity,
            max_age,
            scan_counters: Arc::clone(&scan_counters),
            interval,
            due: None,
            refused: None,
            delivered: Delivered::default(),
        };
        (host, scan_counters)
    }

    /// Runs one scan at `now`: inputs, program, outputs.
    #[inline]
    fn scan(&mut self, now: Nanos) {
        let Delivered {
            frames,
            heard,
            is_latest,
            is_fresh,
        } = &mut self.delivered;
        if *is_latest {
            // Between two ticks only simulation time passes: the machine is alive all along, however large the steps
            // are.
            *heard = Some(now);
        }
        let arrival = Arrival {
            fresh: std::mem::take(is_fresh),
            stale: false,
            age: heard.map_or(Nanos::MAX, |heard| (now - heard).max(Nanos::ZERO)),
            sequence: *frames,
        };
        let mut alive = true;
        for (station, (unit, line)) in self.stations.iter_mut().enumerate() {
            let is_valid = self.validity.is_valid(station);
            let stale = is_stale(arrival.age, self.max_age, is_valid);
            unit.take(|inputs| {
                if heard.is_some() {
                    let bytes = if stale {
                        line.inputs.latest()
                    } else {
                        line.inputs.read(now)
                    };
                    copy_frame(&mut inputs.bytes, bytes);
                }
                Arrival { stale, ..arrival }
            });
            unit.run(now, true, &self.scan_counters, std::iter::empty());
            unit.count_outputs(&self.scan_counters);
            line.outputs
                .write(|frame| copy_frame(frame, unit.outputs()));
            alive &= unit.is_alive();
        }
        self.scan_counters.scanned(arrival.age, alive);
    }
}

impl Line {
    fn new(streams: StationStreams, swallowed: &Swallowed) -> Self {
        Self {
            inputs: DirectStream::new(streams.rx_fail_safe, streams.rx_latched)
                .with_counted(&streams.rx_counted, swallowed),
            outputs: DirectStream::new(streams.tx_fail_safe, streams.tx_latched)
                .with_counted(&streams.tx_counted, swallowed),
        }
    }
}

impl Stepped for SteppedHost {
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        port.running("the hosted program is there");
        self.delivered.is_latest = false;
        // An injected fault can swallow the frames.
        let Some(mut frames) = port.take_all(now) else {
            return Ok(());
        };
        for (station, (_, line)) in self.stations.iter_mut().enumerate() {
            let frame = frames.frame(station);
            self.validity.arrived(station, now, frame);
            if self.validity.is_valid(station) {
                line.inputs.write(|bytes| copy_frame(bytes, frame));
            } else {
                line.inputs.pass(frame);
            }
        }
        let receipt = frames.receipt();
        port.sent(&receipt);
        self.delivered = Delivered {
            frames: self.delivered.frames + 1,
            heard: Some(now),
            is_latest: true,
            is_fresh: true,
        };
        Ok(())
    }

    fn accepts(&mut self, now: Nanos) -> Result<(), BusError> {
        let most = self.interval.times(MOST_SCANS);
        let due = self.due.unwrap_or(now);
        let refused = self.refused.take();
        if now - due <= most {
            return Ok(());
        }
        if refused.is_some_and(|before| before <= now && now - before <= most) {
            // The jump was intended.
            self.due = Some(now);
            return Ok(());
        }
        self.refused = Some(now);
        Err(BusError::Refused(format!(
            "simulation time jumped from {due} to {now}, over more than {MOST_SCANS} scans of the \
             hosted program; hand in the nanoseconds since the simulation began, tick by tick",
        )))
    }

    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        port.running("the hosted program is there");
        let mut due = self.due.unwrap_or(now);
        let late = now - due;
        // Counted, not compared: at the largest possible time the next scan would be due at the same time as the last
        // one.
        let scans = if late < Nanos::ZERO {
            0
        } else if late < self.interval {
            // The usual case; avoids a division.
            1
        } else {
            late.0 / self.interval.0 + 1
        };
        for _ in 0..scans {
            self.scan(due);
            due += self.interval;
        }
        self.due = Some(due);
        if port.is_up(now) {
            port.together(|port| {
                for (station, (_, line)) in self.stations.iter_mut().enumerate() {
                    port.received(station, now, line.outputs.read(now));
                }
            });
        }
        Ok(due)
    }
}

#[cfg(test)]
mod tests;
