//! `--json`: one JSON document on stdout, for programs. docs/json.md describes its keys.

use serde_json::{Value, json};

use super::{Outcome, print};
use tickbus_base::toml_text::Mistakes;

/// How a command prints its result.
#[derive(Debug, Default, clap::Args)]
pub(super) struct Format {
    /// Print the result as one JSON document; docs/json.md describes its keys.
    #[arg(long)]
    json: bool,
}

impl Format {
    /// The same format, for a command within this one.
    pub(super) const fn same(&self) -> Self {
        Self { json: self.json }
    }

    /// Returns true if stdout has one JSON document, and nothing else.
    pub(super) fn is_json(&self) -> bool {
        self.json
    }

    /// Reports the mistakes in an input on stderr, and with `--json` on stdout, too.
    pub(super) fn refuse(&self, title: &str, mistakes: &Mistakes) -> Outcome {
        eprintln!("{mistakes}\n{title}: failed mistakes={}", mistakes.len());
        if self.json {
            let list: Vec<Value> = mistakes
                .iter()
                .map(|found| {
                    let (line, column) = found.place.unzip();
                    json!({
                        "file": mistakes.file(),
                        "line": line,
                        "column": column,
                        "what": found.mistake.what,
                        "right": found.mistake.right,
                    })
                })
                .collect();
            print_document(title, json!({ "ok": false, "mistakes": list }));
        }
        Outcome::WrongInput
    }

    /// Reports on stderr why a command failed, and with `--json` on stdout, too.
    pub(super) fn fail(&self, title: &str, reason: &str, outcome: Outcome) -> Outcome {
        eprintln!("{reason}");
        if self.json {
            let bare = reason.strip_prefix(title);
            let bare = bare.and_then(|reason| reason.strip_prefix(": "));
            let document = json!({ "ok": false, "reason": bare.unwrap_or(reason) });
            print_document(title, document);
        }
        outcome
    }
}

/// Prints a document. Every document has the keys `ok`, `mistakes` and `reason`; those that are missing are added.
pub(super) fn print_document(title: &str, mut document: Value) -> Outcome {
    for (key, usual) in [
        ("ok", json!(true)),
        ("mistakes", json!([])),
        ("reason", json!(null)),
    ] {
        if document.get(key).is_none() {
            document[key] = usual;
        }
    }
    print(title, &format!("{document:#}\n"))
}
