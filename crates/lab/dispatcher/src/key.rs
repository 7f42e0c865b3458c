//! The key of a laboratory.

use std::fmt;
use std::path::Path;

use tickbus_base::toml_text::load_text;
use tickbus_base::{Mistake, is_same_secret};

/// The shortest and the longest key, in characters.
const LENGTH: std::ops::RangeInclusive<usize> = 16..=128;

/// The key that every client of a laboratory states in its first line: `KEY <key>`.
///
/// It is 16 to 128 characters of ASCII without blanks. Neither `Debug` nor a message shows it.
#[derive(Clone)]
pub struct Key(String);

impl Key {
    /// The key `text`.
    ///
    /// # Errors
    ///
    /// It is too short, too long, or has other characters.
    pub fn parse(text: &str) -> Result<Self, Mistake> {
        let (least, most) = LENGTH.into_inner();
        let right = format!(
            "take {least} to {most} letters, digits and signs, such as those of `openssl rand -hex 16`"
        );
        if !text.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(Mistake::new(
                "the key has a blank or a character that is not ASCII",
                right,
            ));
        }
        if !LENGTH.contains(&text.len()) {
            return Err(Mistake::new(
                format!("the key has {} characters", text.len()),
                right,
            ));
        }
        Ok(Self(text.to_owned()))
    }

    /// The key in the file at `path`: its only line.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or its text is no key.
    pub fn load(path: &Path) -> Result<Self, Mistake> {
        let of_file = |mistake: Mistake| {
            let what = format!("the key in {}: {}", path.display(), mistake.what);
            Mistake::new(what, mistake.right)
        };
        let text = load_text(path).map_err(|mistakes| {
            let first = mistakes.iter().next();
            let what = first.map_or("it cannot be read", |first| &*first.mistake.what);
            let right = first.map_or("check the path", |first| &*first.mistake.right);
            of_file(Mistake::new(what, right))
        })?;
        // Some editors begin a file with a byte-order mark.
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        Self::parse(text.trim()).map_err(of_file)
    }

    /// The line that states the key, without its end.
    pub fn line(&self) -> String {
        format!("KEY {}", self.0)
    }

    /// Reads the line that answers a key, without its end.
    ///
    /// # Errors
    ///
    /// The key was not accepted, or the line is not from a dispatcher.
    pub fn answered(line: &[u8]) -> Result<(), KeyRefused> {
        if line == b"OK KEY" {
            return Ok(());
        }
        let code = line.strip_prefix(b"ERR ").and_then(|rest| rest.get(..3));
        let code = code.and_then(|code| std::str::from_utf8(code).ok());
        Err(match code.and_then(|code| code.parse().ok()) {
            Some(403) => KeyRefused::Wrong,
            Some(429) => KeyRefused::Later,
            Some(code) => KeyRefused::Otherwise(code),
            None => KeyRefused::NoDispatcher,
        })
    }

    /// True if a client that has stated `said` knows the key.
    pub(crate) fn is(&self, said: &[u8]) -> bool {
        is_same_secret(said, self.0.as_bytes())
    }
}

/// Why a key was not accepted. The texts repeat nothing of the answer: a service that returns what it gets, or complains
/// about it, would put the key into logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyRefused {
    /// The key is wrong.
    #[error("ERR 403 the key is wrong; ask the operator of the laboratory for it")]
    Wrong,
    /// Keys of this address are not looked at for a moment, or the dispatcher is full.
    #[error("ERR 429 a wrong key came from this address just now, or the dispatcher is full")]
    Later,
    /// The dispatcher refused the line with this code.
    #[error("ERR {0} the key was not accepted")]
    Otherwise(u16),
    /// The answer is not that of a dispatcher.
    #[error(
        "ERR 503 what listens there does not answer the key as a dispatcher does; check the address of the dispatcher"
    )]
    NoDispatcher,
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.is(other.0.as_bytes())
    }
}

impl Eq for Key {}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(..)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_a_line_without_blanks_and_is_never_shown() {
        let right = "0123456789abcdef";
        let key = Key::parse(right).expect("a key");
        assert!(key.is(right.as_bytes()) && !key.is(b"0123456789abcdeF"));
        assert_eq!(format!("{key:?}"), "Key(..)");
        assert_eq!(key.line(), "KEY 0123456789abcdef");
        for wrong in [
            "",
            "short",
            "0123456789 abcdef",
            "0123456789abcdé01",
            &"x".repeat(129),
        ] {
            let mistake = Key::parse(wrong).expect_err(wrong);
            assert!(mistake.right.contains("16 to 128"), "{mistake}");
            assert!(wrong.is_empty() || !mistake.to_string().contains(wrong));
        }
    }

    #[test]
    fn a_key_is_read_from_the_only_line_of_its_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("lab.key");
        let missing = Key::load(&file).expect_err("it is missing");
        assert!(
            missing.what.contains("lab.key: there is no such file"),
            "{missing}"
        );
        std::fs::write(&file, "0123456789abcdef\r\n").expect("a file");
        assert!(Key::load(&file).expect("a key").is(b"0123456789abcdef"));
        std::fs::write(&file, "\u{feff}0123456789abcdef\n").expect("a file");
        assert!(Key::load(&file).expect("a key").is(b"0123456789abcdef"));
        std::fs::write(&file, "0123456789abcdef\n0123456789abcdef\n").expect("a file");
        assert!(Key::load(&file).is_err());
    }
}
