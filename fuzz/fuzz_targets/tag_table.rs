//! Any bytes as a list of PLC tags: the first byte chooses how it is read.
//!
//! Nothing may panic, and a table that is accepted becomes a driver.cfg without mistakes.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_driver_cfg::Config;
use tickbus_kinds::KINDS;
use tickbus_import::{Client, ImportOptions, import};
use tickbus_image::signal::Addressing;

fuzz_target!(|data: &[u8]| {
    let Some((choice, bytes)) = data.split_first() else {
        return;
    };
    let reading = ImportOptions {
        addressing: (choice & 1 != 0).then_some(Addressing::Elements),
        lenient: choice & 2 != 0,
        replies: choice & 16 != 0,
        client: match choice >> 2 & 3 {
            1 => Some(Client::Modbus),
            2 => Some(Client::S7),
            _ => None,
        },
    };
    match import("tags.csv", bytes, reading, &KINDS) {
        Ok(imported) => {
            let config = Config::parse("driver.cfg", &imported.text, &KINDS)
                .unwrap_or_else(|mistakes| panic!("{mistakes}\n{}", imported.text));
            assert_eq!(config.table.signals.len(), imported.signals);
        }
        Err(mistakes) => {
            assert!(mistakes.iter().all(|found| !found.mistake.what.is_empty()));
        }
    }
});
