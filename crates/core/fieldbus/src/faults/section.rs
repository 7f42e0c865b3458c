//! The `[[fault]]` sections: of a driver.cfg, of a separate file, or handed in one at a time.

mod effect;
mod keys;

use std::sync::Once;

pub use self::effect::model_value;
use self::effect::read_effect;
pub use self::keys::{FAULT_KEYS, FAULT_KINDS, FORMER_FAULT_KINDS};
use super::{AnswerCodes, Begin, Condition, Effect, Fault, Lasts};
use tickbus_base::toml_text::{Collector, Mistakes, Table, TableKind, Value, read_text, shown};
use tickbus_image::signal::SignalTable;
use tickbus_image::signal::section::NAME_LIMIT;

/// The maximum number of faults of one driver that wait or are active.
pub const LIMIT: usize = 64;

/// The driver for which faults are read.
#[derive(Clone, Copy, Debug)]
pub struct Scope<'a> {
    /// The stations and signals of the driver.
    pub table: &'a SignalTable,
    /// True if the driver's bus [has a diagnosis](crate::BusOptions::has_diagnosis).
    pub has_diagnosis: bool,
    /// True if the driver's bus [has answers](crate::BusOptions::has_answers).
    pub has_answers: bool,
    /// The [codes](crate::BusOptions::answer_codes) with which the bus can refuse a request.
    pub codes: AnswerCodes,
}

/// The scope of a driver whose bus has no diagnosis and gives no answers.
impl<'a> From<&'a SignalTable> for Scope<'a> {
    fn from(table: &'a SignalTable) -> Self {
        Self {
            table,
            has_diagnosis: false,
            has_answers: false,
            codes: AnswerCodes::BYTE,
        }
    }
}

/// The remedy for a fault of the model without a name.
const NAME_OF_MODEL: &str =
    "name the fault as the model calls it, such as name = \"hose of clamp left\"";

const KIND: &str = "write the kind of fault, such as kind = \"stuck\"";

/// Reads the faults of a separate file.
///
/// # Errors
///
/// With every mistake in the text.
pub fn read_file<'a>(
    file: &str,
    text: &str,
    scope: impl Into<Scope<'a>>,
) -> Result<Vec<Fault>, Mistakes> {
    let scope = Some(scope.into());
    let mut collector = Collector::new(file, text);
    let faults = read_text(&mut collector, text, |mut root| {
        let sections = root.require("fault", "write [[fault]] sections");
        root.finish();
        let sections = sections.map(|value| value.tables("[[fault]]"));
        Some(read_sections(sections.unwrap_or_default(), scope))
    });
    match collector.finish() {
        Some(mistakes) => Err(mistakes),
        None => Ok(faults.unwrap_or_default()),
    }
}

/// Reads one fault, with or without its section header: `kind = "link-down"`.
///
/// # Errors
///
/// With every mistake in the text; the mistakes name the file `fault`.
pub fn read_one<'a>(text: &str, scope: impl Into<Scope<'a>>) -> Result<Fault, Mistakes> {
    let scope = Some(scope.into());
    let mut collector = Collector::new("fault", text);
    let fault = read_text(&mut collector, text, |root| {
        let has_sections = root.all().any(|(key, _)| key == "fault");
        if !has_sections {
            return read(root, scope);
        }
        let mut root = root;
        let sections = root.take("fault")?.tables("[[fault]]");
        root.finish();
        if let Some(second) = sections.get(1) {
            second.wrong("this is a second fault", "inject each one by itself");
        }
        sections
            .into_iter()
            .find_map(|section| read(section, scope))
    });
    match collector.finish() {
        Some(mistakes) => Err(mistakes),
        None => Ok(fault.expect("what is not read has a mistake")),
    }
}

/// Reads `[[fault]]` sections and reports their mistakes. Without a scope, runs only the checks that need none.
pub fn read_sections(sections: Vec<Table<'_>>, scope: Option<Scope<'_>>) -> Vec<Fault> {
    if let Some(first) = sections.get(LIMIT) {
        first.wrong(
            format!("there are {} faults", sections.len()),
            format!("a driver has at most {LIMIT}"),
        );
        return Vec::new();
    }
    let mut faults: Vec<Fault> = Vec::new();
    for mut section in sections {
        let name = section.take("name");
        let Some(fault) = read(section, scope) else {
            continue;
        };
        let twin = faults.iter().any(|other| other.name == fault.name);
        match (twin, name) {
            // The model knows one fault by that name, which may come twice.
            (true, Some(_)) if matches!(fault.effect, Effect::Model(_)) => faults.push(fault),
            (true, Some(name)) => name.wrong(
                format!("there is a fault \"{}\" already", shown(&fault.name)),
                "give each a name of its own",
            ),
            (true, None) => {
                let free = (2..).map(|number| format!("{} {number}", fault.name));
                let mut free = free.filter(|name| faults.iter().all(|fault| fault.name != *name));
                let name = free.next().unwrap_or_default();
                faults.push(Fault { name, ..fault });
            }
            (false, _) => faults.push(fault),
        }
    }
    faults
}

/// The keys of a section.
struct Keys<'a> {
    kind: Option<Value<'a>>,
    name: Option<Value<'a>>,
    signal: Option<Value<'a>>,
    value: Option<Value<'a>>,
    by: Option<Value<'a>>,
    amplitude: Option<Value<'a>>,
    chance: Option<Value<'a>>,
    direction: Option<Value<'a>>,
    station: Option<Value<'a>>,
    slot: Option<Value<'a>>,
    channel: Option<Value<'a>>,
    error: Option<Value<'a>>,
    function: Option<Value<'a>>,
    quantity: Option<Value<'a>>,
    pause: Option<Value<'a>>,
    code: Option<Value<'a>>,
    how: Option<Value<'a>>,
    octets: Option<Value<'a>>,
    alarm: Option<Value<'a>>,
    static_: Option<Value<'a>>,
    seed: Option<Value<'a>>,
    at: Option<Value<'a>>,
    tick: Option<Value<'a>>,
    when: Option<Value<'a>>,
    while_: Option<Value<'a>>,
    for_: Option<Value<'a>>,
    ticks: Option<Value<'a>>,
    times: Option<Value<'a>>,
}

impl<'a> Keys<'a> {
    fn take(table: &mut Table<'a>) -> Self {
        Self {
            kind: table.require("kind", KIND),
            name: table.take("name"),
            signal: table.take("signal"),
            value: table.take("value"),
            by: table.take("by"),
            amplitude: table.take("amplitude"),
            chance: table.take("chance"),
            direction: table.take("direction"),
            station: table.take("station"),
            slot: table.take("slot"),
            channel: table.take("channel"),
            error: table.take("error"),
            function: table.take("function"),
            quantity: table.take("quantity"),
            pause: table.take("pause"),
            code: table.take("code"),
            how: table.take("how"),
            octets: table.take("octets"),
            alarm: table.take("alarm"),
            static_: table.take("static"),
            seed: table.take("seed"),
            at: table.take("at"),
            tick: table.take("tick"),
            when: table.take("when"),
            while_: table.take("while"),
            for_: table.take("for"),
            ticks: table.take("ticks"),
            times: table.take("times"),
        }
    }

    /// The keys that only some kinds have.
    fn of_kinds(&self) -> [(&'static str, Option<&Value<'a>>); 19] {
        [
            ("signal", self.signal.as_ref()),
            ("value", self.value.as_ref()),
            ("by", self.by.as_ref()),
            ("amplitude", self.amplitude.as_ref()),
            ("chance", self.chance.as_ref()),
            ("direction", self.direction.as_ref()),
            ("station", self.station.as_ref()),
            ("slot", self.slot.as_ref()),
            ("channel", self.channel.as_ref()),
            ("error", self.error.as_ref()),
            ("function", self.function.as_ref()),
            ("quantity", self.quantity.as_ref()),
            ("pause", self.pause.as_ref()),
            ("code", self.code.as_ref()),
            ("how", self.how.as_ref()),
            ("octets", self.octets.as_ref()),
            ("alarm", self.alarm.as_ref()),
            ("static", self.static_.as_ref()),
            ("seed", self.seed.as_ref()),
        ]
    }
}

/// Reads one section.
fn read(mut section: Table<'_>, scope: Option<Scope<'_>>) -> Option<Fault> {
    let table = scope.map(|scope| scope.table);
    let keys = Keys::take(&mut section);
    let known = keys.kind.as_ref().and_then(kind_of);
    if let Some(kind) = known {
        for key in kind.required {
            section.require(key.name, key.right);
        }
        if kind.needs_name {
            section.require("name", NAME_OF_MODEL);
        }
    }
    let whole = section.is_whole();
    section.finish();

    if let Some(kind) = known {
        check_keys(kind.name, &keys);
    }
    if let (Some(kind), Some(value), Some(scope)) = (known, &keys.kind, scope)
        && kind.name == "diagnosis"
        && !scope.has_diagnosis
    {
        value.wrong(
            "a station of this bus has no diagnosis",
            "remove the fault; \"profibus-device\" has one",
        );
    }
    if let (Some(kind), Some(value), Some(scope)) = (known, &keys.kind, scope)
        && kind.name.starts_with("answer-")
        && !scope.has_answers
    {
        value.wrong(
            "this bus answers no requests that tickbus can answer wrongly",
            "remove the fault; \"modbus-server\", \"s7-server\" and \"opcua-server\" do",
        );
    }
    if let (Some(kind), Some(value), Some(scope)) = (known, &keys.kind, scope)
        && kind.name == "answer-wrong"
        && scope.has_answers
        && scope.codes.wrong.is_empty()
    {
        value.wrong(
            "the telegrams of this bus are made by a library that makes no malformed ones",
            "write kind = \"answer-late\" or kind = \"answer-error\"",
        );
    }
    let begin = read_begin(&keys, table);
    let lasts = read_lasts(&keys);
    let name = match &keys.name {
        None => Some(None),
        Some(value) => name_of(value).map(Some),
    };
    let seed = match &keys.seed {
        None => Some(1),
        Some(value) => value
            .whole(0..=u64::MAX.into())
            .and_then(|seed| u64::try_from(seed).ok()),
    };
    let effect = known.and_then(|kind| read_effect(kind.name, &keys, scope, whole));
    let (begin, lasts) = (begin?, lasts?);
    let times = read_times(&keys, &begin, lasts)?;
    let (effect, name) = (effect?, name?);
    let mut fault = Fault {
        name: String::new(),
        effect,
        begin,
        lasts,
        times,
        seed: seed?,
    };
    fault.name = match (name, effect) {
        (Some(name), _) => name,
        (None, Effect::Signal(index, _)) => {
            format!("{} {}", fault.kind(), table?.signals[index].name)
        }
        // The statistics have the name as it was written.
        (None, Effect::Line(_) | Effect::Model(_)) => {
            let written = keys.kind.as_ref().and_then(Value::as_text);
            written.unwrap_or(fault.kind()).to_owned()
        }
    };
    Some(fault)
}

fn kind_of(value: &Value<'_>) -> Option<TableKind> {
    let kinds = FAULT_KINDS.map(|kind| (kind.name, kind));
    let former = FORMER_FAULT_KINDS.iter();
    let mut former = former.filter(|(before, _)| value.as_text() == Some(before));
    if let Some((before, name)) = former.next() {
        static REPORTED: Once = Once::new();
        REPORTED.call_once(|| {
            log::warn!(
                "the kind of fault \"{before}\" is called \"{name}\" now; change it in the file, since a later version \
                 does not know the old name"
            );
        });
        let mut kinds = kinds.iter();
        return kinds
            .find(|(known, _)| known == name)
            .map(|(_, kind)| *kind);
    }
    value.choice("kinds of faults", &kinds)
}

/// Reports keys that do not belong to faults of this kind.
fn check_keys(kind: &str, keys: &Keys<'_>) {
    for (key, value) in keys.of_kinds() {
        let Some(value) = value else { continue };
        let owners: Vec<&str> = FAULT_KINDS
            .iter()
            .filter(|kind| kind.keys().any(|own| own == key))
            .map(|kind| kind.name)
            .collect();
        if !owners.contains(&kind) {
            value.wrong(
                format!("a fault of kind \"{kind}\" has no \"{key}\""),
                format!("remove it; it is for {}", owners.join(", ")),
            );
        }
    }
}

fn name_of(value: &Value<'_>) -> Option<String> {
    let name = value.label(
        NAME_LIMIT,
        "give the fault a name of its own, or leave it out",
    )?;
    Some(name.to_owned())
}

fn read_begin(keys: &Keys<'_>, table: Option<&SignalTable>) -> Option<Begin> {
    let triggers = [
        ("at", &keys.at),
        ("tick", &keys.tick),
        ("when", &keys.when),
        ("while", &keys.while_),
    ];
    let stated: Vec<_> = triggers
        .iter()
        .filter_map(|(key, value)| value.as_ref().map(|value| (*key, value)))
        .collect();
    if let [(first, _), (second, value), ..] = &stated[..] {
        value.wrong(
            format!("a fault has both \"{first}\" and \"{second}\""),
            "keep one of them, or write two faults",
        );
    }
    let read = |(key, value): &(&str, &Value<'_>)| {
        Some(match *key {
            "at" => Begin::At(value.duration()?),
            "tick" => Begin::Tick(
                value
                    .whole(1..=i64::MAX.into())
                    .and_then(|tick| u64::try_from(tick).ok())?,
            ),
            "when" => Begin::When(read_condition(value, table)?),
            _ => Begin::While(read_condition(value, table)?),
        })
    };
    let read: Vec<Option<Begin>> = stated.iter().map(read).collect();
    match <[_; 1]>::try_from(read) {
        Ok([begin]) => begin,
        Err(read) if read.is_empty() => Some(Begin::AtOnce),
        Err(_) => None,
    }
}

fn read_condition(value: &Value<'_>, table: Option<&SignalTable>) -> Option<Condition> {
    let text = value.text("write a condition in quotes, such as \"LA1 run == 1\"")?;
    Condition::parse(text, table?)
        .map_err(|mistake| value.refuse(mistake))
        .ok()
}

fn read_lasts(keys: &Keys<'_>) -> Option<Lasts> {
    let span = keys.for_.as_ref().map(Value::duration);
    let ticks = keys.ticks.as_ref().map(|value| {
        value
            .whole(1..=i64::MAX.into())
            .and_then(|ticks| u64::try_from(ticks).ok())
    });
    let both = [&keys.for_, &keys.ticks];
    let stated = both.into_iter().flatten().max_by_key(|value| value.at());
    if let (Some(_), Some(value)) = (&keys.while_, stated) {
        value.wrong(
            "a fault with \"while\" ends with its condition",
            "remove this key, or write \"when\" instead of \"while\"",
        );
        return None;
    }
    match (span, ticks) {
        (None, None) => Some(Lasts::UntilEnded),
        (Some(span), None) => span.map(Lasts::For),
        (None, Some(ticks)) => ticks.map(Lasts::Ticks),
        (Some(_), Some(_)) => {
            if let Some(value) = &keys.ticks {
                value.wrong("a fault has both \"for\" and \"ticks\"", "keep one of them");
            }
            None
        }
    }
}

fn read_times(keys: &Keys<'_>, begin: &Begin, lasts: Lasts) -> Option<u64> {
    let usual = if matches!(begin, Begin::While(_)) {
        u64::MAX
    } else {
        1
    };
    let Some(value) = &keys.times else {
        return Some(usual);
    };
    let times = value.whole(1..=i64::MAX.into())?;
    if !matches!(begin, Begin::When(_)) {
        value.wrong(
            "\"times\" stands without \"when\"",
            "remove it; only a condition comes true more than once",
        );
        return None;
    }
    if times > 1 && lasts == Lasts::UntilEnded {
        value.wrong(
            "a fault that does not end by itself cannot begin again",
            "add for = \"300ms\" or ticks = 20, or remove \"times\"",
        );
        return None;
    }
    u64::try_from(times).ok()
}
