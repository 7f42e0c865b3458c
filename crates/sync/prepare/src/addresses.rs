//! Checks that the server's variables have their own memory.

use std::ops::Range;

use super::library::Addresses;
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Mistakes};

/// Invalid addresses, each under the name of its variable.
pub(crate) fn mistakes(addresses: &Addresses) -> Vec<Mistakes> {
    let mut wrong = Vec::new();
    let named = named(addresses);
    for (index, (name, address)) in named.iter().enumerate() {
        let before = named[..index].iter();
        if let Some((other, _)) = before.clone().find(|(_, one)| is_same(one, address)) {
            let what = format!("{other} is at {address} too");
            let mistake = Mistake::new(what, "give each variable an address of its own");
            wrong.push(Mistakes::of(name, mistake));
        }
        if name.starts_with("done") && address[1..].starts_with(['I', 'i']) {
            let what = format!("{address} is an input, and the PLC writes {name}");
            let mistake = Mistake::new(what, "name an output, such as %QD100, or a marker");
            wrong.push(Mistakes::of(name, mistake));
        }
    }
    wrong
}

fn named(addresses: &Addresses) -> Vec<(&'static str, &str)> {
    let stated = addresses.variables();
    let stated = stated.filter_map(|(name, address)| Some((name, address.as_deref()?)));
    stated
        .filter(|(_, address)| address.starts_with('%'))
        .collect()
}

fn is_same(one: &str, other: &str) -> bool {
    one.eq_ignore_ascii_case(other)
}

/// Reports an address of the program, at a byte of its file, that one of the server's variables also has. If both may
/// share memory, returns a remark.
pub(crate) fn check(
    own: &str,
    at: usize,
    addresses: &Addresses,
    wrong: &Collector<'_>,
) -> Option<String> {
    let named = named(addresses);
    if named.iter().any(|(_, address)| is_same(address, own)) {
        wrong.report(
            at,
            format!("the program uses {own} already"),
            "name a free address for the server's variable",
        );
        return None;
    }
    let (name, address) = named
        .iter()
        .find(|(_, address)| may_overlap(address, own))?;
    Some(format!(
        "{name} at {address} and the program's {own} are the same memory on some PLCs: check that they are not on yours"
    ))
}

/// CODESYS counts in units of the variable's size, others count bytes.
fn may_overlap(one: &str, other: &str) -> bool {
    [true, false].into_iter().any(|in_units| {
        let areas = (bits(one, in_units), bits(other, in_units));
        let (Some((area, one)), Some((other_area, other))) = areas else {
            return false;
        };
        area == other_area && one.start < other.end && other.start < one.end
    })
}

/// The area of an address, and its bits; `None` if it has no fixed place, or several levels.
fn bits(address: &str, in_units: bool) -> Option<(char, Range<u64>)> {
    let capitals = address.to_ascii_uppercase();
    let mut rest = capitals.strip_prefix('%')?.chars();
    let area = rest.next()?;
    let numbers = rest.as_str();
    let size: u64 = match numbers.chars().next()? {
        'B' => 8,
        'W' => 16,
        'D' => 32,
        'L' => 64,
        _ => 1,
    };
    let numbers = numbers.trim_start_matches(|c: char| c.is_ascii_alphabetic());
    let mut parts = numbers.split('.').map(str::parse::<u64>);
    let first = parts.next()?.ok()?;
    let start = match (size, parts.next()) {
        (1, Some(bit)) => first.checked_mul(8)?.checked_add(bit.ok()?)?,
        (1, None) => first,
        (_, None) => first.checked_mul(if in_units { size } else { 8 })?,
        _ => return None,
    };
    let end = start.checked_add(size)?;
    parts.next().is_none().then_some((area, start..end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_that_may_share_memory_are_known() {
        for (one, other, right) in [
            ("%QD100", "%QW200", true),
            ("%QD100", "%QX400.0", true),
            ("%QD100", "%QX100.0", true),
            ("%QD100", "%qb103", true),
            ("%QD100", "%QW104", false),
            ("%QD100", "%QW202", false),
            ("%QD100", "%IW200", false),
            ("%MD100", "%ML50", true),
            ("%QD1.2", "%QW1.2", false),
            ("%QD100", "%QX*", false),
            ("%QD18446744073709551615", "%QD0", false),
        ] {
            assert_eq!(may_overlap(one, other), right, "{one} {other}");
        }
    }
}
