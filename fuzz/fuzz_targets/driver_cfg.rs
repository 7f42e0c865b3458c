//! Any text as a driver.cfg: it is accepted or refused without a panic, and if accepted it is consistent.

#![no_main]

use std::collections::HashSet;

use libfuzzer_sys::fuzz_target;
use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::Config;
use tickbus_kinds::KINDS;
use tickbus_fieldbus::faults::{Effect, LIMIT};
use tickbus_image::signal::{Area, DataType};
use tickbus_base::time::Nanos;

fuzz_target!(|text: &str| {
    match Config::parse("fuzz.cfg", text, &KINDS) {
        Ok(config) => {
            check_config(&config);
            check_faults(&config);
        }
        Err(mistakes) => check_mistakes(&mistakes, text),
    }
});

/// Every property that the rest of the crate relies on.
fn check_config(config: &Config) {
    assert!(config.id > 0);
    assert!(!config.name.is_empty());
    let timing = &config.timing;
    assert!(timing.max_age > Nanos::ZERO);
    assert!(timing.cycle.is_none_or(|cycle| cycle > Nanos::ZERO && cycle <= timing.max_age));
    assert!(timing.watchdog.is_none_or(|watchdog| watchdog > Nanos::ZERO));
    assert!(!timing.reconnect.is_empty());
    assert!(timing.reconnect.iter().all(|wait| *wait > Nanos::ZERO));

    let table = &config.table;
    assert!(!table.stations.is_empty());
    let stations: HashSet<&str> = table.stations.iter().map(|station| &*station.name).collect();
    assert_eq!(stations.len(), table.stations.len());

    let mut names = HashSet::new();
    let mut bits = HashSet::new();
    for signal in &table.signals {
        let name = signal.name.as_str();
        assert!(!name.is_empty() && !name.starts_with("bus.") && !name.contains(char::is_control));
        assert!(names.insert(name.to_owned()), "{name} twice");
        let size = table.stations[signal.station].bytes(signal.area);
        for bit in signal.address().bits() {
            assert!(bit < size * 8, "{name} beyond its area");
            assert!(bits.insert((signal.station, signal.area, bit)), "{name} overlaps");
        }
        let is_bool = signal.data_type == DataType::Bool;
        assert!(signal.bit == 0 || (is_bool && signal.bit < 8));
        assert!(signal.latch.is_none() || is_bool);
        assert!(signal.hold >= Nanos::ZERO);
        assert!(signal.hold == Nanos::ZERO || (signal.latch.is_some() && signal.area == Area::Input));
        if let Some(scale) = signal.scale {
            assert!(!is_bool);
            assert!(scale.gain.is_finite() && scale.gain != 0.0 && scale.offset.is_finite());
        }
        if !signal.is_integer_slot() {
            let value = signal.fail_safe.real();
            assert!(value.is_finite());
            let raw = signal.scale.map_or(value, |scale| scale.raw(value)).round();
            if let Some(range) = signal.data_type.range() {
                assert!(raw >= *range.start() as f64 && raw <= *range.end() as f64, "{name}: {raw}");
            }
        }
    }
    for signal in table.signals.iter().filter(|signal| signal.latch.is_some()) {
        assert!(!names.contains(&format!("{}.edges", signal.name)));
    }
}

/// Checks what the faults' layers assume without checking.
fn check_faults(config: &Config) {
    assert!(config.faults.len() <= LIMIT);
    for fault in &config.faults {
        assert!(!fault.name.is_empty() && !fault.name.contains(char::is_control));
        assert!(fault.times > 0);
        if let Effect::Signal(signal, _) = fault.effect {
            assert!(signal < config.table.signals.len());
        }
        assert!(!fault.what(&config.table).contains(char::is_control));
    }
}

/// Mistakes are located within the text, in order, and take one line each.
fn check_mistakes(mistakes: &Mistakes, text: &str) {
    assert!(mistakes.len() > 0);
    let lines: Vec<&str> = text.split('\n').collect();
    let mut before = (1, 1);
    for found in mistakes {
        let (line, column) = found.place.expect("a mistake in a text has a place");
        assert!(before <= (line, column), "out of order");
        before = (line, column);
        assert!(line <= lines.len(), "line {line} of {}", lines.len());
        assert!(column <= lines[line - 1].chars().count() + 1, "column {column} in line {line}");
        for part in [&found.mistake.what, &found.mistake.right] {
            assert!(!part.is_empty() && !part.contains(char::is_control), "{part:?}");
        }
    }
    assert_eq!(mistakes.to_string().lines().count(), mistakes.len());
}
