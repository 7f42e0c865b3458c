//! Reading statistics: `key=value` lines, as documented in `docs/statistics.md`.

use tickbus_base::statistics::entries;

/// Statistics of a driver or of a PLC program. If a key occurs more than once, its last value counts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunStatistics(Vec<(String, String)>);

/// One distribution of the statistics.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Distribution {
    pub(super) name: String,
    /// The unit of all values except the count; empty for plain numbers.
    pub(super) unit: &'static str,
    pub(super) count: u64,
    /// The median, the 90th and 99th percentile, the maximum, and the mean.
    pub(super) values: [f64; 5],
}

/// The names of `values` in the text.
const VALUES: [&str; 5] = ["p50", "p90", "p99", "max", "mean"];

/// The units of distributions: as the suffix of a key, and as shown to people.
const UNITS: [(&str, &str); 2] = [("_us", "µs"), ("", "")];

impl RunStatistics {
    /// Reads the statistics in a text; other lines are skipped, so the complete output of a command may be passed.
    pub fn read(text: &str) -> Self {
        let mut found: Vec<(String, String)> = Vec::new();
        let mut places = std::collections::HashMap::new();
        for (key, value) in entries(text) {
            let place = *places.entry(key).or_insert_with_key(|key| {
                found.push((key.clone(), String::new()));
                found.len() - 1
            });
            value.clone_into(&mut found[place].1);
        }
        Self(found)
    }

    /// True if there are no statistics.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// All keys with their values, in the order of the text.
    pub(super) fn all(&self) -> &[(String, String)] {
        &self.0
    }

    pub(super) fn get(&self, key: &str) -> Option<&str> {
        self.0
            .iter()
            .find(|(name, _)| name == key)
            .map(|(_, value)| &**value)
    }

    /// The distributions that are not empty.
    pub(super) fn distributions(&self) -> Vec<Distribution> {
        let names = self
            .0
            .iter()
            .filter_map(|(key, _)| key.strip_suffix(".count"));
        names.filter_map(|name| self.distribution(name)).collect()
    }

    fn distribution(&self, name: &str) -> Option<Distribution> {
        let count = self
            .get(&format!("{name}.count"))?
            .parse()
            .ok()
            .filter(|count| *count > 0)?;
        let number =
            |value: &str, end: &str| self.get(&format!("{name}.{value}{end}"))?.parse().ok();
        let (end, unit) = UNITS
            .into_iter()
            .find(|(end, _)| number(VALUES[0], end).is_some())?;
        let mut values = [f64::NAN; VALUES.len()];
        for (value, key) in values.iter_mut().zip(VALUES) {
            *value = number(key, end).filter(|number: &f64| number.is_finite())?;
        }
        Some(Distribution {
            name: name.to_owned(),
            unit,
            count,
            values,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "plc: opening: waiting for a=b\nstate=opening\nticks=5\n\nstate=running\nreason=x = y\n\
        age.count=9\nage.p50_us=1.5\nage.p90_us=2\nage.p99_us=3\nage.max_us=4\nage.mean_us=1.7\n\
        reaction.cycles.count=2\nreaction.cycles.p50=1\nreaction.cycles.p90=1\nreaction.cycles.p99=2\n\
        reaction.cycles.max=2\nreaction.cycles.mean=1.5\nbus_cycle.count=0\nodd.count=3\nplc.rises.LA1 run=7\n\
        plc: ok scans=7 stale=0\n=3\n";

    #[test]
    fn the_last_value_of_each_key_counts() {
        let statistics = RunStatistics::read(TEXT);
        let get = |key| statistics.get(key);
        assert_eq!((get("state"), get("ticks")), (Some("running"), Some("5")));
        assert_eq!(
            (get("reason"), get("plc.rises.LA1 run")),
            (Some("x = y"), Some("7"))
        );
        assert_eq!(get("plc: ok scans"), None);
        assert_eq!(statistics.all().len(), 18);
    }

    #[test]
    fn distributions_are_found_with_their_unit() {
        let found = RunStatistics::read(TEXT).distributions();
        let [age, cycles] = &*found else {
            panic!("{found:?}")
        };
        assert_eq!((&*age.name, age.unit, age.count), ("age", "µs", 9));
        assert_eq!((&*cycles.name, cycles.unit), ("reaction.cycles", ""));
        assert_eq!(format!("{:?}", age.values), "[1.5, 2.0, 3.0, 4.0, 1.7]");
    }

    #[test]
    fn what_is_no_number_is_no_distribution() {
        let text = TEXT
            .replace("p99_us=3", "p99_us=NaN")
            .replace("p99=2", "p99=");
        assert_eq!(RunStatistics::read(&text).distributions(), []);
        assert!(RunStatistics::read("nothing here").is_empty());
    }
}
