//! Unix sockets, as written in a driver.cfg and on a command line.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;

/// The longest path of a socket that all systems accept, in bytes.
const LONGEST: usize = 103;

/// The longest name, in characters.
const LONGEST_NAME: usize = 40;

/// The path of a Unix socket: `unix:/run/user/1000/cell`, or `unix:cell` for a socket of this name in the folder for
/// temporary files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LocalAddress(PathBuf);

impl LocalAddress {
    /// The text before a path or a name.
    pub const PREFIX: &str = "unix:";

    /// The path.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl FromStr for LocalAddress {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        const RIGHT: &str = "write a full path, such as \"unix:/run/user/1000/cell\", or a name of at most 40 letters, \
                             digits, hyphens and underscores, such as \"unix:cell\"";
        let refuse = |what: &str| {
            let what = format!("the address \"{}\" {what}", shown(text));
            Err(Mistake::new(what, RIGHT))
        };
        let Some(place) = text.strip_prefix(Self::PREFIX) else {
            return refuse("is no Unix socket");
        };
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        let path = if place.starts_with('/') {
            PathBuf::from(place)
        } else if (1..=LONGEST_NAME).contains(&place.len()) && place.chars().all(is_plain) {
            std::env::temp_dir().join(format!("tickbus-{place}.socket"))
        } else {
            return refuse("has neither a full path nor a name behind \"unix:\"");
        };
        let is_odd = |text: &str| text.ends_with('/') || text.contains(char::is_control);
        if path.to_str().is_none_or(is_odd) {
            return refuse("has a path that no socket can have");
        }
        match path.as_os_str().len() {
            ..=LONGEST => Ok(Self(path)),
            long => refuse(&format!(
                "has a path of {long} bytes, and systems accept {LONGEST} for a socket"
            )),
        }
    }
}

impl fmt::Display for LocalAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", Self::PREFIX, self.0.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_stays_and_a_name_is_in_the_folder_for_temporary_files() {
        let path: LocalAddress = "unix:/run/cell".parse().expect("a path");
        assert_eq!(path.path(), Path::new("/run/cell"));
        assert_eq!(path.to_string(), "unix:/run/cell");
        let named: LocalAddress = "unix:cell-7_a".parse().expect("a name");
        assert!(named.path().ends_with("tickbus-cell-7_a.socket"));
        #[cfg(unix)]
        assert_eq!(named.to_string().parse(), Ok(named));
    }

    #[test]
    fn what_is_no_socket_is_told_why() {
        let long = format!("unix:/{}", "x".repeat(103));
        for (text, part) in [
            ("127.0.0.1:7", "is no Unix socket"),
            ("unix:", "neither a full path nor a name"),
            ("unix:a/b", "neither a full path nor a name"),
            ("unix:../x", "neither a full path nor a name"),
            ("unix:a b", "neither a full path nor a name"),
            ("unix:/run/", "no socket can have"),
            ("unix:/a\0b", "no socket can have"),
            (&*long, "a path of 104 bytes, and systems accept 103"),
        ] {
            let told = text.parse::<LocalAddress>().expect_err(text).to_string();
            assert!(told.contains(part), "\"{part}\" in {told}");
        }
    }
}
