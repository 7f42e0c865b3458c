//! The signals in a drive's parameters, and parameters with fixed values.

use std::collections::BTreeMap;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{Address, Addressing, Area, Signal};

use crate::acyclic::{ELEMENT_LIMIT, Format, Parameter};
use crate::layout::{Move, Place, format_of};
use crate::records::RecordLayout;

/// A parameter as in `parameters` of a station: `945 Unsigned16 = 1355 0 0`, or `2053 Unsigned16 = %IW0 %IW2`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FixedParameter {
    parameter: Parameter,
    /// The elements that are words of the image, which masters only read.
    seen: Vec<(usize, Address)>,
}

impl FromStr for FixedParameter {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        let [number, name, "=", ref values @ ..] = words[..] else {
            return Err(Mistake::new(
                format!("\"{}\" is no parameter", shown(text)),
                "write the number, the format and the values, such as \"945 Unsigned16 = 1355 0 0\"",
            ));
        };
        let number = number.parse().ok().filter(|number| *number > 0);
        let number = number.ok_or_else(|| {
            Mistake::new(
                format!("\"{}\" is no number of a parameter", shown(words[0])),
                "write 1 to 65535",
            )
        })?;
        let mut all = Format::ALL.iter();
        let format = all.find(|(own, _)| own.eq_ignore_ascii_case(name));
        let (_, format) = *format.ok_or_else(|| {
            let names = Format::ALL.map(|(name, _)| name).join(", ");
            Mistake::new(
                format!("\"{}\" is no format of a parameter", shown(name)),
                format!("the formats are {names}"),
            )
        })?;
        if !(1..=ELEMENT_LIMIT).contains(&values.len()) {
            return Err(Mistake::new(
                format!("the parameter has {} values", values.len()),
                format!("write 1 to {ELEMENT_LIMIT}"),
            ));
        }
        let (mut octets, mut seen) = (Vec::new(), Vec::new());
        for (element, value) in values.iter().enumerate() {
            if value.starts_with('%') {
                let address = Address::parse(value, Addressing::Bytes)?;
                if address.bits().len() != 8 * format.octets() {
                    return Err(Mistake::new(
                        format!("{address} has not the size of {name}"),
                        format!("write an address of {} bytes", format.octets()),
                    ));
                }
                seen.push((element, address));
                octets.resize(octets.len() + format.octets(), 0);
                continue;
            }
            let read = octets_of(value, format).ok_or_else(|| {
                Mistake::new(
                    format!("\"{}\" is no {name}", shown(value)),
                    "write a number in its range, or the address of a word of the image such as %IW0",
                )
            })?;
            octets.extend(read);
        }
        let parameter = Parameter {
            number,
            format,
            is_array: values.len() > 1,
            octets,
            is_writable: seen.is_empty(),
        };
        Ok(Self { parameter, seen })
    }
}

/// A value in the octets of its format; `None` if it does not fit.
fn octets_of(text: &str, format: Format) -> Option<Vec<u8>> {
    if format == Format::FloatingPoint {
        let value: f32 = text.parse().ok()?;
        return value.is_finite().then(|| value.to_be_bytes().to_vec());
    }
    let value: i64 = text.parse().ok()?;
    let bits = 8 * format.octets();
    let range = match format {
        Format::Boolean => 0..=1,
        Format::Integer8 | Format::Integer16 | Format::Integer32 => {
            -(1 << (bits - 1))..=(1 << (bits - 1)) - 1
        }
        _ => 0..=(1 << bits) - 1,
    };
    let all = value.to_be_bytes();
    range
        .contains(&value)
        .then(|| all[all.len() - format.octets()..].to_vec())
}

/// The parameters of a station: the fixed ones, and those with signals, each with its offset in the driver.cfg. The image
/// of the station has these bytes of inputs and of outputs.
///
/// # Errors
///
/// A word is beyond the image, two share a number, or two signals an element; or the formats of one parameter differ.
pub(crate) fn parameters<'s>(
    fixed: &[(FixedParameter, usize)],
    signals: impl Iterator<Item = &'s Signal>,
    places: &BTreeMap<String, (Place, usize)>,
    sizes: [usize; 2],
) -> Result<Vec<(Parameter, RecordLayout)>, (usize, Mistake)> {
    let mut all: Vec<(Parameter, RecordLayout)> = Vec::new();
    for (fixed, at) in fixed {
        let own = &fixed.parameter;
        if all.iter().any(|(other, _)| other.number == own.number) {
            let what = format!("parameter {} is there twice", own.number);
            return Err((*at, Mistake::new(what, "remove one of the two")));
        }
        let mut layout = RecordLayout::default();
        for (element, address) in &fixed.seen {
            let bits = address.bits();
            let size = sizes[usize::from(address.area == Area::Output)];
            if bits.end > 8 * size {
                let what = format!("{address} lies beyond the {size} bytes of {}", address.area);
                let right = "take an address of a signal, or of a word of a drive";
                return Err((*at, Mistake::new(what, right)));
            }
            let begin = 8 * element * own.format.octets();
            let wire = Move {
                image: bits.start,
                wire: begin..begin + bits.len(),
            };
            layout.show(address.area, wire);
        }
        all.push((own.clone(), layout));
    }
    let mut taken: Vec<(&str, u16, usize)> = Vec::new();
    for signal in signals {
        let Some((Place::Parameter { number, element }, at)) = places.get(&signal.name) else {
            continue;
        };
        let wrong = |what: String, right: &str| (*at, Mistake::new(what, right));
        let format = format_of(signal.data_type).expect("checked with its place");
        let own = all.iter().position(|(own, _)| own.number == *number);
        let own = own.unwrap_or_else(|| {
            let parameter = Parameter {
                number: *number,
                format,
                is_array: element.is_some(),
                octets: Vec::new(),
                is_writable: false,
            };
            all.push((parameter, RecordLayout::default()));
            all.len() - 1
        });
        let (parameter, layout) = &mut all[own];
        if parameter.format != format || parameter.is_array != element.is_some() {
            return Err(wrong(
                format!("parameter {number} has another format, or elements, elsewhere"),
                "give all its elements the same type, and write them as \"parameter 945[0]\"",
            ));
        }
        let element = element.unwrap_or(0);
        let twin = taken
            .iter()
            .find(|(_, other, at)| (other, at) == (number, &element));
        if let Some((twin, ..)) = twin {
            let what = format!("\"{}\" is the same element of the parameter", shown(twin));
            return Err(wrong(what, "give each signal an element of its own"));
        }
        taken.push((&signal.name, *number, element));
        let octets = format.octets();
        let begin = element * octets;
        let end = begin + octets;
        parameter.octets.resize(parameter.octets.len().max(end), 0);
        let bits = if format == Format::Boolean {
            1
        } else {
            8 * octets
        };
        let wire = Move {
            image: signal.address().bits().start,
            wire: 8 * begin..8 * begin + bits,
        };
        parameter.is_writable |= signal.area == Area::Output;
        layout.push(signal.area, wire);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::signal;
    use tickbus_image::signal::DataType;

    fn read(
        fixed: &[&str],
        signals: &[Signal],
        places: &[&str],
    ) -> Result<Vec<(Parameter, RecordLayout)>, (usize, Mistake)> {
        let fixed: Vec<_> = fixed
            .iter()
            .map(|text| (text.parse().expect("a parameter"), 7))
            .collect();
        let places = signals.iter().zip(places).enumerate();
        let places = places.map(|(at, (signal, place))| {
            (signal.name.clone(), (place.parse().expect("a place"), at))
        });
        parameters(&fixed, signals.iter(), &places.collect(), [4, 4])
    }

    #[test]
    fn signals_are_parameters_or_elements_of_them() {
        let signals = [
            signal("ramp", "%QD0", DataType::Real),
            signal("fault", "%IW0", DataType::Uint),
            signal("jog", "%QX4.3", DataType::Bool),
        ];
        let places = ["parameter 1121", "parameter 945[1]", "parameter 3[0]"];
        let fixed = ["945 Unsigned16 = 1355 0 9", "964 integer8 = -1"];
        let all = read(&fixed, &signals, &places).expect("right");
        let [(faults, inputs), (device, _), (ramp, outputs), (jog, bit)] = &all[..] else {
            panic!("{all:?}");
        };
        let mut octets = faults.octets.clone();
        inputs.fill(&[0x12, 0x34], &mut octets);
        assert_eq!(octets, [0x05, 0x4B, 0x12, 0x34, 0, 9]);
        assert_eq!((&device.octets[..], device.is_array), (&[0xFF][..], false));
        assert_eq!(
            (ramp.format, ramp.is_writable),
            (Format::FloatingPoint, true)
        );
        let mut frame = [0; 5];
        outputs.take(&12.5_f32.to_be_bytes(), &mut frame);
        bit.take(&[1], &mut frame);
        assert_eq!(frame, [0x41, 0x48, 0, 0, 8]);
        assert_eq!((jog.format, jog.is_array), (Format::Boolean, true));
    }

    #[test]
    fn words_of_the_image_are_parameters_that_are_read() {
        let all = read(
            &["2053 Unsigned16 = %IW2 7", "2050 Unsigned32 = %QD0"],
            &[],
            &[],
        );
        let all = all.expect("right");
        let [(sent, inputs), (received, outputs)] = &all[..] else {
            panic!("{all:?}");
        };
        assert!(!sent.is_writable && !received.is_writable);
        let mut octets = sent.octets.clone();
        inputs.fill(&[1, 2, 3, 4], &mut octets);
        assert_eq!(octets, [3, 4, 0, 7]);
        let mut octets = received.octets.clone();
        outputs.reflect(&[1, 2, 3, 4], &mut octets);
        assert_eq!(octets, [1, 2, 3, 4]);
        let mut frame = [9; 4];
        outputs.take(&octets, &mut frame);
        assert_eq!(frame, [9; 4], "nobody writes them");
        let (at, mistake) = read(&["1 Unsigned16 = %IW3"], &[], &[]).expect_err("beyond");
        assert_eq!(
            (at, &*mistake.what),
            (7, "%IW3 lies beyond the 4 bytes of %I")
        );
    }

    #[test]
    fn mistakes_are_told_at_their_place() {
        let signals = [
            signal("a", "%IW0", DataType::Int),
            signal("b", "%IW2", DataType::Word),
        ];
        for (places, what) in [
            (
                ["parameter 1", "parameter 1"],
                "parameter 1 has another format, or elements, elsewhere",
            ),
            (
                ["parameter 1", "parameter 945[0]"],
                "parameter 945 has another format, or elements, elsewhere",
            ),
        ] {
            let (at, mistake) = read(&["945 Integer16 = 1 2"], &signals, &places).expect_err(what);
            assert_eq!((at, &*mistake.what), (1, what));
        }
        let same = [
            signal("a", "%IW0", DataType::Int),
            signal("b", "%IW2", DataType::Int),
        ];
        let (at, mistake) = read(&[], &same, &["parameter 1", "parameter 1"]).expect_err("twice");
        assert_eq!(
            (at, &*mistake.what),
            (1, "\"a\" is the same element of the parameter")
        );
        let twice = ["1 Unsigned8 = 1", "1 Unsigned8 = 2"];
        let (at, mistake) = read(&twice, &[], &[]).expect_err("twice");
        assert_eq!((at, &*mistake.what), (7, "parameter 1 is there twice"));
        for text in [
            "",
            "1 = 1",
            "0 Unsigned8 = 1",
            "65536 Unsigned8 = 1",
            "1 Unsigned64 = 1",
            "1 Unsigned8 =",
            "1 Unsigned8 = 256",
            "1 Integer8 = -129",
            "1 Boolean = 2",
            "1 FloatingPoint = inf",
            "1 FloatingPoint = x",
            "1 Unsigned16 = %IB0",
            "1 Unsigned16 = %IX0.0",
            "1 Unsigned16 = %",
        ] {
            assert!(text.parse::<FixedParameter>().is_err(), "{text}");
        }
        let many = format!("1 Unsigned8 = {}", "1 ".repeat(ELEMENT_LIMIT + 1));
        assert!(many.parse::<FixedParameter>().is_err());
    }
}
