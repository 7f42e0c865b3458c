//! The states of a program's nets.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::layout::{Layout, Net};

/// The longest text of all states, in bytes.
const LONGEST: usize = 4 << 20;

/// The state of each net; `None` for a net that has not been scanned.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct States {
    nets: Vec<Option<NetState>>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct NetState {
    /// How old it was when it was handed over, in milliseconds.
    #[serde(default)]
    age: u64,
    scans: u64,
    /// The time of the last scan, in microseconds.
    us: Option<i64>,
    /// A note that holds for all nets of one scan, such as that the line is stale.
    #[serde(default)]
    note: String,
    /// Why the net has stopped; empty while it runs.
    #[serde(default)]
    stop: String,
    /// By place.
    tokens: Vec<u32>,
    /// Tokens that are too young to be taken, by place.
    #[serde(default)]
    young: BTreeMap<usize, u32>,
    /// A digit for each transition: 0 not enabled, 1 delayed, 2 held back by its condition, 3 ready.
    phases: String,
    /// When the delay of a transition ends, in microseconds.
    #[serde(default)]
    due: BTreeMap<usize, i64>,
    /// The part of its condition that did not hold, by transition.
    #[serde(default)]
    failed: BTreeMap<usize, usize>,
    /// How often each transition has fired.
    fired: Vec<u64>,
    /// When it last did, in microseconds.
    last: Vec<Option<i64>>,
    #[serde(rename = "in", default)]
    inputs: Vec<Option<f64>>,
    #[serde(rename = "out", default)]
    outputs: Vec<Option<f64>>,
}

/// Reads the states of these nets, or says what is wrong; returns them as one line of JSON.
pub(crate) fn read(json: &str, layout: &Layout) -> Result<String, String> {
    let wrong = |what: String| format!("the states of the nets cannot be shown: {what}");
    if json.len() > LONGEST {
        return Err(wrong(format!(
            "they have {} bytes, and the most is {LONGEST}; show fewer nets, or smaller ones",
            json.len()
        )));
    }
    let states: States = serde_json::from_str(json)
        .map_err(|why| wrong(format!("their JSON is not as docs/petri.md says: {why}")))?;
    let (count, expected) = (states.nets.len(), layout.nets.len());
    if count != expected {
        return Err(wrong(format!(
            "there are {count}; expected {expected}, one for each net that was drawn"
        )));
    }
    for (state, net) in states.nets.iter().zip(&layout.nets) {
        let Some(state) = state else { continue };
        state
            .check(net)
            .map_err(|what| wrong(format!("\"{}\" {what}", net.name)))?;
    }
    // Written again, because an event is one line.
    serde_json::to_string(&states.nets).map_err(|why| wrong(why.to_string()))
}

impl NetState {
    fn check(&self, net: &Net) -> Result<(), String> {
        let (places, transitions) = (net.places.len(), net.transitions.len());
        for (what, count, expected) in [
            ("tokens", self.tokens.len(), places),
            ("phases", self.phases.len(), transitions),
            ("fired", self.fired.len(), transitions),
            ("last", self.last.len(), transitions),
            ("in", self.inputs.len(), net.inputs.len()),
            ("out", self.outputs.len(), net.outputs.len()),
        ] {
            if count != expected {
                return Err(format!("has {count} \"{what}\"; expected {expected}"));
            }
        }
        if !self
            .phases
            .bytes()
            .all(|phase| (b'0'..=b'3').contains(&phase))
        {
            return Err("has other phases than 0, 1, 2 and 3".to_owned());
        }
        for (what, greatest, count) in [
            ("young", self.young.keys().next_back(), places),
            ("due", self.due.keys().next_back(), transitions),
            ("failed", self.failed.keys().next_back(), transitions),
        ] {
            if let Some(index) = greatest.filter(|index| **index >= count) {
                return Err(format!(
                    "has the number {index} in \"{what}\"; expected numbers below {count}"
                ));
            }
        }
        Ok(())
    }
}
