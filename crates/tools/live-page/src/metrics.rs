//! The metrics of the page, for Prometheus and similar programs, in its text format 0.0.4.

use std::fmt::{Display, Write as _};

use tickbus_base::statistics::{Distribution, Value};
use tickbus_fieldbus::LinkState;
use tickbus_image::signal::Signal;

use crate::exhibit::{Exhibit, Freshness};
use crate::line::is_of_one_fault;
use crate::model::Model;
use crate::sheet::{FAIL_SAFE, FORCED, STALE, UNKNOWN};

mod counters;

/// Labels in braces.
#[derive(Clone)]
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

    /// The labels of a signal, with its station if there are several.
    fn and_signal(&self, stations: &[Freshness<'_>], signal: &Signal) -> Self {
        let labels = self.and("signal", &signal.name);
        match stations.get(signal.station) {
            Some(station) if stations.len() > 1 => labels.and("station", station.name),
            _ => labels,
        }
    }
}

/// The metrics, grouped: all samples of one family stand together, whichever driver they are of.
#[derive(Default)]
struct Families(Vec<Family>);

struct Family {
    name: String,
    text: String,
}

impl Families {
    /// The family of this name, which gets its head the first time.
    fn family(&mut self, name: &str, kind: &str, help: &str) -> &mut Family {
        let place = self.0.iter().position(|family| family.name == name);
        let place = place.unwrap_or_else(|| {
            self.0.push(Family {
                name: name.to_owned(),
                text: format!("# HELP {name} {help}\n# TYPE {name} {kind}\n"),
            });
            self.0.len() - 1
        });
        &mut self.0[place]
    }

    fn gauge(&mut self, name: &str, help: &str) -> &mut Family {
        self.family(name, "gauge", help)
    }
}

impl Family {
    fn sample(&mut self, labels: &Labels, value: f64) {
        self.sample_of("", labels, &Number(value));
    }

    fn sample_of(&mut self, suffix: &str, labels: &Labels, value: &dyn Display) {
        let (name, labels) = (&self.name, &labels.0);
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{name}{suffix}{{{labels}}} {value}");
    }

    fn histogram(&mut self, labels: &Labels, of: &Distribution) {
        for (bound, count) in Distribution::BOUNDS.iter().zip(of.up_to) {
            let bound = bound.as_micros() / 1e6;
            self.sample_of("_bucket", &labels.and("le", &bound.to_string()), &count);
        }
        self.sample_of("_bucket", &labels.and("le", "+Inf"), &of.count);
        self.sample_of("_sum", labels, &of.sum);
        self.sample_of("_count", labels, &of.count);
    }
}

/// A number as the format writes it.
struct Number(f64);

impl Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            number if number.is_nan() => f.write_str("NaN"),
            f64::INFINITY => f.write_str("+Inf"),
            f64::NEG_INFINITY => f.write_str("-Inf"),
            number => number.fmt(f),
        }
    }
}

/// The text of all metrics.
pub(crate) fn text(model: &Model) -> String {
    let mut families = Families::default();
    for driver in model.drivers() {
        let labels = Labels::of(driver);
        signals(&mut families, &labels, driver);
        line(&mut families, &labels, driver);
        statistics(&mut families, &labels, driver);
    }
    let texts: Vec<String> = families.0.into_iter().map(|family| family.text).collect();
    texts.concat()
}

/// The flags of values that are not live.
const NOT_LIVE: u8 = FAIL_SAFE | STALE | UNKNOWN;

fn signals(families: &mut Families, labels: &Labels, driver: &dyn Exhibit) {
    let stations = driver.stations();
    for (signal, row) in driver.signals().iter().zip(&driver.sheet().rows) {
        let of_signal = labels.and_signal(&stations, signal);
        if row.flags & NOT_LIVE == 0 {
            let unit = signal.unit.as_deref().unwrap_or_default();
            let help =
                "The value of a signal, in its unit; left out while it is stale or fail-safe.";
            let family = families.gauge("tickbus_signal_value", help);
            family.sample(&of_signal.and("unit", unit), row.live(signal));
        }
        if row.flags & FAIL_SAFE != 0 {
            let help = "1 for each signal that has its fail-safe value.";
            let family = families.gauge("tickbus_signal_failsafe", help);
            family.sample(&of_signal, 1.0);
        }
        if row.flags & FORCED != 0 {
            let help = "1 for each signal that is forced.";
            let family = families.gauge("tickbus_signal_forced", help);
            family.sample(&of_signal, 1.0);
        }
        if signal.latch.is_some() {
            let help = "The latched edges of a signal.";
            let family = families.family("tickbus_signal_edges_total", "counter", help);
            family.sample(&of_signal, f64::from(row.edges));
        }
    }
}

fn line(families: &mut Families, labels: &Labels, driver: &dyn Exhibit) {
    for state in LinkState::ALL {
        let is_it = f64::from(u8::from(state == driver.state()));
        let help = "1 for the state that the line is in, 0 for the others.";
        let family = families.gauge("tickbus_line_state", help);
        family.sample(&labels.and("state", state.name()), is_it);
    }
    for station in driver.stations() {
        let of_station = labels.and("station", station.name);
        let stale = f64::from(u8::from(station.stale));
        let help = "1 if the data of a station do not count.";
        let family = families.gauge("tickbus_station_stale", help);
        family.sample(&of_station, stale);
        if let Some(age) = station.age_ms {
            let help = "How old the data of a station are; left out if there never were any.";
            let family = families.gauge("tickbus_station_age_seconds", help);
            family.sample(&of_station, age / 1e3);
        }
    }
}

/// The statistics of a driver. Distributions are histograms, counts that only rise are counters, and everything
/// else keeps the key of docs/statistics.md.
fn statistics(families: &mut Families, labels: &Labels, driver: &dyn Exhibit) {
    let statistics = driver.statistics();
    for distribution in statistics.distributions() {
        let name = format!("tickbus_{}_seconds", distribution.key.replace('.', "_"));
        let help = "A distribution of docs/statistics.md.";
        let family = families.family(&name, "histogram", help);
        family.histogram(labels, distribution);
    }
    let is_of_distribution = |key: &str| {
        let mut all = statistics.distributions().iter();
        all.any(|all| {
            let rest = key.strip_prefix(all.key.as_str());
            rest.is_some_and(|rest| rest == ".count" || rest.ends_with("_us"))
        })
    };
    for (key, value) in statistics.iter() {
        if is_of_distribution(key) || is_of_one_fault(key) {
            continue;
        }
        let number = match value {
            #[expect(clippy::cast_precision_loss, reason = "the format has doubles")]
            Value::Count(count) => *count as f64,
            Value::Number(number, _) => *number,
            Value::Time(time) => time.as_micros() / 1e6,
            Value::Text(_) => continue,
        };
        if let Some(counter) = counters::of(key) {
            let family = families.family(&counter.name, "counter", counter.help);
            let with = |labels: Labels, (name, value): &(&str, String)| labels.and(name, value);
            let labels = counter.labels.iter().fold(labels.clone(), with);
            family.sample(&labels, number);
        } else {
            let help = "Other things that a driver measures: docs/statistics.md.";
            let family = families.gauge("tickbus_statistic", help);
            family.sample(&labels.and("key", &counters::plain(key)), number);
        }
    }
}
