//! A third-party bus, and the program that has it: tickbus is used unchanged, and not forked.
//!
//! The bus joins its two ends by memory. The program opens both, and ends when each has seen what the other wrote.

use std::sync::{Arc, Mutex};

use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_base::toml_text::{Key, Table};
use tickbus_driver::Driver;
use tickbus_driver_cfg::{Config, Kind, Kinds};
use tickbus_fieldbus::{
    Bus, BusError, BusKind, BusOptions, BusSetup, Free, NamedFile, OpenError, Port, Role,
};
use tickbus_image::signal::{Slot, SignalTable};

/// The kinds that a driver.cfg of this program can name: the loopback, and this bus.
static KINDS: Kinds = Kinds::new(&[Kind::of::<Options>()]);

const CYCLE: Nanos = Nanos::from_millis(1);

/// The bytes that the device and the controller sent last.
static WIRE: Mutex<[Option<Vec<u8>>; 2]> = Mutex::new([None, None]);

#[derive(Clone, Debug, PartialEq, Eq)]
struct Options;

impl BusKind for Options {
    const NAME: &'static str = "wire";
    const KEYS: &'static [&'static [Key]] = &[];

    fn read(_role: Role, _moved: bool, _table: &mut Table<'_>) -> Option<Self> {
        Some(Self)
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        vec!["in memory".to_owned()]
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        Ok(Bus::Free(Box::new(Wire { role: setup.role })))
    }
}

#[derive(Debug)]
struct Wire {
    role: Role,
}

impl Free for Wire {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let (own, peers) = match self.role {
            Role::Device | Role::Observer => (0, 1),
            Role::Controller => (1, 0),
        };
        port.opening("waiting for the other end");
        while !stop.is_stopped() {
            let now = port.clock().now();
            if let Some(mut frames) = port.take_all(now) {
                WIRE.lock().expect("no end panics")[own] = Some(frames.frame(0).to_vec());
                let receipt = frames.receipt();
                port.sent(&receipt);
            }
            let received = WIRE.lock().expect("no end panics")[peers].clone();
            if let Some(bytes) = received {
                port.running("the other end is there");
                port.received(0, now, &bytes);
            }
            port.wait_until(now + CYCLE, stop);
        }
        Ok(())
    }
}

fn text(role: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"{role}\"\n[fieldbus]\nkind = \"wire\"\nrole = \"{role}\"\n\
         [[signal]]\nname = \"position\"\naddress = \"%IW0\"\n\
         [[signal]]\nname = \"speed\"\naddress = \"%QW0\"\n"
    )
}

fn main() {
    let unknown = Config::parse("driver.cfg", &text("device"), &Kinds::LOOPBACK);
    assert!(unknown.is_err(), "tickbus itself does not know the bus");
    let clock = Monotonic::shared();
    let open = |role: &str| {
        let config = Config::parse("driver.cfg", &text(role), &KINDS);
        let config = config.unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
        let slots = driver.initial_slots();
        (driver, slots)
    };
    let (mut device, mut controller) = (open("device"), open("controller"));
    device.1[0] = Slot::from_real(12.0);
    controller.1[1] = Slot::from_real(34.0);
    let end = clock.now() + Nanos::from_secs(20);
    while (controller.1[0].real(), device.1[1].real()) != (12.0, 34.0) {
        assert!(clock.now() < end, "the values did not arrive");
        for (driver, slots) in [&mut device, &mut controller] {
            driver.exchange(None, slots);
        }
        clock.wait_until(clock.now() + CYCLE, &Stop::new());
    }
    device.0.close();
    controller.0.close();
    println!("foreign-bus: ok position=12 speed=34");
}
