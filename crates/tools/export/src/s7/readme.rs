//! The README of the files: the steps to take in TIA Portal.

use super::{Plan, head_lines, line, link, tags};

/// The text of the README.
pub(super) fn text(plan: &Plan<'_>, notes: &[String]) -> String {
    let prefix = &plan.prefix;
    let mut text = String::new();
    for head in head_lines(plan, "How to use the files beside this one.") {
        line(&mut text, &head);
    }
    line(&mut text, "");
    let images = [&plan.inputs, &plan.outputs];
    let mut places = images.into_iter().flat_map(|image| &image.record.places);
    let is_any_elsewhere = places.any(|place| tags::is_elsewhere(plan, place.signal));
    let mut steps = vec![format!(
        "External source files > Add new external file: {prefix}_1_data.scl, {prefix}_2_link.scl, {prefix}_3_copy.scl. \
         Generate blocks from source, in this order."
    )];
    steps.extend(link::steps(plan));
    steps.extend([
        format!(
            "Make an instance data block \"{prefix}_link_DB\" for the function block \"{prefix}_link\", unless the source \
             has made it."
        ),
        format!("OB1, first network: call \"{prefix}_begin\". OB1, last network: call \"{prefix}_end\"."),
        "OB1 is not first everywhere. An OB that interrupts it (cyclic interrupt, hardware interrupt) sees the inputs as \
         the last call has left them. Modules whose addresses belong to a process image partition (PIP) of another OB are \
         read when that OB starts, over the simulated inputs: set them to \"Automatic update\", or make both calls in that OB."
            .to_owned(),
        format!(
            "While \"{prefix}\".Simulated is TRUE, %I comes from the simulation. While it is FALSE, its start value, \
             nothing is copied and no connection is held: the same program runs the real machine."
        ),
        "Outputs are copied, not taken away: with real output modules plugged, the real machine moves as well. Leave \
         them out of the hardware configuration, or switch their power off."
            .to_owned(),
        format!(
            "{prefix}_tags.sdf has the tags of all signals{}: PLC tags > Import, into a tag table of its own.",
            if is_any_elsewhere {
                " but those of [fieldbus.at], which lie where the program has them"
            } else {
                ""
            }
        ),
    ]);
    for (number, step) in steps.iter().enumerate() {
        line(&mut text, &format!("{}. {step}", number + 1));
    }
    if !notes.is_empty() {
        line(&mut text, "");
        for note in notes {
            line(&mut text, &format!("Note: {note}"));
        }
    }
    text
}
