//! The sources for S7, checked by a reader that computes structure layouts itself.

use std::collections::{HashMap, HashSet};

use proptest::prelude::*;
use tickbus::driver_cfg::Config;
use tickbus::export::{Target, export};
use tickbus::signal::{Area, ByteOrder, DataType};

use crate::export::machine::{Machine, Value, units};
use crate::export::tables;

/// A structure in S7's standard-access layout.
#[derive(Debug, Default)]
struct Structure {
    /// Path, offset in bits, type.
    members: Vec<(String, usize, String)>,
    bytes: usize,
}

/// All structures of a source, by name, laid out only by the rules of S7: offsets in comments are not used.
fn structures(source: &str) -> HashMap<String, Structure> {
    let mut all: HashMap<String, Structure> = HashMap::new();
    let mut lines = source.lines();
    while let Some(line) = lines.next() {
        let Some(name) = line.strip_prefix("TYPE ") else {
            continue;
        };
        let mut structure = Structure::default();
        let mut at = 0_usize;
        for line in lines.by_ref() {
            let line = line.trim();
            if line == "END_STRUCT;" {
                break;
            }
            let Some((name, rest)) = line.split_once(" : ").filter(|_| line.starts_with('"'))
            else {
                assert!(matches!(line, "VERSION : 0.1" | "STRUCT"), "{line}");
                continue;
            };
            let kind = rest.split_once(';').expect("a semicolon").0;
            if kind == "Bool" {
                structure
                    .members
                    .push((name.to_owned(), at, kind.to_owned()));
                at += 1;
            } else if let Some(last) = kind.strip_prefix("Array[0..") {
                let last: usize = last
                    .strip_suffix("] of Byte")
                    .expect(kind)
                    .parse()
                    .expect(kind);
                at = at.next_multiple_of(16);
                structure
                    .members
                    .push((name.to_owned(), at, kind.to_owned()));
                at = (at + (last + 1) * 8).next_multiple_of(16);
            } else {
                let size = kind.parse::<DataType>().expect(kind).size_bytes();
                at = at.next_multiple_of(if size == 1 { 8 } else { 16 });
                structure
                    .members
                    .push((name.to_owned(), at, kind.to_owned()));
                at += size * 8;
            }
        }
        structure.bytes = at.next_multiple_of(16) / 8;
        all.insert(name.to_owned(), structure);
    }
    all
}

fn source(config: &Config, which: &str) -> String {
    source_for(config, Target::S71500, which)
}

fn source_for(config: &Config, target: Target, which: &str) -> String {
    let made = export(config, target).expect("sources");
    let file = made
        .files
        .into_iter()
        .find(|file| file.name.contains(which));
    file.unwrap_or_else(|| panic!("{which}")).text
}

/// Each signal with its area and its first bit in the record of that area.
fn expected(config: &Config) -> Vec<(Area, usize, &tickbus::signal::Signal)> {
    let table = &config.table;
    let start = |area, station: usize| {
        table.stations[..station]
            .iter()
            .map(|s| s.bytes(area))
            .sum::<usize>()
    };
    let place = |signal: &'_ tickbus::signal::Signal| {
        (start(signal.area, signal.station) + signal.byte) * 8 + usize::from(signal.bit)
    };
    table
        .signals
        .iter()
        .map(|signal| (signal.area, place(signal), signal))
        .collect()
}

/// Asserts that each signal is placed once, at its bus offset, and that values are copied between the right
/// places.
fn assert_laid(config: &Config, target: Target) {
    let data = source_for(config, target, "data");
    let structures = structures(&data);
    let copy = source_for(config, target, "copy");
    let (begin, end) = copy.split_once("END_FUNCTION").expect("two functions");
    let prefix = config.name.replace(' ', "_");
    for (area, name, block, body) in [
        (Area::Input, "inputs", "in", begin),
        (Area::Output, "outputs", "out", end),
    ] {
        let name = format!("\"{prefix}_{name}\"");
        let block = format!("\"{prefix}_{block}\".Image.");
        let total: usize = config
            .table
            .stations
            .iter()
            .map(|station| station.bytes(area))
            .sum();
        let Some(structure) = structures.get(&name) else {
            assert_eq!(total, 0);
            continue;
        };
        assert_eq!(structure.bytes, total.next_multiple_of(2), "{data}");
        let names: HashSet<&String> = structure.members.iter().map(|(path, ..)| path).collect();
        assert_eq!(
            names.len(),
            structure.members.len(),
            "names are unique\n{data}"
        );
        let signals: Vec<_> = expected(config)
            .into_iter()
            .filter(|(of, ..)| *of == area)
            .collect();
        let mut covered = 0;
        for (_, at, signal) in &signals {
            let size = signal.data_type.size_bytes();
            let native = size == 1
                || (signal.order == ByteOrder::Abcd
                    && (at / 8).is_multiple_of(2)
                    && (target == Target::S71500 || size < 8));
            let pieces: Vec<(usize, String)> = if native {
                vec![(*at, signal.data_type.to_string())]
            } else {
                (0..signal.data_type.size_bytes())
                    .map(|byte| (at + 8 * byte, "BYTE".to_owned()))
                    .collect()
            };
            for (at, kind) in pieces {
                let found: Vec<_> = structure
                    .members
                    .iter()
                    .filter(|member| member.1 == at)
                    .collect();
                assert_eq!(found.len(), 1, "{} at bit {at}\n{data}", signal.name);
                let (path, _, found) = found[0];
                assert!(!path.contains("\"_reserve"), "{path} at bit {at}");
                assert_eq!(found.to_uppercase(), kind, "{}", signal.name);
                let uses = body.matches(&format!("{block}{path}")).count();
                assert!(uses >= 1, "{path} is copied\n{body}");
                covered += 1;
            }
        }
        let reserve = structure
            .members
            .iter()
            .filter(|(path, ..)| path.contains("\"_reserve"))
            .count();
        assert_eq!(
            covered + reserve,
            structure.members.len(),
            "nothing else is there\n{data}"
        );
        assert_eq!(
            body.matches(&block).count(),
            covered,
            "each is copied once\n{body}"
        );
    }
}

#[test]
fn the_connection_follows_role_tcp() {
    let signal = "[[signal]]\nname = \"a\"\naddress = \"%QW0\"\n[[signal]]\nname = \"b\"\naddress = \"%ID0\"\n";
    let link = source(&tables::parse("", signal), "link");
    for line in [
        "#Connection.ActiveEstablished := TRUE;",
        "#Connection.RemoteAddress.ADDR[1] := 192;",
        "#Connection.RemoteAddress.ADDR[4] := 20;",
        "#Connection.RemotePort := 2000;",
        "#Connection.LocalPort := 0;",
    ] {
        assert!(link.contains(line), "{line}\n{link}");
    }
    let link = source(&tables::parse("role_tcp = \"connect\"", signal), "link");
    for line in [
        "#Connection.ActiveEstablished := FALSE;",
        "#Connection.RemoteAddress.ADDR[1] := 0;",
        "#Connection.RemotePort := 0;",
        "#Connection.LocalPort := 2000;",
    ] {
        assert!(link.contains(line), "{line}\n{link}");
    }
    assert_eq!(
        (
            link.matches("LEN := 2,").count(),
            link.matches("LEN := 4,").count()
        ),
        (1, 1),
        "{link}"
    );
}

#[test]
fn a_direction_without_bytes_has_no_block() {
    let config = tables::parse("", "[[signal]]\nname = \"a\"\naddress = \"%QW0\"\n");
    assert_laid(&config, Target::S71500);
    let (data, link) = (source(&config, "data"), source(&config, "link"));
    assert!(!data.contains("Cell_1_in") && !link.contains("TRCV_C") && link.contains("TSEND_C"));
}

proptest! {
    #[test]
    fn any_table_is_laid_where_the_bus_has_it(config in tables::any_table()) {
        assert_laid(&config, Target::S71500);
        assert_laid(&config, Target::S71200);
    }

    /// An S7-1200 has no `LWord`, `LInt` and `ULInt`, and an `LReal` cannot be addressed.
    #[test]
    fn nothing_of_64_bits_is_in_the_sources_for_an_s7_1200(config in tables::any_table()) {
        for file in export(&config, Target::S71200).expect("sources").files {
            if file.name.ends_with("README.txt") {
                continue;
            }
            for line in file.text.split("\r\n") {
                let code = line.split_once("//").map_or(line, |(code, _)| code);
                // Names and comments of tags are chosen by the user.
                let code = if file.name.contains(".sdf") { code.split(',').nth(2).unwrap_or_default() } else { code };
                for word in ["LWord", "LInt", "LReal", "LWORD", "LINT", "LREAL"] {
                    let found = code.split(|c: char| !c.is_ascii_alphanumeric()).any(|piece| piece == word);
                    prop_assert!(!found, "{}: {}", file.name, line);
                }
            }
        }
    }

    #[test]
    fn the_same_table_makes_the_same_texts(config in tables::any_table()) {
        prop_assert_eq!(export(&config, Target::S71500), export(&config.clone(), Target::S71500));
    }

    /// Identifiers are ASCII, comments stay on their line, and quotation marks outside them are paired.
    #[test]
    fn every_line_is_one_that_scl_can_read(config in tables::any_table()) {
        for which in ["data", "link", "copy"] {
            for line in source(&config, which).trim_start_matches('\u{feff}').split("\r\n") {
                prop_assert!(!line.contains(['\n', '\r']), "{}", line);
                let code = line.split_once("//").map_or(line, |(code, _)| code);
                prop_assert!(code.is_ascii(), "{}", code);
                prop_assert!(code.matches('"').count() % 2 == 0, "{}", code);
            }
        }
    }
}

/// Runs the statements of the link block that decide when a record is sent, with an OB1 of `scan`
/// milliseconds and a `TSEND_C` that is busy for `busy` calls; returns when each record was requested.
fn sent_at(scan: i128, busy: u32, until: i128) -> Vec<i128> {
    let config = tables::parse(
        "cycle = \"10ms\"",
        "[[signal]]\nname = \"a\"\naddress = \"%QW0\"\n",
    );
    let link = source(&config, "link");
    let piece = |from: &str, to: &str| {
        let start = link.find(from).unwrap_or_else(|| panic!("{from}\n{link}"));
        let end = start
            + link[start..]
                .find(to)
                .unwrap_or_else(|| panic!("{to}\n{link}"));
        link[start..end]
            .lines()
            .map(|line| line.split_once("//").map_or(line, |(code, _)| code))
            .collect::<Vec<_>>()
            .join("\n")
    };
    let unit = |name: &str, code: &str| {
        let code = code
            .replace('#', "")
            .replace("\"Cell_1\".", "")
            .replace("T0ms", "0")
            .replace("T10ms", "10");
        units(&format!("PROGRAM {name}\n{code}\nEND_PROGRAM\n")).remove(0)
    };
    let before = unit(
        "before",
        &(piece("#Now := ", "// What is being sent") + piece("#Is_asked := ", "#Send(").as_str()),
    );
    let after = unit("after", &piece("#Is_busy := ", "IF #Send.DONE"));
    let mut machine = Machine::with_functions(&[]);
    for name in ["Now", "Last"] {
        machine
            .variables
            .insert(name.to_owned(), Value::Whole(None, 0));
    }
    for name in ["Is_due", "Is_asked", "Is_busy"] {
        machine
            .variables
            .insert(name.to_owned(), Value::Bool(false));
    }
    machine
        .variables
        .insert("Simulated".to_owned(), Value::Bool(true));
    let (mut sent, mut left, mut asked) = (Vec::new(), 0, false);
    let mut now = 0;
    while now < until {
        machine
            .variables
            .insert("Clock.ET".to_owned(), Value::Whole(None, now));
        machine.run(&before.body);
        // TSEND_C starts a job on a rising edge of REQ, and is busy for some calls.
        let asks = machine.variables["Is_asked"] == Value::Bool(true);
        left = if asks && !asked {
            busy
        } else {
            u32::saturating_sub(left, 1)
        };
        if asks {
            assert!(!asked, "REQ rises at {now}");
            sent.push(now);
        }
        asked = asks;
        machine
            .variables
            .insert("Send.BUSY".to_owned(), Value::Bool(left > 0));
        machine.run(&after.body);
        now += scan;
    }
    sent
}

#[test]
fn the_socket_block_keeps_its_cycle_whatever_ob1_takes() {
    for scan in [1, 2, 3, 4, 5] {
        for busy in [0, 1] {
            let sent = sent_at(scan, busy, 10_000);
            let count = sent.len();
            assert!(
                (998..=1000).contains(&count),
                "{count} records in 10 s with {scan} ms"
            );
        }
    }
    // If OB1 is slower, it sends in every other call, and never stops.
    let sent = sent_at(20, 1, 10_000);
    assert!((249..=250).contains(&sent.len()), "{}", sent.len());
}

#[test]
fn a_long_pause_of_the_plc_is_not_made_up_for_in_a_burst() {
    // 25 ms per call: each record is late by more than a whole cycle.
    let sent = sent_at(25, 0, 1_000);
    assert!(
        sent.windows(2).all(|pair| pair[1] - pair[0] >= 25),
        "{sent:?}"
    );
}

/// A driver.cfg on the bus `kind` with `inputs` and `outputs` bytes.
fn sized(kind: &str, inputs: usize, outputs: usize) -> Config {
    let text = format!(
        "[driver]\nid = 7\nname = \"Cell 1\"\n[fieldbus]\nkind = \"{kind}\"\ninput_bytes = {inputs}\n\
         output_bytes = {outputs}\n[[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n[[signal]]\nname = \"b\"\n\
         address = \"%QX0.0\"\n"
    );
    Config::parse("driver.cfg", &text, &tickbus::KINDS)
        .unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}"))
}

/// First byte, length, and length of the local array of each PUT (`Q`) or GET (`I`).
fn jobs(link: &str, area: char, parts: &str) -> Vec<(usize, usize, usize)> {
    let addresses = link
        .lines()
        .filter_map(|line| line.trim().strip_prefix(&format!("ADDR_1 := P#{area}")));
    let addresses = addresses.map(|rest| {
        let (first, length) = rest.split_once(".0 BYTE ").expect("whole bytes");
        let length = length.trim_end_matches(',');
        (
            first.parse().expect("a byte"),
            length.parse().expect("a length"),
        )
    });
    let view = link
        .split_once(&format!("{parts}_parts AT"))
        .map_or("", |(_, view)| view);
    let view = view.split_once("END_STRUCT").map_or("", |(view, _)| view);
    let arrays: Vec<usize> = view
        .lines()
        .filter_map(|line| line.split_once("Array[0.."))
        .map(|(_, rest)| {
            rest.split_once(']')
                .expect("an end")
                .0
                .parse::<usize>()
                .expect("a number")
                + 1
        })
        .collect();
    let jobs: Vec<(usize, usize, usize)> = addresses
        .zip(arrays)
        .map(|((first, length), array)| (first, length, array))
        .collect();
    assert_eq!(
        jobs.len(),
        link.matches(&format!("ADDR_1 := P#{area}")).count()
    );
    jobs
}

#[test]
fn no_put_and_no_get_is_longer_than_the_cpu_takes_and_both_ends_have_the_same_length() {
    for (target, get, put) in [(Target::S71200, 222, 212), (Target::S71500, 400, 400)] {
        for bytes in [1, 25, 212, 213, 222, 223, 360, 401, 1000] {
            let link = source_for(&sized("s7-server", bytes, bytes), target, "link");
            for (area, parts, most) in [('I', "Incoming", get), ('Q', "Outgoing", put)] {
                let mut next = 0;
                for (first, length, array) in jobs(&link, area, parts) {
                    assert_eq!((first, length), (next, array), "{link}");
                    assert!(length <= most, "{length} bytes\n{link}");
                    next += length;
                }
                assert_eq!(next, bytes, "all bytes are carried\n{link}");
            }
        }
    }
}

/// Everything that the control block declares, except `Simulated`, is set by the link block, on every bus.
#[test]
fn no_member_of_the_control_block_is_one_that_nothing_sets() {
    for kind in [
        "socket",
        "modbus-server",
        "modbus-client",
        "s7-server",
        "s7-client",
        "opcua-server",
        "loopback",
    ] {
        let address = match kind {
            "modbus-client" => "address = \"192.168.0.1:502\"\n",
            "s7-client" => "address = \"192.168.0.1\"\n",
            "opcua-server" => "anonymous = true\n",
            "loopback" => "link = \"cell\"\n",
            _ => "",
        };
        for (bytes, letter) in [((4, 0), 'I'), ((0, 4), 'Q'), ((4, 4), 'I')] {
            let text = format!(
                "[driver]\nid = 7\nname = \"Cell 1\"\n[fieldbus]\nkind = \"{kind}\"\n{address}input_bytes = {}\n\
                 output_bytes = {}\n[[signal]]\nname = \"a\"\naddress = \"%{letter}X0.0\"\n",
                bytes.0, bytes.1
            );
            let config = Config::parse("driver.cfg", &text, &tickbus::KINDS)
                .unwrap_or_else(|m| panic!("{m}\n{text}"));
            let (data, link) = (source(&config, "data"), source(&config, "link"));
            let control = data
                .split_once("DATA_BLOCK \"Cell_1\"")
                .expect("the control block")
                .1;
            for member in ["Alive", "Received", "Sent", "Errors", "Last_error"] {
                let sets = link.contains(&format!("\"Cell_1\".{member} := "));
                let declares = control.contains(&format!("{member} : "));
                assert_eq!(sets, declares, "{member} on {kind}\n{link}\n{control}");
            }
        }
    }
}

/// On every bus the PLC watches heartbeats of the driver, and counts up the signals named in `alive`.
#[test]
fn signs_of_life_are_watched_and_given_on_every_bus() {
    for kind in ["socket", "s7-client"] {
        let address = if kind == "s7-client" {
            "address = \"192.168.0.1\"\ninput = \"DB1\"\noutput = \"DB2\"\n"
        } else {
            ""
        };
        let text = format!(
            "[driver]\nid = 7\nname = \"Cell 1\"\n[fieldbus]\nkind = \"{kind}\"\n{address}\
             alive = {{ signal = \"PLC life\", within = \"500ms\" }}\n\
             heartbeat = {{ signal = \"Beat\", every = \"100ms\" }}\n\
             [[signal]]\nname = \"PLC life\"\naddress = \"%QB1\"\n\
             [[signal]]\nname = \"Beat\"\naddress = \"%IW2\"\ntype = \"UINT\"\n"
        );
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS)
            .unwrap_or_else(|m| panic!("{m}\n{text}"));
        let link = source(&config, "link");
        let beat = "\"Cell_1_in\".Image.\"Beat\"";
        for line in [
            format!("IF {beat} <> #Last_beat_1 THEN"),
            "PT := T#500ms);".to_owned(),
            format!("#Last_beat_1 := {beat};"),
            "\"Cell_1\".Alive := #Is_heard_1;".to_owned(),
        ] {
            assert!(link.contains(&line), "{line}\n{link}");
        }
        let (data, copy) = (source(&config, "data"), source(&config, "copy"));
        assert!(
            data.contains("Alive : Bool;   // the simulation ticks"),
            "{data}"
        );
        let life = "\"Cell_1_out\".Image.\"PLC_life\"";
        assert!(
            copy.contains(&format!(
                "{life} := USINT_TO_BYTE((BYTE_TO_USINT({life}) + 1) MOD 100);"
            )),
            "{copy}"
        );
        assert!(
            !copy.contains("%QB1"),
            "the count is not overwritten\n{copy}"
        );
    }
}

/// If the CPU's own inputs and outputs are the place of the images, %I contains what the simulation has
/// written: it must not be overwritten with zeros from a data block.
#[test]
fn what_the_simulation_reads_and_writes_in_the_cpu_itself_is_not_copied() {
    let config = Config::parse(
        "driver.cfg",
        "[driver]\nid = 7\nname = \"Cell 1\"\n[fieldbus]\nkind = \"s7-client\"\naddress = \"192.168.0.1\"\noutput = \"DB2\"\n\
         alive = { signal = \"Life\", within = \"500ms\" }\nheartbeat = { signal = \"Beat\", every = \"100ms\" }\n\
         [fieldbus.at]\n\"Life\" = \"DB20.DBW8\"\n\
         [[signal]]\nname = \"Beat\"\naddress = \"%IW4\"\ntype = \"UINT\"\n[[signal]]\nname = \"Life\"\naddress = \"%QW0\"\n\
         [[signal]]\nname = \"Run\"\naddress = \"%QX2.0\"\n", &tickbus::KINDS,
    )
    .unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let (link, copy) = (source(&config, "link"), source(&config, "copy"));
    assert!(
        !copy.contains(":= \"Cell_1_in\"") && !copy.contains("%IW4"),
        "{copy}"
    );
    assert!(
        copy.contains("\"Cell_1_out\".Image.\"Run\" := %Q2.0;"),
        "{copy}"
    );
    assert!(
        copy.contains("%DB20.DBB9 := USINT_TO_BYTE((BYTE_TO_USINT(%DB20.DBB9) + 1) MOD 100);"),
        "{copy}"
    );
    assert!(
        link.contains("IF %IB5 <> #Last_beat_1 THEN") && link.contains("Last_beat_1 : Byte;"),
        "{link}"
    );
}
