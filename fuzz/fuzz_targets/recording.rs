//! Any bytes as a recording: the first byte chooses between VCD and CSV, whether the signals are known, and whether VCD of other
//! programs is read as well.
//!
//! Nothing may panic, ticks are in order, and a reader's memory does not grow with what it has read.

#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use tickbus_record::{Format, Recording, Tick};
use tickbus_image::signal::{Area, DataType, Signal, SignalTable};
use tickbus_base::time::Nanos;

fuzz_target!(|data: &[u8]| {
    let Some((choice, bytes)) = data.split_first() else {
        return;
    };
    let format = [Format::Vcd, Format::Csv][usize::from(choice & 1)];
    let table = table();
    let table = (choice & 2 != 0).then_some(&table);
    let from = Box::new(Cursor::new(bytes.to_vec()));
    let read = if choice & 4 == 0 { Recording::read } else { Recording::read_any };
    let mut recording = match read("run", format, from, table) {
        Ok(recording) => recording,
        Err(error) => {
            assert!(error.to_string().starts_with("run"));
            return;
        }
    };
    let mut tick = Tick::new(recording.columns());
    let columns = recording.columns().columns.len();
    let (mut number, mut time) = (0, Nanos(i64::MIN));
    while let Ok(true) = recording.next(&mut tick) {
        assert!(tick.number > number && tick.time >= time);
        assert_eq!(tick.values.len(), columns);
        (number, time) = (tick.number, tick.time);
    }
    let _ = recording.ending();
});

/// The signals in the seeds.
fn table() -> SignalTable {
    let signal = |name: &str, data_type, byte| Signal::new(name, Area::Output, byte, data_type);
    let signals = vec![
        signal("run", DataType::Bool, 0),
        signal("speed", DataType::Real, 4),
        signal("count", DataType::Lint, 8),
        signal("word", DataType::Lword, 16),
    ];
    SignalTable::of_one_station(0, 32, signals)
}
