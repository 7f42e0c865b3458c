//! Reads what each kind of reply has.

use tickbus_base::Threshold;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::short_number;
use tickbus_fieldbus::faults::Random;
use tickbus_image::signal::DataType;
use tickbus_image::signal::section::{slot_of, value_limits};

use super::reader::Reader;
use crate::behaviour::{Behaviour, RULE};
use crate::delay::{Delay, Follows};
use crate::integrator::{Flow, Integrator};
use crate::lag::{Lag, Source};
use crate::motor::Motor;
use crate::numbers::{Counter, Encoder, Speed, Switch};
use crate::part::{Part, Rates};
use crate::pulses::{Beat, Blink, LifeSign};
use crate::signal::Output;
use crate::track::{Exit, Lane, Sensor, Span, Track};
use crate::travel::{Drive, Travel};

/// The positions of a part without `limits`, in percent.
const PERCENT: [f64; 2] = [0.0, 100.0];

/// Keys of which a section needs one, with the remedy.
pub type OneOf = (&'static [&'static str], &'static str);

/// The keys of which replies of this kind need one.
pub fn one_of(kind: &str) -> &'static [OneOf] {
    match kind {
        "motor" => &[(
            &["running", "at_speed", "speed", "overload", "healthy"],
            "name a signal that the motor makes, such as running = \"Pump 1 running\"",
        )],
        "cylinder" => &[(
            &["extended", "retracted", "position"],
            "name a signal that the cylinder makes, such as extended = \"Clamp is out\"",
        )],
        "valve" => &[
            (
                &["open", "target"],
                "write what opens the valve, such as open = \"Inlet open\"",
            ),
            (
                &["opened", "closed", "position"],
                "name a signal that the valve makes, such as opened = \"Inlet is open\"",
            ),
        ],
        "lag" => &[(
            &["input", "when"],
            "name a signal that it follows, such as input = \"Heater\", or a condition with \"when\"",
        )],
        "switch" => &[(
            &["above", "below"],
            "write the number above which it is on, such as above = 80, or below which",
        )],
        "encoder" => &[(
            &["input", "forward"],
            "name the signal with the speed, such as input = \"Belt speed\", or a condition with \"forward\"",
        )],
        "track" => &[(
            &["input", "forward"],
            "write what moves it, such as forward = \"Belt on\" with a rate, or the signal with its speed with \"input\"",
        )],
        "life-sign" => &[(
            &["every", "input"],
            "write how often it counts, such as every = \"1s\", or the signal that it repeats with \"input\"",
        )],
        RULE => &[(&["set", "ramp"], "say what the machine does then")],
        _ => &[],
    }
}

/// Reads the keys of a kind. Every mistake is reported before the first one ends reading.
pub(super) fn read(kind: &str, reader: &Reader<'_>) -> Option<Behaviour> {
    match kind {
        "constant" => constant(reader),
        "follows" => follows(reader),
        "motor" => motor(reader),
        "cylinder" => travel(reader, &CYLINDER),
        "valve" => travel(reader, &VALVE),
        "lag" => lag(reader),
        "switch" => switch(reader),
        "counter" => counter(reader),
        "encoder" => encoder(reader),
        "blink" => blink(reader),
        "life-sign" => life_sign(reader),
        "integrator" => integrator(reader),
        "track" => track(reader),
        _ => reader.rule().map(|rule| Behaviour::Rule(Box::new(rule))),
    }
}

fn constant(reader: &Reader<'_>) -> Option<Behaviour> {
    let output = reader.output("signal")??;
    let signal = reader.signal(output.signal());
    let value = reader.read("value", |value| slot_of(value, signal, "the value"))??;
    Some(Behaviour::Constant(output, value))
}

fn delay(reader: &Reader<'_>) -> Option<Delay> {
    let (on, off) = (reader.time("on_after"), reader.time("off_after"));
    Some(Delay::new(
        on?.unwrap_or_default(),
        off?.unwrap_or_default(),
    ))
}

fn follows(reader: &Reader<'_>) -> Option<Behaviour> {
    let (signal, when) = (reader.bit("signal"), reader.levels("when"));
    let (delay, inverted) = (delay(reader), reader.flag("inverted"));
    Some(Behaviour::Follows(Follows {
        signal: signal??,
        when: when??,
        inverted: inverted?,
        delay: delay?,
    }))
}

fn motor(reader: &Reader<'_>) -> Option<Behaviour> {
    let contactor = reader.levels("contactor");
    let outputs = ["running", "at_speed", "overload", "healthy"].map(|key| reader.bit(key));
    let speed = reader.number_made("speed");
    let contact = delay(reader);
    let times = ["start_time", "stop_time"].map(|key| reader.time(key));
    let full_speed = reader.number("full_speed");
    let target = reader.input("target", false);
    let (trip, reset) = (reader.levels("trip"), reader.levels("reset"));
    let sound = [
        match reader.get("target") {
            None => reader.needs("full_speed", "speed"),
            Some(_) => Some(()),
        },
        reader.needs("reset", "trip"),
    ];
    let [running, at_speed, overload, healthy] = outputs;
    let [start_time, stop_time] = times;
    sound.into_iter().collect::<Option<()>>()?;
    Some(Behaviour::Motor(Box::new(Motor {
        contactor: contactor??,
        contact: contact?,
        rates: Rates::of(start_time?.unwrap_or_default(), stop_time?),
        full_speed: full_speed?.unwrap_or(100.0),
        target: target?,
        trip: trip?,
        reset: reset?,
        running: running?,
        at_speed: at_speed?,
        speed: speed?,
        overload: overload?,
        healthy: healthy?,
        part: Part::new(0.0),
        has_tripped: false,
    })))
}

/// The keys of a part that travels: commands, times and switches, forth and back.
struct TravelKeys {
    commands: [&'static str; 2],
    times: [&'static str; 2],
    ends: [&'static str; 2],
}

const CYLINDER: TravelKeys = TravelKeys {
    commands: ["extend", "retract"],
    times: ["extend_time", "retract_time"],
    ends: ["extended", "retracted"],
};

const VALVE: TravelKeys = TravelKeys {
    commands: ["open", "close"],
    times: ["open_time", "close_time"],
    ends: ["opened", "closed"],
};

fn travel(reader: &Reader<'_>, keys: &TravelKeys) -> Option<Behaviour> {
    let [forth, back] = keys.commands.map(|key| reader.levels(key));
    let [time, time_back] = keys.times.map(|key| reader.time(key));
    let [far, near] = keys.ends.map(|key| reader.bit(key));
    let position = reader.number_made("position");
    let target = reader.input("target", false);
    let impulse = reader.flag("impulse");
    let [open, close] = keys.commands;
    let sound = [
        reader.exclude(open, "target"),
        reader.exclude(close, "target"),
        reader.exclude("target", "impulse"),
        match impulse {
            Some(true) if reader.get("target").is_none() => reader.needs("impulse", close),
            _ => Some(()),
        },
    ];
    let made = position.flatten().map(Output::signal);
    let of = made.or(target.flatten().map(|input| input.signal));
    let usual = of.and_then(|signal| reader.signal(signal).range);
    let usual = usual.map_or(PERCENT, |[one, other]| [one.min(other), one.max(other)]);
    let limits = reader.limits(made, usual);
    let start = limits.map(|limits| reader.start(limits));
    sound.into_iter().collect::<Option<()>>()?;
    let (limits, start, time) = (limits?, start??, time??);
    let [low, high] = limits;
    let drive = match target? {
        Some(target) => Drive::Target(target),
        None => Drive::Commands {
            forth: forth??,
            back: back?,
            impulse: impulse?,
        },
    };
    Some(Behaviour::Travel(Box::new(Travel {
        drive,
        rates: Rates::of(time, time_back?),
        ends: [far?, near?],
        position: position?,
        limits,
        part: Part::new((start.unwrap_or(low) - low) / (high - low)),
    })))
}

fn lag(reader: &Reader<'_>) -> Option<Behaviour> {
    let (signal, time) = (reader.number_made("signal"), reader.time("time"));
    let (input, when) = (reader.input("input", false), reader.levels("when"));
    let [gain, offset] = ["gain", "offset"].map(|key| reader.number(key));
    let [on, off] = ["on", "off"].map(|key| reader.number(key));
    let noise = reader.amount("noise");
    let seed = reader.read("seed", |value| value.whole(0..=u64::MAX.into()));
    let sound = [
        reader.exclude("input", "when"),
        reader.needs("gain", "input"),
        reader.needs("offset", "input"),
        reader.needs("on", "when"),
        reader.needs("off", "when"),
        match reader.get("when") {
            None => Some(()),
            Some(_) => reader.needs("when", "on").and(reader.needs("when", "off")),
        },
    ];
    let signal = signal??;
    let (least, greatest) = value_limits(reader.signal(signal.signal()));
    let limits = reader.limits(Some(signal.signal()), [least, greatest])?;
    let start = reader.start(limits);
    sound.into_iter().collect::<Option<()>>()?;
    let source = match input? {
        Some(input) => Source::Number {
            input,
            gain: gain?.unwrap_or(1.0),
            offset: offset?.unwrap_or(0.0),
        },
        None => Source::Condition {
            when: when??,
            on: on??,
            off: off??,
        },
    };
    let seed = u64::try_from(seed?.unwrap_or(1)).ok()?;
    // Replies with the same seed draw different numbers.
    let place = u32::try_from(signal.signal()).ok()?;
    Some(Behaviour::Lag(Box::new(Lag {
        signal,
        source,
        time: time??,
        tick: (Nanos::ZERO, 0.0),
        limits,
        noise: noise?,
        random: Random::new(seed, place),
        at: start?,
    })))
}

fn switch(reader: &Reader<'_>) -> Option<Behaviour> {
    let (signal, input) = (reader.bit("signal"), reader.input("input", false));
    let (above, below) = (reader.number("above"), reader.number("below"));
    let hysteresis = reader.amount("hysteresis");
    reader.exclude("above", "below")?;
    let (above, below) = (above?, below?);
    Some(Behaviour::Switch(Switch {
        signal: signal??,
        input: input??,
        threshold: Threshold::new(above.or(below)?, above.is_some(), hysteresis?),
    }))
}

fn counter(reader: &Reader<'_>) -> Option<Behaviour> {
    let signal = reader.number_made("signal");
    let [up, down, reset] = ["when", "down", "reset"].map(|key| reader.levels(key));
    let signal = signal??;
    let limits = reader.count_limits(signal.signal())?;
    let start = reader.start(limits)?;
    let start = start.unwrap_or_else(|| first_count(limits));
    Some(Behaviour::Counter(Box::new(Counter {
        signal,
        up: up??,
        down: down?,
        reset: reset?,
        limits,
        start,
        count: start,
        held: [true; 2],
    })))
}

fn encoder(reader: &Reader<'_>) -> Option<Behaviour> {
    let (signal, source) = (reader.number_made("signal"), speed(reader));
    let reset = reader.levels("reset");
    let signal = signal??;
    let limits = reader.count_limits(signal.signal())?;
    let start = reader.start(limits)?;
    let start = start.unwrap_or_else(|| first_count(limits));
    Some(Behaviour::Encoder(Box::new(Encoder {
        signal,
        source: source?,
        reset: reset?,
        limits,
        start,
        count: start,
    })))
}

/// A speed: a number, or conditions with a rate.
fn speed(reader: &Reader<'_>) -> Option<Speed> {
    let input = reader.input("input", false);
    let [forward, reverse] = ["forward", "reverse"].map(|key| reader.levels(key));
    let [gain, rate] = ["gain", "rate"].map(|key| reader.number(key));
    let sound = [
        reader.exclude("input", "forward"),
        reader.needs("gain", "input"),
        reader.needs("rate", "forward"),
        reader.needs("reverse", "forward"),
        reader.needs("forward", "rate"),
    ];
    sound.into_iter().collect::<Option<()>>()?;
    Some(match input? {
        Some(input) => Speed::Number {
            input,
            gain: gain?.unwrap_or(1.0),
        },
        None => Speed::Conditions {
            forward: forward??,
            reverse: reverse?,
            rate: rate??,
        },
    })
}

fn integrator(reader: &Reader<'_>) -> Option<Behaviour> {
    let (signal, reset) = (reader.number_made("signal"), reader.levels("reset"));
    let flows = reader.each("flows", &["when", "rate", "input", "gain"], |flow| {
        let (when, input) = (flow.levels("when"), flow.input("input", false));
        let [rate, gain] = ["rate", "gain"].map(|key| flow.number(key));
        let sound = [
            flow.exclude("input", "rate"),
            flow.needs("gain", "input"),
            flow.needs_one_of(
                &["rate", "input"],
                "add how fast it flows, such as rate = 5",
            ),
        ];
        sound.into_iter().collect::<Option<()>>()?;
        let (input, rate) = (input?, rate?);
        Some(Flow {
            when: when?,
            factor: rate.or(gain?).unwrap_or(1.0),
            input,
        })
    });
    let signal = signal??;
    let (least, greatest) = value_limits(reader.signal(signal.signal()));
    let usual = reader.signal(signal.signal()).range;
    let usual = usual.map_or([least, greatest], |[one, other]| {
        [one.min(other), one.max(other)]
    });
    let limits = reader.limits(Some(signal.signal()), usual)?;
    let start = reader.start(limits)?;
    let start = start.unwrap_or_else(|| first_count(limits));
    Some(Behaviour::Integrator(Box::new(Integrator {
        signal,
        flows: flows??.into(),
        reset: reset?,
        limits,
        start,
        at: start,
    })))
}

/// The heights that a sensor or an exit of a track is for.
fn span(reader: &Reader<'_>) -> Option<Span> {
    let [above, below] = ["above", "below"].map(|key| reader.number(key));
    let span = Span {
        above: above?.unwrap_or(f64::NEG_INFINITY),
        below: below?.unwrap_or(f64::INFINITY),
    };
    if span.above > span.below {
        let [above, below] = [span.above, span.below].map(short_number);
        return reader.wrong(
            "below",
            format!("no height is above {above} and below {below}"),
            "write the lower height with \"above\"",
        );
    }
    Some(span)
}

/// The place of a sensor or an exit, which must be on a track of this length, if it has one.
fn on_track(reader: &Reader<'_>, at: f64, length: Option<f64>) -> Option<f64> {
    match length {
        Some(length) if !(0.0..=length).contains(&at) => {
            let [at, length] = [at, length].map(short_number);
            reader.wrong(
                "at",
                format!("{at} is beyond the track, which is {length} long"),
                format!("write a place from 0 to {length}, or a longer track"),
            )
        }
        _ => Some(at),
    }
}

fn track(reader: &Reader<'_>) -> Option<Behaviour> {
    let (speed, enters) = (speed(reader), reader.levels("enters"));
    let [length, size, gap] = ["length", "size", "gap"].map(|key| reader.above_zero(key));
    let parts = reader.numbers("parts");
    let sensors = reader.each("sensors", &["signal", "at", "above", "below"], |sensor| {
        let (signal, at, span) = (sensor.bit("signal"), sensor.number("at"), span(sensor));
        let whole = [sensor.require("signal"), sensor.require("at")];
        whole.into_iter().collect::<Option<()>>()?;
        Some(Sensor {
            signal: signal??,
            at: on_track(sensor, at??, length.flatten())?,
            span: span?,
        })
    });
    let exits = reader.each(
        "exits",
        &["at", "when", "above", "below", "signal"],
        |exit| {
            let (at, when, span) = (exit.number("at"), exit.levels("when"), span(exit));
            let signal = exit.number_made("signal");
            exit.require("at")?;
            Some(Exit {
                at: on_track(exit, at??, length.flatten())?,
                when: when?,
                span: span?,
                signal: signal?,
                count: 0.0,
            })
        },
    );
    let places = reader.each("places", &["position", "height"], |place| {
        let [position, height] = ["position", "height"].map(|key| place.number_made(key));
        place.require("position")?;
        Some(Lane {
            position: position??,
            height: height?,
            part: None,
        })
    });
    let (length, size, gap) = (length??, size??, gap?.unwrap_or(2.0 * size??));
    if gap < size {
        return reader.wrong(
            "gap",
            format!(
                "parts of {} enter every {}",
                short_number(size),
                short_number(gap)
            ),
            "write a gap that is not shorter than a part",
        );
    }
    Some(Behaviour::Track(Box::new(Track {
        speed: speed?,
        enters: enters?,
        length,
        size,
        gap,
        parts: parts?.into(),
        entered: 0,
        sensors: sensors?.unwrap_or_default().into(),
        exits: exits?.unwrap_or_default().into(),
        lanes: places??.into(),
    })))
}

/// A count begins at 0 if its limits allow that.
fn first_count([low, high]: [f64; 2]) -> f64 {
    0.0_f64.clamp(low, high)
}

fn blink(reader: &Reader<'_>) -> Option<Behaviour> {
    let signal = reader.bit("signal");
    let (on_for, off_for) = (reader.time("on_for"), reader.time("off_for"));
    let when = reader.levels("when");
    let on_for = on_for??;
    Some(Behaviour::Blink(Blink {
        signal: signal??,
        on_for,
        off_for: off_for?,
        when: when?,
        since: None,
    }))
}

fn life_sign(reader: &Reader<'_>) -> Option<Behaviour> {
    let (signal, every) = (reader.output("signal"), reader.time("every"));
    let input = reader.input("input", true);
    let sound = [
        reader.exclude("every", "input"),
        reader.exclude("input", "limits"),
    ];
    let signal = signal??;
    let limits = if reader.signal(signal.signal()).data_type == DataType::Bool {
        reader.limits(Some(signal.signal()), [0.0, 1.0])
    } else {
        reader.count_limits(signal.signal())
    };
    sound.into_iter().collect::<Option<()>>()?;
    let source = match input? {
        Some(input) => Beat::Echo(input),
        None => Beat::Every {
            every: every??,
            since: Nanos::ZERO,
        },
    };
    let limits = limits?;
    Some(Behaviour::LifeSign(LifeSign {
        signal,
        source,
        limits,
        count: first_count(limits),
    }))
}
