//! The rules, each a function from a source file to its violations.

use super::source::{Token, texts, tokens};

/// Where `unsafe` is allowed: files that start like this.
const UNSAFE_HOMES: &[&str] = &[
    "src/c_api.rs",
    "src/c_api/",
    "src/cli/in_library.rs",
    "src/fmi_api",
    "src/jni.rs",
    "src/jni/",
    "crates/core/base/src/os/",
    "crates/core/binding/src/handles.rs",
    "crates/core/binding/src/shared.rs",
    "crates/bus/hilscher/src/cif/library.rs",
    "crates/bus/hilscher/src/cifx/library.rs",
    "crates/bus/interbus/src/library.rs",
    "crates/bus/plugin/src/library.rs",
    "crates/core/conformance/src/resources.rs",
    "crates/sync/federation/src/helics/library.rs",
    "crates/sync/federation/src/silkit/library.rs",
    "crates/sync/federation/src/text.rs",
    "crates/tools/fmi/src/foreign/library",
    "crates/core/image/src/triple.rs",
    "crates/tools/launcher/src/main.rs",
    "crates/tools/worlds/src/scheduler.rs",
    "crates/core/plc/src/hosted/table.rs",
    "python/src/view.rs",
];

/// Where the system's clocks may be read.
const CLOCK_HOMES: &[&str] = &[
    "crates/core/base/src/time/",
    "crates/core/conformance/",
    "src/cli/",
];

/// The house whose crates know no bus but the loopback: the kinds are handed in. The tests of a bus use these crates, and
/// would otherwise compile all other buses.
const CORE: &str = "crates/core/";

/// The largest number of lines in a source file.
const MOST_LINES: usize = 700;

/// One source file: its path from the project's root, with `/`, and its text.
#[derive(Clone, Copy, Debug)]
pub(crate) struct File<'a> {
    pub(crate) path: &'a str,
    pub(crate) text: &'a str,
}

/// All violations in `file`, one per line.
pub(crate) fn mistakes(file: File<'_>) -> Vec<String> {
    let tokens = tokens(file.text);
    let mut found = unsafe_code(file, &tokens);
    found.extend(clocks(file, &tokens));
    found.extend(buses(file, &tokens));
    found.extend(length(file));
    found
}

/// The buses that this manifest names, also for tests, if the crate is of the core.
pub(crate) fn buses_of_core(file: &str, manifest: &str) -> Vec<String> {
    let lines = manifest.lines().filter(|_| file.starts_with(CORE));
    let buses = lines.filter(|line| is_bus(&line.replace('-', "_")));
    buses
        .map(|line| format!("{file}: {line}: {NO_BUS}"))
        .collect()
}

fn is_bus(name: &str) -> bool {
    name.starts_with("tickbus_bus_") || name.starts_with("tickbus_kinds")
}

/// The advice for a crate that names a bus.
const NO_BUS: &str = "this crate knows no bus; ask `BusOptions`, or take the kinds from the caller";

fn buses(file: File<'_>, tokens: &[Token<'_>]) -> Vec<String> {
    if !file.path.starts_with(CORE) {
        return Vec::new();
    }
    let places = tokens.iter().filter(|token| is_bus(token.text));
    places
        .map(|token| format!("{}:{}: {}: {NO_BUS}", file.path, token.line, token.text))
        .collect()
}

fn at_home(file: File<'_>, homes: &[&str]) -> bool {
    homes.iter().any(|home| file.path.starts_with(home))
}

fn unsafe_code(file: File<'_>, tokens: &[Token<'_>]) -> Vec<String> {
    if at_home(file, UNSAFE_HOMES) {
        return Vec::new();
    }
    let places = tokens.iter().filter(|token| token.text == "unsafe");
    places
        .map(|token| {
            format!(
                "{}:{}: unsafe code outside its homes; write it safely, or move it into src/jni/ (for \
                 the JVM) or crates/core/base/src/os/ (for the system) behind a safe function",
                file.path, token.line
            )
        })
        .collect()
}

fn clocks(file: File<'_>, tokens: &[Token<'_>]) -> Vec<String> {
    if at_home(file, CLOCK_HOMES) {
        return Vec::new();
    }
    let names: &[&[&str]] = &[
        &["SystemTime"],
        &["clock_gettime"],
        &["thread", ":", ":", "sleep"],
    ];
    let mut found = Vec::new();
    for (at, token) in tokens.iter().enumerate() {
        let rest = &tokens[at..];
        let is_named = names.iter().any(|wanted| texts(rest, wanted));
        // Any type that can read the time: Instant, DateTime, Utc, ...
        let is_type = token.text.starts_with(char::is_uppercase) && token.text != "Self";
        let tells = is_type && texts(&rest[1..], &[":", ":"]) && rest.get(3).is_some_and(asks_time);
        if is_named || tells {
            let name = if tells {
                format!("{}::{}", token.text, rest[3].text)
            } else if token.text == "thread" {
                "thread::sleep".to_owned()
            } else {
                token.text.to_owned()
            };
            found.push(format!(
                "{}:{}: {name} is the system's time; take `now` as an argument, a \
                 `&dyn tickbus::time::Clock` to wait on, or a `tickbus::time::WallClock` for the date",
                file.path, token.line
            ));
        }
    }
    found
}

/// True if a function of this name reads the time: `now`, `now_utc`, `now_with_offset`.
fn asks_time(token: &Token<'_>) -> bool {
    token.text == "now" || token.text.starts_with("now_")
}

fn length(file: File<'_>) -> Option<String> {
    let lines = file.text.lines().count();
    (lines > MOST_LINES).then(|| {
        format!(
            "{}:{lines}: {lines} lines, the most is {MOST_LINES}; a file holds one idea: find the \
             second one and give it a file",
            file.path
        )
    })
}
