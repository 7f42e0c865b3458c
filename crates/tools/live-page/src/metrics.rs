//! The metrics of the page, for Prometheus and similar programs.

use std::fmt::Write as _;

use tickbus_base::statistics::Value;
use tickbus_fieldbus::LinkState;
use tickbus_image::signal::Signal;

use crate::exhibit::{Exhibit, Freshness};
use crate::model::Model;
use crate::sheet::{FAIL_SAFE, FORCED, STALE, UNKNOWN};

/// Labels in braces.
struct Labels(String);

impl Labels {
    fn of(driver: &dyn Exhibit) -> Self {
        Self(String::new())
            .and("driver", driver.name())
            .and("id", &driver.id().to_string())
    }

    /// The same labels and one more.
    fn and(&self, name: &str, value: &str) -> Self {
        let mut text = self.0.clone();
        if !text.is_empty() {
            text.push(',');
        }
        text.push_str(name);
        text.push_str("=\"");
        for c in value.chars() {
            match c {
                '\\' => text.push_str("\\\\"),
                '"' => text.push_str("\\\""),
                '\n' => text.push_str("\\n"),
                c => text.push(c),
            }
        }
        text.push('"');
        Self(text)
    }
}

/// The text of all metrics.
pub(crate) fn text(model: &Model) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write(model, &mut text);
    text.push_str("# EOF\n");
    text
}

fn write(model: &Model, text: &mut String) -> std::fmt::Result {
    values(model, text)?;
    stations(model, text)?;
    family(
        text,
        "tickbus_signal_edges",
        "counter",
        "The latched edges of a signal.",
    )?;
    for driver in model.drivers() {
        let labels = Labels::of(driver);
        let rows = driver.signals().iter().zip(&driver.sheet().rows);
        for (signal, row) in rows.filter(|(signal, _)| signal.latch.is_some()) {
            let of_signal = labels.and("signal", &signal.name);
            let edges = f64::from(row.edges);
            sample(text, "tickbus_signal_edges_total", &of_signal, edges)?;
        }
    }
    family(
        text,
        "tickbus_signal_forced",
        "gauge",
        "1 for each signal that is forced.",
    )?;
    for driver in model.drivers() {
        let labels = Labels::of(driver);
        let rows = driver.signals().iter().zip(&driver.sheet().rows);
        for (signal, _) in rows.filter(|(_, row)| row.flags & FORCED != 0) {
            sample(
                text,
                "tickbus_signal_forced",
                &labels.and("signal", &signal.name),
                1.0,
            )?;
        }
    }
    family(
        text,
        "tickbus_line_state",
        "stateset",
        "The state of the line.",
    )?;
    for driver in model.drivers() {
        let labels = Labels::of(driver);
        for state in LinkState::ALL {
            let is_it = f64::from(u8::from(state == driver.state()));
            let of_state = labels.and("tickbus_line_state", state.name());
            sample(text, "tickbus_line_state", &of_state, is_it)?;
        }
    }
    family(
        text,
        "tickbus_statistic",
        "gauge",
        "What a driver counts and measures: docs/statistics.md.",
    )?;
    for driver in model.drivers() {
        let labels = Labels::of(driver);
        for (key, value) in driver.statistics().iter() {
            let number = match value {
                #[expect(clippy::cast_precision_loss, reason = "the format has doubles")]
                Value::Count(count) => *count as f64,
                Value::Number(number, _) => *number,
                Value::Time(time) => time.as_micros() / 1e6,
                Value::Text(_) => continue,
            };
            sample(text, "tickbus_statistic", &labels.and("key", key), number)?;
        }
    }
    Ok(())
}

/// The live values, and the signals with fail-safe values.
fn values(model: &Model, text: &mut String) -> std::fmt::Result {
    family(
        text,
        "tickbus_signal_value",
        "gauge",
        "The value of a signal, in its unit; left out while it is stale or fail-safe.",
    )?;
    for driver in model.drivers() {
        let labels = Labels::of(driver);
        let stations = driver.stations();
        let rows = driver.signals().iter().zip(&driver.sheet().rows);
        for (signal, row) in rows.filter(|(_, row)| row.flags & NOT_LIVE == 0) {
            let unit = signal.unit.as_deref().unwrap_or_default();
            let of_signal = of_signal(&labels, &stations, signal).and("unit", unit);
            sample(text, "tickbus_signal_value", &of_signal, row.live(signal))?;
        }
    }
    family(
        text,
        "tickbus_signal_failsafe",
        "gauge",
        "1 for each signal that has its fail-safe value.",
    )?;
    for driver in model.drivers() {
        let labels = Labels::of(driver);
        let stations = driver.stations();
        let rows = driver.signals().iter().zip(&driver.sheet().rows);
        for (signal, _) in rows.filter(|(_, row)| row.flags & FAIL_SAFE != 0) {
            let of_signal = of_signal(&labels, &stations, signal);
            sample(text, "tickbus_signal_failsafe", &of_signal, 1.0)?;
        }
    }
    Ok(())
}

/// The age of the stations' data.
fn stations(model: &Model, text: &mut String) -> std::fmt::Result {
    for (name, help) in [
        (
            "tickbus_station_stale",
            "1 if the data of a station do not count.",
        ),
        (
            "tickbus_station_age_seconds",
            "How old the data of a station are; left out if there never were any.",
        ),
    ] {
        family(text, name, "gauge", help)?;
        for driver in model.drivers() {
            let labels = Labels::of(driver);
            for station in driver.stations() {
                let of_station = labels.and("station", station.name);
                let value = if name == "tickbus_station_stale" {
                    Some(f64::from(u8::from(station.stale)))
                } else {
                    station.age_ms.map(|age| age / 1e3)
                };
                if let Some(value) = value {
                    sample(text, name, &of_station, value)?;
                }
            }
        }
    }
    Ok(())
}

/// The flags of values that are not live.
const NOT_LIVE: u8 = FAIL_SAFE | STALE | UNKNOWN;

/// The labels of a signal, with its station if there are several.
fn of_signal(labels: &Labels, stations: &[Freshness<'_>], signal: &Signal) -> Labels {
    let labels = labels.and("signal", &signal.name);
    match stations.get(signal.station) {
        Some(station) if stations.len() > 1 => labels.and("station", station.name),
        _ => labels,
    }
}

fn family(text: &mut String, name: &str, kind: &str, help: &str) -> std::fmt::Result {
    writeln!(text, "# TYPE {name} {kind}\n# HELP {name} {help}")
}

fn sample(text: &mut String, name: &str, labels: &Labels, value: f64) -> std::fmt::Result {
    let labels = &labels.0;
    if value.is_nan() {
        writeln!(text, "{name}{{{labels}}} NaN")
    } else if value.is_infinite() {
        let sign = if value > 0.0 { '+' } else { '-' };
        writeln!(text, "{name}{{{labels}}} {sign}Inf")
    } else {
        writeln!(text, "{name}{{{labels}}} {value}")
    }
}
