//! Durations in the notations of PLC programs.

/// The milliseconds of a literal of `TIME`, such as `T#1s500ms`, or of XML, such as `PT0.02S`.
///
/// # Errors
///
/// The text is no such duration; the message says why.
pub(crate) fn milliseconds(text: &str) -> Result<u32, &'static str> {
    const UNREAD: &str = "is no duration that can be read here";
    let lower = text.trim().to_ascii_lowercase().replace('_', "");
    let known = ["t#", "time#", "lt#", "ltime#", "p"];
    let rest = known.iter().find_map(|start| lower.strip_prefix(start));
    // Days precede the T of an XML duration; the rest follows it.
    let mut rest = rest.ok_or(UNREAD)?.to_owned();
    if lower.starts_with('p') {
        rest = rest.replace('t', "");
    }
    let mut rest = rest.as_str();
    let mut nanos: u64 = 0;
    if rest.is_empty() {
        return Err(UNREAD);
    }
    while !rest.is_empty() {
        let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.');
        let (number, unit) = rest.split_at(end.ok_or(UNREAD)?);
        let end = unit.find(|c: char| !c.is_ascii_alphabetic());
        let (unit, next) = unit.split_at(end.unwrap_or(unit.len()));
        let scale: u64 = match unit {
            "d" => 86_400_000_000_000,
            "h" => 3_600_000_000_000,
            "m" => 60_000_000_000,
            "s" => 1_000_000_000,
            "ms" => 1_000_000,
            "us" => 1000,
            "ns" => 1,
            _ => return Err(UNREAD),
        };
        let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
        let whole: u64 = whole.parse().map_err(|_| UNREAD)?;
        let mut part = whole.checked_mul(scale).ok_or(UNREAD)?;
        let mut scale = scale;
        for digit in fraction.bytes() {
            let digit = char::from(digit).to_digit(10).ok_or(UNREAD)?;
            if !scale.is_multiple_of(10) && digit != 0 {
                return Err(UNREAD);
            }
            scale /= 10;
            part += u64::from(digit) * scale;
        }
        nanos = nanos.checked_add(part).ok_or(UNREAD)?;
        rest = next;
    }
    if nanos == 0 {
        return Err("is 0");
    }
    if !nanos.is_multiple_of(1_000_000) {
        return Err("is not a whole number of milliseconds");
    }
    u32::try_from(nanos / 1_000_000).map_err(|_| "is longer than 49 days")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_milliseconds() {
        for (text, right) in [
            ("T#10ms", Some(10)),
            ("t#1s500ms", Some(1500)),
            ("TIME#1.5s", Some(1500)),
            ("T#1d_2h_3m_4s_5ms", Some(93_784_005)),
            ("LTIME#2000us", Some(2)),
            ("PT0.02S", Some(20)),
            ("P1DT1S", Some(86_401_000)),
            ("T#0.0005s", None),
            ("T#500us", None),
            ("T#0ms", None),
            ("T#-5ms", None),
            ("T#", None),
            ("T#5", None),
            ("T#5x", None),
            ("T#.5s", None),
            ("T#1.2.3s", None),
            ("10", None),
            ("T#50d", None),
            ("T#99999999999999999999d", None),
        ] {
            assert_eq!(milliseconds(text).ok(), right, "{text}");
        }
    }
}
