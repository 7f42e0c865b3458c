//! Reads the text with the CONNECT lines of a controller.

use std::path::Path;

use tickbus_base::toml_text::{Collector, Mistakes, load_text};
use tickbus_dispatcher::grammar::{self, Line};
use tickbus_dispatcher::{Cable, Counts};

/// Reads the connections of a client with these channels. Empty lines and lines that begin with `#` are ignored.
pub(super) fn load(path: &Path, counts: Counts) -> Result<Vec<Cable>, Mistakes> {
    parse(&path.display().to_string(), &load_text(path)?, counts)
}

fn parse(file: &str, text: &str, counts: Counts) -> Result<Vec<Cable>, Mistakes> {
    const RIGHT: &str = "write lines such as CONNECT I1:NAME:Q2";

    let collector = Collector::new(file, text);
    let mut cables = Vec::new();
    let mut at = 0;
    for whole in text.split_inclusive('\n') {
        let line = whole.trim_end();
        let place = at + line.len() - line.trim_start().len();
        at += whole.len();
        if line.trim_start().starts_with('#') {
            continue;
        }
        let joints = match grammar::parse(line.as_bytes()) {
            Ok(Line::Nothing) => continue,
            Ok(Line::Connect(joints)) => joints,
            Ok(_) => {
                collector.report(place, "this connects nothing", RIGHT);
                continue;
            }
            Err(refusal) => {
                collector.report(place, refusal.text, RIGHT);
                continue;
            }
        };
        for joint in joints {
            match joint {
                Ok(joint) => {
                    let cable = format!("{}:{}:{}", joint.own, joint.peer, joint.channel);
                    let cable =
                        Cable::parse(&cable).and_then(|cable| cable.check(counts).map(|()| cable));
                    match cable {
                        Ok(cable) => cables.push(cable),
                        Err(mistake) => collector.collect(place, mistake),
                    }
                }
                Err(refusal) => collector.report(place, refusal.text, RIGHT),
            }
        }
    }
    match collector.finish() {
        Some(mistakes) => Err(mistakes),
        None => Ok(cables),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNTS: Counts = Counts::new(4, 8, 2, 2);

    #[test]
    fn connections_are_read_in_their_order() {
        let text = "# The house.\n\nCONNECT I1:HOUSE:Q1 I2 :HOUSE:Q2\r\n  connect aq1:P1:ai2";
        let cables = parse("lab.patch", text, COUNTS).expect("it is right");
        let shown: Vec<_> = cables.iter().map(ToString::to_string).collect();
        assert_eq!(shown, ["I1:HOUSE:Q1", "I2:HOUSE:Q2", "AQ1:P1:AI2"]);
    }

    #[test]
    fn mistakes_are_told_at_their_line() {
        let text = "CONNECT I9:HOUSE:Q1\n CONECT I1:HOUSE:Q1\nCONNECT\nP Q1=5\nCONNECT I1:HOUSE:I1\nCONNECT I1:HOUSE";
        let told = parse("lab.patch", text, COUNTS).expect_err("it is wrong");
        let told = told.to_string();
        let expected = [
            "lab.patch:1:1: this client has no I9",
            "lab.patch:2:2: \"CONECT\" is no keyword",
            "lab.patch:3:1: say what, such as I1:NAME:Q2",
            "lab.patch:4:1: this connects nothing",
            "lab.patch:5:1: I1 and I1 cannot be connected",
            "lab.patch:6:1: ",
        ];
        assert_eq!(told.lines().count(), expected.len(), "{told}");
        for (line, expected) in told.lines().zip(expected) {
            assert!(line.starts_with(expected), "{line}");
        }
    }
}
