//! A program hosted by tickbus: its located variables are the image.

use super::{COMPILED, EDITOR, configuration, declared, program, remarks};
use crate::record::PlacedSignal;
use crate::st::life::{self, ALIVE, Life};
use crate::st::{add, comment, records, source, taken};
use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{DataType, Signal};

#[expect(
    clippy::too_many_lines,
    reason = "one program of the PLC, from its head to its end"
)]
pub(super) fn text(config: &Config, notes: &mut Vec<String>) -> Result<String, Mistakes> {
    let wrong = |what: String, right: &str| {
        Mistakes::of_file(&config.path.display().to_string(), what, right)
    };
    if config.table.stations.len() > 1 {
        return Err(wrong(
            "a hosted program is one PLC, and this file has several stations".to_owned(),
            "export from a driver.cfg for each program, with the signals of its station",
        ));
    }
    let mut names = taken(declared(config).chain(life::declared(config)));
    let records = records(config, 1, &mut names);
    let mut text = source(
        config,
        1,
        "The PLC's half for a program that tickbus hosts: docs/own-plc-program.md tells how.",
        EDITOR,
        COMPILED,
    );
    remarks(
        &mut text,
        &["Addresses count elements, as OpenPLC does: %QW1 is the second word.".to_owned()],
    );
    let [name, _] = program(config);
    add(&mut text, &format!("PROGRAM {name}"));
    let mut odd = 0;
    for (record, what) in records.iter().zip([
        "inputs: the simulation writes them",
        "outputs: the simulation reads them",
    ]) {
        if record.places.is_empty() {
            continue;
        }
        add(&mut text, &format!("  VAR {}", comment(what)));
        for place in &record.places {
            let remark = comment(&place.remark());
            if let Some(address) = element(place) {
                let (name, data_type) = (&place.name, place.data_type());
                add(
                    &mut text,
                    &format!("    {name} AT {address} : {data_type}; {remark}"),
                );
                continue;
            }
            if is_life_sign(config, place.signal) {
                let size = place.size();
                return Err(wrong(
                    format!(
                        "\"{}\" is a sign of life at {}: the program counts with elements, and none of {size} bytes begins \
                         there",
                        place.signal.name,
                        place.signal.address()
                    ),
                    &format!("give it an address whose byte is a multiple of {size}"),
                ));
            }
            odd += 1;
            for number in 0..place.size() {
                let remark = if number == 0 { remark.as_str() } else { "" };
                let name = names.give(&format!("{}_at{number}", place.name));
                let byte = place.byte + number;
                let line = format!(
                    "    {name} AT {}B{byte} : BYTE; {remark}",
                    place.signal.area
                );
                add(&mut text, line.trim_end());
            }
        }
        add(&mut text, "  END_VAR");
    }
    if odd > 0 {
        notes.push(format!(
            "{odd} signals do not begin at a multiple of their size, where no element does: they are there as bytes"
        ));
    }
    let life = Life::of(
        config,
        &records,
        &|place| place.data_type(),
        &str::to_owned,
        [ALIVE, "TRUE"],
        false,
    );
    if life.is_beating() {
        add(&mut text, "  VAR");
        add(
            &mut text,
            &format!("    {ALIVE} : BOOL; (* the heartbeat of the simulation was seen lately *)"),
        );
        for (name, kind) in &life.locals {
            add(&mut text, &format!("    {name} : {kind};"));
        }
        add(&mut text, "  END_VAR");
    }
    add(&mut text, "");
    for line in life.before.iter().chain(&life.after) {
        add(&mut text, &format!("  {line}"));
    }
    // iec2c accepts neither a program without statements nor a lone semicolon.
    add(
        &mut text,
        "  (* Your program goes here, before this line. *)",
    );
    add(&mut text, "  RETURN;");
    add(&mut text, "END_PROGRAM");
    configuration(&mut text, config);
    Ok(text)
}

/// Returns true if either end counts a signal up.
fn is_life_sign(config: &Config, signal: &Signal) -> bool {
    let signs = &config.life_signs;
    let beats = signs.heartbeat.iter().map(|beat| beat.signal);
    let mut counted = signs.alive.iter().map(|alive| alive.signal).chain(beats);
    counted.any(|index| std::ptr::eq(&raw const config.table.signals[index], signal))
}

/// The address of a signal in elements of its size; `None` if it starts between two of them.
fn element(place: &PlacedSignal<'_>) -> Option<String> {
    let (area, byte) = (place.signal.area, place.byte);
    if place.data_type() == DataType::Bool {
        return Some(format!("{area}X{byte}.{}", place.bit()));
    }
    let letter = place.data_type().width().letter();
    let is_whole = byte.is_multiple_of(place.size());
    is_whole.then(|| format!("{area}{letter}{}", byte / place.size()))
}
