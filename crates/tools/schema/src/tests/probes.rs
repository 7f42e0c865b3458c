//! Values for each key of a table, right and wrong ones, tried on the schema and on the reader.

use std::collections::BTreeSet;

use jsonschema::Validator;
use serde_json::{Value, json};
use tickbus_base::toml_text::{Key, Mistakes, Shape};

use super::{Table, is_structural, read, written};

/// The key that no table has.
const UNKNOWN: &str = "§§";

pub(super) fn check(validator: &Validator, document: &Value, table: &Table) {
    check_names(validator, document, table);
    for key in &table.keys {
        let with = |value: Option<Value>| {
            let mut changed = document.clone();
            let place = changed.pointer_mut(&table.pointer).expect("the table");
            let entries = place.as_object_mut().expect("a table");
            entries.remove(key.name);
            if let Some(value) = value {
                entries.insert(key.name.to_owned(), value);
            }
            changed
        };
        let place = format!("{} in {}", key.name, table.name);
        let without = with(None);
        if key.is_required {
            assert!(!validator.is_valid(&without), "no {place}");
            assert!(read(&written(&without)).is_err(), "no {place}");
        }
        for probe in right(&key.shape) {
            let changed = with(Some(probe.clone()));
            let mistakes = read(&written(&changed)).err();
            if validator.is_valid(&changed) {
                // Another key may contradict it.
                let seen = mistakes.iter().flatten();
                let seen = seen.filter(|found| is_structural(&found.mistake));
                assert_eq!(seen.count(), 0, "{place} = {probe}: {mistakes:?}");
            } else {
                assert!(
                    mistakes.is_some(),
                    "{place} = {probe} is refused by the schema alone"
                );
            }
        }
        for probe in wrong(&key.shape) {
            let changed = with(Some(probe.clone()));
            assert!(
                !validator.is_valid(&changed),
                "{place} = {probe} passes the schema"
            );
            assert!(
                read(&written(&changed)).is_err(),
                "{place} = {probe} passes the reader"
            );
        }
        check_default(key, &place, &without, &with);
    }
}

/// The reader knows the declared keys, and no others.
fn check_names(validator: &Validator, document: &Value, table: &Table) {
    let mut changed = document.clone();
    changed.pointer_mut(&table.pointer).expect("the table")[UNKNOWN] = json!(1);
    assert!(
        !validator.is_valid(&changed),
        "an unknown key in {}",
        table.name
    );
    let mistakes = read(&written(&changed)).expect_err(&table.name);
    let unknown = format!("unknown key \"{UNKNOWN}\"");
    let found = mistakes
        .iter()
        .find(|found| found.mistake.what.starts_with(&unknown));
    let found = found.unwrap_or_else(|| panic!("{}: {mistakes}", table.name));
    let known = found.mistake.right.strip_prefix("keys here are ");
    let known: BTreeSet<&str> = known.expect("the keys").split(", ").collect();
    let mut declared: BTreeSet<&str> = table.keys.iter().map(|key| key.name).collect();
    if table.pointer == "/fieldbus" {
        declared.insert("kind");
    }
    assert_eq!(known, declared, "the keys of {}", table.name);
}

/// A key that the table cannot have, because of its kind or without another key.
fn is_foreign(mistakes: &Mistakes) -> bool {
    mistakes.iter().all(|found| {
        let what = &found.mistake.what;
        let is_of_kind = ["a fault of kind ", "a reply of kind ", "telegram "];
        is_of_kind.iter().any(|head| what.starts_with(head))
            || what.contains("\" stands without \"")
    })
}

/// A table with the default is read as one without the key.
fn check_default(key: &Key, place: &str, without: &Value, with: &dyn Fn(Option<Value>) -> Value) {
    let Some(default) = key.default else { return };
    let default: Value = serde_json::from_str(default).expect(place);
    let (text, shorter) = (written(&with(Some(default))), written(without));
    if read(&shorter).is_err() {
        return;
    }
    // A comment in the place of the line: what is read remembers where it was.
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let differs = |(line, other): &(&String, &str)| line != other;
    let equal = lines
        .iter()
        .zip(shorter.lines())
        .take_while(|pair| !differs(pair));
    let line = equal.count();
    assert!(
        lines[line].starts_with(key.name),
        "{place}: {}",
        lines[line]
    );
    lines[line] = "#".repeat(lines[line].len());
    let commented = lines.join("\n") + "\n";
    let (stated, left_out) = (read(&text), read(&commented));
    if stated.as_ref().is_err_and(is_foreign) {
        return;
    }
    assert_eq!(stated, left_out, "the default of {place}");
}

/// Values that the shape has: its limits among them.
fn right(shape: &Shape) -> Vec<Value> {
    let texts = |all: &[&str]| all.iter().map(|text| json!(text)).collect::<Vec<Value>>();
    match *shape {
        Shape::Text => texts(&["x", ""]),
        Shape::Label(longest) => vec![json!("x"), json!("x".repeat(longest))],
        Shape::Pattern(_) | Shape::Table(_) => Vec::new(),
        Shape::Choice(names) => texts(names),
        Shape::AnyCase(names) => {
            let small = names.iter().map(|name| json!(name.to_lowercase()));
            texts(names).into_iter().chain(small).collect()
        }
        Shape::Boolean => vec![json!(true), json!(false)],
        Shape::Whole(least, most) => whole(&[least, most]),
        Shape::Numbers(numbers) => numbers.iter().map(|number| json!(number)).collect(),
        Shape::Number => vec![json!(1), json!(0.5)],
        Shape::Duration => texts(&["1s", "1.5 s", "20ms", "2min"]),
        Shape::List(element, least, most) => {
            let least = list(element, least);
            let most = Some(most).filter(|most| *most < 1_000);
            let most = most.and_then(|most| list(element, most));
            least.into_iter().chain(most).collect()
        }
        Shape::Map(_) => vec![json!({})],
        Shape::Any(shapes) => shapes.iter().flat_map(right).collect(),
    }
}

/// Values that the shape does not have: each other type, and what is just beyond its limits.
fn wrong(shape: &Shape) -> Vec<Value> {
    let types = [
        json!(true),
        json!(7),
        json!(1.5),
        json!("§"),
        json!([]),
        json!({}),
    ];
    let types = types.into_iter().filter(|value| !has_type(shape, value));
    let beyond = match *shape {
        Shape::Label(longest) => vec![json!(""), json!(" x"), json!("x".repeat(longest + 1))],
        Shape::Pattern(_) | Shape::Choice(_) | Shape::AnyCase(_) | Shape::Duration => {
            vec![json!("§"), json!("")]
        }
        Shape::Whole(least, most) => whole(&[least - 1, most.saturating_add(1)]),
        Shape::Numbers(numbers) => {
            let most = numbers.iter().max().copied().unwrap_or_default();
            whole(&[i128::from(most) + 1])
        }
        Shape::List(element, least, most) => {
            let few = least.checked_sub(1).and_then(|few| list(element, few));
            let many = Some(most).filter(|most| *most < 1_000);
            let many = many.and_then(|most| list(element, most + 1));
            let of_element = wrong(element).into_iter().map(|value| json!([value]));
            few.into_iter().chain(many).chain(of_element).collect()
        }
        Shape::Map(value) => {
            let of_value = wrong(value).into_iter();
            of_value.map(|value| json!({ "x": value })).collect()
        }
        _ => Vec::new(),
    };
    types.chain(beyond).collect()
}

/// A list of `count` equal elements, if an element of this shape is easily made.
fn list(element: &Shape, count: usize) -> Option<Value> {
    let sample = right(element).into_iter().next()?;
    Some(json!(vec![sample; count]))
}

/// Numbers as JSON, as far as TOML has them.
fn whole(numbers: &[i128]) -> Vec<Value> {
    let numbers = numbers
        .iter()
        .filter_map(|number| i64::try_from(*number).ok());
    numbers.map(|number| json!(number)).collect()
}

fn has_type(shape: &Shape, value: &Value) -> bool {
    match shape {
        Shape::Text
        | Shape::Label(_)
        | Shape::Pattern(_)
        | Shape::Choice(_)
        | Shape::AnyCase(_)
        | Shape::Duration => value.is_string(),
        Shape::Boolean => value.is_boolean(),
        Shape::Whole(..) | Shape::Numbers(_) => value.is_i64(),
        Shape::Number => value.is_number(),
        Shape::List(..) => value.is_array(),
        Shape::Table(_) | Shape::Map(_) => value.is_object(),
        Shape::Any(shapes) => shapes.iter().any(|shape| has_type(shape, value)),
    }
}
