//! Compares the program scanned by the tick with one behind its own image and port, as on another thread.

use std::fmt::Write as _;

use super::*;
use crate::Driver;
use crate::bus_handle::{BusHandle, SteppedBus};
use crate::host::cpu::{Cpu, half};
use tickbus_base::time::{Clock, Manual};
use tickbus_fieldbus::LinkStatus;
use tickbus_image::signal::Slot;
use tickbus_plc::Scan;

/// Shows at its outputs what each scan saw.
struct Witness {
    scans: u8,
}

impl Program for Witness {
    fn name(&self) -> &'static str {
        "witness"
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn for_another_station(&self, _station: usize) -> Option<Box<dyn Program>> {
        Some(Box::new(Self { scans: 0 }))
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        self.scans = self.scans.wrapping_add(1);
        // The pulses are shorter than most ticks.
        scan.outputs[0] = scan.inputs[0] ^ self.scans & self.scans >> 3;
        scan.outputs[1] = scan.inputs[1];
        scan.outputs[2] = u8::from(scan.alive);
        scan.outputs[3] = scan.cycle.to_le_bytes()[0];
    }
}

/// The same program behind an image and a port.
struct Reference {
    cpu: Cpu,
    port: Port,
    interval: Nanos,
    due: Option<Nanos>,
    is_delivered: bool,
}

impl Reference {
    fn new(config: &Config, interval: Nanos) -> Self {
        let (role, max_age) = (Role::Controller, config.timing.max_age);
        let (cpu, bus) = half(
            Box::new(Witness { scans: 0 }),
            (config, role),
            &Swallowed::new(config.table.signals.len()),
        );
        let watches = config.life_signs.watches(&config.table, role, max_age);
        let status = LinkStatus::new("reference", max_age);
        Self {
            cpu,
            port: Port::new(bus, Manual::new(), role, None, status).with_life_signs(watches),
            interval,
            due: None,
            is_delivered: false,
        }
    }
}

/// Carries the frames from `from` to `to`. Returns false if an injected fault swallows them.
fn carry(from: &mut Port, to: &mut Port, now: Nanos) -> bool {
    let Some(mut frames) = from.take_all(now) else {
        return false;
    };
    to.together(|to| {
        for station in frames.stations() {
            to.received(station, now, frames.frame(station));
        }
    });
    let receipt = frames.receipt();
    from.sent(&receipt);
    true
}

impl Stepped for Reference {
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        port.running("the hosted program is there");
        self.is_delivered = carry(port, &mut self.port, now);
        Ok(())
    }

    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        port.running("the hosted program is there");
        let mut due = self.due.unwrap_or(now);
        while due <= now {
            if self.is_delivered {
                (0..self.port.stations()).for_each(|station| self.port.touch(station, due));
            }
            self.cpu.scan(due, true);
            due += self.interval;
        }
        self.due = Some(due);
        if port.is_up(now) {
            carry(&mut self.port, port, now);
        }
        Ok(due)
    }
}

/// Two stations, latched signals of all kinds, a heartbeat that gets stuck for a while, and lines that break.
fn config() -> Config {
    let mut text = "[driver]\nid = 1\nname = \"x\"\n\
                    [fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\nprogram = \"mirror\"\nmax_age = \"40ms\"\n\
                    heartbeat = { signal = \"A life\", every = \"1ms\" }\n\
                    [[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n"
        .to_owned();
    for (station, area) in ["A", "B"]
        .into_iter()
        .flat_map(|station| [(station, "I"), (station, "Q")])
    {
        let mut signal = |name: &str, address: &str, more: &str| {
            write!(
                text,
                "[[signal]]\nname = \"{station} {name}\"\nstation = \"{station}\"\naddress = \"%{area}{address}\"\n{more}"
            )
            .expect("a text takes it");
        };
        for bit in 0..8 {
            let latch = match (bit % 4, area) {
                (0, _) => "",
                (1, _) => "latch = \"rising\"\n",
                (2, _) => "latch = \"falling\"\n",
                (_, "I") => "latch = \"both\"\nhold = \"3ms\"\n",
                _ => "latch = \"both\"\n",
            };
            signal(&format!("{area}{bit}"), &format!("X0.{bit}"), latch);
        }
        match area {
            "I" => signal("life", "B1", ""),
            _ => {
                for (name, address) in [("echo", "B1"), ("alive", "B2"), ("cycle", "B3")] {
                    signal(name, address, "");
                }
            }
        }
    }
    for second in 0..10 {
        for (fault, begin, span) in [
            ("kind = \"stuck\"\nsignal = \"A life\"", 400, 200),
            ("kind = \"link-down\"", 700, 90),
            ("kind = \"drop\"\nchance = 0.3", 850, 100),
        ] {
            let at = second * 1_000 + begin;
            writeln!(
                text,
                "[[fault]]\n{fault}\nat = \"{at}ms\"\nfor = \"{span}ms\""
            )
            .expect("a text takes it");
        }
    }
    Config::parse("driver.cfg", &text, &crate::KINDS).unwrap_or_else(|wrong| panic!("{wrong}"))
}

#[test]
fn a_program_on_the_tick_sees_and_shows_what_one_behind_an_image_does() {
    let interval = Nanos::from_millis(2);
    let hosts: [Box<dyn Stepped>; 2] = {
        let config = config();
        let program = Box::new(Witness { scans: 0 });
        let swallowed = Swallowed::new(config.table.signals.len());
        [
            Box::new(SteppedHost::new(program, &config, interval, &swallowed).0),
            Box::new(Reference::new(&config, interval)),
        ]
    };
    let mut ends = hosts.map(|host| {
        let mut driver = Driver::open(config(), Manual::new() as Arc<dyn Clock>).expect("opens");
        let BusHandle::Stepped { bus, .. } = &mut driver.line else {
            panic!("it is stepped");
        };
        *bus = SteppedBus::Any(host);
        let slots = driver.initial_slots();
        (driver, slots)
    });
    let table = &config().table;
    let place = |name: &str| {
        let found = table.signals.iter().position(|signal| signal.name == name);
        found.unwrap_or_else(|| panic!("there is {name}"))
    };
    let (inputs, alive) = (
        ["A I", "B I"]
            .map(|start| [0, 1, 2, 3, 4, 5, 6, 7].map(|bit| place(&format!("{start}{bit}")))),
        place("A alive"),
    );
    let (mut now, mut random) = (Nanos::ZERO, 1_u64);
    let (mut dead, mut stale) = (0, 0);
    for step in 0..3_000 {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let draw =
            |shift: u32, below: u64| usize::try_from((random >> shift) % below).expect("small");
        // From four ticks per scan to a tick that takes longer than data stay valid.
        let steps = [500, 500, 1_000, 2_000, 3_100, 16_000, 500, 50_000];
        now += Nanos(1_000 * steps[draw(20, 8)]);
        let (station, bit, level) = (draw(26, 2), draw(28, 8), [0.0, 1.0][draw(32, 2)]);
        let seen = [0, 1].map(|index| {
            let (driver, slots) = &mut ends[index];
            slots[inputs[station][bit]] = Slot::from_real(level);
            let found = if draw(36, 3) == 0 {
                driver.receive(now, slots);
                driver.send(slots)
            } else {
                driver.exchange(now, slots)
            };
            (found, slots.iter().map(|slot| slot.0).collect::<Vec<_>>())
        });
        assert_eq!(seen[0], seen[1], "step {step} at {now}");
        let is_stale = seen[0].0.code == crate::Code::Stale;
        stale += u32::from(is_stale);
        dead += u32::from(!is_stale && ends[0].1[alive].real() == 0.0);
    }
    assert!(
        dead > 50 && stale > 50,
        "{dead} ticks with a dead machine, {stale} stale ones"
    );
    let [one, other] = ends.map(|(driver, _)| driver.statistics());
    assert_eq!(one, other);
}
