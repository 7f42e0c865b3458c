//! `tickbus check FILE`: prints the signal table of a driver.cfg, or every mistake in it.

mod axes;
mod document;
mod unwritten;

use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use super::columns::aligned;
use super::json::{Format, print_document};
use super::{Outcome, print};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::short_number;
use tickbus_driver_cfg::{Config, Kinds, Timing};
use tickbus_fieldbus::{Events, Role};
use tickbus_image::signal::{
    Area, ByteOrder, DataType, Latch, Scale, Signal, SignalTable, Station, Width,
};
use tickbus_record as record;

/// Read a driver.cfg; print its signal table, or every mistake in it.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg to check.
    file: PathBuf,

    /// List the %I signals that the driver does not make itself, and propose `[[reply]]` sections for them.
    #[arg(long, conflicts_with = "json")]
    unwritten: bool,

    #[command(flatten)]
    writers: unwritten::Writers,

    #[command(flatten)]
    format: Format,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    match Config::load(&arguments.file, kinds) {
        Ok(config) if arguments.format.is_json() => {
            print_document("check", document::document(&config))
        }
        Ok(config) if arguments.unwritten => match unwritten::report(&config, &arguments.writers) {
            Ok(text) => print("check", &text),
            Err(mistakes) => arguments.format.refuse("check", &mistakes),
        },
        Ok(config) => print("check", &report(&config)),
        Err(mistakes) => arguments.format.refuse("check", &mistakes),
    }
}

/// Returns the complete report on a valid driver.cfg.
fn report(config: &Config) -> String {
    let mut out = String::new();
    let table = config.table.as_in_plc();
    let stations = &table.stations;
    let mut line = |head: &str, text: &str| {
        writeln!(out, "{head:9} {text}").expect("a String takes all");
    };
    line("driver", &format!("{} \"{}\"", config.id, config.name));
    line("role", role(config));
    line("bus", &bus(config));
    for request in config.bus.requests(&config.table) {
        line("request", &request);
    }
    for (written, read) in config.bus.both_ways(&config.table) {
        let [written, read] = [written, read].map(|index| {
            let signal = &config.table.signals[index];
            let place = config.bus.place(signal, &config.table);
            format!("\"{}\" at {place}", signal.name)
        });
        line(
            "note",
            &format!(
                "{written} is written where {read} is read: what is read there may be what was just written"
            ),
        );
    }
    line("timing", &timing(&config.timing));
    if let Some(real_time) = config.real_time {
        line("threads", &real_time.to_string());
    }
    for contradiction in config.contradictions() {
        line("warning", &contradiction.to_string());
    }
    life_signs(config, &mut line);
    if let Some(record) = &config.record {
        line("record", &recording(record));
    }
    for station in stations {
        let name = if station.name.is_empty() {
            ""
        } else {
            &format!("\"{}\": ", station.name)
        };
        let sizes = format!(
            "{}, {}",
            size(station, Area::Input),
            size(station, Area::Output)
        );
        line(
            if station.name.is_empty() {
                "image"
            } else {
                "station"
            },
            &format!("{name}{sizes}"),
        );
    }
    for (head, text) in config.bus.details(config.folder(), &config.table) {
        line(&head, &text);
    }
    for fault in &config.faults {
        let when = format!("{} {}", fault.begin, fault.lasts);
        line(
            "fault",
            &format!(
                "\"{}\" ({}) {}: {}",
                fault.name,
                fault.kind(),
                when.trim_end(),
                fault.what(&config.table)
            ),
        );
    }
    for reply in &config.replies {
        line("reply", &reply.what(&config.table));
    }
    out.push('\n');
    out.push_str(&tables(config, &table));
    let total = |area| {
        stations
            .iter()
            .map(|station| station.bytes(area))
            .sum::<usize>()
    };
    writeln!(
        out,
        "\ncheck: ok signals={} input_bytes={} output_bytes={}",
        config.table.signals.len(),
        total(Area::Input),
        total(Area::Output)
    )
    .expect("a String takes all");
    out
}

/// The axes and the signals.
fn tables(config: &Config, table: &SignalTable) -> String {
    let mut out = String::new();
    let taken = words_of_values(&table.signals);
    if !config.axes.is_empty() {
        let rows = config.axes.iter().map(|axis| axes::row(axis).to_vec());
        out.push_str(&aligned(&axes::HEADINGS, &rows.collect::<Vec<_>>()));
        out.push('\n');
    }
    let signals = table.signals.iter();
    let rows = signals.map(|signal| row(signal, table, &taken, config).to_vec());
    let rows: Vec<Vec<String>> = rows.collect();
    if rows.is_empty() {
        out.push_str("no signals\n");
    } else {
        out.push_str(&aligned(&HEADINGS, &rows));
    }
    out
}

fn role(config: &Config) -> &'static str {
    match config.role {
        Role::Device => "device: the machine, which writes %I and reads %Q",
        Role::Controller => "controller: the PLC, which reads %I and writes %Q",
        Role::Observer => "observer: reads %I and %Q, and writes nothing",
    }
}

fn bus(config: &Config) -> String {
    let mut parts = vec![config.bus.kind().to_owned()];
    parts.extend(config.bus.summary(config.role, &config.table.as_in_plc()));
    if config.events == Events::Writes {
        parts.extend(config.bus.summary_of_writes().map(str::to_owned));
    }
    if config.events != Events::None {
        parts.push("with events".to_owned());
    }
    parts.join(", ")
}

fn timing(timing: &Timing) -> String {
    let cycle = timing
        .cycle
        .map(|cycle| format!("cycle {cycle}, "))
        .unwrap_or_default();
    let watchdog = timing.watchdog.map_or_else(
        || "no watchdog".to_owned(),
        |watchdog| format!("watchdog {watchdog}"),
    );
    let waits: Vec<String> = timing.reconnect.iter().map(Nanos::to_string).collect();
    format!(
        "{cycle}stale after {}, {watchdog}, reconnect after {}",
        timing.max_age,
        waits.join(" ")
    )
}

/// Writes a line for each life sign: a signal that shows one end that the other is alive, as seen from this end.
fn life_signs(config: &Config, line: &mut impl FnMut(&str, &str)) {
    let name = |signal: usize| &config.table.signals[signal].name;
    for watch in config
        .life_signs
        .watches(&config.table, config.role, config.timing.max_age)
    {
        line(
            "alive",
            &format!(
                "\"{}\" has to change within {}, or its station is stale",
                watch.name, watch.within
            ),
        );
    }
    for beat in config.life_signs.beats(&config.table, config.role) {
        let counts = format!(
            "\"{}\" counts every {} while the simulation ticks",
            name(beat.signal),
            beat.every
        );
        line("heartbeat", &counts);
    }
}

fn recording(options: &record::Options) -> String {
    let ring = options.ring.map(|ticks| format!(", ring of {ticks} ticks"));
    let when = match options.when {
        record::When::Always => "",
        record::When::Never => ", switched off",
    };
    format!(
        "\"{}\"{}{when}",
        options.file.display(),
        ring.unwrap_or_default()
    )
}

fn size(station: &Station, area: Area) -> String {
    let bytes = station.bytes(area);
    format!(
        "{area} {bytes} {}",
        if bytes == 1 { "byte" } else { "bytes" }
    )
}

const HEADINGS: [&str; 13] = [
    "station",
    "address",
    "in word",
    "place",
    "type",
    "order",
    "direction",
    "latch",
    "scale",
    "unit",
    "dead band",
    "fail-safe",
    "name",
];

fn row(
    signal: &Signal,
    table: &SignalTable,
    taken: &HashSet<WordKey>,
    config: &Config,
) -> [String; HEADINGS.len()] {
    let stations = &table.stations;
    let station = &stations[signal.station];
    [
        if stations.len() > 1 {
            station.name.clone()
        } else {
            String::new()
        },
        signal.address().to_string(),
        bit_of_word(signal, station, taken),
        config.bus.place(signal, table),
        signal.data_type.to_string(),
        if signal.order == ByteOrder::Abcd {
            String::new()
        } else {
            signal.order.to_string()
        },
        match (signal.area, config.role) {
            (Area::Input, Role::Observer) => "PLC input → observer",
            (Area::Output, Role::Observer) => "PLC output → observer",
            (Area::Input, _) => "simulation → PLC input",
            (Area::Output, _) => "PLC output → simulation",
        }
        .to_owned(),
        latch(signal),
        signal.scale.map(scale).unwrap_or_default(),
        signal.unit.clone().unwrap_or_default(),
        dead_band(signal),
        fail_safe(signal),
        signal.name.clone(),
    ]
}

/// The WORD around a BOOL, by station, area and even byte offset.
type WordKey = (usize, Area, usize);

/// Returns the WORDs that contain a part of a signal other than a BOOL.
fn words_of_values(signals: &[Signal]) -> HashSet<WordKey> {
    let values = signals
        .iter()
        .filter(|signal| signal.data_type != DataType::Bool);
    values
        .flat_map(|signal| {
            let bytes = signal.byte..signal.byte + signal.data_type.size_bytes();
            bytes.map(|byte| (signal.station, signal.area, byte & !1))
        })
        .collect()
}

/// Returns the bit number of a BOOL in the big-endian WORD at the even offset: old bus cards and many wiring lists
/// count this way. Empty if there is no such WORD.
fn bit_of_word(signal: &Signal, station: &Station, taken: &HashSet<WordKey>) -> String {
    let size = Width::Word.bytes();
    let even = signal.byte & !1;
    if signal.data_type != DataType::Bool
        || even + size > station.bytes(signal.area)
        || taken.contains(&(signal.station, signal.area, even))
    {
        return String::new();
    }
    let here = (signal.byte - even, usize::from(signal.bit));
    (0..Width::Word.bits())
        .find(|bit| ByteOrder::Abcd.bit_position(size, *bit) == here)
        .map(|bit| format!("{}W{even} bit {bit}", signal.area))
        .unwrap_or_default()
}

fn edge(latch: Latch) -> &'static str {
    match latch {
        Latch::Rising => "rising",
        Latch::Falling => "falling",
        Latch::Both => "both",
    }
}

fn latch(signal: &Signal) -> String {
    let Some(edge) = signal.latch.map(edge) else {
        return String::new();
    };
    if signal.hold == Nanos::ZERO {
        edge.to_owned()
    } else {
        format!("{edge}, hold {}", signal.hold)
    }
}

fn scale(scale: Scale) -> String {
    let gain = format!("raw × {}", short_number(scale.gain));
    if scale.offset == 0.0 {
        gain
    } else {
        let sign = if scale.offset < 0.0 { '−' } else { '+' };
        format!("{gain} {sign} {}", short_number(scale.offset.abs()))
    }
}

fn dead_band(signal: &Signal) -> String {
    if signal.dead_band == 0.0 {
        String::new()
    } else {
        short_number(signal.dead_band)
    }
}

fn fail_safe(signal: &Signal) -> String {
    let slot = signal.fail_safe;
    match signal.data_type {
        DataType::Bool => (if slot.real() == 0.0 { "false" } else { "true" }).to_owned(),
        data_type if signal.is_integer_slot() => {
            if data_type.is_signed() {
                slot.signed().to_string()
            } else {
                slot.unsigned().to_string()
            }
        }
        _ => short_number(slot.real()),
    }
}
