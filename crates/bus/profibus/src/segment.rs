//! All stations of one line: finds the telegrams among the bytes, and the stations that they address.

use tickbus_base::os::Characters;
use tickbus_base::time::Nanos;

use crate::finder::{Finder, Found, bits};
use crate::station::{Process, Station};
use crate::telegram::{BROADCAST, Frame, Telegram};

/// The stations on a line, and the bytes of the next telegram so far.
#[derive(Debug)]
pub struct Segment {
    baud: u32,
    stations: Vec<(Station, Listening)>,
    finder: Finder,
}

/// How far an address is known to be free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Listening {
    /// No master has sent a request to the address.
    Silent,
    /// A master has sent a request, and an answer may still come.
    Asked,
    /// The master has continued without an answer.
    Free,
}

/// The result of a piece of the line's traffic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heard {
    /// How many telegrams have passed.
    pub telegrams: u64,
    /// How often bytes were skipped that are no telegram.
    pub damaged: usize,
    /// The station that answers, if any, and its wait before the answer.
    pub answer: Option<(u8, Nanos)>,
}

/// Another device has the address of a station.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// The address.
    pub address: u8,
}

impl Segment {
    /// These stations on a line of `baud` bits per second.
    ///
    /// # Panics
    ///
    /// When `baud` is 0.
    pub fn new(baud: u32, stations: Vec<Station>) -> Self {
        assert_ne!(baud, 0, "a line has a speed");
        let silent = stations
            .into_iter()
            .map(|station| (station, Listening::Silent));
        Self {
            baud,
            stations: silent.collect(),
            finder: Finder::new(baud),
        }
    }

    /// The stations.
    pub fn stations(&self) -> impl Iterator<Item = &Station> {
        self.stations.iter().map(|(station, _)| station)
    }

    /// The station at `address`.
    pub fn station_mut(&mut self, address: u8) -> Option<&mut Station> {
        let stations = self.stations.iter_mut().map(|(station, _)| station);
        stations.into_iter().find(|own| own.address() == address)
    }

    /// The time of this many bits.
    pub fn bits(&self, count: i64) -> Nanos {
        bits(self.baud, count)
    }

    /// When a station acts on its own; [`Nanos::MAX`] for never.
    pub fn deadline(&self) -> Nanos {
        let deadlines = self.stations().map(Station::deadline);
        deadlines.min().unwrap_or(Nanos::MAX)
    }

    /// Does what is due at `now`.
    pub fn turn(&mut self, now: Nanos, process: &mut impl Process) {
        for (station, _) in &mut self.stations {
            station.turn(now, process);
        }
    }

    /// Takes characters off the line. `reply` becomes the answer to the last telegram; a station no longer answers an
    /// earlier request once its master has continued.
    ///
    /// # Errors
    ///
    /// Another device answers at the address of a station that has never answered itself.
    pub fn hear<'a>(
        &mut self,
        now: Nanos,
        characters: impl Into<Characters<'a>>,
        process: &mut impl Process,
        reply: &mut Vec<u8>,
    ) -> Result<Heard, Taken> {
        let mut heard = Heard::default();
        let Self {
            finder,
            stations,
            baud,
        } = self;
        finder.hear(now, characters.into(), |found| {
            match found {
                Found::Damaged => {
                    heard.damaged += 1;
                    // The next bytes may be a part of a telegram: they prove nothing.
                    for (_, listening) in &mut *stations {
                        if *listening == Listening::Asked {
                            *listening = Listening::Silent;
                        }
                    }
                }
                Found::Telegram(telegram, _) => {
                    heard.telegrams += 1;
                    reply.clear();
                    listen(stations, &telegram)?;
                    let answer = serve(stations, now, &telegram, process, reply);
                    heard.answer = answer.map(|(address, wait)| (address, bits(*baud, wait)));
                }
            }
            Ok(())
        })?;
        if finder.has_begun() {
            reply.clear();
            heard.answer = None;
        }
        Ok(heard)
    }
}

/// Serves a telegram; returns the station that answers, if any, with its wait in bits.
fn serve(
    stations: &mut [(Station, Listening)],
    now: Nanos,
    telegram: &Telegram<'_>,
    process: &mut impl Process,
    reply: &mut Vec<u8>,
) -> Option<(u8, i64)> {
    let Telegram::Frame(frame) = telegram else {
        return None;
    };
    if !frame.control.is_request() {
        return None;
    }
    let mut answer = None;
    for (station, listening) in stations {
        let address = station.address();
        if frame.destination == BROADCAST {
            station.request(now, frame, process, reply);
        } else if frame.destination == address && *listening != Listening::Free {
            if frame.control.is_answered() {
                *listening = Listening::Asked;
            }
        } else if frame.destination == address {
            station.request(now, frame, process, reply);
            answer = Some((address, i64::from(station.min_tsdr())));
        }
    }
    answer.filter(|_| !reply.is_empty())
}

/// Finds out whether the addresses are free: one request to each must remain unanswered.
fn listen(stations: &mut [(Station, Listening)], telegram: &Telegram<'_>) -> Result<(), Taken> {
    for (station, listening) in stations {
        let address = station.address();
        let is_answered = match telegram {
            Telegram::Frame(Frame {
                source, control, ..
            }) if !control.is_request() => *source == address,
            Telegram::ShortAck => *listening == Listening::Asked,
            _ => {
                if *listening == Listening::Asked {
                    *listening = Listening::Free;
                }
                false
            }
        };
        // An adapter may echo sent bytes, but nothing is sent before an address is free.
        if is_answered && *listening != Listening::Free {
            return Err(Taken { address });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::Configuration;
    use crate::event::Event;
    use crate::finder::{PATIENCE, SILENCE};
    use crate::station::Identity;
    use crate::telegram::{Control, DATA_LIMIT};
    use crate::user_parameters::UserParameters;

    struct Nothing;

    impl Process for Nothing {
        fn inputs(&mut self, _: u8, _: Nanos, _: &mut [u8]) -> bool {
            true
        }
        fn delivered(&mut self, _: u8) {}
        fn outputs(&mut self, _: u8, _: Nanos, _: &[u8]) {}
        fn alive(&mut self, _: u8, _: Nanos) {}
        fn tell(&mut self, _: u8, _: Nanos, _: Event) {}
    }

    fn segment(addresses: &[u8]) -> Segment {
        let station = |address: &u8| {
            let identity = Identity {
                ident: 1,
                configuration: Configuration::of_sizes(1, 1),
                user: UserParameters::default(),
                sync: true,
                freeze: true,
                fail_safe: false,
                dpv1: false,
                max_diagnosis: DATA_LIMIT,
                acyclic: crate::Acyclic::default(),
            };
            Station::new(*address, identity)
        };
        Segment::new(500_000, addresses.iter().map(station).collect())
    }

    fn status(to: u8) -> Vec<u8> {
        frame(to, 2, 0x49, None, &[])
    }

    fn frame(to: u8, from: u8, control: u8, sap: Option<u8>, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        Frame {
            destination: to,
            source: from,
            control: Control(control),
            dsap: sap,
            ssap: sap.map(|_| 62),
            data,
        }
        .append(&mut bytes);
        bytes
    }

    /// The station that answers these bytes.
    fn hear(segment: &mut Segment, now: Nanos, bytes: &[u8]) -> Option<u8> {
        let mut reply = Vec::new();
        let heard = segment.hear(now, bytes, &mut Nothing, &mut reply);
        let answer = heard.expect("free").answer;
        assert_eq!(answer.is_some(), !reply.is_empty());
        answer.map(|(address, _)| address)
    }

    /// The segment after a request to each of its stations has remained unanswered.
    fn free(addresses: &[u8]) -> Segment {
        let mut segment = segment(addresses);
        for address in addresses {
            assert_eq!(hear(&mut segment, Nanos(0), &status(*address)), None);
        }
        assert_eq!(hear(&mut segment, Nanos(0), &[0xDC, 2, 2]), None);
        segment
    }

    #[test]
    fn each_station_answers_its_own_address_alone() {
        let mut line = free(&[3, 7]);
        for (address, answers) in [(3, Some(3)), (7, Some(7)), (5, None), (127, None)] {
            assert_eq!(hear(&mut line, Nanos(0), &status(address)), answers);
        }
    }

    #[test]
    fn bytes_come_in_any_pieces_and_after_any_noise() {
        let mut line = free(&[3]);
        let request = status(3);
        for cut in 1..request.len() {
            assert_eq!(hear(&mut line, Nanos(0), &request[..cut]), None);
            assert_eq!(hear(&mut line, Nanos(0), &request[cut..]), Some(3));
        }
        let mut noise: Vec<u8> = (0..=255).filter(|byte| *byte != 0xE5).collect();
        noise.extend_from_slice(&request);
        let mut reply = Vec::new();
        let heard = line.hear(Nanos(0), &noise[..], &mut Nothing, &mut reply);
        let heard = heard.expect("free");
        assert!(heard.damaged > 0 && heard.answer.is_some());
    }

    #[test]
    fn a_telegram_that_never_ends_does_not_swallow_the_next_one() {
        let mut line = free(&[3]);
        // The head of a long telegram, followed by silence.
        let head = [0x68, 200, 200, 0x68, 3, 2, 0x5D];
        assert_eq!(hear(&mut line, Nanos(0), &head), None);
        let later = line.bits(SILENCE) + Nanos(1);
        assert_eq!(hear(&mut line, later, &status(3)), Some(3));
        // Works in pieces too, but not at once.
        assert_eq!(hear(&mut line, later, &head), None);
        let much_later = later + PATIENCE + Nanos(1);
        assert_eq!(hear(&mut line, much_later, &status(3)[..2]), None);
        assert_eq!(hear(&mut line, much_later, &status(3)[2..]), Some(3));
    }

    #[test]
    fn what_the_master_no_longer_waits_for_is_not_answered() {
        let mut line = free(&[3]);
        let mut both = status(3);
        both.extend(status(9));
        assert_eq!(hear(&mut line, Nanos(0), &both), None);
        let mut twice = status(9);
        twice.extend(status(3));
        assert_eq!(hear(&mut line, Nanos(0), &twice), Some(3));
    }

    #[test]
    fn a_request_behind_which_the_next_telegram_begins_is_not_answered() {
        let mut line = free(&[3]);
        let next = frame(9, 2, 0x7D, None, &[1, 2]);
        for cut in 1..next.len() {
            let mut bytes = status(3);
            bytes.extend_from_slice(&next[..cut]);
            assert_eq!(hear(&mut line, Nanos(0), &bytes), None, "{cut}");
            assert_eq!(hear(&mut line, Nanos(0), &next[cut..]), None, "{cut}");
        }
    }

    #[test]
    fn what_nobody_answers_and_what_follows_noise_say_nothing_about_an_address() {
        let mut line = segment(&[3]);
        let control = frame(3, 2, 0x46, Some(58), &[0, 0]);
        assert_eq!(hear(&mut line, Nanos(0), &control), None);
        assert_eq!(hear(&mut line, Nanos(0), &[0xDC, 2, 2]), None);
        assert_eq!(hear(&mut line, Nanos(0), &status(3)), None, "it listens on");
        let mut reply = Vec::new();
        let noise = line.hear(Nanos(0), &[0x33, 0xE5][..], &mut Nothing, &mut reply);
        assert_eq!(noise.expect("no answer of another device").damaged, 1);
        assert_eq!(
            hear(&mut line, Nanos(0), &status(3)),
            None,
            "it listens again"
        );
    }

    #[test]
    fn an_address_that_another_device_answers_is_not_used() {
        let answer = frame(2, 3, 0x00, None, &[]);
        let mut reply = Vec::new();
        let mut hears =
            |line: &mut Segment, bytes: &[u8]| line.hear(Nanos(0), bytes, &mut Nothing, &mut reply);
        let taken = Err(Taken { address: 3 });
        let mut line = segment(&[3]);
        assert_eq!(hears(&mut line, &answer), taken);
        let mut line = segment(&[3]);
        assert!(hears(&mut line, &status(3)).is_ok());
        assert_eq!(hears(&mut line, &[0xE5]), taken, "it has no address");
        let mut line = segment(&[3]);
        assert!(hears(&mut line, &status(9)).is_ok());
        assert!(hears(&mut line, &[0xE5]).is_ok(), "another station's");
        let mut line = free(&[3]);
        assert!(hears(&mut line, &answer).is_ok(), "the own echo");
    }

    #[test]
    fn the_wait_before_an_answer_is_that_of_the_station_in_bits_of_the_line() {
        let mut line = free(&[3]);
        let mut reply = Vec::new();
        let heard = line.hear(Nanos(0), &status(3)[..], &mut Nothing, &mut reply);
        assert_eq!(heard.expect("free").answer, Some((3, Nanos(22_000))));
    }
}
