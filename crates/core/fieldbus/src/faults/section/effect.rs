//! The effect of a fault: the keys of its kind.

use super::keys::{ALARM_SLOT_LIMIT, DIAGNOSIS_LIMIT, DIRECTIONS, SIGNAL};
use super::{Keys, Scope};
use crate::faults::condition::unknown;
use crate::faults::diagnosis::OCTET_LIMIT;
use crate::faults::fault::{LATE_VALUES, MODEL};
use crate::faults::{
    AlarmKind, AnswerCodes, AnswerEffect, AnswerTrouble, ChannelError, Diagnosis, Direction,
    Effect, Elements, Finding, LineEffect, Octets, SignalEffect, WrongAnswer, measure,
};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Value, did_you_mean, short_number, shown};
use tickbus_image::signal::section::{slot_of, value_limits, value_range};
use tickbus_image::signal::{DataType, Signal, SignalTable, Slot};

/// The longest delay.
const LONGEST: Nanos = Nanos::from_secs(60);

/// Reads the effect of a fault of `kind` and reports its mistakes. With `whole` no line of the section was skipped, so
/// an absent key was not written.
pub(super) fn read_effect(
    kind: &str,
    keys: &Keys<'_>,
    scope: Option<Scope<'_>>,
    whole: bool,
) -> Option<Effect> {
    let table = scope.map(|scope| scope.table);
    let line = |trouble| Some(Effect::Line(trouble));
    match kind {
        "delay" => line(LineEffect::Delay(read_hold(keys)?)),
        LATE_VALUES => line(LineEffect::LateValues(read_hold(keys)?)),
        "drop" => {
            let (chance, direction) = (read_chance(keys, None), read_direction(keys));
            line(LineEffect::Drop(chance?, direction?))
        }
        "duplicate" => {
            let (chance, direction) = (read_chance(keys, Some(1.0)), read_direction(keys));
            line(LineEffect::Duplicate(chance?, direction?))
        }
        "answer-late" => read_answer(keys, scope, |codes| {
            let pause = keys.pause.as_ref();
            let pause = pause.map_or(Some(Nanos::ZERO), |pause| read_pause(pause, codes));
            Some(AnswerTrouble::Late {
                by: read_hold(keys)?,
                pause: pause?,
            })
        }),
        "answer-error" => read_answer(keys, scope, |codes| {
            read_code(keys.code.as_ref()?, codes).map(AnswerTrouble::Error)
        }),
        "answer-wrong" => read_answer(keys, scope, |codes| {
            let (value, names) = (keys.how.as_ref()?, &WrongAnswer::NAMES);
            let how = value.choice("faults of answers", names)?;
            if !codes.wrong.contains(&how) {
                let known = names.iter().filter(|(_, how)| codes.wrong.contains(how));
                let known: Vec<_> = known.map(|(name, _)| format!("\"{name}\"")).collect();
                // A bus without any was reported with the kind.
                if !known.is_empty() {
                    value.wrong(
                        format!(
                            "answers of this bus cannot be \"{}\"",
                            value.as_text().unwrap_or_default()
                        ),
                        format!("write {}", known.join(" or ")),
                    );
                }
                return None;
            }
            Some(AnswerTrouble::Wrong(how))
        }),
        "link-down" => line(LineEffect::LinkDown),
        "station-down" => {
            let station = keys.station.as_ref()?;
            let right = "write kind = \"link-down\"";
            line(LineEffect::StationDown(read_station(
                station, table?, right,
            )?))
        }
        MODEL => model_value(keys.value.as_ref()).map(Effect::Model),
        "diagnosis" => line(LineEffect::Diagnosis(read_diagnosis(keys, table?, whole)?)),
        _ => read_change(kind, keys, table, whole),
    }
}

/// Reads which answers are wrong, and what is wrong by `trouble`.
fn read_answer(
    keys: &Keys<'_>,
    scope: Option<Scope<'_>>,
    trouble: impl FnOnce(AnswerCodes) -> Option<AnswerTrouble>,
) -> Option<Effect> {
    let table = scope.map(|scope| scope.table);
    let codes = scope.map_or(AnswerCodes::ANY, |scope| scope.codes);
    let chance = read_chance(keys, Some(1.0));
    let station = match &keys.station {
        None => Some(None),
        Some(value) => {
            table.and_then(|table| read_station(value, table, "remove \"station\"").map(Some))
        }
    };
    let function = match &keys.function {
        None => Some(None),
        Some(value) => value
            .whole(1..=255)
            .and_then(|code| u8::try_from(code).ok())
            .map(Some),
    };
    let elements = read_elements(keys, table, codes);
    let trouble = trouble(codes);
    Some(Effect::Line(LineEffect::Answer(AnswerEffect {
        station: station?,
        function: function?,
        elements: elements?,
        chance: chance?,
        trouble: trouble?,
    })))
}

/// Reads the elements of the requests whose answers are wrong.
fn read_elements(
    keys: &Keys<'_>,
    table: Option<&SignalTable>,
    codes: AnswerCodes,
) -> Option<Elements> {
    let both = [("signal", &keys.signal), ("quantity", &keys.quantity)];
    let stated = both
        .iter()
        .filter_map(|(key, value)| Some((key, value.as_ref()?)));
    if !codes.has_elements {
        let mut stated = stated.peekable();
        let is_right = stated.peek().is_none();
        for (key, value) in stated {
            value.wrong(
                format!("faults of answers do not depend on a \"{key}\" on this bus"),
                "remove it; they do on \"modbus-server\"",
            );
        }
        return is_right.then(Elements::default);
    }
    let signal = match &keys.signal {
        None => Some(None),
        Some(value) => table.and_then(|table| signal_of(value, table).map(Some)),
    };
    let quantity = match &keys.quantity {
        None => Some(None),
        Some(value) => value
            .whole(1..=u16::MAX.into())
            .and_then(|number| u16::try_from(number).ok())
            .map(Some),
    };
    Some(Elements {
        signal: signal?,
        quantity: quantity?,
    })
}

/// The signal that a value names.
fn signal_of(value: &Value<'_>, table: &SignalTable) -> Option<usize> {
    let name = value.text(SIGNAL)?;
    let found = table.position(name);
    if found.is_none() {
        value.refuse(unknown(name, table));
    }
    found
}

/// Reads the time between two bytes of an answer.
fn read_pause(value: &Value<'_>, codes: AnswerCodes) -> Option<Nanos> {
    if !codes.has_pauses {
        value.wrong(
            "the bytes of an answer go out together on this line",
            "remove it; \"modbus-server\" and \"s7-server\" have pauses over TCP",
        );
        return None;
    }
    at_most_the_longest(value)
}

/// Reads the code of an error, as a number or by its name.
fn read_code(value: &Value<'_>, codes: AnswerCodes) -> Option<u32> {
    if !codes.names.is_empty() && value.as_text().is_some() {
        return value.choice("codes of errors that tickbus knows", codes.names);
    }
    if codes == AnswerCodes::ANY && value.as_text().is_some() {
        return None;
    }
    let (least, most) = codes.range;
    let code = value.whole(least.into()..=most.into())?;
    u32::try_from(code).ok()
}

/// Reads the value of a fault of the model; 1 if none is stated. Reports a mistake.
pub fn model_value(value: Option<&Value<'_>>) -> Option<f64> {
    match value {
        None => Some(1.0),
        Some(value) if value.is_boolean() => value.boolean().map(|on| f64::from(u8::from(on))),
        Some(value) => value.number("write a number, such as 0.4, or true"),
    }
}

fn read_hold(keys: &Keys<'_>) -> Option<Nanos> {
    at_most_the_longest(keys.by.as_ref()?)
}

fn at_most_the_longest(value: &Value<'_>) -> Option<Nanos> {
    let by = value.duration()?;
    if by > LONGEST {
        value.wrong(
            format!("frames cannot be held back for {by}"),
            format!("write at most \"{LONGEST}\", or use kind = \"link-down\""),
        );
        return None;
    }
    Some(by)
}

/// The probability, or the default if there is one and none is stated; `None` if that makes it invalid.
fn read_chance(keys: &Keys<'_>, usual: Option<f64>) -> Option<f64> {
    const RIGHT: &str = "write a chance above 0 and up to 1, such as 0.1 for one in ten";
    let Some(value) = &keys.chance else {
        return usual;
    };
    let chance = value.number(RIGHT)?;
    if chance > 0.0 && chance <= 1.0 {
        return Some(chance);
    }
    value.wrong(
        format!("a chance of {} is out of range", value.written()),
        RIGHT,
    );
    None
}

fn read_direction(keys: &Keys<'_>) -> Option<Direction> {
    let choose = |value: &Value<'_>| value.choice("directions", &DIRECTIONS);
    keys.direction
        .as_ref()
        .map_or(Some(Direction::Both), choose)
}

fn read_diagnosis(keys: &Keys<'_>, table: &SignalTable, whole: bool) -> Option<Diagnosis> {
    let small = |value: &Value<'_>, range| {
        let number = value.whole(range)?;
        u8::try_from(number).ok()
    };
    let station = match &keys.station {
        Some(value) => read_station(value, table, "remove \"station\""),
        None if table.stations.len() > 1 => {
            if let (Some(value), true) = (&keys.kind, whole) {
                value.wrong("it is not said whose diagnosis it is", "name the station");
            }
            None
        }
        None => Some(0),
    };
    let is_static = keys.static_.as_ref().map_or(Some(false), Value::boolean);
    let alarm = keys.alarm.as_ref();
    let alarm = alarm.map(|alarm| alarm.choice("types of alarms", &AlarmKind::ALL));
    let slot = keys.slot.as_ref().map(|value| {
        let slot = small(value, 0..=ALARM_SLOT_LIMIT)?;
        if alarm.is_none() && !(1..=DIAGNOSIS_LIMIT).contains(&slot.into()) {
            value.wrong(
                format!("slot {slot} is beyond those of a diagnosis"),
                format!("name a slot from 1 to {DIAGNOSIS_LIMIT}; those of alarms are 0 to {ALARM_SLOT_LIMIT}"),
            );
            return None;
        }
        Some(slot)
    });
    let channel = keys.channel.as_ref();
    let channel = channel.map(|channel| small(channel, 0..=DIAGNOSIS_LIMIT - 1));
    let error = keys.error.as_ref();
    let error = error.map(|error| error.choice("errors", &ChannelError::ALL));
    let octets = keys.octets.as_ref().map(read_octets);
    if let (Some(_), Some(value)) = (&alarm, &keys.static_) {
        value.wrong("an alarm is not static", "remove \"static\"");
        return None;
    }
    let finding = match (octets, slot, channel, error) {
        (octets, Some(slot), None, None) if alarm.is_some() => Finding::Alarm {
            kind: alarm.flatten()?,
            slot: slot?,
            octets: match octets {
                Some(octets) => Some(octets?),
                None => None,
            },
        },
        _ if alarm.is_some() => {
            if let (Some(value), true) = (&keys.alarm, whole) {
                value.wrong(
                    "an alarm has a slot, and may have octets",
                    "write slot = 2, and remove \"channel\" and \"error\"",
                );
            }
            return None;
        }
        (Some(octets), None, None, None) => Finding::Device(octets?),
        (None, Some(slot), None, None) => Finding::Module(slot?),
        (None, Some(slot), Some(channel), error) => Finding::Channel {
            slot: slot?,
            channel: channel?,
            error: error.unwrap_or(Some(ChannelError::Error))?,
        },
        _ => {
            if let (Some(value), true) = (&keys.kind, whole) {
                value.wrong(
                    "it is not said what the station reports",
                    "write slot = 2, or slot, channel = 0 and error = \"line-break\", or octets = [0x11] of the device's \
                     own",
                );
            }
            return None;
        }
    };
    Some(Diagnosis {
        station: station?,
        finding,
        is_static: is_static?,
    })
}

fn read_octets(value: &Value<'_>) -> Option<Octets> {
    let octets = value.list("write the octets, such as [0x11, 0x22]")?;
    let octets = octets
        .iter()
        .map(|octet| u8::try_from(octet.whole(0..=255)?).ok());
    let octets: Vec<u8> = octets.collect::<Option<_>>()?;
    let all = Octets::new(&octets);
    if all.is_none() {
        value.wrong(
            format!("there are {} octets", octets.len()),
            format!("write 1 to {OCTET_LIMIT}"),
        );
    }
    all
}

/// The station that a value names; `right` is the remedy for a driver with only one station.
fn read_station(value: &Value<'_>, table: &SignalTable, right: &str) -> Option<usize> {
    let name = value.text("write the name of a [[station]] in quotes")?;
    if let [_] = &table.stations[..] {
        value.wrong("this driver has one station only", right);
        return None;
    }
    let names: Vec<&str> = table.stations.iter().map(|s| s.name.as_str()).collect();
    let found = names.iter().position(|known| *known == name);
    if found.is_none() {
        value.wrong(
            format!("there is no station \"{}\"", shown(name)),
            did_you_mean(name, "stations", &names),
        );
    }
    found
}

fn read_change(
    kind: &str,
    keys: &Keys<'_>,
    table: Option<&SignalTable>,
    whole: bool,
) -> Option<Effect> {
    let (value, table) = (keys.signal.as_ref()?, table?);
    let index = signal_of(value, table)?;
    let signal = &table.signals[index];
    let change = match kind {
        "stuck" => SignalEffect::Stuck(match &keys.value {
            None => None,
            Some(value) => Some(read_value(value, signal)?),
        }),
        "invert" => read_invert(value, signal)?,
        "offset" => read_offset(value, keys.by.as_ref()?, signal)?,
        _ => read_noise(value, keys, signal, whole)?,
    };
    Some(Effect::Signal(index, change))
}

/// A value of the signal, with or without its unit.
fn read_value(value: &Value<'_>, signal: &Signal) -> Option<Slot> {
    if value.as_text().is_none() || signal.data_type == DataType::Bool || signal.is_integer_slot() {
        return slot_of(value, signal, "value");
    }
    let number = measure::of_value(value, signal)?;
    let (low, high) = value_limits(signal);
    if (low..=high).contains(&number) {
        return Some(Slot::from_real(number));
    }
    value.wrong(
        format!("value {} does not fit", short_number(number)),
        value_range(signal),
    );
    None
}

fn read_invert(value: &Value<'_>, signal: &Signal) -> Option<SignalEffect> {
    use DataType::{Bool, Byte, Dword, Lword, Word};

    let bits = matches!(signal.data_type, Bool | Byte | Word | Dword | Lword);
    if bits && signal.scale.is_none() {
        return Some(SignalEffect::Invert);
    }
    value.wrong(
        format!(
            "\"{}\" is a number ({}), and has no opposite",
            shown(&signal.name),
            signal.data_type
        ),
        "invert a BOOL or a bit string, or write kind = \"offset\" or \"stuck\"",
    );
    None
}

fn read_offset(place: &Value<'_>, value: &Value<'_>, signal: &Signal) -> Option<SignalEffect> {
    if signal.data_type == DataType::Bool {
        place.wrong(
            format!("\"{}\" is a BOOL, and has no offset", shown(&signal.name)),
            "write kind = \"invert\" or kind = \"stuck\"",
        );
        return None;
    }
    let by = measure::of_value(value, signal)?;
    if by == 0.0 {
        value.wrong("an offset of 0 changes nothing", "write another number");
        return None;
    }
    check_step(value, by, signal)?;
    Some(SignalEffect::Offset(by))
}

fn read_noise(
    place: &Value<'_>,
    keys: &Keys<'_>,
    signal: &Signal,
    whole: bool,
) -> Option<SignalEffect> {
    let is_bool = signal.data_type == DataType::Bool;
    let (wanted, other, example) = if is_bool {
        (&keys.chance, &keys.amplitude, "chance = 0.05")
    } else {
        (&keys.amplitude, &keys.chance, "amplitude = 2.5")
    };
    if let Some(other) = other {
        let name = shown(&signal.name);
        let (what, right) = if is_bool {
            (
                format!("\"{name}\" is a BOOL, and has no amplitude"),
                "say how likely it flickers at a tick, such as chance = 0.05",
            )
        } else {
            (
                format!("\"{name}\" is a number, and its noise has no chance"),
                "say how far it goes to either side, such as amplitude = 2.5",
            )
        };
        other.wrong(what, right);
        return None;
    }
    let Some(value) = wanted else {
        if whole {
            place.wrong(
                format!("the noise of \"{}\" has no strength", shown(&signal.name)),
                format!("add {example}"),
            );
        }
        return None;
    };
    if is_bool {
        return read_chance(keys, None).map(SignalEffect::Flicker);
    }
    let amplitude = measure::of_value(value, signal)?;
    if amplitude <= 0.0 {
        value.wrong(
            format!(
                "an amplitude of {} is out of range",
                short_number(amplitude)
            ),
            "write a number above 0",
        );
        return None;
    }
    check_step(value, amplitude, signal)?;
    Some(SignalEffect::Noise(amplitude))
}

/// Rejects a step that is larger than the signal's whole range, or too small to have an effect.
fn check_step(value: &Value<'_>, step: f64, signal: &Signal) -> Option<()> {
    let (low, high) = value_limits(signal);
    let least = match signal.scale {
        _ if !signal.data_type.is_integer() => 0.0,
        Some(scale) => scale.gain.abs() / 2.0,
        None => 0.5,
    };
    if step.abs() > high - low {
        value.wrong(
            format!("{} is beyond the range of the signal", short_number(step)),
            value_range(signal),
        );
        None
    } else if step.abs() < least {
        value.wrong(
            format!("{} is too little to be seen", short_number(step)),
            format!(
                "one step of \"{}\" is {}",
                shown(&signal.name),
                short_number(least * 2.0)
            ),
        );
        None
    } else {
        Some(())
    }
}
