//! The axes of a driver.cfg, one line each.

use tickbus_axis::{Axis, COMMAND_BYTES, Field};
use tickbus_base::toml_text::short_number;

pub(super) const HEADINGS: [&str; 7] = [
    "axis", "kind", "command", "feedback", "unit", "limits", "with",
];

pub(super) fn row(axis: &Axis) -> [String; HEADINGS.len()] {
    let bytes =
        |area: &str, begin: usize, size: usize| format!("{area}B{begin}…{}", begin + size - 1);
    let mut with: Vec<String> = Vec::new();
    if axis.inverted {
        with.push("inverted".to_owned());
    }
    for (field, what) in [
        (Field::Acknowledge, "acknowledge"),
        (Field::Status, "diagnostics"),
        (Field::Jerk, "jerk"),
    ] {
        if axis.slot(field).is_some() {
            with.push(what.to_owned());
        }
    }
    if axis.slot(Field::CommandNumber).is_some() {
        let numbers: Vec<String> = axis
            .commands
            .iter()
            .map(|command| format!("{} {}", command.number, command.mode.name()))
            .collect();
        with.push(format!("commands {}", numbers.join(", ")));
    }
    for switch in &axis.switches {
        let side = if switch.above { "above" } else { "below" };
        with.push(format!(
            "\"{}\" {side} {}",
            switch.name,
            short_number(switch.at)
        ));
    }
    [
        axis.name.clone(),
        axis.kind.name().to_owned(),
        bytes("%Q", axis.command, COMMAND_BYTES),
        bytes("%I", axis.feedback, axis.feedback_bytes),
        axis.unit.clone().unwrap_or_default(),
        axis.limits
            .map(|[low, high]| format!("{} to {}", short_number(low), short_number(high)))
            .unwrap_or_default(),
        with.join("; "),
    ]
}
