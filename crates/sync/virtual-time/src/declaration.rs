//! The declaration of a client before the run.

use std::collections::HashSet;
use std::num::NonZeroU32;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{DataType, Slot};

use crate::step::{Step, step_at};

/// The longest name of a client or variable, in bytes of UTF-8.
pub(crate) const LONGEST_NAME: usize = 255;

/// The most variables that one client may write, and the most that it may read.
pub(crate) const MOST_VARIABLES: usize = 65_535;

/// The declaration that a client sends to the server before the run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Declaration {
    /// The name, unique among the clients: 1 to 255 bytes. Clients are ordered by name.
    pub name: String,
    /// How many steps of the server one step of this client takes.
    pub multiple: NonZeroU32,
    /// The virtual time of one step of this client, in place of the multiple: it runs in the first step at or after each
    /// whole multiple of this time. At least one step of the server.
    pub interval: Option<Nanos>,
    /// The variables that the client writes, at most 65535. No other client writes them.
    pub writes: Vec<Variable>,
    /// The names of the variables that the client reads, at most 65535; may include its own.
    pub reads: Vec<String>,
}

/// A variable that all clients may read and one writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// The name, unique among the variables of the run: 1 to 255 bytes.
    pub name: String,
    /// The type of its values.
    pub data_type: DataType,
}

impl Variable {
    /// A variable of this name and type.
    pub fn new(name: impl Into<String>, data_type: DataType) -> Self {
        let name = name.into();
        Self { name, data_type }
    }
}

impl Declaration {
    /// A client of this name that runs at every step, without any variables so far.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            multiple: NonZeroU32::MIN,
            interval: None,
            writes: Vec::new(),
            reads: Vec::new(),
        }
    }

    /// Replaces an interval that is a whole number of steps of `step` by the multiple; another one stays.
    ///
    /// # Errors
    ///
    /// The interval is shorter than a step.
    pub(crate) fn fit(&mut self, step: Nanos) -> Result<(), String> {
        let Some(interval) = self.interval else {
            return Ok(());
        };
        if interval < step {
            return Err(format!(
                "its step of {interval} is shorter than the server's, {step}, in which a client runs once at most; \
                 make the server's step shorter"
            ));
        }
        let multiple = u32::try_from(interval.0 / step.0).ok();
        let multiple = multiple.and_then(NonZeroU32::new);
        if let Some(multiple) = multiple.filter(|_| interval.0 % step.0 == 0) {
            (self.multiple, self.interval) = (multiple, None);
        } else {
            self.multiple = NonZeroU32::MIN;
        }
        Ok(())
    }

    /// The step in which the client runs next after `step`, if it does not ask for another one; the server's steps take
    /// `length`.
    pub(crate) fn next_after(&self, step: Step, length: Nanos) -> u64 {
        let Some(interval) = self.interval else {
            return step.sequence + u64::from(self.multiple.get());
        };
        // From the multiples of the interval, so that rounding up to a step does not add up.
        let next = (step.time.0 / interval.0 + 1).saturating_mul(interval.0);
        step_at(Nanos(next), length)
    }

    /// The first difference to another declaration of the same client, as text for people.
    pub(crate) fn difference(&self, other: &Self) -> Option<String> {
        if self.multiple != other.multiple {
            let (own, other) = (self.multiple, other.multiple);
            return Some(format!("its multiple was {own}, and is {other}"));
        }
        if self.interval != other.interval {
            let [own, other] = [self, other].map(|one| match one.interval {
                Some(interval) => interval.to_string(),
                None => "a whole number of the server's steps".to_owned(),
            });
            return Some(format!("its interval was {own}, and is {other}"));
        }
        let writes = |one: &Self| -> Vec<String> {
            let writes = one.writes.iter();
            writes
                .map(|variable| format!("\"{}\" ({})", variable.name, variable.data_type))
                .collect()
        };
        let reads = |one: &Self| -> Vec<String> {
            one.reads.iter().map(|name| format!("\"{name}\"")).collect()
        };
        let lists = [
            ("writes", writes(self), writes(other)),
            ("reads", reads(self), reads(other)),
        ];
        lists.into_iter().find_map(|(what, own, other)| {
            let at = (0..own.len().max(other.len())).find(|at| own.get(*at) != other.get(*at))?;
            let shown = |of: &[String]| of.get(at).cloned().unwrap_or_else(|| "nothing".to_owned());
            let number = at + 1;
            Some(format!(
                "number {number} of what it {what} was {}, and is {}",
                shown(&own),
                shown(&other)
            ))
        })
    }

    /// Checks everything that does not depend on other clients.
    ///
    /// # Errors
    ///
    /// A name is not allowed, a variable is written or read twice, or there are too many of them.
    pub fn check(&self) -> Result<(), Mistake> {
        check_name("client", &self.name)?;
        let writes = self.writes.iter().map(|variable| &variable.name);
        check_all("writes", &self.name, writes)?;
        check_all("reads", &self.name, self.reads.iter())
    }
}

fn check_all<'a>(
    does: &str,
    client: &str,
    names: impl ExactSizeIterator<Item = &'a String>,
) -> Result<(), Mistake> {
    if names.len() > MOST_VARIABLES {
        return Err(Mistake::new(
            format!("client \"{client}\" {does} {} variables", names.len()),
            format!("at most {MOST_VARIABLES} are possible; split it into several clients"),
        ));
    }
    let mut seen = HashSet::new();
    for name in names {
        check_name("variable", name)?;
        if !seen.insert(name) {
            return Err(Mistake::new(
                format!("client \"{client}\" {does} the variable \"{name}\" twice"),
                "name it once",
            ));
        }
    }
    Ok(())
}

/// Checks the name of a client or variable.
pub(crate) fn check_name(of: &str, name: &str) -> Result<(), Mistake> {
    let refuse = |what: &str| {
        let shown = tickbus_base::toml_text::shown(name);
        let right = format!(
            "a name has 1 to {LONGEST_NAME} bytes, no control characters, and no blanks around it"
        );
        Err(Mistake::new(
            format!("the name \"{shown}\" of a {of} {what}"),
            right,
        ))
    };
    if name.is_empty() {
        return refuse("is empty");
    }
    if name.len() > LONGEST_NAME {
        return refuse("is too long");
    }
    if name.chars().any(char::is_control) {
        return refuse("has a control character in it");
    }
    if name.trim() != name {
        return refuse("has blanks around it");
    }
    Ok(())
}

/// True if `slot` holds a raw value of this type: integers and bit strings extended to 64 bits by sign or zeros, BOOL
/// as 0 or 1, REAL as the 32 bits of its number, LREAL as the 64 bits.
pub const fn is_raw(data_type: DataType, slot: u64) -> bool {
    let unused = 64 - data_type.width().bits();
    if data_type.is_signed() {
        (slot << unused).cast_signed() >> unused == slot.cast_signed()
    } else {
        slot << unused >> unused == slot
    }
}

/// The slot of a simulation with a [raw value](is_raw) of a run: a double, or the 64 bits of an LWORD, LINT or ULINT.
pub fn slot_of(data_type: DataType, raw: u64) -> Slot {
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "32 bits at most"
    )]
    Slot::from_real(match data_type {
        DataType::Lword | DataType::Lint | DataType::Ulint => return Slot::from_unsigned(raw),
        DataType::Real => f32::from_bits(raw as u32).into(),
        DataType::Lreal => f64::from_bits(raw),
        _ if data_type.is_signed() => raw.cast_signed() as f64,
        _ => raw as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slot_holds_what_its_type_can() {
        for (data_type, right, wrong) in [
            (DataType::Bool, vec![0, 1], vec![2, u64::MAX]),
            (DataType::Byte, vec![0, 255], vec![256, u64::MAX]),
            (
                DataType::Sint,
                vec![127, 0_u64.wrapping_sub(128)],
                vec![128, 255],
            ),
            (
                DataType::Dint,
                vec![0x7FFF_FFFF, 0xFFFF_FFFF_8000_0000],
                vec![0x8000_0000],
            ),
            (
                DataType::Real,
                vec![u64::from(1.5_f32.to_bits())],
                vec![1.5_f64.to_bits()],
            ),
            (DataType::Lreal, vec![u64::MAX], vec![]),
            (DataType::Lint, vec![u64::MAX], vec![]),
        ] {
            assert!(right.iter().all(|&slot| is_raw(data_type, slot)));
            assert!(!wrong.iter().any(|&slot| is_raw(data_type, slot)));
        }
    }

    #[test]
    fn names_that_cannot_be_are_refused() {
        let long = "x".repeat(256);
        for (name, part) in [
            ("", "is empty"),
            (" a", "blanks around"),
            ("a\n", "control character"),
            (&*long, "too long"),
        ] {
            let told = Declaration::new(name).check().expect_err(name).to_string();
            assert!(told.contains(part), "{told}");
        }
        let mut twice = Declaration::new("a");
        twice.reads = vec!["x".to_owned(), "x".to_owned()];
        let told = twice.check().expect_err("twice").to_string();
        assert!(told.contains("reads the variable \"x\" twice"), "{told}");
    }
}
