//! Status codes from the table `status.tsv`: build.rs generates the enum, and a Java test compares Java's own.

include!(concat!(env!("OUT_DIR"), "/status.rs"));

impl Code {
    /// Returns the number that Java uses for this code.
    pub const fn code(self) -> i32 {
        self as i32
    }

    /// Returns the worse of two codes: an error over stale, stale over unchanged, unchanged over fresh.
    #[must_use]
    pub fn worse(self, other: Self) -> Self {
        let rank = |code: Self| {
            if code.code() < 0 {
                i32::MAX
            } else {
                code.code()
            }
        };
        if rank(other) > rank(self) {
            other
        } else {
            self
        }
    }
}

/// Writes `STALE (2): nothing has come …`.
impl std::fmt::Display for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}): {}", self.name(), self.code(), self.text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_have_a_text_and_a_remedy() {
        for code in Code::ALL {
            assert!(
                !code.text().is_empty() && !code.remedy().is_empty(),
                "{code}"
            );
        }
    }

    #[test]
    fn done_is_zero_and_above() {
        let done: Vec<&str> = Code::ALL
            .into_iter()
            .filter(|code| code.code() >= 0)
            .map(Code::name)
            .collect();
        assert_eq!(done, ["FRESH", "UNCHANGED", "STALE"]);
    }
}
