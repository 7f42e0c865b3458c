//! A device with one station for an independent master, and helpers that wait for conditions.

use std::time::Duration;

use profirust::Baudrate;
use tickbus_base::time::{Manual, Monotonic};
use tickbus_conformance::rig::{Bus, End, Liar, await_that, config};
use tickbus_driver::Code;
use tickbus_driver_cfg::{Kind, Kinds};
use tickbus_fieldbus::LinkState;

use crate::peer::{Master, Project, SLOT, Slave};
use crate::pty;

pub static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_profibus::Options>()]);

pub const ADDRESS: u8 = 8;
pub const IDENT: u16 = 0x80E0;

/// The kind for the rig, on this port.
pub struct OnPort(pub String);

impl Bus for OnPort {
    fn kinds(&self) -> &'static Kinds {
        &KINDS
    }

    fn fieldbus(&self, _role: &str) -> String {
        format!(
            "kind = \"profibus-device\"\ndevice = \"{}\"\nbaud = 500000\nmax_tsdr = {}\n\
             address = {ADDRESS}\nident = {IDENT:#06x}\nconfig = [0x52, 0x62]",
            self.0,
            SLOT - 1000,
        )
    }

    fn liar(&self, _clock: &std::sync::Arc<Manual>) -> Liar {
        unreachable!("a master that lies is met below")
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            (
                "kind = \"profibus-device\"\ndevice = \"x\"\nbaud = 9601\naddress = 3\nident = 1",
                "9601 is no rate of PROFIBUS",
            ),
            (
                "kind = \"profibus-device\"\ndevice = \"x\"\naddress = 3\ngsd = \"none.gsd\"",
                "cannot read the GSD file",
            ),
            (
                "kind = \"profibus-device\"\ndevice = \"x\"\naddress = 3\nident = 1\nconfig = [0x50]",
                "the signals have 1 bytes of %Q, and the station 0",
            ),
        ]
    }
}

pub fn device(line: &pty::Line) -> End {
    device_at(line, 500_000)
}

pub fn device_at(line: &pty::Line, baud: u32) -> End {
    let bus = OnPort(line.end(0).display().to_string());
    let text = config(&bus, "device", "");
    let text = text.replace("baud = 500000", &format!("baud = {baud}"));
    End::open(&text, &Monotonic::shared(), &KINDS)
}

pub fn slave() -> Slave {
    Slave {
        address: ADDRESS,
        ident: IDENT,
        parameters: &[],
        config: &[0x52, 0x62],
        inputs: 6,
        outputs: 6,
    }
}

pub fn project() -> Project {
    Project {
        baud: Baudrate::B500000,
        slot: SLOT,
        watchdog: Some(profirust::time::Duration::from_millis(500)),
        address: 2,
        slaves: vec![slave()],
    }
}

/// The project at one of the [`RATES`].
pub fn project_at((baud, _, slot): (Baudrate, u32, u16)) -> Project {
    Project {
        baud,
        slot,
        ..project()
    }
}

/// Ticks until `done` holds.
#[track_caller]
pub fn until(device: &mut End, what: &str, mut done: impl FnMut(&mut End) -> bool) {
    await_that(what, || {
        device.tick();
        std::thread::sleep(Duration::from_micros(500));
        done(device)
    });
}

#[track_caller]
pub fn until_exchanging(device: &mut End, master: &Master) {
    let before = master.first(|seen| seen.exchanges);
    until(device, "data are exchanged", |device| {
        let goes = master.first(|seen| seen.exchanges) > before;
        goes && device.tick().code == Code::Fresh && device.link().state == LinkState::Running
    });
}

/// Each end sends a number to the other.
#[track_caller]
pub fn exchange(device: &mut End, master: &Master, number: u8) {
    device.set("position", f64::from(number));
    master.first(|seen| seen.outputs[2..4].copy_from_slice(&[0, number]));
    until(device, "both numbers arrive", |device| {
        let came = master.first(|seen| seen.inputs.get(2..4) == Some(&[0, number]));
        came && device.get("speed") == f64::from(number)
    });
}

/// The rates that a program in user space can serve, each with a slot time for a busy machine.
pub const RATES: [(Baudrate, u32, u16); 4] = [
    (Baudrate::B9600, 9_600, 500),
    (Baudrate::B19200, 19_200, 1_000),
    (Baudrate::B187500, 187_500, 4_000),
    (Baudrate::B500000, 500_000, SLOT),
];
