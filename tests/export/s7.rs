//! The sources for S7, under the eyes of a reader that lays structures out by itself.

use std::collections::{HashMap, HashSet};

use proptest::prelude::*;
use tickbus::driver::Config;
use tickbus::export::{Target, export};
use tickbus::signal::{Area, ByteOrder, DataType};

use crate::tables;

/// A structure as S7 lays it out with standard access.
#[derive(Debug, Default)]
struct Structure {
    /// Path, offset in bits, type.
    members: Vec<(String, usize, String)>,
    bytes: usize,
}

/// All structures of a source, by name, laid out by the rules of S7 alone: no offset is read from a comment.
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
            } else if let Some(inner) = all.get(kind) {
                at = at.next_multiple_of(16);
                for (path, offset, kind) in &inner.members {
                    structure
                        .members
                        .push((format!("{name}.{path}"), at + offset, kind.clone()));
                }
                at += inner.bytes * 8;
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
    let made = export(config, Target::S71500).expect("sources");
    let file = made
        .files
        .into_iter()
        .find(|file| file.name.contains(which));
    file.unwrap_or_else(|| panic!("{which}")).text
}

/// Each signal with its area and the bit at which it begins in the record of that area.
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

/// Asserts that S7 lays each signal where the bus has it, once, and that the copies go between the right places.
fn assert_laid(config: &Config) {
    let data = source(config, "data");
    let structures = structures(&data);
    let copy = source(config, "copy");
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
            let native = signal.data_type.size_bytes() == 1
                || (signal.order == ByteOrder::Abcd && (at / 8).is_multiple_of(2));
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
fn axes_become_structures_of_one_type() {
    let config = tables::axes();
    assert_laid(&config);
    let data = source(&config, "data");
    let structures = structures(&data);
    assert_eq!(structures["\"Cell_1_command_1\""].bytes, 30, "{data}");
    assert_eq!(structures["\"Cell_1_feedback_1\""].bytes, 10, "{data}");
    for axis in 0..3 {
        assert!(
            data.contains(&format!("\"axis_{axis}\" : \"Cell_1_command_1\"")),
            "{data}"
        );
    }
    for axis in 0..4 {
        assert!(
            data.contains(&format!("\"axis_{axis}\" : \"Cell_1_feedback_1\"")),
            "{data}"
        );
    }
    assert!(
        data.contains("\"axis_3\" : \"Cell_1_command_axis_3\""),
        "{data}"
    );
}

#[test]
fn the_peeling_line_has_its_axes_as_structures() {
    for (file, axes) in [("charger", 12), ("lathe", 13)] {
        let path = format!("{}/plc/peeler/{file}.cfg", env!("CARGO_MANIFEST_DIR"));
        let config = Config::load(path.as_ref()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        assert_laid(&config);
        let structures = structures(&source(&config, "data"));
        let of_size = |bytes: usize, kind: &str| {
            let types = structures
                .iter()
                .filter(|(name, s)| name.contains(kind) && s.bytes == bytes);
            types.count()
        };
        assert!(
            of_size(30, "_command_") > 0 && of_size(10, "_feedback_") > 0,
            "{structures:?}"
        );
        let data = source(&config, "data");
        // The first axis of either lends bits of its reserve to signals between the two PLCs, and is no structure.
        let members = data.matches("\" : \"").count();
        assert!(
            members >= 2 * (axes - 1),
            "{members} structures for {axes} axes\n{data}"
        );
    }
}

#[test]
fn a_stranger_between_two_members_keeps_them_out_of_a_structure() {
    let config = tables::parse(
        "",
        "[[signal]]\nname = \"a.x\"\naddress = \"%QX0.0\"\n[[signal]]\nname = \"b\"\naddress = \"%QX0.1\"\n\
         [[signal]]\nname = \"a.y\"\naddress = \"%QX0.2\"\n[[signal]]\nname = \"c.x\"\naddress = \"%QX2.0\"\n\
         [[signal]]\nname = \"c.y\"\naddress = \"%QX2.1\"\n[[signal]]\nname = \"d\"\naddress = \"%QX2.2\"\n",
    );
    assert_laid(&config);
    assert_eq!(structures(&source(&config, "data")).len(), 1);
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
    assert_laid(&config);
    let (data, link) = (source(&config, "data"), source(&config, "link"));
    assert!(!data.contains("Cell_1_in") && !link.contains("TRCV_C") && link.contains("TSEND_C"));
}

proptest! {
    #[test]
    fn any_table_is_laid_where_the_bus_has_it(config in tables::any_table()) {
        assert_laid(&config);
    }

    #[test]
    fn the_same_table_makes_the_same_texts(config in tables::any_table()) {
        prop_assert_eq!(export(&config, Target::S71500), export(&config.clone(), Target::S71500));
    }

    /// Identifiers are ASCII, comments stay in their line, and quotation marks come in pairs outside of them.
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
