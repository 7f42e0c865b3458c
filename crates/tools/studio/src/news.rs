//! The news of a page: of the rows, the addresses in the device and the text, what has changed since its last
//! look. A file of 5,000 signals is half a megabyte, and an edit a line.

use std::collections::VecDeque;

use serde_json::{Map, Value as Json, json};

/// The most states that are kept to compare with: pages look once in half a second.
const KEPT: usize = 4;

/// The large parts of a state.
#[derive(Clone, Debug)]
struct Shown {
    version: u64,
    signals: Vec<Json>,
    at: Map<String, Json>,
    text: String,
}

/// The last states.
#[derive(Debug, Default)]
pub(crate) struct News(VecDeque<Shown>);

impl News {
    /// Replaces the large parts of the state with the number `version` by what has changed since the state with the number
    /// `seen`, in the key `since`; if that state is not known any more, they stay.
    pub(crate) fn since(&mut self, seen: Option<u64>, version: u64, state: &mut Json) {
        let Some(now) = Shown::of(version, state) else {
            return;
        };
        if let Some(before) = self.0.iter().find(|shown| Some(shown.version) == seen) {
            state["since"] = now.since(before);
            if let Some(sheet) = state["sheet"].as_object_mut() {
                sheet.remove("signals");
                sheet.remove("at");
            }
            if let Some(state) = state.as_object_mut() {
                state.remove("text");
            }
        }
        if self.0.iter().all(|shown| shown.version != version) {
            self.0.push_back(now);
            if self.0.len() > KEPT {
                self.0.pop_front();
            }
        }
    }
}

impl Shown {
    /// The large parts of a state; `None` for a file without a table.
    fn of(version: u64, state: &Json) -> Option<Self> {
        let sheet = state["sheet"].as_object()?;
        Some(Self {
            version,
            signals: sheet.get("signals")?.as_array()?.clone(),
            at: sheet.get("at")?.as_object()?.clone(),
            text: state["text"].as_str()?.to_owned(),
        })
    }

    fn since(&self, before: &Self) -> Json {
        let (from, gone, new) = differing(&before.signals, &self.signals);
        let set = self
            .at
            .iter()
            .filter(|(name, at)| before.at.get(*name) != Some(*at));
        let set: Map<String, Json> = set.map(|(name, at)| (name.clone(), at.clone())).collect();
        let left = before.at.keys().filter(|name| !self.at.contains_key(*name));
        json!({
            "rows": { "from": from, "gone": gone, "new": new },
            "at": { "set": set, "gone": left.collect::<Vec<_>>() },
            "text": text_since(&before.text, &self.text),
        })
    }
}

/// The part of a list that differs from another one: where it begins, how many entries it had, and those that it has.
fn differing<'a, T: PartialEq>(before: &[T], now: &'a [T]) -> (usize, usize, &'a [T]) {
    let same = |(before, now): &(&T, &T)| before == now;
    let head = before.iter().zip(now).take_while(same).count();
    let (before, now) = (&before[head..], &now[head..]);
    let tail = before.iter().rev().zip(now.iter().rev());
    let tail = tail.take_while(same).count();
    (head, before.len() - tail, &now[..now.len() - tail])
}

/// As [`differing`], with the counts of a browser: in units of UTF-16.
fn text_since(before: &str, now: &str) -> Json {
    let (mut from, mut gone, new) = differing(before.as_bytes(), now.as_bytes());
    let mut end = from + new.len();
    // Whole characters.
    while !before.is_char_boundary(from) {
        from -= 1;
        gone += 1;
    }
    while !now.is_char_boundary(end) || !before.is_char_boundary(from + gone) {
        end += 1;
        gone += 1;
    }
    let units = |text: &str| text.encode_utf16().count();
    json!({
        "from": units(&before[..from]),
        "gone": units(&before[from..from + gone]),
        "new": &now[from..end],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(names: &[&str], text: &str) -> Json {
        let signals: Vec<Json> = names.iter().map(|name| json!({ "name": name })).collect();
        let at: Map<String, Json> = names
            .iter()
            .map(|name| ((*name).to_owned(), json!("x")))
            .collect();
        json!({ "sheet": { "signals": signals, "at": at, "kind": "socket" }, "text": text })
    }

    #[test]
    fn a_page_gets_what_has_changed_since_its_last_look() {
        let mut news = News::default();
        let mut first = state(&["A", "B", "C"], "a\u{e4}b\u{1f600}c");
        news.since(None, 1, &mut first);
        assert_eq!(
            first,
            state(&["A", "B", "C"], "a\u{e4}b\u{1f600}c"),
            "all of it"
        );
        let mut second = state(&["A", "D", "E", "C"], "a\u{e4}b\u{1f601}c");
        news.since(Some(1), 2, &mut second);
        assert_eq!(second["sheet"], json!({ "kind": "socket" }));
        assert_eq!(
            second["since"]["rows"],
            json!({ "from": 1, "gone": 1, "new": [{ "name": "D" }, { "name": "E" }] })
        );
        assert_eq!(
            second["since"]["at"],
            json!({ "set": { "D": "x", "E": "x" }, "gone": ["B"] })
        );
        assert_eq!(
            second["since"]["text"],
            json!({ "from": 3, "gone": 2, "new": "\u{1f601}" })
        );
        // One that has slept for long gets all.
        for version in 3..=9 {
            news.since(None, version, &mut state(&["A"], ""));
        }
        let mut last = state(&["A"], "");
        news.since(Some(2), 10, &mut last);
        assert_eq!(last, state(&["A"], ""));
    }

    #[test]
    fn every_pair_of_texts_is_put_together_again() {
        let texts = [
            "",
            "a",
            "\u{e4}",
            "\u{e5}",
            "a\u{e4}",
            "\u{e4}\u{e4}",
            "\u{1f600}",
            "\u{1f601}a",
            "aba",
            "ababa",
        ];
        for before in texts {
            for now in texts {
                let since = text_since(before, now);
                let units: Vec<u16> = before.encode_utf16().collect();
                let number = |key: &str| {
                    usize::try_from(since[key].as_u64().expect("a number")).expect("it is small")
                };
                let (from, gone) = (number("from"), number("gone"));
                let mut made = units[..from].to_vec();
                made.extend(since["new"].as_str().expect("a text").encode_utf16());
                made.extend(&units[from + gone..]);
                assert_eq!(
                    String::from_utf16(&made).expect("text"),
                    now,
                    "{before} {since}"
                );
            }
        }
    }
}
