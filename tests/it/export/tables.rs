//! Arbitrary signal tables to export.

use std::fmt::Write as _;

use proptest::prelude::*;
use tickbus::driver_cfg::Config;

/// A driver.cfg on the socket bus with these lines in `[fieldbus]`, and these sections.
pub(crate) fn parse(fieldbus: &str, sections: &str) -> Config {
    let text = format!(
        "[driver]\nid = 7\nname = \"Cell 1\"\n[fieldbus]\nkind = \"socket\"\naddress = \"192.168.0.20:2000\"\n{fieldbus}\n{sections}"
    );
    Config::parse("driver.cfg", &text, &tickbus::KINDS)
        .unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}"))
}

const TYPES: [(&str, char, usize); 15] = [
    ("BOOL", 'X', 1),
    ("BYTE", 'B', 1),
    ("SINT", 'B', 1),
    ("USINT", 'B', 1),
    ("WORD", 'W', 2),
    ("INT", 'W', 2),
    ("UINT", 'W', 2),
    ("DWORD", 'D', 4),
    ("DINT", 'D', 4),
    ("UDINT", 'D', 4),
    ("REAL", 'D', 4),
    ("LWORD", 'L', 8),
    ("LINT", 'L', 8),
    ("ULINT", 'L', 8),
    ("LREAL", 'L', 8),
];

/// A table of adjacent signals with gaps, in both areas of up to three stations.
pub(crate) fn any_table() -> impl Strategy<Value = Config> {
    let names = prop_oneof![
        "[a-c ]{0,3}",
        "axis [1-3]\\.(Execute|Speed|Torque)",
        "\\PC{1,20}",
        "(int|Step|END_IF|%I0\\.0|\\*\\)|\"\"|//|\\(\\*)",
    ];
    let signal = (
        names,
        0..TYPES.len(),
        0..4_usize,
        0..8_u8,
        0..4_usize,
        prop::bool::ANY,
    );
    (prop::collection::vec(signal, 0..40), 1..4_usize).prop_map(|(signals, stations)| {
        let mut sections = String::new();
        if stations > 1 {
            for station in 0..stations {
                writeln!(
                    sections,
                    "[[station]]\nname = \"S {station}\"\ninput_bytes = 401\noutput_bytes = 400"
                )
                .unwrap();
            }
        }
        let mut free = vec![[0_usize; 2]; stations];
        for (number, (name, kind, gap, bit, order, input)) in signals.into_iter().enumerate() {
            let (data_type, letter, size) = TYPES[kind];
            let station = number % stations;
            let at = &mut free[station][usize::from(input)];
            *at += gap * 8;
            let area = if input { 'I' } else { 'Q' };
            let address = if letter == 'X' {
                *at += usize::from(bit % 3);
                let address = format!("%{area}X{}.{}", *at / 8, *at % 8);
                *at += 1;
                address
            } else {
                *at = at.next_multiple_of(8);
                let address = format!("%{area}{letter}{}", *at / 8);
                *at += size * 8;
                address
            };
            // A unique name without surrounding blanks.
            let name: String = name.chars().filter(|c| !c.is_control()).collect();
            let name = format!("{} {number}", name.trim())
                .trim()
                .replace('\\', "\\\\")
                .replace('"', "\\\"");
            writeln!(
                sections,
                "[[signal]]\nname = \"{name}\"\naddress = \"{address}\"\ntype = \"{data_type}\""
            )
            .unwrap();
            if size > 1 {
                writeln!(
                    sections,
                    "order = \"{}\"",
                    ["ABCD", "CDAB", "BADC", "DCBA"][order]
                )
                .unwrap();
            }
            if stations > 1 {
                writeln!(sections, "station = \"S {station}\"").unwrap();
            }
        }
        if stations == 1 {
            sections = format!("input_bytes = 401\noutput_bytes = 400\n{sections}");
        }
        parse("", &sections)
    })
}
