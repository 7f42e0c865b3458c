//! The result of `tickbus check --json`: a valid driver.cfg as a JSON document.

use std::collections::HashSet;

use serde_json::{Value, json};

use super::{WordKey, bit_of_word, edge, words_of_values};
use tickbus_axis::{Axis, Field};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{Events, Outputs};
use tickbus_image::signal::{Area, DataType, Signal, SignalTable};
use tickbus_record::When;

pub(super) fn document(config: &Config) -> Value {
    let table = &config.table.as_in_plc();
    let name = |signal: usize| &table.signals[signal].name;
    let names = |signals: &[usize]| {
        signals
            .iter()
            .map(|signal| name(*signal))
            .collect::<Vec<_>>()
    };
    let taken = words_of_values(&table.signals);
    let signals = table.signals.iter();
    let stations = table.stations.iter().map(|station| {
        json!({
            "name": station.name,
            "input_bytes": station.input_bytes,
            "output_bytes": station.output_bytes,
        })
    });
    let faults = config.faults.iter().map(|fault| {
        json!({
            "name": fault.name,
            "kind": fault.kind(),
            "begin": fault.begin.to_string(),
            "lasts": fault.lasts.to_string(),
            "what": fault.what(table),
        })
    });
    let watches = config
        .life_signs
        .watches(&config.table, config.role, config.timing.max_age);
    let watches = watches
        .iter()
        .map(|watch| json!({ "signal": watch.name, "within_ns": watch.within.0 }));
    let beats = config.life_signs.beats(table, config.role);
    let beats = beats.map(|beat| json!({ "signal": name(beat.signal), "every_ns": beat.every.0 }));
    json!({
        "driver": { "id": config.id, "name": config.name },
        "role": config.role.name(),
        "bus": bus(config),
        "timing": timing(config),
        "warnings": config.contradictions().iter().map(ToString::to_string).collect::<Value>(),
        "alive": watches.collect::<Value>(),
        "heartbeat": beats.collect::<Value>(),
        "real_time": config.real_time.map(|real_time| json!({
            "priority": real_time.priority,
            "cpu": real_time.cpu,
            "lock_memory": real_time.lock_memory,
            "required": real_time.required,
        })),
        "record": config.record.as_ref().map(|record| json!({
            "file": record.file.display().to_string(),
            "ring": record.ring,
            "when": match record.when { When::Always => "always", When::Never => "never" },
        })),
        "stations": stations.collect::<Value>(),
        "faults": faults.collect::<Value>(),
        "replies": config.replies.iter().map(|reply| json!({
            "name": reply.name,
            "kind": reply.kind,
            "makes": names(&reply.outputs),
            "reads": names(&reply.inputs),
        })).collect::<Value>(),
        "axes": config.axes.iter().map(axis).collect::<Value>(),
        "signals": signals.map(|signal| row((signal, table), config, &taken)).collect::<Value>(),
    })
}

fn bus(config: &Config) -> Value {
    let (bus, table) = (&config.bus, &config.table);
    let both_ways = bus.both_ways(table).into_iter().map(|(written, read)| {
        json!({ "written": table.signals[written].name, "read": table.signals[read].name })
    });
    let details = bus.details(config.folder(), table).into_iter();
    let details = details.map(|(head, text)| json!({ "head": head, "text": text }));
    json!({
        "kind": bus.kind(),
        "summary": bus.summary(config.role, &table.as_in_plc()),
        "events": match config.events {
            Events::None => json!(false),
            Events::Changes => json!(true),
            Events::Writes => json!("writes"),
        },
        "requests": bus.requests(table),
        "both_ways": both_ways.collect::<Value>(),
        "details": details.collect::<Value>(),
    })
}

fn timing(config: &Config) -> Value {
    let timing = &config.timing;
    let outputs = |outputs| match outputs {
        Outputs::FailSafe => "fail_safe",
        Outputs::Hold => "hold",
    };
    let reconnect: Vec<i64> = timing.reconnect.iter().map(|pause| pause.0).collect();
    json!({
        "cycle_ns": timing.cycle.map(|cycle| cycle.0),
        "max_age_ns": timing.max_age.0,
        "watchdog_ns": timing.watchdog.map(|watchdog| watchdog.0),
        "at_close": outputs(timing.at_close),
        "while_stale": outputs(timing.while_stale),
        "reconnect_ns": reconnect,
    })
}

fn axis(axis: &Axis) -> Value {
    let has = |field| axis.slot(field).is_some();
    let commands = axis
        .commands
        .iter()
        .map(|command| json!({ "number": command.number, "mode": command.mode.name() }));
    let switches = axis
        .switches
        .iter()
        .map(|switch| json!({ "name": switch.name, "at": switch.at, "above": switch.above }));
    json!({
        "name": axis.name,
        "kind": axis.kind.name(),
        "unit": axis.unit,
        "limits": axis.limits,
        "inverted": axis.inverted,
        "command_offset": axis.command,
        "feedback_offset": axis.feedback,
        "feedback_bytes": axis.feedback_bytes,
        "acknowledge": has(Field::Acknowledge),
        "diagnostics": has(Field::Status),
        "jerk": has(Field::Jerk),
        "commands": commands.collect::<Value>(),
        "switches": switches.collect::<Value>(),
    })
}

/// Returns one signal. A text that would be empty is null.
fn row(
    (signal, table): (&Signal, &SignalTable),
    config: &Config,
    taken: &HashSet<WordKey>,
) -> Value {
    let station = &table.stations[signal.station];
    let some = |text: String| (!text.is_empty()).then_some(text);
    json!({
        "name": signal.name,
        "station": some(station.name.clone()),
        "address": signal.address().to_string(),
        "in_word": some(bit_of_word(signal, station, taken)),
        "place": some(config.bus.place(signal, table)),
        "type": signal.data_type.name(),
        "order": signal.order.name(),
        "area": match signal.area { Area::Input => "input", Area::Output => "output" },
        "latch": signal.latch.map(edge),
        "count_swallowed": signal.counts_swallowed(),
        "hold_ns": (signal.hold != Nanos::ZERO).then_some(signal.hold.0),
        "scale": signal.scale.map(|scale| json!({ "gain": scale.gain, "offset": scale.offset })),
        "unit": signal.unit,
        "comment": some(signal.comment().to_owned()),
        "folder": some(signal.folder().to_owned()),
        "dead_band": (signal.dead_band != 0.0).then_some(signal.dead_band),
        "fail_safe": fail_safe(signal),
    })
}

fn fail_safe(signal: &Signal) -> Value {
    let slot = signal.fail_safe;
    match signal.data_type {
        DataType::Bool => json!(slot.real() != 0.0),
        data_type if signal.is_integer_slot() && data_type.is_signed() => json!(slot.signed()),
        _ if signal.is_integer_slot() => json!(slot.unsigned()),
        _ => json!(slot.real()),
    }
}
