//! Reads rules: those among replies, and those of test files, which have the same keys.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Table, Value};
use tickbus_image::signal::section::NAME_LIMIT;

use super::signals::Signals;
use crate::Condition;
use crate::rule::{Ramp, Rule};

/// The keys of a rule, taken from its table.
pub(super) struct RuleKeys<'k, 'a> {
    pub(super) when: Option<&'k Value<'a>>,
    pub(super) after: Option<&'k Value<'a>>,
    pub(super) set: Option<&'k Value<'a>>,
    pub(super) otherwise: Option<&'k Value<'a>>,
    pub(super) ramp: Option<&'k Value<'a>>,
}

/// A rule, and the signals that it makes with their places.
pub(super) type PlacedRule<'a> = (Rule, Vec<(usize, Value<'a>)>);

/// Reads a `[[machine.rule]]` and reports its mistakes; `condition` reads a condition that is a text.
pub fn read_rule<'a>(
    mut table: Table<'a>,
    signals: Signals<'_>,
    condition: impl Fn(&Value<'a>) -> Option<Condition>,
) -> Option<Rule> {
    let name = table.take("name");
    let when = table.require("when", "write a condition, such as \"LA1 run\"");
    let [after, set, otherwise, ramp] = ["after", "set", "else", "ramp"].map(|key| table.take(key));
    table.require_one_of(&["set", "ramp"], "say what the machine does then");
    table.finish();
    let keys = RuleKeys {
        when: when.as_ref(),
        after: after.as_ref(),
        set: set.as_ref(),
        otherwise: otherwise.as_ref(),
        ramp: ramp.as_ref(),
    };
    let read = keys.read(signals, condition, Value::duration);
    let name = name.and_then(|value| {
        let name = value.label(NAME_LIMIT, "name the rule, such as \"lift 1 up\"")?;
        Some(name.to_owned())
    });
    read.map(|(rule, _)| Rule { name, ..rule })
}

impl<'a> RuleKeys<'_, 'a> {
    /// Reads the values; `condition` reads a condition that is a text, and `time` the duration.
    pub(super) fn read(
        &self,
        signals: Signals<'_>,
        condition: impl Fn(&Value<'a>) -> Option<Condition>,
        time: impl FnOnce(&Value<'a>) -> Option<Nanos>,
    ) -> Option<PlacedRule<'a>> {
        let when = self
            .when
            .and_then(|value| signals.conditions(value, condition));
        let after = self.after.map_or(Some(Nanos::ZERO), time);
        let set = signals.placed_assignments(self.set);
        if let (Some(when), Some(value)) = (&when, self.otherwise)
            && when.iter().any(|(condition, _)| condition.is_edge())
        {
            value.wrong(
                "an edge has no \"else\": it is over at once",
                "write the condition without \"rises\", \"falls\" or \"changes\", or a second rule",
            );
        }
        let otherwise = signals.placed_assignments(self.otherwise);
        let ramp = match self.ramp {
            None => Some(None),
            Some(value) => read_ramp(value, signals).map(Some),
        };
        let (when, after, set) = (when?, after?, set?);
        let (otherwise, ramp) = (otherwise?, ramp?);
        let made = set.iter().chain(&otherwise);
        let made = made.map(|(signal, _, place)| (*signal, place.clone()));
        let moved = ramp.map(|ramp| ramp.signal).zip(self.ramp);
        let moved = moved.map(|(signal, place)| (signal, place.clone()));
        let made = made.chain(moved).collect();
        let values = |placed: Vec<(usize, _, _)>| {
            let placed = placed.into_iter();
            placed.map(|(signal, slot, _)| (signal, slot)).collect()
        };
        let rule = Rule {
            name: None,
            when: when.into_iter().map(|(condition, _)| condition).collect(),
            after,
            set: values(set),
            otherwise: values(otherwise),
            ramp,
        };
        Some((rule, made))
    }
}

fn read_ramp(value: &Value<'_>, signals: Signals<'_>) -> Option<Ramp> {
    const SHAPE: &str = "write ramp = { signal = \"LA1 position\", to = 180, per_second = 250 }";
    let mut table = value.table("ramp", SHAPE)?;
    let signal = table.require("signal", SHAPE);
    let to = table.require("to", SHAPE);
    let rate = table.require("per_second", SHAPE);
    table.finish();
    let signal = signal.and_then(|value| signals.settable(&value, value.text(SHAPE)?));
    let to = to.and_then(|value| value.number(SHAPE));
    let rate = rate.and_then(|value| {
        let rate = value.number(SHAPE)?;
        if rate <= 0.0 {
            value.wrong(
                format!("\"per_second\" is {}", value.written()),
                "write how fast it moves, above 0; \"to\" says whether up or down",
            );
            return None;
        }
        Some(rate)
    });
    let signal = signal?;
    if signals.table.signals[signal].is_integer_slot() {
        value.wrong(
            "a 64-bit integer cannot move along a ramp",
            "use a signal of another type, or give it a scale",
        );
        return None;
    }
    Some(Ramp {
        signal,
        to: to?,
        per_second: rate?,
    })
}
