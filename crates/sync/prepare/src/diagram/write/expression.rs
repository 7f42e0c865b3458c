//! Expressions of Structured Text, put together from parts.

use crate::code::Code;
use crate::lexer::Kind;

/// How strongly the parts of an expression hold together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Level {
    /// Always on.
    On,
    /// A variable.
    Place,
    /// A literal, a call, or an expression in brackets.
    Primary,
    And,
    Or,
    /// Anything else.
    Other,
}

/// A text and its level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Expression {
    pub(super) text: String,
    pub(super) level: Level,
}

impl Expression {
    /// The value of the power rail.
    pub(super) fn on() -> Self {
        let text = "TRUE".to_owned();
        let level = Level::On;
        Self { text, level }
    }

    pub(super) fn place(text: String) -> Self {
        let level = Level::Place;
        Self { text, level }
    }

    pub(super) fn primary(text: String) -> Self {
        let level = Level::Primary;
        Self { text, level }
    }

    /// An expression as someone wrote it.
    pub(super) fn of_text(text: &str) -> Self {
        let code = Code::new(text);
        let end = code.tokens.len();
        let mut level = match code.kind(0) {
            Some(Kind::Word | Kind::Address) => Level::Place,
            Some(Kind::Literal | Kind::Text) => Level::Primary,
            _ => Level::Other,
        };
        let mut at = 1;
        while at < end && level != Level::Other {
            match code.word(at) {
                "." => at += 2,
                "^" => at += 1,
                "[" => at = code.closing(at, end) + 1,
                "(" => {
                    level = Level::Primary;
                    at = code.closing(at, end) + 1;
                }
                _ => level = Level::Other,
            }
        }
        if matches!(code.capitals(0).as_str(), "TRUE" | "FALSE" | "NOT") && level == Level::Place {
            level = Level::Primary;
        }
        let text = text.to_owned();
        Self { text, level }
    }

    /// The text as a part of another expression: in brackets, unless it holds together better than `level`.
    fn within(self, level: Level) -> String {
        let holds = match self.level {
            Level::On | Level::Place | Level::Primary => true,
            Level::And => level != Level::Primary,
            Level::Or => level == Level::Or,
            Level::Other => false,
        };
        if holds {
            self.text
        } else {
            format!("({})", self.text)
        }
    }

    pub(super) fn negated(self) -> Self {
        let text = format!("NOT ({})", self.text);
        Self::primary(text)
    }

    pub(super) fn and(self, other: Self) -> Self {
        match (self.level, other.level) {
            (Level::On, _) => other,
            (_, Level::On) => self,
            _ => {
                let text = format!(
                    "{} AND {}",
                    self.within(Level::And),
                    other.within(Level::And)
                );
                let level = Level::And;
                Self { text, level }
            }
        }
    }

    pub(super) fn or(self, other: Self) -> Self {
        match (self.level, other.level) {
            (Level::On, _) | (_, Level::On) => Self::on(),
            _ => {
                let text = format!("{} OR {}", self.within(Level::Or), other.within(Level::Or));
                let level = Level::Or;
                Self { text, level }
            }
        }
    }
}
