//! Engineering units, as named in OPC UA.

use opcua::types::EUInformation;

/// The origin of the unit numbers: UN/CEFACT, recommendation 20.
const CEFACT: &str = "http://www.opcfoundation.org/UA/units/un/cefact";

/// Units in their usual notation, and their common codes of three characters.
const CODES: [(&str, &str); 36] = [
    ("%", "P1"),
    ("1/min", "RPM"),
    ("A", "AMP"),
    ("Hz", "HTZ"),
    ("K", "KEL"),
    ("L", "LTR"),
    ("N", "NEW"),
    ("Nm", "NU"),
    ("Pa", "PAL"),
    ("V", "VLT"),
    ("W", "WTT"),
    ("bar", "BAR"),
    ("cm", "CMT"),
    ("deg", "DD"),
    ("g", "GRM"),
    ("h", "HUR"),
    ("kN", "B47"),
    ("kW", "KWT"),
    ("kg", "KGM"),
    ("km/h", "KMH"),
    ("l", "LTR"),
    ("l/min", "L2"),
    ("m", "MTR"),
    ("m/min", "2X"),
    ("m/s", "MTS"),
    ("m/s²", "MSK"),
    ("mA", "4K"),
    ("mbar", "MBR"),
    ("min", "MIN"),
    ("mm", "MMT"),
    ("mm/s", "C16"),
    ("ms", "C26"),
    ("rpm", "RPM"),
    ("s", "SEC"),
    ("°", "DD"),
    ("°C", "CEL"),
];

/// The unit called `name`; without a code it has only its name.
pub(super) fn unit(name: &str) -> EUInformation {
    let code = CODES.iter().find(|(known, _)| *known == name);
    EUInformation {
        namespace_uri: CEFACT.into(),
        unit_id: code.map_or(-1, |(_, code)| number(code)),
        display_name: name.into(),
        description: name.into(),
    }
}

/// A common code as a number, whose digits are the characters.
fn number(code: &str) -> i32 {
    code.bytes()
        .fold(0, |number, byte| number << 8 | i32::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_the_numbers_that_opc_ua_gives_them() {
        for (name, id) in [
            ("mm", 5_066_068),
            ("°C", 4_408_652),
            ("s", 5_457_219),
            ("%", 20_529),
            ("furlong", -1),
        ] {
            assert_eq!(unit(name).unit_id, id, "{name}");
        }
    }
}
