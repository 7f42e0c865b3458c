//! The examination of a serial line: whether it is quiet, and which unit answers at which settings.

use tickbus_base::os::SerialPort;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::examine::{Examination, Wire, WireEnd};
use tickbus_net::serial::open;

use super::super::{ClientOptions, Request};
use super::ask::{Frame, Miss, Talk};
use super::speak::answers;
use crate::line::Serial;
use crate::serial_settings::{others, written};
use crate::{Coding, PDU_LIMIT, rtu};

/// How long the line is overheard before the first question.
const OVERHEARD: Nanos = Nanos::from_millis(300);

/// The time in which a unit answers while others are tried, besides the time of the characters.
const TRIED: Nanos = Nanos::from_millis(200);

/// The units that are tried.
const UNITS: std::ops::RangeInclusive<u8> = 1..=10;

/// The characters of a short question and its answer.
const SHORT: i64 = 40;

impl ClientOptions {
    /// Examines a serial line.
    pub(super) fn examine_serial(&self, examination: &mut Examination<'_>, serial: &Serial) {
        let Some(mut port) = examination.reach_serial(&serial.device, serial.settings) else {
            return;
        };
        let mut overheard = 0;
        examination.overhear(&mut port, OVERHEARD, |_, bytes| overheard += bytes.len());
        if overheard == 0 {
            examination.ok("line", "it is quiet until somebody is asked");
        } else {
            let evidence = format!("{overheard} bytes came within {OVERHEARD} without a question");
            let next = "end the other master, as a line has one; if there is none, check the termination and the bias \
                        resistors";
            examination.warn("line", "another-master", evidence, next);
        }
        let longest = i64::try_from(serial.coding.characters(PDU_LIMIT)).unwrap_or_default();
        let longest = serial.settings.character().times(2 * longest);
        let patience = examination.patience + longest;
        let mut talk = talk(examination, port, serial, patience);
        for station in 0..examination.setup.table.stations.len() {
            let unit = self.unit(station);
            let probe = self.probe(examination, station);
            // A first character can be damaged by what was on the line before.
            let answered = match answers(&mut talk, unit, &probe) {
                Err(Miss::End(WireEnd::Silent) | Miss::Alien(_)) => {
                    answers(&mut talk, unit, &probe)
                }
                answered => answered,
            };
            let Err(miss) = answered else {
                examination.ok("protocol", format!("unit {unit} answers as Modbus does"));
                continue;
            };
            drop(talk);
            tell_miss(examination, serial, (unit, &probe), &miss);
            return;
        }
        let none = || None;
        self.look_at_values(examination, talk, (&serial.device, &none), |_| {});
    }
}

/// A conversation at the settings of `serial`.
fn talk(examination: &Examination<'_>, port: SerialPort, serial: &Serial, patience: Nanos) -> Talk {
    let frame = Frame::Serial {
        coding: serial.coding,
        echoes: serial.echo,
        // Of an ASCII telegram the end is a character.
        apart: rtu::silence(serial.settings.baud),
    };
    let wire = Wire::serial(port, patience, examination.setup.clock);
    Talk::new(wire, frame)
}

/// Says why a unit does not answer, after a search for what does.
fn tell_miss(
    examination: &mut Examination<'_>,
    serial: &Serial,
    (unit, probe): (u8, &Request),
    miss: &Miss,
) {
    let evidence = format!("unit {unit} on {} {miss}", serial.device);
    match miss {
        Miss::Echo { expected } => {
            let next = if *expected {
                "remove echo = true: this adapter does not send back what it sends"
            } else {
                "write echo = true: the adapter sends back what it sends"
            };
            examination.fail("protocol", "echo", evidence, next);
            return;
        }
        Miss::End(WireEnd::Closed | WireEnd::Broken(_)) => {
            let next = "see whether the adapter is still plugged in";
            examination.fail("protocol", "connection-lost", evidence, next);
            return;
        }
        _ => {}
    }
    let answers_at = |examination: &Examination<'_>, unit: u8, serial: &Serial| {
        let Ok(port) = open(&serial.device, serial.settings) else {
            return false;
        };
        let patience = TRIED + serial.settings.character().times(SHORT);
        !examination.stop.is_stopped()
            && answers(&mut talk(examination, port, serial, patience), unit, probe).is_ok()
    };
    let mut units = UNITS.filter(|other| *other != unit);
    if let Some(other) = units.find(|other| answers_at(examination, *other, serial)) {
        let evidence = format!("{evidence}, and unit {other} answers");
        let next = format!("write unit = {other}");
        examination.fail("protocol", "wrong-unit", evidence, &next);
        return;
    }
    let (coding, framing) = match serial.coding {
        Coding::Rtu => (Coding::Ascii, "write framing = \"ascii\""),
        Coding::Ascii => (Coding::Rtu, "remove framing = \"ascii\""),
    };
    let recoded = Serial {
        coding,
        ..serial.clone()
    };
    if answers_at(examination, unit, &recoded) {
        let evidence = format!("{evidence}, and answers in the other framing");
        examination.fail("protocol", "wrong-framing", evidence, framing);
        return;
    }
    let mut tried = 0;
    for settings in others(serial.settings) {
        tried += 1;
        let other = Serial {
            settings,
            ..serial.clone()
        };
        if answers_at(examination, unit, &other) {
            let evidence = format!("{evidence}, and answers at {settings}");
            let next = format!("write {}", written(settings));
            examination.fail("protocol", "wrong-settings", evidence, &next);
            return;
        }
    }
    let evidence = format!(
        "{evidence}; units {} to {} do not answer either, nor does unit {unit} in {tried} other settings",
        UNITS.start(),
        UNITS.end()
    );
    let cause = if matches!(miss, Miss::Alien(_)) {
        "not-modbus"
    } else {
        "silent"
    };
    let next = "check the supply of the device, whether A and B are exchanged, the unit and the baud rate in the device, and \
                whether it is a Modbus device";
    examination.fail("protocol", cause, evidence, next);
}
