//! A program with its process image, and one scan of the program.

use std::sync::Arc;

use crate::Code;
use crate::frames::{area_bytes, directions};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, Signal, fail_safe_frame};
use tickbus_image::{Arrival, BusEnd, Peers, Receiver, TickEnd, copy_frame, image};
use tickbus_plc::{Program, Scan};

use super::ScanCounters;
use super::own_end::{OwnEnd, take_over};
use super::scan_counters::CountedArea;

/// A program with the tick's end of its process image: a PLC without its bus.
pub(super) struct Cpu {
    /// The program of the first station, and a further instance for each other station.
    units: Vec<Unit>,
    tick: TickEnd,
    max_age: Nanos,
    pub(super) scan_counters: Arc<ScanCounters>,
    /// The end that a driver.cfg describes; `None` for a program behind the bus of one.
    pub(super) own: Option<OwnEnd>,
}

/// The program of one station, with its inputs and outputs.
pub(super) struct Unit {
    program: Box<dyn Program>,
    station: usize,
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

    /// Takes over the inputs. The program sees when they are stale, and then sees the last ones.
    fn read(
        &mut self,
        (now, max_age): (Nanos, Nanos),
        image: &mut TickEnd,
        own: Option<&mut OwnEnd>,
    ) {
        let station = self.station;
        self.take(|inputs| {
            let mut taking = Taking { inputs, own };
            let arrival = image.read(station, (now, max_age), &mut taking);
            if arrival.stale {
                image.shown_instead(station, &mut taking);
                taking.levels(image.latest(station));
            }
            arrival
        });
    }

    /// Lets `take` fetch the inputs.
    #[inline]
    pub(super) fn take(&mut self, take: impl FnOnce(&mut Inputs) -> Arrival) {
        let inputs = &mut self.inputs;
        ScanCounters::keep(self.counted.1, &mut inputs.before, &inputs.bytes);
        self.arrival = Some(take(inputs));
    }

    /// Runs the program on the inputs.
    #[inline]
    pub(super) fn run(&mut self, now: Nanos, in_time: bool, scan_counters: &ScanCounters) {
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
        self.is_alive = in_time && !arrival.stale;
        ScanCounters::keep(*written, outputs_before, outputs);
        program.scan(&mut Scan {
            now,
            alive: self.is_alive,
            cycle: arrival.sequence,
            inputs: match fail_safe {
                Some(fail_safe) if !self.is_alive => fail_safe.apply(&inputs.bytes),
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

    /// Returns true if all of these were fail-safe values.
    pub(super) fn is_fail_safe(&self) -> bool {
        let is_whole = self.fail_safe.as_ref().is_some_and(|it| it.is_whole);
        is_whole && !self.is_alive
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
    /// True if every signal states a value.
    is_whole: bool,
    frame: Box<[u8]>,
    /// The values that the program sees.
    seen: Box<[u8]>,
}

impl FailSafe {
    fn new(config: &Config, station: usize, area: Area) -> Self {
        let table = &config.table;
        let of_it = |it: &&Signal| it.station == station && it.area == area;
        let signals: Vec<&Signal> = table.signals.iter().filter(of_it).collect();
        let stated = signals.iter().filter(|it| it.states_fail_safe);
        let stated: Vec<Signal> = stated.copied().cloned().collect();
        let frame = fail_safe_frame(table, station, area);
        Self {
            is_whole: stated.len() == signals.len(),
            stated,
            seen: frame.clone(),
            frame,
        }
    }

    #[inline]
    fn apply(&mut self, inputs: &[u8]) -> &[u8] {
        copy_frame(&mut self.seen, inputs);
        for signal in &self.stated {
            take_over(signal, &self.frame, &mut self.seen);
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

/// Takes over the inputs, and their edges for a recording.
struct Taking<'a> {
    inputs: &'a mut Inputs,
    own: Option<&'a mut OwnEnd>,
}

impl Receiver for Taking<'_> {
    fn levels(&mut self, bytes: &[u8]) {
        copy_frame(&mut self.inputs.bytes, bytes);
    }

    fn edges(&mut self, signal: usize, count: u32) {
        if let Some(own) = &mut self.own {
            own.edges(signal, count);
        }
    }
}

impl Cpu {
    /// Returns the bus's notes about each peer.
    pub(super) fn peers(&self) -> &Peers {
        &self.tick.peers
    }

    /// Runs one scan at `now`: inputs, program, outputs. `in_time` is false when the scan is so late that the peer has
    /// received fail-safe values in the meantime: the program must then start over as after a broken line.
    pub(super) fn scan(&mut self, now: Nanos, in_time: bool) {
        let (units, own) = (&mut self.units, &mut self.own);
        // A fault looks at all stations together, before and after each part of the scan.
        if let Some(own) = own {
            own.begin(now, units);
        }
        self.tick.update();
        for unit in &mut *units {
            unit.read((now, self.max_age), &mut self.tick, own.as_mut());
        }
        if let Some(own) = own {
            own.received(units);
        }
        for unit in &mut *units {
            unit.run(now, in_time, &self.scan_counters);
        }
        if let Some(own) = own {
            own.sending(now, units);
        }
        let (mut age, mut alive) = (Nanos::ZERO, true);
        for unit in &*units {
            unit.count_outputs(&self.scan_counters);
            age = age.max(unit.age());
            alive &= unit.is_alive;
        }
        self.tick.write(now, |station, frame| {
            if let Some(unit) = units.get(station) {
                copy_frame(frame, &unit.outputs);
                if let Some(own) = own {
                    own.bend_outputs(station, frame);
                }
            }
        });
        self.scan_counters.scanned(age, alive);
        if let Some(own) = own {
            own.end(now, &self.tick, units);
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
        .filter_map(|station| Some((program.for_another_station()?, station)))
        .collect::<Vec<_>>();
    std::iter::once((program, 0))
        .chain(others)
        .map(|(program, station)| Unit::new(program, (config, role), station, scan_counters))
        .collect()
}

/// Creates the program's half of a line: the CPU with its counters, and the bus's end of its image. A program that can
/// serve several stations serves all of them.
pub(super) fn half(program: Box<dyn Program>, config: &Config, role: Role) -> (Cpu, BusEnd) {
    let scan_counters = Arc::new(ScanCounters::new(&config.table));
    let (tick, bus) = image(directions(&config.table, role));
    let cpu = Cpu {
        units: units(program, (config, role), &scan_counters),
        tick,
        max_age: config.timing.max_age,
        scan_counters,
        own: None,
    };
    (cpu, bus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use tickbus_plc::Program;

    /// Records, per station, whether each scan saw its peer.
    struct Witness(Arc<Mutex<Vec<bool>>>);

    impl Program for Witness {
        fn name(&self) -> &'static str {
            "witness"
        }

        fn input_bytes(&self) -> usize {
            1
        }

        fn output_bytes(&self) -> usize {
            1
        }

        fn for_another_station(&self) -> Option<Box<dyn Program>> {
            Some(Box::new(Self(Arc::clone(&self.0))))
        }

        fn scan(&mut self, scan: &mut Scan<'_>) {
            self.0.lock().expect("no panic").push(scan.alive);
        }
    }

    #[test]
    fn a_scan_that_comes_too_late_is_told_that_the_line_was_broken() {
        let mut text =
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
                        [[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n"
                .to_owned();
        for address in ["%IB0", "%QB0"] {
            for station in ["A", "B"] {
                let signal = format!("name = \"{station} {address}\"\naddress = \"{address}\"");
                text.extend(["[[signal]]\n", &signal, "\nstation = \"", station, "\"\n"]);
            }
        }
        let config =
            tickbus_driver_cfg::Config::parse("driver.cfg", &text, &crate::KINDS).expect("right");
        let told = Arc::new(Mutex::new(Vec::new()));
        let program = Box::new(Witness(Arc::clone(&told)));
        let (mut cpu, mut bus) = half(program, &config, Role::Controller);
        for (millis, in_time) in [(10, true), (500, false), (510, true)] {
            let now = Nanos::from_millis(millis);
            // The peer sends faster than the delayed scan runs.
            for station in 0..bus.stations() {
                bus.received(station, now, &[1], true);
            }
            bus.hand_over();
            cpu.scan(now, in_time);
        }
        assert_eq!(
            *told.lock().expect("no panic"),
            [[true; 2], [false; 2], [true; 2]].concat()
        );
    }

    #[test]
    fn a_machine_takes_the_fail_safe_values_that_are_stated_when_its_plc_is_gone() {
        /// Records what each scan sees.
        struct Seen(Arc<Mutex<Vec<Vec<u8>>>>);

        impl Program for Seen {
            fn name(&self) -> &'static str {
                "seen"
            }

            fn input_bytes(&self) -> usize {
                2
            }

            fn output_bytes(&self) -> usize {
                0
            }

            fn scan(&mut self, scan: &mut Scan<'_>) {
                self.0.lock().expect("no panic").push(scan.inputs.to_vec());
            }
        }

        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
                    [[signal]]\nname = \"a\"\naddress = \"%QB0\"\nfail_safe = 7\n\
                    [[signal]]\nname = \"b\"\naddress = \"%QB1\"\n";
        let config =
            tickbus_driver_cfg::Config::parse("driver.cfg", text, &crate::KINDS).expect("right");
        let seen = Arc::default();
        let program = Box::new(Seen(Arc::clone(&seen)));
        let (mut cpu, mut bus) = half(program, &config, Role::Device);
        // The PLC is alive, but has written nothing yet.
        bus.touch(0, Nanos::from_millis(5));
        bus.hand_over();
        cpu.scan(Nanos::from_millis(5), true);
        bus.received(0, Nanos::from_millis(10), &[170, 171], true);
        bus.hand_over();
        cpu.scan(Nanos::from_millis(10), true);
        cpu.scan(Nanos::from_secs(60), true);
        bus.received(0, Nanos::from_secs(61), &[170, 171], true);
        bus.hand_over();
        cpu.scan(Nanos::from_secs(61), true);
        let seen = seen.lock().expect("no panic").clone();
        assert_eq!(seen, [[7, 0], [170, 171], [7, 171], [170, 171]]);
    }

    #[test]
    fn a_mirror_serves_each_station_by_itself() {
        use crate::Driver;
        use tickbus_base::time::Manual;

        let signal = |name: &str, address: &str, station: &str| {
            format!(
                "[[signal]]\nname = \"{name}\"\naddress = \"{address}\"\nstation = \"{station}\"\n"
            )
        };
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
                    program = \"mirror\"\nscan = \"1ms\"\n[[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n"
            .to_owned()
            + signal("A to", "%IB0", "A").as_str()
            + signal("B to", "%IB2", "B").as_str()
            + signal("A from", "%QB0", "A").as_str()
            + signal("B from", "%QB2", "B").as_str();
        let config = tickbus_driver_cfg::Config::parse("driver.cfg", &text, &crate::KINDS);
        let config = config.unwrap_or_else(|wrong| panic!("{wrong}"));
        let mut driver = Driver::open(config, Manual::new()).expect("opens");
        let mut slots = driver.initial_slots();
        for (slot, value) in [(0, 5.0), (1, 7.0)] {
            slots[slot] = tickbus_image::signal::Slot::from_real(value);
        }
        let mut seen = Vec::new();
        for tick in 1..=3 {
            driver.exchange(Nanos::from_millis(tick), &mut slots);
            seen = slots[2..4].iter().map(|slot| slot.real()).collect();
        }
        assert_eq!(seen, [5.0, 7.0]);
    }
}
