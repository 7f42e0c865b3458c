//! Generates the `Code` enum of `src/status.rs` from the table `src/status.tsv`.

use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs};

const TABLE: &str = "src/status.tsv";

/// Reads one column of a row.
type Column = for<'r> fn(&'r Row<'_>) -> &'r str;

struct Row<'a> {
    code: i32,
    name: &'a str,
    text: &'a str,
    remedy: &'a str,
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed={TABLE}");
    let table = fs::read_to_string(TABLE).unwrap_or_else(|error| panic!("{TABLE}: {error}"));
    let rows: Vec<Row<'_>> = table
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.starts_with('#') && !line.is_empty())
        .map(|(at, line)| row(at + 1, line))
        .collect();
    for (at, row) in rows.iter().enumerate() {
        let twin = rows[..at]
            .iter()
            .find(|other| other.code == row.code || other.name == row.name);
        assert!(
            twin.is_none(),
            "{TABLE}: code {} or name {} stands twice",
            row.code,
            row.name
        );
    }
    let out = env::var_os("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out).join("status.rs");
    fs::write(&out, generate(&rows)).unwrap_or_else(|error| panic!("{}: {error}", out.display()));
}

fn row(at: usize, line: &str) -> Row<'_> {
    let fields: Vec<&str> = line.split('\t').collect();
    let &[code, name, text, remedy] = fields.as_slice() else {
        panic!(
            "{TABLE}:{at}: {} fields, expected 4: code, name, meaning, remedy",
            fields.len()
        );
    };
    let code = code
        .parse()
        .unwrap_or_else(|_| panic!("{TABLE}:{at}: `{code}` is no number"));
    let well_formed = |c: char| c.is_ascii_uppercase() || c == '_';
    assert!(
        name.chars().all(well_formed),
        "{TABLE}:{at}: `{name}` is not UPPER_CASE"
    );
    Row {
        code,
        name,
        text,
        remedy,
    }
}

/// Converts `NOT_OPEN` to `NotOpen`.
fn variant(name: &str) -> String {
    name.split('_')
        .flat_map(|word| [word[..1].to_owned(), word[1..].to_ascii_lowercase()])
        .collect()
}

/// Prepares a text for a doc comment: names from configuration files are marked as code.
fn marked(text: &str) -> String {
    let words = text.split(' ').map(|word| {
        let name = word.trim_end_matches([';', ',', ':']);
        if name.contains('_') {
            format!("`{name}`{}", &word[name.len()..])
        } else {
            word.to_owned()
        }
    });
    words.collect::<Vec<_>>().join(" ")
}

fn generate(rows: &[Row<'_>]) -> String {
    let mut text = String::from(
        "/// What an exchange or another call on a driver came to.\n\
         ///\n\
         /// Zero and above: the exchange was done. Below zero: it was not.\n\
         #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]\n\
         #[repr(i32)]\n\
         pub enum Code {\n",
    );
    let mut write = |line: &str| writeln!(text, "{line}").expect("a string takes all");
    for row in rows {
        write(&format!("    /// `{}`: {}.", row.name, marked(row.text)));
        write(&format!("    {} = {},", variant(row.name), row.code));
    }
    write("}\n\nimpl Code {");
    write("    /// Every code, in the order of the table.");
    let all: Vec<String> = rows
        .iter()
        .map(|row| format!("Self::{}", variant(row.name)))
        .collect();
    write(&format!(
        "    pub const ALL: [Self; {}] = [{}];",
        rows.len(),
        all.join(", ")
    ));
    let columns: [(&str, &str, Column); 3] = [
        (
            "name",
            "Its name, as the Java enum `tickbus.Status` spells it.",
            |row| row.name,
        ),
        ("text", "What it means.", |row| row.text),
        ("remedy", "What to do about it.", |row| row.remedy),
    ];
    for (function, doc, field) in columns {
        write(&format!("\n    /// {doc}"));
        write(&format!(
            "    pub const fn {function}(self) -> &'static str {{"
        ));
        write("        match self {");
        for row in rows {
            write(&format!(
                "            Self::{} => {:?},",
                variant(row.name),
                field(row)
            ));
        }
        write("        }\n    }");
    }
    write("}");
    text
}
