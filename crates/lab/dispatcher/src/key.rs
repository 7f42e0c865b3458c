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
        Self::parse(text.trim()).map_err(of_file)
    }

    /// The line that states the key, without its end.
    pub fn line(&self) -> String {
        format!("KEY {}", self.0)
    }

    /// True if a client that has stated `said` knows the key.
    pub(crate) fn is(&self, said: &[u8]) -> bool {
        is_same_secret(said, self.0.as_bytes())
    }
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
        std::fs::write(&file, "0123456789abcdef\n0123456789abcdef\n").expect("a file");
        assert!(Key::load(&file).is_err());
    }
}
