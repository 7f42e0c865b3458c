//! The examination of a line: the port, and what its masters say.

use std::collections::BTreeSet;

use tickbus_base::os::{Characters, SerialPort};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::examine::Examination;
use tickbus_net::serial::open;

use crate::finder::{Finder, Found};
use crate::options::Options;
use crate::rates::RATES;
use crate::telegram::{BROADCAST, Telegram};

/// How long the line is overheard at another rate.
const TRIED: Nanos = Nanos::from_millis(200);

/// One damaged piece among this many telegrams is none of the line: the first is often not whole.
const FEW: usize = 10;

/// The telegrams on a line.
#[derive(Debug, Default)]
struct Heard {
    bytes: usize,
    telegrams: usize,
    damaged: usize,
    /// The masters that pass the token.
    masters: BTreeSet<u8>,
    /// The stations to which somebody sends.
    asked: BTreeSet<u8>,
}

impl Heard {
    /// True if the telegrams outweigh what is damaged: single bytes can look like telegrams.
    const fn is_legible(&self) -> bool {
        self.telegrams > self.damaged
    }
}

impl Options {
    /// Examines the line. Nothing is sent.
    pub(crate) fn examine_line(&self, examination: &mut Examination<'_>) {
        let line = &self.line;
        let Some(mut port) = examination.reach_serial(&line.device, line.settings) else {
            return;
        };
        let heard = overhear(
            examination,
            &mut port,
            line.settings.baud,
            examination.watch,
        );
        drop(port);
        let within = examination.watch;
        if heard.bytes == 0 {
            let next = "see whether the master runs, and check the plug: A and B, ground, and the termination at both ends";
            let evidence = format!("nothing is heard within {within}");
            examination.fail("line", "silent", evidence, next);
        } else if heard.is_legible() {
            self.tell_masters(examination, &heard);
        } else {
            self.tell_illegible(examination, &heard);
        }
    }

    fn tell_masters(&self, examination: &mut Examination<'_>, heard: &Heard) {
        let evidence = format!(
            "{} telegrams within {}, {} damaged pieces; masters {}",
            heard.telegrams,
            examination.watch,
            heard.damaged,
            listed(&heard.masters)
        );
        if heard.damaged * FEW > heard.telegrams {
            let next =
                "check the termination at both ends, and the length of the line at this rate";
            examination.warn("line", "damaged", evidence, next);
        } else {
            examination.ok("line", evidence);
        }
        let own: BTreeSet<u8> = self.stations().map(|station| station.address).collect();
        let missing: BTreeSet<u8> = own.difference(&heard.asked).copied().collect();
        if missing.is_empty() {
            let evidence = format!("the master asks station {}", listed(&own));
            examination.ok("stations", evidence);
        } else {
            let evidence = format!(
                "the master does not ask station {}; it asks {}",
                listed(&missing),
                listed(&heard.asked)
            );
            let next = "write the address that the master's configuration has; some masters ask an absent station only \
                        every few seconds";
            examination.warn("stations", "not-asked", evidence, next);
        }
    }

    fn tell_illegible(&self, examination: &mut Examination<'_>, heard: &Heard) {
        let settings = self.line.settings;
        let evidence = format!("{} bytes, and no telegram is whole", heard.bytes);
        let others = RATES.iter().filter(|rate| rate.baud != settings.baud);
        let mut others = others.map(|rate| rate.baud);
        let legible = others.find(|baud| {
            let settings = tickbus_base::os::SerialSettings {
                baud: *baud,
                ..settings
            };
            let port = open(&self.line.device, settings);
            !examination.stop.is_stopped()
                && port.is_ok_and(|mut port| {
                    overhear(examination, &mut port, *baud, TRIED).is_legible()
                })
        });
        if let Some(baud) = legible {
            let evidence = format!("{evidence}; at {baud} baud they are");
            let next = format!("write the rate of the master: baud = {baud}");
            examination.fail("line", "wrong-settings", evidence, &next);
        } else {
            let next = "write the rate of the master, and check the plug: A and B, ground, termination; many adapters do \
                        not reach 1.5 Mbit/s";
            examination.fail("line", "damaged", evidence, next);
        }
    }
}

/// Overhears a line at one rate.
fn overhear(examination: &Examination<'_>, port: &mut SerialPort, baud: u32, span: Nanos) -> Heard {
    let mut heard = Heard::default();
    let mut finder = Finder::new(baud);
    examination.overhear(port, span, |now, bytes| {
        heard.bytes += bytes.len();
        // The type of the error is one that cannot be.
        let _ = finder.hear(now, Characters::from(bytes), |found| {
            match found {
                Found::Damaged => heard.damaged += 1,
                Found::Telegram(telegram, _) => {
                    heard.telegrams += 1;
                    match telegram {
                        Telegram::Token { source, .. } => {
                            heard.masters.insert(source);
                        }
                        Telegram::Frame(frame) if frame.destination != BROADCAST => {
                            heard.asked.insert(frame.destination);
                        }
                        _ => {}
                    }
                }
            }
            Ok::<(), std::convert::Infallible>(())
        });
    });
    // A master is answered, and not asked.
    heard
        .asked
        .retain(|station| !heard.masters.contains(station));
    heard
}

/// Addresses as text.
fn listed(addresses: &BTreeSet<u8>) -> String {
    if addresses.is_empty() {
        return "none".to_owned();
    }
    let all: Vec<String> = addresses.iter().map(u8::to_string).collect();
    all.join(", ")
}
