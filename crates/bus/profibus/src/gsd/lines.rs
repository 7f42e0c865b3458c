//! The lines of a GSD file, and their contents.

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;

use super::GsdError;

/// A line and its continuation lines, without comments.
pub(super) struct Line {
    pub(super) number: usize,
    text: String,
}

/// The lines after `#Profibus_DP`, and the number of the last line of the file.
///
/// A backslash at the end of a line continues it; a semicolon outside quotes begins a comment.
pub(super) fn lines(text: &str) -> Result<(Vec<Line>, usize), GsdError> {
    let mut all: Vec<Line> = Vec::new();
    let (mut has_begun, mut continues, mut in_quotes, mut last) = (false, false, false, 1);
    for (number, raw) in (1..).zip(text.lines()) {
        last = number;
        in_quotes &= continues;
        let end = raw.find(|c| {
            in_quotes ^= c == '"';
            c == ';' && !in_quotes
        });
        let line = raw[..end.unwrap_or(raw.len())].trim();
        if !has_begun {
            has_begun = line.eq_ignore_ascii_case("#profibus_dp");
            in_quotes = false;
            continue;
        }
        let (line, goes_on) = match line.strip_suffix('\\') {
            Some(line) => (line, true),
            None => (line, false),
        };
        match all.last_mut() {
            Some(last) if continues => last.text.push_str(line),
            _ if line.is_empty() && !goes_on => {}
            _ => all.push(Line {
                number,
                text: line.to_owned(),
            }),
        }
        continues = goes_on;
    }
    if !has_begun {
        return Err(wrong(
            1,
            "there is no line \"#Profibus_DP\"",
            "take the GSD file of a DP slave, which begins so",
        ));
    }
    Ok((all, last))
}

pub(super) fn wrong(line: usize, what: impl Into<String>, right: impl Into<String>) -> GsdError {
    let mistake = Mistake::new(what, right);
    GsdError { line, mistake }
}

impl Line {
    /// The keyword in lower case, its index in brackets, and the values after `=`. A line without `=` is just a
    /// keyword.
    pub(super) fn setting(&self) -> (String, Option<Values<'_>>, Values<'_>) {
        let (key, value) = match self.text.split_once('=') {
            Some((key, value)) if !key.contains('"') => (key, value),
            _ => (&*self.text, ""),
        };
        let (key, index) = match key.split_once('(') {
            Some((key, rest)) => (key, Some(rest.split(')').next().unwrap_or_default())),
            None => (key, None),
        };
        let values = |rest| Values {
            line: self.number,
            rest,
        };
        let key = key.trim().to_ascii_lowercase();
        (key, index.map(values), values(value))
    }

    /// The values of a line that is no setting.
    pub(super) fn values(&self) -> Values<'_> {
        Values {
            line: self.number,
            rest: &self.text,
        }
    }
}

/// The numbers and texts of a line, one after the other.
#[derive(Clone, Copy)]
pub(super) struct Values<'t> {
    pub(super) line: usize,
    rest: &'t str,
}

impl<'t> Values<'t> {
    pub(super) fn wrong(&self, what: impl Into<String>, right: impl Into<String>) -> GsdError {
        wrong(self.line, what, right)
    }

    /// True if nothing is left.
    pub(super) fn is_empty(&self) -> bool {
        self.rest.trim_start().is_empty()
    }

    /// Takes `sign` if it is next.
    pub(super) fn eat(&mut self, sign: char) -> bool {
        let behind = self.rest.trim_start().strip_prefix(sign);
        self.rest = behind.unwrap_or(self.rest);
        behind.is_some()
    }

    /// Takes letters and digits.
    pub(super) fn word(&mut self) -> &'t str {
        let rest = self.rest.trim_start();
        let end = rest.find(|c: char| !c.is_ascii_alphanumeric());
        let (word, behind) = rest.split_at(end.unwrap_or(rest.len()));
        self.rest = behind;
        word
    }

    /// Takes a number, decimal or hexadecimal, with an optional sign.
    pub(super) fn number(&mut self) -> Result<i64, GsdError> {
        let before = *self;
        let sign = if self.eat('-') { "-" } else { "" };
        let digits = self.word();
        let hex = digits
            .strip_prefix("0x")
            .or_else(|| digits.strip_prefix("0X"));
        let read = match hex {
            Some(hex) => i64::from_str_radix(&format!("{sign}{hex}"), 16),
            None => format!("{sign}{digits}").parse(),
        };
        read.map_err(|_| {
            let what = if before.is_empty() {
                "the line ends too early".to_owned()
            } else {
                format!("\"{}\" is no number", shown(before.rest.trim()))
            };
            self.wrong(what, "write a number there, such as 12 or 0x0C")
        })
    }

    /// Takes a number from 0 to `most`.
    pub(super) fn up_to(&mut self, most: u32) -> Result<u32, GsdError> {
        let number = self.number()?;
        let fitting = u32::try_from(number).ok().filter(|number| *number <= most);
        fitting.ok_or_else(|| {
            self.wrong(
                format!("{number} is out of range"),
                format!("write 0 to {most}"),
            )
        })
    }

    /// Takes an octet.
    pub(super) fn octet(&mut self) -> Result<u8, GsdError> {
        let octet = self.up_to(0xFF)?;
        Ok(u8::try_from(octet).expect("it is at most 255"))
    }

    /// Takes octets to the end of the line.
    pub(super) fn octets(&mut self) -> Result<Vec<u8>, GsdError> {
        let mut octets = Vec::new();
        while !self.is_empty() {
            octets.push(self.octet()?);
            self.eat(',');
        }
        Ok(octets)
    }

    /// Takes text in quotes.
    pub(super) fn quoted(&mut self) -> Result<String, GsdError> {
        let inner = self.rest.trim_start().strip_prefix('"');
        let parts = inner.and_then(|inner| inner.split_once('"'));
        let (text, behind) = parts.ok_or_else(|| {
            self.wrong("there is no text in quotes", "write it, \"such as this\"")
        })?;
        self.rest = behind;
        Ok(text.trim().to_owned())
    }

    /// Checks that nothing is left.
    pub(super) fn end(self) -> Result<(), GsdError> {
        if self.is_empty() {
            return Ok(());
        }
        let what = format!("\"{}\" is too much here", shown(self.rest.trim()));
        Err(self.wrong(what, "remove it"))
    }
}
