//! Any text as PLCopen XML or L5X: the first byte chooses how it is read.
//!
//! Nothing may panic, and a project that is accepted becomes a driver.cfg without mistakes.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_driver_cfg::Config;
use tickbus_kinds::KINDS;
use tickbus_import::{ImportOptions, import};
use tickbus_image::signal::Addressing;

fuzz_target!(|data: &[u8]| {
    let Some((choice, bytes)) = data.split_first() else {
        return;
    };
    // Anything that does not start like XML is left to tag_table.
    if bytes.first() != Some(&b'<') {
        return;
    }
    let reading = ImportOptions {
        addressing: (choice & 1 != 0).then_some(Addressing::Elements),
        lenient: choice & 2 != 0,
        client: None,
        replies: choice & 16 != 0,
    };
    match import("project.xml", bytes, reading, &KINDS) {
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
