//! The end of a line that a driver.cfg describes, if a program is there. Extra work, recording and watch are those of a
//! driver and work on slots, which a scan makes from its frames while they are needed.

use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::{Effect, FaultBoard, Slots, TickTime};
use tickbus_fieldbus::{MaxAge, Role, is_stale};
use tickbus_image::TickEnd;
use tickbus_image::signal::{Plan, Signal, Slot};
use tickbus_record::Recorder;
use tickbus_reply::Replies;

use super::unit::{Unit, take_over};
use crate::extras::Extras;
use crate::heartbeat::Beat;
use crate::tap::Tap;
use crate::view::StationView;
use crate::{Code, SlotMap};

/// The end of a line that a driver.cfg describes, beside the frames of its program.
pub(super) struct OwnEnd {
    config: Arc<Config>,
    /// The limit of age of its line.
    pub(super) max_age: MaxAge,
    extras: Extras,
    /// The signals that replies make.
    replied: Vec<usize>,
    recorder: Option<Recorder>,
    /// Lets another thread look at the program.
    tap: Tap,
    slots: Vec<Slot>,
    /// Per signal, the slot that counts its edges since the previous scan.
    edges: Vec<Option<usize>>,
    stations: Vec<Station>,
    /// True while the program's inputs are bent.
    is_bent: bool,
    /// The time of the first scan.
    begun: Option<Nanos>,
    /// The current scan.
    moment: TickTime,
}

/// The conversion between the slots and the frames of one station.
struct Station {
    writes: Plan,
    reads: Plan,
    /// The true inputs, while the program sees bent ones.
    truth: Box<[u8]>,
    /// Frames made from the slots; single signals are copied from here.
    sent: Box<[u8]>,
    received: Box<[u8]>,
}

impl OwnEnd {
    /// Creates the end with the faults and the heartbeats of `config`.
    ///
    /// # Errors
    ///
    /// There are more faults than an end can have, or one of a machine's model.
    pub(super) fn new(
        config: Arc<Config>,
        board: &Arc<FaultBoard>,
        tap: Tap,
        recorder: Option<Recorder>,
    ) -> Result<Self, Mistake> {
        let table = &config.table;
        let (writes, reads) = config.role.areas();
        let made = match config.role {
            Role::Device => &config.replies[..],
            Role::Controller | Role::Observer => &[],
        };
        let replied = made.iter().flat_map(|reply| reply.outputs.iter().copied());
        let replied = replied.collect();
        // Values go through frames here, and come back rounded.
        let replies = Replies::new(made, table, board).map(Replies::over_all);
        let mut extras = Extras::new(None, replies, Beat::all(&config, config.role));
        extras.make_room(board);
        let map = SlotMap::new(table, config.role);
        for fault in &config.faults {
            if let Effect::Model(_) = fault.effect {
                return Err(Mistake::new(
                    format!("the fault \"{}\" is one of the machine's model", fault.name),
                    "inject it at the machine's end: a PLC program has no such faults",
                ));
            }
            let slots = Slots {
                table,
                writes,
                edges: &map.edges,
            };
            extras.inject(fault, slots, board)?;
        }
        let frame = |bytes| vec![0; bytes].into();
        let stations = table.stations.iter().enumerate();
        let stations = stations.map(|(index, station)| Station {
            writes: Plan::new(table, index, writes),
            reads: Plan::new(table, index, reads),
            truth: frame(station.bytes(reads)),
            sent: frame(station.bytes(writes)),
            received: frame(station.bytes(reads)),
        });
        Ok(Self {
            max_age: MaxAge::new(config.timing.max_age),
            extras,
            replied,
            recorder,
            tap,
            slots: map.initial(table),
            edges: map.edges,
            stations: stations.collect(),
            is_bent: false,
            begun: None,
            moment: TickTime::default(),
            config,
        })
    }

    /// Begins a scan: restores the true inputs of the previous one, and lets faults begin and end.
    pub(super) fn begin(&mut self, now: Nanos, units: &mut [Unit]) {
        self.moment = TickTime {
            time: now - *self.begun.get_or_insert(now),
            tick: self.moment.tick + 1,
        };
        if !self.extras.is_busy() {
            return;
        }
        for (station, unit) in self.stations.iter().zip(units) {
            if self.is_bent {
                unit.inputs.bytes.copy_from_slice(&station.truth);
            }
            station.reads.decode(&unit.inputs.bytes, &mut self.slots);
            // Until the program has written outputs, its peer has the fail-safe values.
            if self.moment.tick > 1 {
                station.writes.decode(unit.outputs(), &mut self.slots);
            }
        }
        self.is_bent = false;
        self.extras.begin_tick(self.moment, &mut self.slots);
    }

    /// Counts edges of a signal since the previous scan.
    pub(super) fn edges(&mut self, signal: usize, count: u32) {
        if let Some(slot) = self.edges[signal] {
            self.slots[slot] = Slot::from_real(f64::from(count));
        }
    }

    /// Bends the inputs after they were read.
    pub(super) fn received(&mut self, units: &mut [Unit]) {
        if !self.extras.is_busy() || self.extras.bent(false).next().is_none() {
            return;
        }
        for (station, unit) in self.stations.iter_mut().zip(&*units) {
            station.truth.copy_from_slice(&unit.inputs.bytes);
            station.reads.decode(&station.truth, &mut self.slots);
        }
        self.is_bent = true;
        self.extras.received(&mut self.slots);
        for station in &mut self.stations {
            station.reads.encode(&self.slots, &mut station.received);
        }
        for signal in self.extras.bent(false) {
            let signal = &self.config.table.signals[signal];
            if let Some(unit) = units.get_mut(signal.station) {
                let bent = &self.stations[signal.station].received;
                take_over(signal, bent, &mut unit.inputs.bytes);
            }
        }
    }

    /// The signals of a station whose inputs are bent in this scan.
    pub(super) fn bent_inputs(&self, station: usize) -> impl Iterator<Item = &Signal> {
        let is_bent = self.is_bent && self.extras.is_busy();
        let bent = is_bent.then(|| self.extras.bent(false));
        let signals = bent.into_iter().flatten();
        let signals = signals.map(|signal| &self.config.table.signals[signal]);
        signals.filter(move |signal| signal.station == station)
    }

    /// Puts the replies and the heartbeats into the outputs, and prepares the values for [`bend_outputs`](Self::bend_outputs).
    pub(super) fn sending(&mut self, now: Nanos, units: &mut [Unit]) {
        let is_bent = self.extras.bent(true).next().is_some();
        if !is_bent && !self.extras.works_on_every_tick() {
            return;
        }
        for (station, unit) in self.stations.iter().zip(&*units) {
            station.reads.decode(unit.inputs(), &mut self.slots);
            station.writes.decode(unit.outputs(), &mut self.slots);
        }
        self.extras
            .handed_over(Some(self.moment.time), &mut self.slots);
        self.extras.beat(now, &mut self.slots);
        self.encode_sent();
        for signal in self.extras.beating().chain(self.replied.iter().copied()) {
            let signal = &self.config.table.signals[signal];
            if let Some(unit) = units.get_mut(signal.station) {
                let beat = &self.stations[signal.station].sent;
                take_over(signal, beat, &mut unit.outputs);
            }
        }
        if is_bent {
            self.extras.sending(&mut self.slots);
            self.encode_sent();
        }
    }

    fn encode_sent(&mut self) {
        for station in &mut self.stations {
            station.writes.encode(&self.slots, &mut station.sent);
        }
    }

    /// Bends the outputs of a station; the program does not notice.
    pub(super) fn bend_outputs(&self, station: usize, outputs: &mut [u8]) {
        if !self.extras.is_busy() {
            return;
        }
        for signal in self.extras.bent(true) {
            let signal = &self.config.table.signals[signal];
            if signal.station == station {
                take_over(signal, &self.stations[station].sent, outputs);
            }
        }
    }

    /// Ends a scan, after everything was sent: records it, and serves another thread that looks at the program.
    pub(super) fn end(&mut self, now: Nanos, image: &TickEnd, units: &[Unit]) {
        if self.extras.is_busy() {
            self.extras.sent(&mut self.slots);
            self.extras.rest();
        }
        if self.recorder.is_some() {
            self.record(units);
        }
        if self.tap.is_wanted() {
            self.serve_watch(now, image, units);
        }
    }

    fn record(&mut self, units: &[Unit]) {
        let mut code = Code::Fresh;
        for (station, unit) in self.stations.iter().zip(units) {
            station.reads.decode(unit.inputs(), &mut self.slots);
            station.writes.decode(unit.outputs(), &mut self.slots);
            code = code.worse(unit.code());
        }
        if let Some(recorder) = &mut self.recorder {
            let TickTime { time, tick } = self.moment;
            // A recording of one station has no status of its own for it.
            let codes = units.iter().filter(|_| units.len() > 1);
            let codes = codes.map(|unit| unit.code().code());
            recorder.record(tick, time, code.code(), codes, &self.slots);
        }
    }

    #[cold]
    fn serve_watch(&mut self, now: Nanos, image: &TickEnd, units: &[Unit]) {
        let wanted = self.tap.take_wanted();
        if wanted.orders() {
            self.extras.obey(&mut self.tap);
        }
        if !wanted.values() {
            return;
        }
        let (stations, moment) = (&self.stations, self.moment);
        let max_age = self.max_age.get();
        self.tap.show(|view| {
            let mut code = Code::Fresh;
            let units = units.iter().zip(stations).zip(&mut view.stations);
            for (index, ((unit, station), seen)) in units.enumerate() {
                station.reads.decode(unit.inputs(), &mut view.slots);
                station.writes.decode(unit.outputs(), &mut view.slots);
                let peers = &image.peers;
                let (age, is_valid) = (peers.age(index, now), peers.is_valid(index));
                *seen = StationView {
                    // A late scan sees the line as down although its data are good.
                    status: if is_stale(age, max_age, is_valid) {
                        Code::Stale
                    } else {
                        unit.code()
                    },
                    age,
                    is_valid,
                    fail_safe: unit.fail_safe(),
                    cycles: peers.received(index),
                };
                code = code.worse(seen.status);
                image.edges(index, |signal, count| view.edges[signal] = count);
            }
            view.now = now;
            view.tick = moment.tick;
            view.time = now;
            view.code = code;
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Watch;
    use crate::host::cpu::{Cpu, half};
    use crate::statistics::{Counters as _, Figures};
    use tickbus_base::statistics::Statistics;
    use tickbus_base::time::Manual;
    use tickbus_fieldbus::LinkStatus;
    use tickbus_image::BusEnd;
    use tickbus_plc::{Program, Scan};

    /// Writes its outputs once.
    struct Once(bool);

    impl Program for Once {
        fn name(&self) -> &'static str {
            "once"
        }

        fn input_bytes(&self) -> usize {
            0
        }

        fn output_bytes(&self) -> usize {
            4
        }

        fn scan(&mut self, scan: &mut Scan<'_>) {
            if !std::mem::replace(&mut self.0, true) {
                scan.outputs.copy_from_slice(&[0xff, 0xf0, 0, 0]);
            }
        }
    }

    /// A program with the own end of this driver.cfg.
    fn with_own_end(text: &str) -> (Cpu, BusEnd) {
        let config = Config::parse("driver.cfg", text, &crate::KINDS)
            .unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let swallowed = crate::open::swallowed_of(&config, "x");
        let (mut cpu, bus) = half(
            Box::new(Once(false)),
            (&config, config.role),
            swallowed.counts(),
        );
        let figures = Figures {
            status: LinkStatus::new("x", config.timing.max_age),
            board: Arc::default(),
            swallowed,
            program: crate::statistics::ProgramCounters::new(None),
            record: None,
            bus: crate::statistics::BusFacts::of(&config),
        };
        let (config, board) = (Arc::new(config), Arc::clone(&figures.board));
        let shared = Arc::clone(&config);
        let (tap, _watch) = Watch::new(shared, Manual::new(), (figures, None), false);
        cpu.own = Some(OwnEnd::new(config, &board, tap, None).expect("it has no faults"));
        (cpu, bus)
    }

    #[test]
    fn the_heartbeat_of_a_program_leaves_its_other_outputs_alone() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\nrole = \"controller\"\n\
                    heartbeat = [{ signal = \"life\", every = \"1ms\" }, { signal = \"n\", every = \"1ms\" }]\n\
                    [[signal]]\nname = \"life\"\naddress = \"%QX1.2\"\n\
                    [[signal]]\nname = \"n\"\naddress = \"%QW2\"\norder = \"DCBA\"\n";
        let (mut cpu, mut bus) = with_own_end(text);
        for (millis, expected) in [(0, [0xff, 0xf4, 1, 0]), (1, [0xff, 0xf0, 2, 0])] {
            let now = Nanos::from_millis(millis);
            cpu.scan(now, true);
            bus.attend(now, None);
            assert_eq!(bus.outgoing(0, now), expected);
        }
    }

    #[test]
    fn a_machine_makes_its_replies_from_what_the_plc_sends_whatever_its_program_writes() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
                    [[signal]]\nname = \"on\"\naddress = \"%QX0.0\"\n\
                    [[signal]]\nname = \"running\"\naddress = \"%IX0.0\"\n\
                    [[signal]]\nname = \"oil\"\naddress = \"%IW2\"\n\
                    [[reply]]\nkind = \"follows\"\nsignal = \"running\"\nwhen = \"on\"\non_after = \"2ms\"\n\
                    [[reply]]\nkind = \"constant\"\nsignal = \"oil\"\nvalue = 0x1234\n\
                    [[fault]]\nkind = \"stuck\"\nsignal = \"oil\"\nvalue = 0\nat = \"2ms\"\nfor = \"1ms\"\n";
        let (mut cpu, mut bus) = with_own_end(text);
        let oil = [0x12, 0x34];
        for (millis, first, [high, low]) in [
            (0, 0xfe, oil),
            (1, 0xfe, oil),
            (2, 0xff, [0; 2]),
            (3, 0xff, oil),
        ] {
            let now = Nanos::from_millis(millis);
            bus.received(0, now, &[1], true);
            bus.hand_over();
            cpu.scan(now, true);
            bus.attend(now, None);
            assert_eq!(bus.outgoing(0, now), [first, 0xf0, high, low], "{millis}");
        }
    }

    #[test]
    fn a_machine_without_a_plc_gets_what_is_forced_and_not_the_fail_safe_value() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
                    [[signal]]\nname = \"on\"\naddress = \"%QX0.0\"\nfail_safe = false\n\
                    [[signal]]\nname = \"running\"\naddress = \"%IX0.0\"\n\
                    [[signal]]\nname = \"level\"\naddress = \"%IW2\"\n\
                    [[reply]]\nkind = \"follows\"\nsignal = \"running\"\nwhen = \"on\"\n\
                    [[fault]]\nkind = \"stuck\"\nsignal = \"on\"\nvalue = 1\nat = \"2ms\"\nfor = \"1ms\"\n";
        let (mut cpu, mut bus) = with_own_end(text);
        for (millis, expected) in [(0, 0), (1, 0), (2, 1), (3, 0)] {
            let now = Nanos::from_millis(millis);
            cpu.scan(now, true);
            bus.attend(now, None);
            assert_eq!(bus.outgoing(0, now)[0] & 1, expected, "{millis}");
        }
    }

    #[test]
    fn an_input_that_a_fault_holds_on_rises_once() {
        let (mut cpu, mut bus) = with_own_end(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\nrole = \"controller\"\n\
             [[signal]]\nname = \"jam\"\naddress = \"%IX0.0\"\n\
             [[signal]]\nname = \"out\"\naddress = \"%QD0\"\n\
             [[fault]]\nkind = \"stuck\"\nsignal = \"jam\"\nvalue = 1\nat = \"2ms\"\nfor = \"5ms\"\n",
        );
        let mut counts = Vec::new();
        for millis in 0..10 {
            let now = Nanos::from_millis(millis);
            bus.received(0, now, &[0], true);
            bus.hand_over();
            cpu.scan(now, true);
            let mut statistics = Statistics::default();
            cpu.scan_counters.write(&mut statistics);
            let text = statistics.to_string();
            let count = text
                .lines()
                .find_map(|line| line.strip_prefix("plc.rises.jam="));
            counts.push(count.expect("it is counted").to_owned());
        }
        assert_eq!(counts.concat(), "0011111111");
    }
}
