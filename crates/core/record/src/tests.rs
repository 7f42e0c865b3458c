//! Written recordings can be read back: complete, truncated, and from a full disk.

use std::io::Cursor;
use std::path::PathBuf;

use proptest::prelude::*;

use super::file::tests::SmallDisc;
use super::*;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Area, DataType, Scale, Signal, SignalTable, Slot, Station};
use tickbus_test_log as logged;

/// A signal of each type, in both areas, with names that are difficult for VCD and CSV.
pub(crate) fn table(stations: &[&str]) -> SignalTable {
    let mut signals = Vec::new();
    for (station, _) in stations.iter().enumerate() {
        for (number, data_type) in DataType::ALL.into_iter().enumerate() {
            for scaled in [false, true] {
                if scaled && data_type == DataType::Bool {
                    continue;
                }
                let name = format!("{station} \"{data_type}\", $end {scaled} \\u{{41}} Ü  x=\"1\"");
                let area = [Area::Input, Area::Output][number % 2];
                signals.push(Signal {
                    station,
                    scale: scaled.then(|| Scale::through([0.0, 2.0], [0.0, 1.0]).expect("a scale")),
                    unit: scaled.then(|| "m/s \"$".to_owned()),
                    ..Signal::new(name, area, 8 * number, data_type)
                });
            }
        }
    }
    let stations = stations.iter().map(|name| Station {
        name: (*name).to_owned(),
        input_bytes: 200,
        output_bytes: 200,
        observed_bytes: 0,
    });
    SignalTable {
        stations: stations.collect(),
        signals,
        structures: Vec::new(),
    }
}

pub(crate) fn columns(table: &SignalTable) -> Columns {
    let count = table.signals.len();
    let edges: Vec<_> = (0..count)
        .map(|signal| (table.signals[signal].data_type == DataType::Bool).then_some(count))
        .collect();
    Columns::new("Cell \"4\" $end", "device", table, &edges)
}

/// The file that a sink writes for these ticks, and the offset in it at which each tick ends.
pub(crate) fn written(format: Format, columns: &Columns, ticks: &[Tick]) -> (Vec<u8>, Vec<usize>) {
    let (mut sink, mut out, mut ends) = (format.sink(columns.clone()), Vec::new(), Vec::new());
    sink.header(&mut out);
    let header = out.len();
    for tick in ticks {
        sink.tick(tick, &mut out);
        // The end of the dump does not belong to the tick.
        let end = out.len();
        let dump = out.ends_with(b"$end\n");
        ends.push(end - if dump { 5 } else { 0 });
    }
    sink.end("ticks=7", &mut out);
    ends.insert(0, header);
    (out, ends)
}

pub(crate) fn open(
    format: Format,
    bytes: &[u8],
    table: &SignalTable,
) -> Result<Recording, RecordingError> {
    let bytes = Box::new(Cursor::new(bytes.to_vec()));
    Recording::read("run", format, bytes, Some(table))
}

/// All ticks, and the result of the last read.
pub(crate) fn read(mut recording: Recording) -> (Vec<Tick>, Result<bool, RecordingError>) {
    let mut tick = Tick::new(recording.columns());
    let mut ticks = Vec::new();
    loop {
        match recording.next(&mut tick) {
            Ok(true) => ticks.push(tick.clone()),
            Ok(false) => return (ticks, Ok(recording.is_cut())),
            Err(error) => return (ticks, Err(error)),
        }
    }
}

/// Slots that a tick may hold, by kind.
fn value(kind: ValueKind, word: u64) -> Slot {
    kind.kept(match kind {
        ValueKind::Bit => Slot::from_real([0.0, 1.0, f64::NAN, 0.5][(word % 4) as usize]),
        ValueKind::Real if word.is_multiple_of(3) => Slot::from_real((word % 1000) as f64 / 8.0),
        ValueKind::Real | ValueKind::Signed | ValueKind::Unsigned => Slot(word),
        ValueKind::Count => Slot::from_real(f64::from(word as u32)),
    })
}

/// Ticks made from random words; few values change between two of them.
pub(crate) fn ticks(columns: &Columns, words: &[(u64, u64)]) -> Vec<Tick> {
    let mut tick = Tick::new(columns);
    let mut ticks = Vec::new();
    for (index, &(at, word)) in words.iter().enumerate() {
        let gap = if word.is_multiple_of(5) { word % 7 } else { 0 };
        tick.number += 1 + gap;
        tick.dropped += gap;
        tick.time += Nanos(i64::try_from(at % 3 * 1_000_000).expect("small"));
        tick.status = [0, 1, 2, -3][(word >> 3) as usize % 4];
        for (station, status) in tick.stations.iter_mut().enumerate() {
            *status = [0, 2][(word >> station) as usize % 2];
        }
        let all = index == 0;
        for (place, column) in columns.columns.iter().enumerate() {
            if all || (at as usize) % columns.columns.len() == place {
                tick.values[place] = value(column.kind, word.rotate_left(index as u32));
            }
        }
        ticks.push(tick.clone());
    }
    ticks
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_reads_back(
        words in proptest::collection::vec(any::<(u64, u64)>(), 0..40),
        several in any::<bool>(),
        format in prop_oneof![Just(Format::Vcd), Just(Format::Csv)],
    ) {
        let table = table(if several { &["A", "B \"$"] } else { &[""] });
        let columns = columns(&table);
        let ticks = ticks(&columns, &words);
        let (bytes, _) = written(format, &columns, &ticks);
        let recording = open(format, &bytes, &table).expect("a recording");
        if format == Format::Vcd {
            prop_assert_eq!(recording.columns(), &columns);
        } else {
            prop_assert_eq!(&recording.columns().columns, &columns.columns);
        }
        prop_assert_eq!(&recording.columns().stations, &columns.stations);
        let (seen, end) = read(recording);
        prop_assert_eq!(seen.len(), ticks.len());
        for (seen, tick) in seen.iter().zip(&ticks) {
            prop_assert_eq!(seen, tick);
        }
        prop_assert_eq!(end, Ok(false));
    }

    #[test]
    fn no_bytes_make_the_readers_panic(
        at in any::<usize>(), byte in any::<u8>(), csv in any::<bool>(),
    ) {
        let table = table(&[""]);
        let columns = columns(&table);
        let format = if csv { Format::Csv } else { Format::Vcd };
        let ticks = ticks(&columns, &[(1, 2), (3, 4), (5, 6)]);
        let (mut bytes, _) = written(format, &columns, &ticks);
        let at = at % bytes.len();
        bytes[at] = byte;
        if let Ok(recording) = open(format, &bytes, &table) {
            let _ = read(recording);
        }
    }
}

/// Every truncation gives a clear error, or all ticks that were complete by then.
#[test]
fn every_cut_keeps_what_is_whole() {
    let table = table(&[""]);
    let columns = columns(&table);
    let words: Vec<_> = (1..8_u64)
        .map(|n| (n, n.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
        .collect();
    let ticks = ticks(&columns, &words);
    for format in [Format::Vcd, Format::Csv] {
        let (bytes, ends) = written(format, &columns, &ticks);
        for cut in 0..bytes.len() {
            match open(format, &bytes[..cut], &table) {
                Err(error) => {
                    assert!(cut < ends[0], "{format:?} {cut}: {error}");
                    let error = error.to_string();
                    let told =
                        error.contains("is cut within its header") || error.contains("is empty");
                    assert!(told && error.starts_with("run:"), "{cut}: {error}");
                }
                Ok(recording) => {
                    assert!(cut >= ends[0]);
                    let whole = ends[1..].iter().filter(|end| **end <= cut).count();
                    let (seen, end) = read(recording);
                    assert_eq!(seen, ticks[..whole], "{format:?} {cut}");
                    let noticed = format == Format::Vcd || !ends.contains(&cut);
                    assert_eq!(end, Ok(noticed), "{format:?} {cut}");
                }
            }
        }
    }
}

#[test]
fn damage_is_told_with_its_place() {
    let table = table(&[""]);
    let columns = columns(&table);
    let ticks = ticks(&columns, &[(1, 2), (3, 4), (5, 6)]);
    let file = |format| String::from_utf8(written(format, &columns, &ticks).0).expect("text");
    let (vcd, csv) = (file(Format::Vcd), file(Format::Csv));
    let second = csv.lines().nth(2).expect("a tick");
    for (format, from, to, told) in [
        (
            Format::Vcd,
            "tickbus recording 1",
            "tickbus recording 2",
            "run: this recording has version 2",
        ),
        (
            Format::Vcd,
            "tickbus recording 1",
            "somebody's",
            "run: this VCD file was not made by tickbus",
        ),
        (
            Format::Vcd,
            "$timescale 1 ns",
            "$timescale 1 ps",
            "run: the header lacks the time scale",
        ),
        (
            Format::Vcd,
            "#1000000\n",
            "@1000000\n",
            "this is no VCD: unexpected character",
        ),
        (
            Format::Vcd,
            "#1000000\n",
            "#1000000\n$scope module a $end\n",
            "a declaration stands among",
        ),
        (
            Format::Vcd,
            "#1000000\n",
            "#1000000\n1zzz\n",
            "the value of \"zzz\", which the header does not",
        ),
        (
            Format::Vcd,
            "#1000000\n",
            "#1000000\nr1 !\n",
            "the value of \"!\" does not fit its type",
        ),
        (
            Format::Vcd,
            "#1000000\n",
            "#1000000\nb1 !\nb1 !\n",
            "tick 1 comes after tick 1",
        ),
        (
            Format::Vcd,
            "$enddefinitions",
            "$comment tick ' $end $enddefinitions",
            "is not as tickbus writes",
        ),
        (
            Format::Csv,
            "bus.tick,",
            "tick,",
            "run:1: the header does not begin with bus.tick,",
        ),
        (
            Format::Csv,
            second,
            "9,9999999999,3",
            "run:3: this line has 3 values, the header names",
        ),
        (
            Format::Csv,
            second,
            "x",
            "run:3: \"x\" in column 1 is no number",
        ),
        (
            Format::Csv,
            second,
            &format!("{second},0"),
            "values, the header names",
        ),
        (
            Format::Csv,
            "\n2,",
            "\n1,",
            "run:3: tick 1 comes after tick 1",
        ),
        (
            Format::Csv,
            "bus.dropped,\"",
            "bus.dropped,\"\"",
            "run:1: the header has a quotation mark",
        ),
    ] {
        let text = if format == Format::Vcd { &vcd } else { &csv };
        assert!(text.contains(from), "{from} in\n{text}");
        let text = text.replacen(from, to, 1);
        let error = match open(format, text.as_bytes(), &table) {
            Err(error) => error,
            Ok(recording) => read(recording).1.expect_err(told),
        };
        let error = error.to_string();
        assert!(
            error.contains(told) && error.contains("; "),
            "{error}\nis not\n{told}"
        );
        let line = error
            .strip_prefix("run")
            .expect("the file")
            .starts_with(':');
        assert!(line, "{error}");
    }
}

fn clock() -> std::sync::Arc<dyn tickbus_base::time::Clock> {
    tickbus_base::time::Monotonic::shared()
}

/// Records ticks to a disk with `room` bytes; returns the recorder's statistics and the file.
fn recorded(format: Format, room: usize, count: u64, lossless: bool) -> (String, Vec<u8>, Columns) {
    let table = table(&[""]);
    let columns = columns(&table);
    let disc = SmallDisc::new(room);
    let target = Box::new(disc.clone());
    let path = PathBuf::from("run");
    let _logged = logged::Watch::new();
    let mut recorder = Recorder::over(
        target,
        format,
        columns.clone().into(),
        8,
        lossless,
        (path, None),
        &clock(),
    )
    .expect("a thread");
    let mut slots = Tick::new(&columns).values;
    for number in 1..=count {
        slots[3] = Slot::from_real(number as f64 / 8.0);
        let time = Nanos::from_millis(i64::try_from(number).expect("small"));
        recorder.record(number, time, 0, std::iter::empty(), &slots);
    }
    let scans = recorder.counters().clone();
    let mut statistics = tickbus_base::statistics::Statistics::default();
    scans.write(&mut statistics);
    let mut text = statistics.to_string();
    drop(recorder);
    if let Some(error) = scans.error() {
        text = format!("record.error={error}");
    }
    let bytes = disc.bytes.lock().expect("no panic").clone();
    (text, bytes, columns)
}

#[test]
fn a_lossless_recorder_has_every_tick_however_small_its_ring() {
    for format in [Format::Vcd, Format::Csv] {
        let (_, bytes, _) = recorded(format, usize::MAX, 5_000, true);
        let recording = open(format, &bytes, &table(&[""])).expect("a recording");
        let (ticks, end) = read(recording);
        assert_eq!(end, Ok(false));
        assert_eq!(ticks.len(), 5_000);
        assert!(
            ticks
                .iter()
                .zip(1..)
                .all(|(tick, number)| tick.number == number)
        );
    }
}

#[test]
fn dropped_ticks_are_counted_and_marked() {
    logged::expect("ticks are dropped, since they come faster than they can be written");
    let (text, bytes, _) = recorded(Format::Vcd, usize::MAX, 50_000, false);
    let recording = open(Format::Vcd, &bytes, &table(&[""])).expect("a recording");
    let (ticks, _) = read(recording);
    let last = ticks.last().expect("some tick fits");
    assert_eq!(ticks.len() as u64 + last.dropped, last.number);
    let dropped = text
        .lines()
        .find_map(|line| line.strip_prefix("record.dropped="));
    let dropped: u64 = dropped.expect("a count").parse().expect("a number");
    // Ticks dropped after the last recorded one appear only in the count.
    assert_eq!(dropped, last.dropped + 50_000 - last.number);
    assert!(dropped > 0, "no machine writes as fast as that");
}

#[test]
fn on_a_full_disc_the_recording_ends_whole_and_says_so() {
    logged::expect("of the file: no storage space; the run goes on without it");
    for format in [Format::Vcd, Format::Csv] {
        let (_, whole, _) = recorded(format, usize::MAX, 300, true);
        let header = written(format, &columns(&table(&[""])), &[]).1[0];
        for room in (0..whole.len()).step_by(97) {
            let (text, bytes, _) = recorded(format, room, 300, true);
            assert!(text.contains("record.error=the recording ended"), "{text}");
            assert!(text.contains("no storage space"), "{text}");
            if room < header {
                assert_eq!(bytes, b"");
                continue;
            }
            let recording = open(format, &bytes, &table(&[""])).expect("a recording");
            let (ticks, end) = read(recording);
            assert!(end.is_ok(), "{end:?}");
            let last = ticks.last().map_or(0, |tick| tick.number);
            assert_eq!(ticks.len() as u64, last);
            assert!(
                text.contains(&format!("with tick {last} of")),
                "{text}: {last}"
            );
            // Nothing is lost except the tick that did not fit.
            assert!(bytes.len() + 500 > room, "{} of {room}", bytes.len());
        }
    }
}

/// A file that does not respond until the sender is dropped.
struct Stuck(std::sync::mpsc::Receiver<()>);

impl std::io::Write for Stuck {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        let _ = self.0.recv();
        Err(std::io::ErrorKind::BrokenPipe.into())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl super::file::Target for Stuck {
    fn cut(&mut self, _: u64) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_file_that_takes_nothing_does_not_keep_its_recorder_from_closing() {
    logged::expect("the file has taken nothing for 20ms");
    logged::expect("of the file: broken pipe; the run goes on without it");
    let columns = columns(&table(&[""]));
    let (answers, stuck) = std::sync::mpsc::channel();
    let target = Box::new(Stuck(stuck));
    let path = PathBuf::from("run");
    let mut recorder = Recorder::over(
        target,
        Format::Csv,
        columns.clone().into(),
        8,
        false,
        (path, None),
        &clock(),
    )
    .expect("a thread");
    recorder.close_timeout = Nanos::from_millis(20);
    let slots = Tick::new(&columns).values;
    recorder.record(1, Nanos(0), 0, std::iter::empty(), &slots);
    drop(recorder);
    drop(answers);
}

#[test]
fn time_that_goes_back_is_recorded_as_standing_still() {
    logged::expect("simulation time went back");
    let table = table(&[""]);
    let columns = columns(&table);
    let disc = SmallDisc::new(usize::MAX);
    let target = Box::new(disc.clone());
    let mut recorder = Recorder::over(
        target,
        Format::Vcd,
        columns.clone().into(),
        8,
        true,
        ("run".into(), None),
        &clock(),
    )
    .expect("a thread");
    let slots = Tick::new(&columns).values;
    for (number, time) in (1..).zip([-5, 10, 4, 12]) {
        recorder.record(number, Nanos(time), 0, std::iter::empty(), &slots);
    }
    drop(recorder);
    let bytes = disc.bytes.lock().expect("no panic").clone();
    let (ticks, _) = read(open(Format::Vcd, &bytes, &table).expect("a recording"));
    let times: Vec<i64> = ticks.iter().map(|tick| tick.time.0).collect();
    assert_eq!(times, [0, 10, 10, 12]);
}
