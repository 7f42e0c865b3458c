//! Node ids as written in a driver.cfg.

use std::fmt;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;

/// The remedy where a node id is expected.
const SHAPE: &str = "write one such as \"ns=2;s=Motor.Speed\", \"ns=3;i=1001\" or \
                     \"nsu=http://example.com/plc;s=Motor.Speed\"";

/// The name of a node: its namespace and identifier.
///
/// Written in the notation of OPC UA, `ns=2;s=Motor.Speed`. The namespace is a number, 0 if omitted, or its
/// URI after `nsu=`, which is looked up in the server: numbers may change when a server is extended.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct NodeName {
    /// The namespace.
    pub namespace: Namespace,
    /// The identifier within the namespace.
    pub identifier: Identifier,
}

/// A namespace of a server.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Namespace {
    /// By its index in the server's list.
    Index(u16),
    /// By its URI, which is looked up in the server's list.
    Uri(String),
}

/// The identifier of a node within its namespace.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Identifier {
    /// A string, `s=`; everything up to the end, quotes and semicolons included.
    Text(String),
    /// A number, `i=`.
    Number(u32),
}

impl FromStr for NodeName {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        let refuse = |why: &str, right: &str| {
            let what = format!("the node id \"{}\" {why}", shown(text));
            Err(Mistake::new(what, right))
        };
        let (namespace, rest) = if let Some(rest) = text.strip_prefix("nsu=") {
            match rest.split_once(';') {
                Some((uri, rest)) if !uri.is_empty() => (Namespace::Uri(uri.to_owned()), rest),
                _ => return refuse("has no end of its namespace URI", SHAPE),
            }
        } else if let Some(rest) = text.strip_prefix("ns=") {
            let (digits, rest) = rest.split_once(';').unwrap_or((rest, ""));
            match number(digits) {
                Some(index) => (Namespace::Index(index), rest),
                None => return refuse("has no namespace from 0 to 65535 behind \"ns=\"", SHAPE),
            }
        } else {
            (Namespace::Index(0), text)
        };
        let identifier = match rest.split_at_checked(2) {
            Some(("s=", "")) => return refuse("has an empty name", SHAPE),
            Some(("s=", name)) => Identifier::Text(name.to_owned()),
            Some(("i=", digits)) => match number(digits) {
                Some(number) => Identifier::Number(number),
                None => return refuse("has no number from 0 to 4294967295 behind \"i=\"", SHAPE),
            },
            Some(("g=" | "b=", _)) => {
                return refuse(
                    "is a GUID or a byte string",
                    "tickbus reads texts (\"s=\") and numbers (\"i=\") only",
                );
            }
            _ => return refuse("says neither \"s=\" nor \"i=\"", SHAPE),
        };
        Ok(Self {
            namespace,
            identifier,
        })
    }
}

/// Digits only: `parse` would accept a sign.
fn number<N: FromStr>(digits: &str) -> Option<N> {
    let plain = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    digits.parse().ok().filter(|_| plain)
}

impl fmt::Display for NodeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.namespace {
            Namespace::Index(0) => {}
            Namespace::Index(index) => write!(f, "ns={index};")?,
            Namespace::Uri(uri) => write!(f, "nsu={uri};")?,
        }
        match &self.identifier {
            Identifier::Text(name) => write!(f, "s={name}"),
            Identifier::Number(number) => write!(f, "i={number}"),
        }
    }
}

/// The pattern that makes a signal's node id from its name: `{name}` and `{station}` are replaced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern(pub(super) String);

impl Pattern {
    /// The placeholder for the signal's name.
    pub(super) const NAME: &'static str = "{name}";
    /// The placeholder for its station's name.
    pub(super) const STATION: &'static str = "{station}";

    /// The node of the signal called `name` of the station called `station`.
    ///
    /// # Errors
    ///
    /// The result is not a node id.
    pub fn node(&self, name: &str, station: &str) -> Result<NodeName, Mistake> {
        // In one pass, because a name may contain braces.
        let mut text = String::new();
        let mut rest = &*self.0;
        while let Some(at) = rest.find('{') {
            let (before, from) = rest.split_at(at);
            text.push_str(before);
            let places = [(Self::NAME, name), (Self::STATION, station)];
            let found = places.iter().find(|(place, _)| from.starts_with(place));
            if let Some((place, value)) = found {
                text.push_str(value);
                rest = &from[place.len()..];
            } else {
                text.push('{');
                rest = &from[1..];
            }
        }
        text.push_str(rest);
        text.parse()
    }
}

impl Default for Pattern {
    fn default() -> Self {
        Self("ns=2;s={name}".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_ids_read_and_write_themselves() {
        for text in [
            "ns=2;s=IM1 index",
            "ns=3;s=\"DB1\".\"x;y\"",
            "ns=4;i=4294967295",
            "i=2258",
            "s=plain",
            "nsu=urn:plc:7;s=a;b=c",
            "nsu=http://example.com/UA/;i=7",
        ] {
            let name: NodeName = text.parse().unwrap_or_else(|why| panic!("{why}"));
            assert_eq!(name.to_string(), text);
        }
    }

    #[test]
    fn what_is_no_node_id_is_told_why() {
        for (text, part) in [
            ("", "neither"),
            ("ns=2", "neither"),
            ("ns=;s=x", "no namespace"),
            ("ns=65536;s=x", "no namespace"),
            ("ns=+1;s=x", "no namespace"),
            ("ns=2;s=", "empty name"),
            ("ns=2;x=7", "neither"),
            ("ns=2;i=", "no number"),
            ("ns=2;i=4294967296", "no number"),
            ("ns=2;i=-1", "no number"),
            ("ns=2;g=09087e75-8e5e-499b-954f-f2a9603db28a", "GUID"),
            ("nsu=;s=x", "namespace URI"),
            ("nsu=urn:x", "namespace URI"),
            ("Motor.Speed", "neither"),
            ("ns=2;\u{fc}=x", "neither"),
        ] {
            let told = text.parse::<NodeName>().expect_err(text).to_string();
            assert!(told.contains(part), "\"{part}\" in {told}");
        }
    }

    #[test]
    fn a_pattern_puts_names_in_their_places_and_nothing_into_names() {
        let pattern = Pattern("ns=3;s=\"{station}\".\"{name}\"{".to_owned());
        let node = pattern.node("a{station}b", "DB1").expect("a node id");
        assert_eq!(node.to_string(), "ns=3;s=\"DB1\".\"a{station}b\"{");
    }
}
