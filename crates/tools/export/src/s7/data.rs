//! Types and data blocks: both images, each signal at its own offset.

use super::body::Body;
use super::members::{Kind, Member};
use super::{Image, Plan, line, source};
use crate::siemens::spelling;

/// The first source.
pub(super) fn text(plan: &Plan<'_>, link: &Body) -> String {
    let mut text = source(
        plan,
        "Both images as structures with standard (non-optimised) access: each signal at the offset that it has on the bus.",
    );
    for image in [&plan.inputs, &plan.outputs] {
        if !image.members.is_empty() {
            structure(&mut text, &image.type_name, &image.members);
        }
    }
    for image in [&plan.inputs, &plan.outputs] {
        if !image.members.is_empty() {
            block(&mut text, image);
        }
    }
    control(&mut text, plan, link);
    text
}

fn structure(text: &mut String, name: &str, members: &[Member]) {
    line(text, &format!("TYPE \"{name}\""));
    line(text, "VERSION : 0.1");
    line(text, "   STRUCT");
    for member in members {
        let kind = match &member.kind {
            Kind::Value(data_type) => spelling(*data_type).to_owned(),
            Kind::Bytes(count) => format!("Array[0..{}] of Byte", count - 1),
        };
        let place = match member.kind {
            Kind::Value(tickbus_image::signal::DataType::Bool) => {
                format!("{}.{}", member.byte, member.bit)
            }
            _ => member.byte.to_string(),
        };
        let remark = if member.remark.is_empty() {
            String::new()
        } else {
            format!(": {}", member.remark)
        };
        line(
            text,
            &format!("      \"{}\" : {kind};   // {place}{remark}", member.name),
        );
    }
    line(text, "   END_STRUCT;");
    line(text, "END_TYPE");
    line(text, "");
}

/// A data block with one image at offset 0, so that a client of the PLC finds each byte at its bus offset.
fn block(text: &mut String, image: &Image<'_>) {
    line(text, &format!("DATA_BLOCK \"{}\"", image.block));
    line(text, "{ S7_Optimized_Access := 'FALSE' }");
    line(text, "VERSION : 0.1");
    line(text, "NON_RETAIN");
    line(text, "   STRUCT");
    line(
        text,
        &format!(
            "      Image : \"{}\";   // {} bytes",
            image.type_name, image.record.bytes
        ),
    );
    line(text, "   END_STRUCT;");
    line(text, "BEGIN");
    line(text, "END_DATA_BLOCK");
    line(text, "");
}

fn control(text: &mut String, plan: &Plan<'_>, link: &Body) {
    line(text, &format!("DATA_BLOCK \"{}\"", plan.prefix));
    line(text, "{ S7_Optimized_Access := 'TRUE' }");
    line(text, "VERSION : 0.1");
    line(text, "NON_RETAIN");
    line(text, "   STRUCT");
    line(
        text,
        "      Simulated : Bool;   // TRUE: the simulation stands in for the machine",
    );
    for member in link.status() {
        line(text, &format!("      {member}"));
    }
    line(text, "   END_STRUCT;");
    line(text, "BEGIN");
    line(text, "   Simulated := FALSE;");
    line(text, "END_DATA_BLOCK");
}
