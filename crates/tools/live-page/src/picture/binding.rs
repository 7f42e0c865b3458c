//! The bindings of a picture to signals.
//!
//! A binding is `NAME`, or `NAME: MAP`. A map is a factor (`0.5`, `90 - 45`), or cases: `0..250 -> 0..-180, else -> 0`.
//! To show or hide an element, cases have no arrow: `1, 3..5`. For a text, a map without an arrow is a pattern: `lift 1
//! at {0} mm`. Parts to press have the value that they force while they are held: `Stop button: off`.

mod map;

use std::collections::HashMap;

use serde_json::{Value, json};
use tickbus_base::toml_text::nearest;

use self::map::Kind;
use super::tree::{Child, Element};
use super::{Notes, short};

/// The properties that can be bound, with the kind of their maps.
const ACTIONS: &[(&str, Kind)] = &[
    ("fill", Kind::Colour),
    ("height", Kind::Share),
    ("hide", Kind::Condition),
    ("opacity", Kind::Share),
    ("scale", Kind::Share),
    ("show", Kind::Condition),
    ("spin", Kind::Number),
    ("stroke", Kind::Colour),
    ("text", Kind::Text),
    ("turn", Kind::Number),
    ("width", Kind::Share),
    ("x", Kind::Number),
    ("y", Kind::Number),
];

/// The controls: a push-button, which is held, and a switch, which stays.
const PRESS: &str = "press";
const SWITCH: &str = "switch";

/// The other attributes of a moving element.
const PIVOT: &str = "pivot";
const SMOOTH: &str = "smooth";

/// The longest time for an element to reach its position, in seconds.
const SLOWEST: f64 = 60.0;

/// The names that every driver has besides its signals.
const OF_BUS: &[&str] = &["bus.age", "bus.status"];

/// Reads the bindings of all elements: sets the attributes `data-tb`, `data-tb-pivot` and `data-tb-smooth`.
pub(super) fn bind(root: &mut Element, signals: &[&str], notes: &mut Notes) {
    let names = signals.iter().enumerate().map(|(at, name)| (*name, at));
    let names = Names {
        signals,
        known: names.collect(),
    };
    bind_all(root, &names, notes);
}

fn bind_all(element: &mut Element, names: &Names<'_>, notes: &mut Notes) {
    let mut bindings = Vec::new();
    for (what, text) in std::mem::take(&mut element.bound) {
        let read = match &*what {
            PIVOT => pivot(&text).map(|value| set(element, "data-tb-pivot", value)),
            SMOOTH => smooth(&text).map(|value| set(element, "data-tb-smooth", value)),
            PRESS | SWITCH => control(&what, &text, names).map(|binding| bindings.push(binding)),
            _ => binding(&what, &text, names).map(|binding| bindings.push(binding)),
        };
        if let Err(mistake) = read {
            notes.mistake(
                element.line,
                &format!("data-tb-{}: {mistake}", short(&what)),
            );
        }
    }
    if !bindings.is_empty() {
        set(element, "data-tb", Value::Array(bindings).to_string());
    }
    for child in &mut element.children {
        if let Child::Element(child) = child {
            bind_all(child, names, notes);
        }
    }
}

fn set(element: &mut Element, name: &str, value: String) {
    element.attributes.push((name.to_owned(), value));
}

/// The names that can be bound.
struct Names<'n> {
    signals: &'n [&'n str],
    known: HashMap<&'n str, usize>,
}

impl Names<'_> {
    /// Splits a binding into the name and the part after the colon. A name may contain colons, so the longest known
    /// name counts.
    fn split<'t>(&self, text: &'t str) -> Option<(&'t str, bool, Option<&'t str>)> {
        let colons = text.match_indices(':').map(|(at, _)| (at, Some(at + 1)));
        let ends = colons.chain([(text.len(), None)]);
        let mut found = None;
        for (end, rest) in ends {
            let name = text[..end].trim();
            let rest = rest.map(|at| text[at..].trim());
            if self.known.contains_key(name) || OF_BUS.contains(&name) {
                found = Some((name, false, rest));
            } else if let Some(of) = name
                .strip_suffix(".edges")
                .filter(|of| self.known.contains_key(of))
            {
                found = Some((of, true, rest));
            }
        }
        found
    }

    /// Like [`split`](Self::split), with the mistake of an unknown name.
    fn find<'t>(&self, text: &'t str) -> Result<(&'t str, bool, Option<&'t str>), String> {
        self.split(text).ok_or_else(|| {
            let name = text.split(':').next().unwrap_or_default().trim();
            format!(
                "there is no signal \"{}\"; {}",
                short(name),
                self.advice(name)
            )
        })
    }

    /// The suggestion for an unknown name.
    fn advice(&self, name: &str) -> String {
        let all = self.signals.iter().copied().chain(OF_BUS.iter().copied());
        match nearest(name, all) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => "write the name of a signal as it stands in the driver.cfg".to_owned(),
        }
    }
}

/// One binding, in the format for the page's script.
fn binding(what: &str, text: &str, names: &Names<'_>) -> Result<Value, String> {
    let Some((_, kind)) = ACTIONS.iter().find(|(name, _)| *name == what) else {
        let others = [PIVOT, PRESS, SMOOTH, SWITCH];
        let all = ACTIONS.iter().map(|(name, _)| *name).chain(others);
        return Err(match nearest(what, all.clone()) {
            Some(near) => format!("nothing can be done by this name; did you mean data-tb-{near}?"),
            None => format!(
                "nothing can be done by this name; there are {}",
                all.collect::<Vec<_>>().join(", ")
            ),
        });
    };
    let (signal, edges, rest) = names.find(text)?;
    let map = rest.map(|rest| map::read(rest, *kind)).transpose()?;
    Ok(json!({ "do": what, "signal": signal, "edges": edges, "map": map }))
}

/// A push-button or a switch: the signal, and for a push-button the value while it is pressed.
fn control(what: &str, text: &str, names: &Names<'_>) -> Result<Value, String> {
    let (signal, edges, rest) = names.find(text)?;
    if edges || OF_BUS.contains(&signal) {
        return Err(format!(
            "\"{}\" is no signal that can be forced",
            short(text.trim())
        ));
    }
    let to = match (what, rest) {
        (_, None) | (PRESS, Some("on" | "true")) => 1.0,
        (PRESS, Some("off" | "false")) => 0.0,
        (PRESS, Some(rest)) => number(rest).ok_or_else(|| {
            format!(
                "\"{}\" is no value; write what the signal is while the button is pressed: on, off or a number",
                short(rest)
            )
        })?,
        (_, Some(_)) => {
            return Err(
                "a switch has the name of its signal alone, which has to be a BOOL".to_owned(),
            );
        }
    };
    Ok(json!({ "do": what, "signal": signal, "edges": false, "map": null, "to": to }))
}

/// A point: two numbers, in the element's own units.
fn pivot(text: &str) -> Result<String, String> {
    let numbers: Vec<f64> = text
        .split([' ', ','])
        .filter(|it| !it.is_empty())
        .map_while(number)
        .collect();
    match numbers[..] {
        [x, y] => Ok(format!("{x} {y}")),
        _ => Err(format!(
            "\"{}\" is no point; write its two coordinates, such as 120 80.5",
            short(text)
        )),
    }
}

/// A time in seconds.
fn smooth(text: &str) -> Result<String, String> {
    let seconds = number(text.trim().trim_end_matches('s').trim_end());
    match seconds {
        Some(seconds) if (0.0..=SLOWEST).contains(&seconds) => Ok(seconds.to_string()),
        _ => Err(format!(
            "\"{}\" is no time; write seconds, from 0 to {SLOWEST}, such as 0.5",
            short(text)
        )),
    }
}

/// A finite number.
fn number(text: &str) -> Option<f64> {
    text.trim()
        .parse()
        .ok()
        .filter(|number: &f64| number.is_finite())
}
