//! The URL of a server.

use std::fmt;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_net::Address;

/// The port of OPC UA.
pub(super) const PORT: u16 = 4840;

const SCHEME: &str = "opc.tcp://";

/// The URL of a server: `opc.tcp://HOST:PORT/PATH`; port (4840) and path are optional.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Url {
    /// Host and port.
    pub address: Address,
    /// The path with its slash; empty for a URL without a path.
    pub path: String,
}

impl FromStr for Url {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        let refuse = |what: String| {
            let right = "write it as \"opc.tcp://192.168.0.1:4840\"";
            Err(Mistake::new(what, right))
        };
        let Some(rest) = text.strip_prefix(SCHEME) else {
            return refuse(format!(
                "the url \"{}\" does not begin with \"{SCHEME}\"",
                shown(text)
            ));
        };
        let (host, path) = rest.find('/').map_or((rest, ""), |at| rest.split_at(at));
        let odd = |c: char| c.is_whitespace() || c.is_control() || "?#\"<>".contains(c);
        if path.contains(odd) {
            return refuse(format!("the url \"{}\" has an odd path", shown(text)));
        }
        // In a bare IPv6 address the last colon does not precede a port.
        let has_port = host
            .rsplit_once(':')
            .is_some_and(|(_, after)| !after.contains(']'));
        let address: Address = if has_port {
            host.parse()?
        } else {
            format!("{host}:{PORT}").parse()?
        };
        if address.port == 0 {
            return refuse(format!("the url \"{}\" has port 0", shown(text)));
        }
        Ok(Self {
            address,
            path: path.to_owned(),
        })
    }
}

impl fmt::Display for Url {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{SCHEME}{}{}", self.address, self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_read_and_write_themselves() {
        for (text, written) in [
            ("opc.tcp://192.168.0.1:4841", "opc.tcp://192.168.0.1:4841"),
            ("opc.tcp://192.168.0.1", "opc.tcp://192.168.0.1:4840"),
            ("opc.tcp://plc-7/a/b", "opc.tcp://plc-7:4840/a/b"),
            ("opc.tcp://[::1]", "opc.tcp://[::1]:4840"),
            ("opc.tcp://[::1]:7/", "opc.tcp://[::1]:7/"),
        ] {
            let url: Url = text.parse().unwrap_or_else(|why| panic!("{why}"));
            assert_eq!(url.to_string(), written);
        }
    }

    #[test]
    fn what_is_no_url_is_told_why() {
        for (text, part) in [
            ("192.168.0.1:4840", "does not begin with"),
            ("http://192.168.0.1:4840", "does not begin with"),
            ("opc.tcp://", "no host"),
            ("opc.tcp://host:0", "port 0"),
            ("opc.tcp://host:x", "no port"),
            ("opc.tcp://::1", "colons in its host"),
            ("opc.tcp://host/a b", "odd path"),
        ] {
            let told = text.parse::<Url>().expect_err(text).to_string();
            assert!(told.contains(part), "\"{part}\" in {told}");
        }
    }
}
