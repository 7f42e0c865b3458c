//! A recorded session of a foreign client with one of our servers, as a text file: tests/sessions/README.md describes
//! the format.

use std::fmt;
use std::str::FromStr;

use super::pcap::From;

/// A session.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// Name and version of the client.
    pub client: String,
    /// The driver.cfg of the server.
    pub config: String,
    /// The events, in order.
    pub steps: Vec<Step>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// The simulation sets a signal.
    Set(String, f64),
    /// The simulation sees a signal of the PLC.
    Sees(String, f64),
    /// Data sent on a connection; `None` is a byte that differs from time to time.
    Said(usize, From, Vec<Option<u8>>),
    /// The client leaves.
    Leaves(usize),
}

const HEAD: &str = "tickbus session 1";
const CLIENT: &str = "client: ";
const CONFIG: &str = "--- driver.cfg";
const STEPS: &str = "--- steps";

impl fmt::Display for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{HEAD}\n{CLIENT}{}\n{CONFIG}", self.client)?;
        writeln!(f, "{}\n{STEPS}", self.config.trim_end())?;
        for step in &self.steps {
            writeln!(f, "{step}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Set(name, value) => write!(f, "set {value} {name}"),
            Self::Sees(name, value) => write!(f, "sees {value} {name}"),
            Self::Leaves(connection) => write!(f, "{connection} leaves"),
            Self::Said(connection, from, bytes) => {
                let sign = if *from == From::Client { '>' } else { '<' };
                write!(f, "{connection} {sign} {}", Hex(bytes))
            }
        }
    }
}

/// Bytes in hexadecimal; `..` for one that differs from time to time.
pub struct Hex<'a>(pub &'a [Option<u8>]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| match byte {
            Some(byte) => write!(f, "{byte:02x}"),
            None => f.write_str(".."),
        })
    }
}

impl FromStr for Session {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut lines = text.lines();
        if lines.next() != Some(HEAD) {
            return Err(format!("line 1 is not \"{HEAD}\""));
        }
        let client = lines.next().and_then(|line| line.strip_prefix(CLIENT));
        let client = client.ok_or("line 2 does not name the client")?.to_owned();
        if lines.next() != Some(CONFIG) {
            return Err(format!("line 3 is not \"{CONFIG}\""));
        }
        let mut config = String::new();
        for line in lines.by_ref().take_while(|line| *line != STEPS) {
            config += line;
            config.push('\n');
        }
        let steps = lines.map(|line| step(line).ok_or_else(|| format!("\"{line}\" is no step")));
        Ok(Self {
            client,
            config,
            steps: steps.collect::<Result<_, _>>()?,
        })
    }
}

fn step(line: &str) -> Option<Step> {
    let (head, rest) = line.split_once(' ')?;
    if let "set" | "sees" = head {
        let (value, name) = rest.split_once(' ')?;
        let (value, name) = (value.parse().ok()?, name.to_owned());
        return Some(if head == "set" {
            Step::Set(name, value)
        } else {
            Step::Sees(name, value)
        });
    }
    let connection = head.parse().ok()?;
    if rest == "leaves" {
        return Some(Step::Leaves(connection));
    }
    let (sign, digits) = rest.split_once(' ')?;
    let from = match sign {
        ">" => From::Client,
        "<" => From::Server,
        _ => return None,
    };
    let pairs = digits.as_bytes().chunks(2);
    let bytes = pairs.map(|pair| match pair {
        b".." => Some(None),
        pair => u8::from_str_radix(str::from_utf8(pair).ok()?, 16)
            .ok()
            .map(Some),
    });
    let bytes = bytes.collect::<Option<Vec<_>>>()?;
    Some(Step::Said(connection, from, bytes))
}
