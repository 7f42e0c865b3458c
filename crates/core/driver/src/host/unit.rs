//! The program of one station, with its inputs and outputs.

use crate::Code;
use crate::frames::area_bytes;
use crate::view::FailSafeValues;
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, DataType, Signal, fail_safe_frame};
use tickbus_image::{Arrival, copy_frame};
use tickbus_plc::{Program, Scan};

use super::ScanCounters;
use super::scan_counters::CountedArea;

/// The program of one station, with its inputs and outputs.
pub(super) struct Unit {
    program: Box<dyn Program>,
    pub(super) station: usize,
    /// The places where the edges of outputs and inputs are counted.
    counted: (Option<CountedArea>, Option<CountedArea>),
    pub(super) inputs: Inputs,
    /// The values that a machine uses when its PLC is absent; `None` at a PLC's end.
    fail_safe: Option<FailSafe>,
    pub(super) outputs: Box<[u8]>,
    outputs_before: Box<[u8]>,
    /// The arrival for the present scan.
    arrival: Option<Arrival>,
    /// True if the program saw its peer in the last scan.
    is_alive: bool,
}

impl Unit {
    fn new(
        program: Box<dyn Program>,
        (config, role): (&Config, Role),
        station: usize,
        scan_counters: &ScanCounters,
    ) -> Self {
        let (writes, reads) = role.areas();
        let outputs = frame(config, station, writes);
        Self {
            program,
            station,
            counted: (
                scan_counters.place(station, writes),
                scan_counters.place(station, reads),
            ),
            // Valid until data arrive: a peer that has only shown that it is alive has sent no values yet.
            inputs: Inputs::new(fail_safe_frame(&config.table, station, reads)),
            fail_safe: (role == Role::Device).then(|| FailSafe::new(config, station, reads)),
            outputs_before: outputs.clone(),
            outputs,
            arrival: None,
            is_alive: false,
        }
    }

    /// Lets `take` fetch the inputs.
    #[inline]
    pub(super) fn take(&mut self, take: impl FnOnce(&mut Inputs) -> Arrival) {
        self.arrival = Some(take(&mut self.inputs));
    }

    /// Runs the program on the inputs, of which these signals are bent.
    #[inline]
    pub(super) fn run<'a>(
        &mut self,
        now: Nanos,
        in_time: bool,
        scan_counters: &ScanCounters,
        bent: impl Iterator<Item = &'a Signal>,
    ) {
        let Self {
            program,
            counted: (written, read),
            inputs,
            fail_safe,
            outputs,
            outputs_before,
            ..
        } = self;
        let Some(arrival) = self.arrival else {
            return;
        };
        scan_counters.count(*read, &inputs.before, &inputs.bytes);
        // Kept here and not before the next scan, which begins without the faults of this one.
        ScanCounters::keep(*read, &mut inputs.before, &inputs.bytes);
        self.is_alive = in_time && !arrival.stale;
        ScanCounters::keep(*written, outputs_before, outputs);
        program.scan(&mut Scan {
            now,
            alive: self.is_alive,
            cycle: arrival.sequence,
            inputs: match fail_safe {
                Some(fail_safe) if !self.is_alive => fail_safe.apply(&inputs.bytes, bent),
                _ => &inputs.bytes,
            },
            outputs,
        });
    }

    /// Counts the edges of the outputs.
    #[inline]
    pub(super) fn count_outputs(&self, scan_counters: &ScanCounters) {
        scan_counters.count(self.counted.0, &self.outputs_before, &self.outputs);
    }

    /// Returns the inputs as the program saw them.
    pub(super) fn inputs(&self) -> &[u8] {
        match &self.fail_safe {
            Some(fail_safe) if !self.is_alive => &fail_safe.seen,
            _ => &self.inputs.bytes,
        }
    }

    /// Returns which of these were fail-safe values.
    pub(super) fn fail_safe(&self) -> FailSafeValues {
        if self.fail_safe.is_some() && !self.is_alive {
            FailSafeValues::Stated
        } else {
            FailSafeValues::None
        }
    }

    /// Returns the outputs as the program left them.
    #[inline]
    pub(super) fn outputs(&self) -> &[u8] {
        &self.outputs
    }

    /// Returns true if the program saw its peer in its last scan.
    #[inline]
    pub(super) fn is_alive(&self) -> bool {
        self.is_alive
    }

    /// Returns the age of the unit's data.
    #[inline]
    pub(super) fn age(&self) -> Nanos {
        self.arrival.map_or(Nanos::ZERO, |arrival| arrival.age)
    }

    /// Returns the status of the last scan.
    pub(super) fn code(&self) -> Code {
        match self.arrival {
            _ if !self.is_alive => Code::Stale,
            Some(Arrival { fresh: true, .. }) => Code::Fresh,
            _ => Code::Unchanged,
        }
    }
}

/// The values that a machine uses when its PLC is absent: the fail-safe values stated in the signal table. Other
/// signals keep their last value, as on a pulled plug.
struct FailSafe {
    stated: Vec<Signal>,
    frame: Box<[u8]>,
    /// The values that the program sees.
    seen: Box<[u8]>,
}

impl FailSafe {
    fn new(config: &Config, station: usize, area: Area) -> Self {
        let table = &config.table;
        let of_it = |it: &&Signal| it.station == station && it.area == area;
        let signals = table.signals.iter().filter(of_it);
        let stated = signals.filter(|it| it.states_fail_safe);
        let frame = fail_safe_frame(table, station, area);
        Self {
            stated: stated.cloned().collect(),
            seen: frame.clone(),
            frame,
        }
    }

    /// Puts the stated values in place of the inputs, but for those that are bent: forced, for example.
    #[inline]
    fn apply<'a>(&mut self, inputs: &[u8], bent: impl Iterator<Item = &'a Signal>) -> &[u8] {
        copy_frame(&mut self.seen, inputs);
        for signal in &self.stated {
            take_over(signal, &self.frame, &mut self.seen);
        }
        for signal in bent {
            take_over(signal, inputs, &mut self.seen);
        }
        &self.seen
    }
}

fn frame(config: &Config, station: usize, area: Area) -> Box<[u8]> {
    vec![0; area_bytes(&config.table, station, area)].into()
}

/// The inputs that the program sees, and those of the previous scan.
pub(super) struct Inputs {
    pub(super) bytes: Box<[u8]>,
    before: Box<[u8]>,
}

impl Inputs {
    fn new(bytes: Box<[u8]>) -> Self {
        Self {
            before: bytes.clone(),
            bytes,
        }
    }
}

/// Returns the program, and an instance for each further station that it can serve.
pub(super) fn units(
    program: Box<dyn Program>,
    (config, role): (&Config, Role),
    scan_counters: &ScanCounters,
) -> Vec<Unit> {
    let others = (1..config.table.stations.len())
        .filter_map(|station| Some((program.for_another_station(station)?, station)))
        .collect::<Vec<_>>();
    std::iter::once((program, 0))
        .chain(others)
        .map(|(program, station)| Unit::new(program, (config, role), station, scan_counters))
        .collect()
}

/// Copies the bits of one signal.
pub(super) fn take_over(signal: &Signal, from: &[u8], to: &mut [u8]) {
    if signal.data_type == DataType::Bool {
        let mask = 1 << signal.bit;
        to[signal.byte] = (to[signal.byte] & !mask) | (from[signal.byte] & mask);
    } else {
        let bytes = signal.byte..signal.byte + signal.data_type.size_bytes();
        to[bytes.clone()].copy_from_slice(&from[bytes]);
    }
}
