//! A program with its process image, and one scan of the program.

use std::sync::Arc;

use crate::frames::directions;
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{MaxAge, Role};
use tickbus_image::{
    BusEnd, EVENT_CAPACITY, Peers, Receiver, Swallowed, TickEnd, copy_frame, image_counting,
};
use tickbus_plc::Program;

use super::ScanCounters;
use super::own_end::OwnEnd;
use super::unit::{Inputs, Unit, units};

/// A program with the tick's end of its process image: a PLC without its bus.
pub(super) struct Cpu {
    /// The program of the first station, and a further instance for each other station.
    units: Vec<Unit>,
    tick: TickEnd,
    pub(super) max_age: MaxAge,
    pub(super) scan_counters: Arc<ScanCounters>,
    /// The end that a driver.cfg describes; `None` for a program behind the bus of one.
    pub(super) own: Option<OwnEnd>,
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

/// Takes over the inputs of a unit. The program sees when they are stale, and then sees the last ones.
fn read(
    unit: &mut Unit,
    (now, max_age): (Nanos, Nanos),
    image: &mut TickEnd,
    own: Option<&mut OwnEnd>,
) {
    let station = unit.station;
    unit.take(|inputs| {
        let mut taking = Taking { inputs, own };
        let arrival = image.read(station, (now, max_age), &mut taking);
        if arrival.stale {
            image.shown_instead(station, &mut taking);
            taking.levels(image.latest(station));
        }
        arrival
    });
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
        let max_age = self.max_age.get();
        for unit in &mut *units {
            read(unit, (now, max_age), &mut self.tick, own.as_mut());
        }
        if let Some(own) = own {
            own.received(units);
        }
        for unit in &mut *units {
            let station = unit.station;
            let bent = own.iter().flat_map(|own| own.bent_inputs(station));
            unit.run(now, in_time, &self.scan_counters, bent);
        }
        if let Some(own) = own {
            own.sending(now, units);
        }
        let (mut age, mut alive) = (Nanos::ZERO, true);
        for unit in &*units {
            unit.count_outputs(&self.scan_counters);
            age = age.max(unit.age());
            alive &= unit.is_alive();
        }
        self.tick.write(now, |station, frame| {
            if let Some(unit) = units.get(station) {
                copy_frame(frame, unit.outputs());
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

/// Creates the program's half of a line: the CPU with its counters, and the bus's end of its image. A program that can
/// serve several stations serves all of them.
pub(super) fn half(
    program: Box<dyn Program>,
    (config, role): (&Config, Role),
    swallowed: &Swallowed,
) -> (Cpu, BusEnd) {
    let scan_counters = Arc::new(ScanCounters::new(&config.table));
    let (tick, bus) = image_counting(directions(&config.table, role), EVENT_CAPACITY, swallowed);
    let cpu = Cpu {
        units: units(program, (config, role), &scan_counters),
        tick,
        max_age: MaxAge::new(config.timing.max_age),
        scan_counters,
        own: None,
    };
    (cpu, bus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use tickbus_plc::Scan;

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

        fn for_another_station(&self, _station: usize) -> Option<Box<dyn Program>> {
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
        let (mut cpu, mut bus) = half(
            program,
            (&config, Role::Controller),
            &Swallowed::new(config.table.signals.len()),
        );
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
        let (mut cpu, mut bus) = half(
            program,
            (&config, Role::Device),
            &Swallowed::new(config.table.signals.len()),
        );
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
