//! The keys of a reply whose values can be changed from outside, as a fit does.

use tickbus_base::time::Nanos;

use super::behaviour::{Behaviour, Reply};
use super::io::seconds;
use super::lag::Source;
use super::numbers::Speed;
use super::pulses::Beat;

/// All of them, of whatever kind.
const KEYS: [&str; 22] = [
    "on_after",
    "off_after",
    "start_time",
    "stop_time",
    "full_speed",
    "extend_time",
    "retract_time",
    "open_time",
    "close_time",
    "time",
    "gain",
    "offset",
    "on",
    "off",
    "above",
    "below",
    "rate",
    "on_for",
    "off_for",
    "every",
    "after",
    "per_second",
];

/// The value of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// The key, as in driver.cfg.
    pub key: &'static str,
    /// Seconds if the key is a time, else the number that stands there.
    pub value: f64,
    /// True if the key is a time.
    pub is_time: bool,
}

/// Where a reply keeps a value.
enum Place<'a> {
    Time(&'a mut Nanos),
    /// A time as the part of the way per second.
    Rate(&'a mut f64),
    Number(&'a mut f64),
}

impl Reply {
    /// Returns the keys whose values [`set`](Self::set) can change, with their values.
    pub fn settings(&self) -> Vec<Setting> {
        let mut reply = self.clone();
        let setting = |key| {
            let (value, is_time) = match reply.place(key)? {
                Place::Time(time) => (seconds(*time), true),
                Place::Rate(rate) => (1.0 / *rate, true),
                Place::Number(number) => (*number, false),
            };
            Some(Setting {
                key,
                value,
                is_time,
            })
        };
        KEYS.into_iter().filter_map(setting).collect()
    }

    /// Changes the value of a key, for replies that have not begun: seconds for a time. Changes nothing if the reply has
    /// no such key. A time that the reply does not state, such as `retract_time`, follows the time that it defaults to.
    pub fn set(&mut self, key: &str, value: f64) {
        match self.place(key) {
            #[expect(clippy::cast_possible_truncation, reason = "at most some years")]
            Some(Place::Time(time)) => *time = Nanos(((value * 1e9).round() as i64).max(1)),
            Some(Place::Rate(rate)) => *rate = 1.0 / value,
            Some(Place::Number(number)) => *number = value,
            None => {}
        }
    }

    fn place(&mut self, key: &str) -> Option<Place<'_>> {
        use Place::{Number, Rate, Time};
        Some(match (&mut self.behaviour, key) {
            (Behaviour::Follows(it), "on_after") => Time(&mut it.delay.on_after),
            (Behaviour::Follows(it), "off_after") => Time(&mut it.delay.off_after),
            (Behaviour::Motor(it), "on_after") => Time(&mut it.contact.on_after),
            (Behaviour::Motor(it), "off_after") => Time(&mut it.contact.off_after),
            (Behaviour::Motor(it), "start_time") => Rate(&mut it.rates.forth),
            (Behaviour::Motor(it), "stop_time") => {
                Rate(it.rates.back.get_or_insert(it.rates.forth))
            }
            (Behaviour::Motor(it), "full_speed") => Number(&mut it.full_speed),
            (Behaviour::Travel(it), key) => match (self.kind, key) {
                ("cylinder", "extend_time") | ("valve", "open_time") => Rate(&mut it.rates.forth),
                ("cylinder", "retract_time") | ("valve", "close_time") => {
                    Rate(it.rates.back.get_or_insert(it.rates.forth))
                }
                _ => return None,
            },
            (Behaviour::Lag(it), "time") => Time(&mut it.time),
            (Behaviour::Lag(it), key) => match (&mut it.source, key) {
                (Source::Number { gain, .. }, "gain") => Number(gain),
                (Source::Number { offset, .. }, "offset") => Number(offset),
                (Source::Condition { on, .. }, "on") => Number(on),
                (Source::Condition { off, .. }, "off") => Number(off),
                _ => return None,
            },
            (Behaviour::Switch(it), "above") => Number(it.threshold.trip_point(true)?),
            (Behaviour::Switch(it), "below") => Number(it.threshold.trip_point(false)?),
            (Behaviour::Encoder(it), key) => match (&mut it.source, key) {
                (Speed::Number { gain, .. }, "gain") => Number(gain),
                (Speed::Conditions { rate, .. }, "rate") => Number(rate),
                _ => return None,
            },
            (Behaviour::Blink(it), "on_for") => Time(&mut it.on_for),
            (Behaviour::Blink(it), "off_for") => Time(it.off_for.get_or_insert(it.on_for)),
            (Behaviour::LifeSign(it), "every") => match &mut it.source {
                Beat::Every { every, .. } => Time(every),
                Beat::Echo(_) => return None,
            },
            (Behaviour::Rule(it), "after") => Time(&mut it.rule.after),
            (Behaviour::Rule(it), "per_second") => Number(&mut it.rule.ramp.as_mut()?.per_second),
            _ => return None,
        })
    }
}
