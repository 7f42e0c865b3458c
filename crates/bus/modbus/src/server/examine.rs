//! The examination of a server's line.

use std::collections::BTreeMap;

use tickbus_base::os::SerialPort;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::examine::Examination;
use tickbus_net::serial::open;

use super::ServerOptions;
use crate::Line;
use crate::coding::Framer;
use crate::function::EXCEPTION_BIT;
use crate::line::Serial;
use crate::serial_settings::{others, written};

/// How long the line is overheard at other settings.
const TRIED: Nanos = Nanos::from_millis(300);

/// One damaged telegram among this many is none of the line: the first is often not whole, and a busy computer takes two for
/// one.
const FEW: usize = 4;

/// The telegrams on a line.
#[derive(Debug, Default)]
struct Heard {
    bytes: usize,
    damaged: usize,
    /// How often each unit was addressed, or has answered.
    units: BTreeMap<u8, usize>,
}

impl ServerOptions {
    /// Examines the line.
    pub(crate) fn examine(&self, examination: &mut Examination<'_>) {
        match &self.line {
            Line::Tcp(address) | Line::RtuOverTcp(address) => {
                if examination.can_listen(address) {
                    examination.sizes("the PLC asks for what it needs");
                }
            }
            Line::Udp(address) => {
                if examination.can_receive(address) {
                    examination.sizes("the PLC asks for what it needs");
                }
            }
            Line::Serial(serial) => {
                let opened = examination.reach_serial(&serial.device, serial.settings);
                let Some(port) = opened else {
                    return;
                };
                self.overhear(examination, port, serial);
                examination.sizes("the PLC asks for what it needs");
            }
        }
    }

    /// The step `line`: who talks on a serial line, and whether it is to one of the units here.
    fn overhear(&self, examination: &mut Examination<'_>, mut port: SerialPort, serial: &Serial) {
        let heard = telegrams(examination, &mut port, serial, examination.watch);
        drop(port);
        let within = examination.watch;
        if heard.bytes == 0 {
            let step = examination.ok("line", format!("nobody talks within {within}"));
            "--wait 30s serves the PLC for a while, and reports what it asks for in vain"
                .clone_into(&mut step.next);
            return;
        }
        if heard.units.is_empty() {
            let evidence = format!(
                "{} bytes came within {within}, and no telegram is whole",
                heard.bytes
            );
            let other = others(serial.settings).find(|settings| {
                let other = Serial {
                    settings: *settings,
                    ..serial.clone()
                };
                let port = open(&serial.device, *settings);
                !examination.stop.is_stopped()
                    && port.is_ok_and(|mut port| {
                        let heard = telegrams(examination, &mut port, &other, TRIED);
                        !heard.units.is_empty()
                    })
            });
            if let Some(settings) = other {
                let next = format!("write {}", written(settings));
                let evidence = format!("{evidence}; at {settings} they are");
                examination.fail("line", "wrong-settings", evidence, &next);
            } else {
                let next = "compare baud rate, parity and framing with those of the PLC, and check the wiring: A and B, \
                            ground, termination";
                examination.fail("line", "damaged", evidence, next);
            }
            return;
        }
        let units: Vec<String> = heard.units.keys().map(u8::to_string).collect();
        let evidence = format!("the PLC talks to unit {}", units.join(", "));
        let stations = 0..examination.setup.table.stations.len();
        let mut own = stations.map(|station| self.stations.unit(station));
        let is_asked = own.any(|own| own.is_none_or(|own| heard.units.contains_key(&own)));
        if !is_asked {
            let next = "write the same unit in the PLC and in the driver.cfg";
            examination.warn("line", "wrong-unit", evidence, next);
        } else if heard.damaged * FEW > heard.units.values().sum() {
            let evidence = format!("{evidence}; {} telegrams are damaged", heard.damaged);
            let next = "check the wiring: A and B, ground, termination at both ends";
            examination.warn("line", "damaged", evidence, next);
        } else {
            examination.ok("line", evidence);
        }
    }
}

/// The telegrams of others on the line within `span`.
fn telegrams(
    examination: &Examination<'_>,
    port: &mut SerialPort,
    serial: &Serial,
    span: Nanos,
) -> Heard {
    let mut framer = Framer::new(serial.coding, serial.silence);
    let mut heard = Heard::default();
    examination.overhear(port, span, |now, mut bytes| {
        heard.bytes += bytes.len();
        loop {
            framer.take(now, |telegram| {
                let telegram = telegram.and_then(|telegram| serial.coding.parse(telegram));
                match telegram {
                    Some((unit, [code, ..])) if code & EXCEPTION_BIT == 0 => {
                        *heard.units.entry(unit).or_default() += 1;
                    }
                    Some(_) => {}
                    None => heard.damaged += 1,
                }
            });
            if bytes.is_empty() {
                return;
            }
            framer.arrived(now, &mut bytes);
        }
    });
    heard
}
