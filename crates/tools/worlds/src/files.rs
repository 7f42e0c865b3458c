//! Reads the files of recordings, as docs/recording.md describes them.

use std::collections::BTreeMap;

/// A tick in a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FileRow {
    pub(crate) number: u64,
    pub(crate) time: i64,
    pub(crate) status: i32,
    pub(crate) stations: Vec<i32>,
    pub(crate) dropped: u64,
    /// The values, in the order of the columns.
    pub(crate) values: Vec<u64>,
}

/// The contents of a file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contents {
    /// The columns: signals, and counts of their edges.
    pub(crate) names: Vec<String>,
    pub(crate) rows: Vec<FileRow>,
    /// The line with which the recorder closed the file, if there is one.
    pub(crate) end: Option<String>,
}

/// Returns true if a column counts the edges of a signal.
#[expect(
    clippy::case_sensitive_file_extension_comparisons,
    reason = "the name of a column"
)]
pub(crate) fn is_count(name: &str) -> bool {
    name.ends_with(".edges")
}

/// The bits of a slot with the number in `text`: those of an integer if the name says so, otherwise those of a double.
fn bits(name: &str, text: &str) -> Result<u64, String> {
    let wrong = || format!("\"{text}\" is no value of {name}");
    if name.starts_with("stamp") || name.starts_with("u64") {
        text.parse::<u64>().map_err(|_| wrong())
    } else if name.starts_with("i64") {
        let signed = text.parse::<i64>().map_err(|_| wrong())?;
        Ok(signed.cast_unsigned())
    } else {
        text.parse::<f64>().map(f64::to_bits).map_err(|_| wrong())
    }
}

/// The area of a signal, from its name.
pub(crate) fn area_of(name: &str) -> char {
    let mut letters = name.chars().filter(char::is_ascii_uppercase);
    letters.next().expect("each name has its area")
}

/// Reads a CSV file up to its last whole line.
pub(crate) fn csv(text: &str) -> Result<Contents, String> {
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let mut lines = whole.lines();
    let Some(header) = lines.next() else {
        return Ok(Contents::default());
    };
    let titles: Vec<&str> = header.split(',').collect();
    let head = ["bus.tick", "bus.time_ns", "bus.status", "bus.dropped"];
    if !titles.starts_with(&head) {
        return Err(format!("it begins with {header}"));
    }
    let stations = titles
        .iter()
        .filter(|title| title.starts_with("bus.status."))
        .count();
    let names: Vec<String> = titles[4 + stations..]
        .iter()
        .map(|name| (*name).to_owned())
        .collect();
    let rows = lines.map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        if cells.len() != titles.len() {
            return Err(format!("{} cells in {line}", cells.len()));
        }
        let number = |index: usize| {
            let cell: &str = cells[index];
            cell.parse::<i64>().map_err(|_| format!("{cell} in {line}"))
        };
        let small = |index| number(index).map(|number| i32::try_from(number).expect("a status"));
        let values = names.iter().zip(&cells[4 + stations..]);
        Ok(FileRow {
            number: number(0)?.cast_unsigned(),
            time: number(1)?,
            status: small(2)?,
            stations: (4..4 + stations).map(small).collect::<Result<_, _>>()?,
            dropped: number(3)?.cast_unsigned(),
            values: values
                .map(|(name, cell)| bits(name, cell))
                .collect::<Result<_, _>>()?,
        })
    });
    let rows = rows.collect::<Result<_, _>>()?;
    Ok(Contents {
        names,
        rows,
        end: None,
    })
}

/// A variable of a VCD file.
#[derive(Clone, Copy, Debug)]
enum Variable {
    Tick,
    Dropped,
    Status,
    Station(usize),
    Value(usize),
}

/// Reads a VCD file up to the line of its last whole tick.
pub(crate) fn vcd(text: &str) -> Result<Contents, String> {
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let mut contents = Contents::default();
    let mut variables = BTreeMap::new();
    let mut row = FileRow {
        number: 0,
        time: 0,
        status: 0,
        stations: Vec::new(),
        dropped: 0,
        values: Vec::new(),
    };
    for line in whole.lines() {
        // No branch needs a fifth word, and a heap list for each line would take longer than everything else.
        let mut words = [""; 4];
        let mut count = 0;
        for (place, word) in words.iter_mut().zip(line.split_ascii_whitespace()) {
            *place = word;
            count += 1;
        }
        match words[..count] {
            ["$comment", "end", ..] => contents.end = Some(line.to_owned()),
            ["$comment", what, id, ..] => {
                let name = line.split('"').nth(1).unwrap_or_default();
                let variable = match what {
                    "tick" => Variable::Tick,
                    "dropped" => Variable::Dropped,
                    "status" if line.contains("station=") => {
                        row.stations.push(0);
                        Variable::Station(row.stations.len() - 1)
                    }
                    "status" => Variable::Status,
                    "signal" | "edges" => {
                        let edges = if what == "edges" { ".edges" } else { "" };
                        contents.names.push(format!("{name}{edges}"));
                        row.values.push(0);
                        Variable::Value(row.values.len() - 1)
                    }
                    _ => continue,
                };
                variables.insert(id.to_owned(), variable);
            }
            [time] if time.starts_with('#') => {
                row.time = time[1..].parse().map_err(|_| line.to_owned())?;
            }
            _ if line.starts_with('$') => {}
            [change] => {
                let (value, id) = change.split_at(1);
                let on = match value {
                    "0" => 0.0,
                    "1" => 1.0,
                    _ => return Err(format!("{line} is no change")),
                };
                if let Some(Variable::Value(index)) = variables.get(id) {
                    row.values[*index] = f64::to_bits(on);
                }
            }
            [value, id] => {
                let Some(variable) = variables.get(id) else {
                    return Err(format!("{line} is of no variable"));
                };
                let (kind, digits) = value.split_at(1);
                let whole = || u64::from_str_radix(digits, 2).map_err(|_| line.to_owned());
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "32 bits in two's complement"
                )]
                let status = || whole().map(|bits| (bits as u32).cast_signed());
                match variable {
                    Variable::Tick => {
                        row.number = whole()?;
                        contents.rows.push(row.clone());
                    }
                    Variable::Dropped => row.dropped = whole()?,
                    Variable::Status => row.status = status()?,
                    Variable::Station(index) => row.stations[*index] = status()?,
                    Variable::Value(index) => {
                        row.values[*index] = match kind {
                            "r" => digits
                                .parse::<f64>()
                                .map(f64::to_bits)
                                .map_err(|_| line.to_owned())?,
                            _ if is_count(&contents.names[*index]) => {
                                #[expect(clippy::cast_precision_loss, reason = "a small count")]
                                let count = whole()? as f64;
                                count.to_bits()
                            }
                            _ => whole()?,
                        };
                    }
                }
            }
            _ => return Err(format!("{line} is no change")),
        }
    }
    Ok(contents)
}
