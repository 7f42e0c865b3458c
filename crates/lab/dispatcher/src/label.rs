//! Labels of channels.

use std::fmt;

/// The longest label of a channel, in characters: that of a signal in a driver.cfg.
pub const LONGEST_LABEL: usize = 120;

/// The label of a channel, such as "Level": 1 to 120 characters in one line.
#[derive(Clone, PartialEq, Eq)]
pub struct Label(Box<str>);

impl Label {
    /// The label in a line of a client; blanks at its ends do not count. `None` if it is empty, too long, not UTF-8, or has a
    /// control character.
    pub(crate) fn read(text: &[u8]) -> Option<Self> {
        let text = std::str::from_utf8(text).ok()?.trim();
        let is_right = (1..=LONGEST_LABEL).contains(&text.chars().count());
        (is_right && !text.contains(is_unfit)).then(|| Self(text.into()))
    }

    /// The label `text`; blanks at its ends do not count. `None` if that is no label.
    pub fn read_text(text: &str) -> Option<Self> {
        Self::read(text.as_bytes())
    }

    /// The label that shows `name`, shortened if necessary, with blanks for control characters. `None` if nothing is left.
    pub fn of(name: &str) -> Option<Self> {
        let text: String = name
            .replace(is_unfit, " ")
            .trim()
            .chars()
            .take(LONGEST_LABEL)
            .collect();
        Self::read(text.as_bytes())
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// True for characters that could change how a terminal or a page shows the text around them.
fn is_unfit(sign: char) -> bool {
    sign.is_control()
        || matches!(sign, '\u{2028}' | '\u{2029}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

impl fmt::Debug for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.0, f)
    }
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_one_short_line_that_can_be_shown() {
        let read = |text: &str| Label::read(text.as_bytes()).map(|label| label.to_string());
        assert_eq!(
            read("  Level of \"tank\" = 1: ä\t"),
            Some("Level of \"tank\" = 1: ä".to_owned())
        );
        assert!(read(&"ä".repeat(120)).is_some());
        for wrong in [
            "",
            "  ",
            "a\tb",
            "a\u{1b}[2J",
            "a\u{202e}b",
            &"ä".repeat(121),
        ] {
            assert_eq!(read(wrong), None, "{wrong:?}");
        }
        assert_eq!(Label::read(b"\xff"), None);
        let made = |text: &str| Label::of(text).map(|label| label.to_string());
        assert_eq!(made("a\n\u{202e}b "), Some("a  b".to_owned()));
        assert_eq!(made(&"x".repeat(500)), Some("x".repeat(120)));
        assert_eq!(made("\n"), None);
    }
}
