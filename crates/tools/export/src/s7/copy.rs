//! The blocks to be called at the beginning and at the end of OB1.

use super::link::counting;
use super::members::Path;
use super::s7comm::direct;
use super::{Image, Plan, line, source};
use crate::record::PlacedSignal;
use crate::siemens::address;
use tickbus_image::signal::{DataType, Width};

/// The third source.
pub(super) fn text(plan: &Plan<'_>) -> String {
    let mut text = source(
        plan,
        "The simulated inputs come into %I at the beginning of OB1, the outputs are taken from %Q at its end; both only \
         while Simulated is TRUE.",
    );
    let prefix = &plan.prefix;
    let only_if_simulated = |text: &mut String| {
        line(text, &format!("   IF NOT \"{prefix}\".Simulated THEN"));
        line(text, "      RETURN;");
        line(text, "   END_IF;");
    };
    let begin = format!("{prefix}_begin");
    function(&mut text, plan, &begin, &plan.inputs, |text| {
        line(text, &format!("   \"{prefix}_link_DB\"();"));
        only_if_simulated(text);
        for place in &plan.inputs.record.places {
            if direct(plan, place).is_none() {
                put(text, place, plan);
            }
        }
    });
    line(&mut text, "");
    let end = format!("{prefix}_end");
    function(&mut text, plan, &end, &plan.outputs, |text| {
        only_if_simulated(text);
        for place in &plan.outputs.record.places {
            if is_watched(place, plan) {
                count(text, place, plan);
            } else if direct(plan, place).is_none() {
                take(text, place, plan);
            }
        }
    });
    text
}

fn function(
    text: &mut String,
    plan: &Plan<'_>,
    name: &str,
    image: &Image<'_>,
    body: impl FnOnce(&mut String),
) {
    line(text, &format!("FUNCTION \"{name}\" : Void"));
    line(text, "{ S7_Optimized_Access := 'TRUE' }");
    line(text, "VERSION : 0.1");
    // %I and %Q cannot address 64-bit values, so these are copied as two halves.
    let is_long = |place: &PlacedSignal<'_>| {
        place.data_type().width() == Width::Long
            && matches!(Path::of(place, plan.cpu), Path::Value(_))
    };
    if image.record.places.iter().any(is_long) {
        line(text, "   VAR_TEMP");
        line(text, "      Long : LWord;");
        line(text, "   END_VAR");
    }
    line(text, "");
    line(text, "BEGIN");
    body(text);
    line(text, "END_FUNCTION");
}

/// The bit string of the same width, unless the type is one.
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

/// Copies a value from the image to %I.
fn put(text: &mut String, place: &PlacedSignal<'_>, plan: &Plan<'_>) {
    let remark = format!("   // \"{}\"", place.signal.name);
    match Path::of(place, plan.cpu) {
        Path::Bytes(names) => {
            for (number, name) in names.iter().enumerate() {
                let remark = if number == 0 { &remark } else { "" };
                let (byte, value) = (place.byte + number, plan.inputs.member(name));
                line(text, &format!("   %IB{byte} := {value};{remark}"));
            }
        }
        Path::Value(name) => {
            let data_type = place.data_type();
            let value = plan.inputs.member(&name);
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

/// Copies a value from %Q to the image.
fn take(text: &mut String, place: &PlacedSignal<'_>, plan: &Plan<'_>) {
    let remark = format!("   // \"{}\"", place.signal.name);
    match Path::of(place, plan.cpu) {
        Path::Bytes(names) => {
            for (number, name) in names.iter().enumerate() {
                let remark = if number == 0 { &remark } else { "" };
                let (byte, target) = (place.byte + number, plan.outputs.member(name));
                line(text, &format!("   {target} := %QB{byte};{remark}"));
            }
        }
        Path::Value(name) => {
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
            let target = plan.outputs.member(&name);
            line(text, &format!("   {target} := {value};{remark}"));
        }
    }
}

/// Returns true if the driver's `alive` requires this signal to change while the PLC's program runs.
fn is_watched(place: &PlacedSignal<'_>, plan: &Plan<'_>) -> bool {
    let signals = &plan.config.table.signals;
    let mut alive = plan.config.life_signs.alive.iter();
    alive.any(|alive| std::ptr::eq(&raw const signals[alive.signal], place.signal))
}

/// Changes the value of a signal in every scan: a BOOL toggles, others count up and restart at 100.
fn count(text: &mut String, place: &PlacedSignal<'_>, plan: &Plan<'_>) {
    let (value, kind) = counting(plan, &plan.outputs, place);
    let remark = format!("   // \"{}\": alive in driver.cfg", place.signal.name);
    let next = match kind {
        "Bool" => format!("NOT {value}"),
        "Byte" => format!("USINT_TO_BYTE((BYTE_TO_USINT({value}) + 1) MOD 100)"),
        "Word" => format!("UINT_TO_WORD((WORD_TO_UINT({value}) + 1) MOD 100)"),
        "DWord" => format!("UDINT_TO_DWORD((DWORD_TO_UDINT({value}) + 1) MOD 100)"),
        "LWord" => format!("ULINT_TO_LWORD((LWORD_TO_ULINT({value}) + 1) MOD 100)"),
        "Real" | "LReal" => {
            line(text, &format!("   IF {value} < 100.0 THEN{remark}"));
            line(text, &format!("      {value} := {value} + 1.0;"));
            line(text, "   ELSE");
            line(text, &format!("      {value} := 0.0;"));
            line(text, "   END_IF;");
            return;
        }
        _ => format!("({value} + 1) MOD 100"),
    };
    line(text, &format!("   {value} := {next};{remark}"));
}
