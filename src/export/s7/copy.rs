//! The blocks for the beginning and the end of OB1.

use super::{Path, Plan, line, source};
use crate::export::record::Place;
use crate::export::siemens::address;
use crate::signal::{DataType, Width};

/// The third source.
pub(super) fn text(plan: &Plan<'_>) -> String {
    let mut text = source(
        plan,
        "The simulated inputs come into %I at the beginning of OB1, the outputs are taken from %Q at its end; both only \
         while Simulated is TRUE.",
    );
    let prefix = &plan.prefix;
    function(
        &mut text,
        &format!("{prefix}_begin"),
        &plan.inputs.record.places,
        |text| {
            line(text, &format!("   \"{prefix}_link_DB\"();"));
            line(text, &format!("   IF NOT \"{prefix}\".Simulated THEN"));
            line(text, "      RETURN;");
            line(text, "   END_IF;");
            for (place, path) in plan.inputs.record.places.iter().zip(&plan.inputs.paths) {
                put(text, place, path, &plan.inputs.block);
            }
        },
    );
    line(&mut text, "");
    function(
        &mut text,
        &format!("{prefix}_end"),
        &plan.outputs.record.places,
        |text| {
            line(text, &format!("   IF NOT \"{prefix}\".Simulated THEN"));
            line(text, "      RETURN;");
            line(text, "   END_IF;");
            for (place, path) in plan.outputs.record.places.iter().zip(&plan.outputs.paths) {
                take(text, place, path, &plan.outputs.block);
            }
        },
    );
    text
}

fn function(text: &mut String, name: &str, places: &[Place<'_>], body: impl FnOnce(&mut String)) {
    line(text, &format!("FUNCTION \"{name}\" : Void"));
    line(text, "{ S7_Optimized_Access := 'TRUE' }");
    line(text, "VERSION : 0.1");
    // 64 bits have no address of their own in %I and %Q: they go as two halves.
    if places
        .iter()
        .any(|place| place.data_type().width() == Width::Long)
    {
        line(text, "   VAR_TEMP");
        line(text, "      Long : LWord;");
        line(text, "   END_VAR");
    }
    line(text, "");
    line(text, "BEGIN");
    body(text);
    line(text, "END_FUNCTION");
}

/// The bit string of the same width, if the type is not one itself.
fn bits(data_type: DataType) -> Option<&'static str> {
    Some(match data_type {
        DataType::Bool | DataType::Byte | DataType::Word | DataType::Dword | DataType::Lword => {
            return None;
        }
        DataType::Sint | DataType::Usint => "BYTE",
        DataType::Int | DataType::Uint => "WORD",
        DataType::Dint | DataType::Udint | DataType::Real => "DWORD",
        DataType::Lint | DataType::Ulint | DataType::Lreal => "LWORD",
    })
}

/// Copies a value from the image into %I.
fn put(text: &mut String, place: &Place<'_>, path: &Path, block: &str) {
    let remark = format!("   // \"{}\"", place.signal.name);
    match path {
        Path::Bytes(paths) => {
            for (number, path) in paths.iter().enumerate() {
                let remark = if number == 0 { &remark } else { "" };
                let byte = place.byte + number;
                line(
                    text,
                    &format!("   %IB{byte} := \"{block}\".Image.{path};{remark}"),
                );
            }
        }
        Path::Value(path) => {
            let data_type = place.data_type();
            let value = format!("\"{block}\".Image.{path}");
            let value = bits(data_type).map_or_else(
                || value.clone(),
                |bits| format!("{data_type}_TO_{bits}({value})"),
            );
            if data_type.width() == Width::Long {
                line(text, &format!("   #Long := {value};{remark}"));
                line(text, &format!("   %ID{} := #Long.%D1;", place.byte));
                line(text, &format!("   %ID{} := #Long.%D0;", place.byte + 4));
            } else {
                let target = address(place);
                line(text, &format!("   {target} := {value};{remark}"));
            }
        }
    }
}

/// Copies a value from %Q into the image.
fn take(text: &mut String, place: &Place<'_>, path: &Path, block: &str) {
    let remark = format!("   // \"{}\"", place.signal.name);
    match path {
        Path::Bytes(paths) => {
            for (number, path) in paths.iter().enumerate() {
                let remark = if number == 0 { &remark } else { "" };
                let byte = place.byte + number;
                line(
                    text,
                    &format!("   \"{block}\".Image.{path} := %QB{byte};{remark}"),
                );
            }
        }
        Path::Value(path) => {
            let data_type = place.data_type();
            let source = if data_type.width() == Width::Long {
                line(text, &format!("   #Long.%D1 := %QD{};", place.byte));
                line(text, &format!("   #Long.%D0 := %QD{};", place.byte + 4));
                "#Long".to_owned()
            } else {
                address(place)
            };
            let value = bits(data_type).map_or_else(
                || source.clone(),
                |bits| format!("{bits}_TO_{data_type}({source})"),
            );
            line(
                text,
                &format!("   \"{block}\".Image.{path} := {value};{remark}"),
            );
        }
    }
}
