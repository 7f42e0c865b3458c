//! The federates whose values are read: HELICS continues when one of them leaves, with its last values for ever.

use std::collections::BTreeSet;

use serde_json::Value;
use tickbus_base::time::Nanos;

use super::library::Federate;

/// How often the sources are asked for, at least.
const LOOK: Nanos = Nanos::from_secs(1);

/// HELICS's largest time, in seconds, less a day.
const NEVER: f64 = 9.223e9;

#[derive(Debug)]
pub(super) struct Sources {
    federate: String,
    names: Vec<String>,
    looked: Nanos,
}

impl Sources {
    pub(super) fn new(federate: &str, now: Nanos) -> Self {
        Self {
            federate: federate.to_owned(),
            names: Vec::new(),
            looked: now,
        }
    }

    /// Finds the sources of the federate's inputs, by their names.
    pub(super) fn find(&mut self, federate: &mut Federate) {
        let mut ids = BTreeSet::new();
        if let Some(graph) = json(federate, &self.federate, "data_flow_graph") {
            for input in list(&graph, "inputs") {
                ids.extend(list(input, "sources").filter_map(|source| source["federate"].as_i64()));
            }
        }
        if let Some(map) = json(federate, "root", "federate_map") {
            self.names_in(&map, &ids);
        }
        self.names.retain(|name| *name != self.federate);
    }

    /// The names of these federates in a broker's or core's part of the map.
    fn names_in(&mut self, map: &Value, ids: &BTreeSet<i64>) {
        for one in list(map, "federates") {
            let attributes = &one["attributes"];
            let is_source = attributes["id"]
                .as_i64()
                .is_some_and(|id| ids.contains(&id));
            if let Some(name) = attributes["name"].as_str().filter(|_| is_source) {
                self.names.push(name.to_owned());
            }
        }
        for below in list(map, "brokers").chain(list(map, "cores")) {
            self.names_in(below, ids);
        }
    }

    /// Checks once a second, and when no other federate holds the time back, that all sources are there.
    ///
    /// # Errors
    ///
    /// A source has left.
    pub(super) fn check(
        &mut self,
        federate: &mut Federate,
        now: Nanos,
        time: Nanos,
    ) -> Result<(), String> {
        if self.names.is_empty() {
            return Ok(());
        }
        if now - self.looked < LOOK {
            // The library answers this one without a message.
            let own = json(federate, &self.federate, "current_time");
            if own
                .and_then(|own| own["allow"].as_f64())
                .is_none_or(|allow| allow < NEVER)
            {
                return Ok(());
            }
        }
        self.looked = now;
        for name in &self.names {
            let state = federate.ask(name, "isconnected");
            if state.is_ok_and(|state| state.trim_matches('"') == "false") {
                return Err(format!(
                    "the federate \"{name}\", whose values are read, has left the federation before {time}"
                ));
            }
        }
        Ok(())
    }
}

/// The answer to a query, if it is a document and no error.
fn json(federate: &mut Federate, target: &str, query: &str) -> Option<Value> {
    let answer = federate.ask(target, query).ok()?;
    serde_json::from_str(&answer).ok()
}

fn list<'v>(of: &'v Value, key: &str) -> impl Iterator<Item = &'v Value> {
    of[key].as_array().into_iter().flatten()
}
