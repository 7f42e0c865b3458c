//! The options of the plug-in bus in a driver.cfg.

use std::path::PathBuf;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, shown};

/// The most entries of `options`.
const OPTION_LIMIT: usize = 100;

/// The longest key or value of `options`, in bytes.
const TEXT_LIMIT: usize = 4000;

/// The longest time-out: the library gets it as milliseconds in an `int32_t`.
const TIMEOUT_LIMIT: Nanos = Nanos::from_secs(24 * 3600);

/// The options of the plug-in bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The library's file as written: relative to the folder of the driver.cfg.
    pub library: PathBuf,
    /// The options for the library itself, as key-value pairs sorted by key.
    pub options: Vec<(String, String)>,
    /// The time limit of one exchange; `None` leaves it to the cycle. Positive.
    pub timeout: Option<Nanos>,
    /// The time limit for opening. Positive.
    pub open_timeout: Nanos,
    /// The time past `timeout` after which a call counts as hung. Positive.
    pub call_timeout: Nanos,
    /// The time limit for closing. Positive.
    pub close_timeout: Nanos,
    /// True if the library runs in a separate process.
    pub isolated: bool,
    /// The tickbus command for starting that process; `None` searches for it. Relative to the folder of the
    /// driver.cfg.
    pub helper: Option<PathBuf>,
}

/// The keys of the bus, for the schema of a driver.cfg.
pub(crate) const KEYS: &[Key] = &[
    Key::required(
        "library",
        Shape::Label(TEXT_LIMIT),
        "The library's file; a relative path begins at the folder of this file",
    ),
    Key::new(
        "options",
        Shape::Map(&Shape::Any(&[Shape::Text, Shape::Number, Shape::Boolean])),
        "Options for the library itself",
    ),
    Key::new(
        "timeout",
        Shape::Duration,
        "How long an exchange may wait for the peer; one cycle by default, at least 10ms",
    ),
    Key::new(
        "open_timeout",
        Shape::Duration,
        "How long loading the library and opening the bus may take",
    )
    .or("\"10s\""),
    Key::new(
        "call_timeout",
        Shape::Duration,
        "How long past \"timeout\" an exchange may take before it counts as hung",
    )
    .or("\"1s\""),
    Key::new(
        "close_timeout",
        Shape::Duration,
        "How long closing the driver waits for the library",
    )
    .or("\"2s\""),
    Key::new(
        "isolated",
        Shape::Boolean,
        "true: the library runs in a helper process",
    )
    .or("false"),
    Key::new(
        "helper",
        Shape::Label(TEXT_LIMIT),
        "With isolated = true: the tickbus command, which the helper process runs",
    ),
];

impl Options {
    /// Reads `library`, `options`, the time-outs, and `isolated` with `helper`.
    pub fn read(table: &mut Table<'_>) -> Option<Self> {
        let library = table.require(
            "library",
            "name the shared library, such as library = \"libmybus.so\"",
        );
        let options = table.take("options");
        let timeout = table.take("timeout");
        let open_timeout = table.take("open_timeout");
        let call_timeout = table.take("call_timeout");
        let close_timeout = table.take("close_timeout");
        let isolated = table.take("isolated");
        let helper = table.take("helper");
        let whole = table.is_whole();

        let library = library.and_then(|value| path(&value, "name the shared library's file"));
        let options = options.map_or(Some(Vec::new()), |value| read_options(&value));
        let timeout = match timeout {
            None => Some(None),
            Some(value) => time_out(&value).map(Some),
        };
        let or = |value: Option<Value<'_>>, seconds| match value {
            None => Some(Nanos::from_secs(seconds)),
            Some(value) => time_out(&value),
        };
        let open_timeout = or(open_timeout, 10);
        let call_timeout = or(call_timeout, 1);
        let close_timeout = or(close_timeout, 2);
        let isolated = isolated.map_or(Some(false), |value| value.boolean());
        let helper = match helper {
            None => Some(None),
            Some(value) => {
                if whole && isolated == Some(false) {
                    value.wrong(
                        "\"helper\" stands without isolated = true",
                        "remove it, or add isolated = true to run the library in a helper process",
                    );
                }
                path(&value, "name the tickbus command's file").map(Some)
            }
        };
        Some(Self {
            library: library?,
            options: options?,
            timeout: timeout?,
            open_timeout: open_timeout?,
            call_timeout: call_timeout?,
            close_timeout: close_timeout?,
            isolated: isolated?,
            helper: helper?,
        })
    }
}

fn path(value: &Value<'_>, right: &str) -> Option<PathBuf> {
    value.label(TEXT_LIMIT, right).map(PathBuf::from)
}

fn time_out(value: &Value<'_>) -> Option<Nanos> {
    let span = value.duration()?;
    if span > TIMEOUT_LIMIT {
        value.wrong(
            format!("{span} is longer than anybody waits for a bus"),
            format!("write at most \"{TIMEOUT_LIMIT}\""),
        );
        return None;
    }
    Some(span)
}

fn read_options(value: &Value<'_>) -> Option<Vec<(String, String)>> {
    let table = value.table("options", "write them as { key = \"value\" }")?;
    let count = table.all().count();
    if count > OPTION_LIMIT {
        value.wrong(
            format!("there are {count} options"),
            format!("a library is given at most {OPTION_LIMIT}"),
        );
        return None;
    }
    let mut read = Some(Vec::new());
    for (key, value) in table.all() {
        match (read_option(key, &value), &mut read) {
            (Some(text), Some(read)) => read.push((key.to_owned(), text)),
            _ => read = None,
        }
    }
    if let Some(read) = &mut read {
        read.sort();
    }
    read
}

/// The text that the library gets for one option.
fn read_option(key: &str, value: &Value<'_>) -> Option<String> {
    let number = value.written();
    let text = if number.ends_with('…') {
        value.wrong(
            format!("the number is longer than any: {number}"),
            "write it as a text, in quotes",
        );
        return None;
    } else if !number.is_empty() {
        number
    } else if value.is_boolean() {
        value.boolean()?.to_string()
    } else {
        value
            .text("write a text, a number, true or false")?
            .to_owned()
    };
    // The library gets C strings, which end at the first NUL.
    if let Some(odd) = [key, &text].into_iter().find(|part| part.contains('\0')) {
        value.wrong(
            format!("the option has a NUL character in it: \"{}\"", shown(odd)),
            "remove it",
        );
        return None;
    }
    if key.len().max(text.len()) > TEXT_LIMIT {
        value.wrong(
            format!("the option is longer than {TEXT_LIMIT} bytes"),
            "shorten it, or let the library read a file",
        );
        return None;
    }
    Some(text)
}
