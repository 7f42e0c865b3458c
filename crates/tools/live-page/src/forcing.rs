//! The ways to force a signal: held, written once, for a time, or along a ramp.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_driver::Force;
use tickbus_fieldbus::faults::{Lasts, SignalEffect};
use tickbus_image::signal::{DataType, Signal, Slot};

use crate::value::parse;

/// The longest time of a pulse or a ramp.
const LONGEST: Nanos = Nanos::from_secs(3600);

/// How a signal is forced to a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// Until it is released.
    Hold,
    /// For one tick.
    Once,
    /// For this long.
    Pulse(Nanos),
    /// From the present value, within this time; held afterwards.
    Ramp(Nanos),
}

impl Way {
    /// The force of the signal with this index; a ramp begins at `from`, or at the value that the signal then has.
    pub(crate) fn force(self, signal: usize, value: Slot, from: Option<Slot>) -> Force {
        let stuck = SignalEffect::Stuck(Some(value));
        let (effect, lasts) = match self {
            Self::Hold => (stuck, Lasts::UntilEnded),
            Self::Once => (stuck, Lasts::Ticks(1)),
            Self::Pulse(time) => (stuck, Lasts::For(time)),
            Self::Ramp(within) => {
                let to = value;
                (SignalEffect::Ramp { from, to, within }, Lasts::UntilEnded)
            }
        };
        Force {
            signal,
            effect,
            lasts,
        }
    }
}

/// Reads `80`, `80 once`, `TRUE for 500ms` or `80 within 10s`.
///
/// # Errors
///
/// Says what would be right.
pub(crate) fn read(text: &str, signal: &Signal) -> Result<(Slot, Way), String> {
    const RIGHT: &str = "write a value alone, or with \"once\", \"for 500ms\" or \"within 10s\"";
    let text = text.trim();
    let (value, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    let rest = rest.trim();
    let (word, time) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
    let way = match word {
        "" => Way::Hold,
        "once" if time.is_empty() => Way::Once,
        "for" => Way::Pulse(span(time)?),
        "within" if signal.data_type == DataType::Bool => {
            let name = shown(&signal.name);
            return Err(format!(
                "\"{name}\" is a BOOL, and has no values in between; hold it, or force it for a time"
            ));
        }
        "within" => Way::Ramp(span(time)?),
        // A value with a blank in it, or a wrong word.
        _ => {
            parse(text, signal)?;
            return Err(format!("\"{}\" is no way to force; {RIGHT}", shown(rest)));
        }
    };
    Ok((parse(value, signal)?, way))
}

/// The time of a pulse or a ramp.
fn span(text: &str) -> Result<Nanos, String> {
    const RIGHT: &str = "write a time above 0 and up to 1h, such as 500ms or 10s";
    match text.parse::<Nanos>() {
        Ok(time) if time > Nanos::ZERO && time <= LONGEST => Ok(time),
        Ok(time) => Err(format!("{time} is no time for this; {RIGHT}")),
        Err(Mistake { what, .. }) => Err(format!("\"{}\" is {what}; {RIGHT}", shown(text))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::Area;

    #[test]
    fn every_way_is_read_and_what_is_none_is_refused() {
        let signal = |data_type| Signal::new("s", Area::Input, 0, data_type);
        let real = |text| read(text, &signal(DataType::Real)).map(|(slot, way)| (slot.real(), way));
        let span = Nanos::from_millis;
        for (text, right) in [
            ("80", (80.0, Way::Hold)),
            (" 80  once ", (80.0, Way::Once)),
            ("-1.5 for 500ms", (-1.5, Way::Pulse(span(500)))),
            ("80 within 10 s", (80.0, Way::Ramp(span(10_000)))),
        ] {
            assert_eq!(real(text), Ok(right), "{text}");
        }
        let bit = |text| read(text, &signal(DataType::Bool)).map(|(slot, way)| (slot.real(), way));
        assert_eq!(bit("TRUE for 1s"), Ok((1.0, Way::Pulse(span(1000)))));
        for (text, told) in [
            ("80 for 0s", "is no time for this; write a time above 0"),
            ("80 within 2h", "write a time above 0 and up to 1h"),
            ("80 for", "write a time above 0"),
            ("80 for 5", "write a time above 0"),
            ("80 twice", "80 twice does not fit \"s\""),
            ("x once", "x does not fit \"s\"; it takes a number"),
            ("", "there is no value for \"s\""),
        ] {
            let why = real(text).expect_err(text);
            assert!(why.contains(told), "{text}: {why}");
        }
        let why = bit("TRUE within 1s").expect_err("no ramp");
        assert!(
            why.contains("a BOOL, and has no values in between"),
            "{why}"
        );
        let why = bit("2 for 1s").expect_err("no value");
        assert!(why.contains("a BOOL takes TRUE or FALSE"), "{why}");
    }
}
