//! Tag lists of clients, PLC4X and KEPServer: their addresses go to `[fieldbus.at]`.

use tickbus::driver_cfg::Config;
use tickbus::import::{Client, ImportOptions, import};

use crate::import::{read, signals, told};

fn expected(signals: &[(&str, &str, &str)]) -> Vec<(String, String, String)> {
    let own = |text: &str| text.to_owned();
    signals
        .iter()
        .map(|(name, address, kind)| (own(name), own(address), own(kind)))
        .collect()
}

#[test]
fn lists_of_plc4x_with_registers_become_a_modbus_client() {
    let laid = expected(&[
        ("Level", "%QW4", "UINT"),
        ("Temperature", "%QD0", "REAL"),
        ("Pump", "%QX6.0", "BOOL"),
        ("Full", "%QX6.1", "BOOL"),
    ]);
    for text in [
        "Level;holding-register:21:UINT\nTemperature;input-register:7:REAL\nPump;coil:5\nFull;4x00021.3\n",
        "name;address;dataType\nLevel;holding-register:21;UINT\nTemperature;300007;REAL\nPump;coil:5;BOOL\nFull;400021.3;BOOL\n",
        "# tags\nLevel = holding-register:21:UINT\nTemperature = input-register:7:REAL\nPump=coil:5:BOOL\n\nFull = 400021.3\n",
    ] {
        let imported = read(text);
        assert!(
            imported.text.contains("kind    = \"modbus-client\""),
            "{}",
            imported.text
        );
        assert_eq!(signals(&imported), laid, "{text}");
    }
    let imported = read("Level;holding-register:21:UINT\n");
    assert!(
        imported
            .text
            .contains("[fieldbus.at]\n\"Level\" = \"holding-register:21:UINT\"\n"),
        "addresses stand as the list has them\n{}",
        imported.text
    );
}

#[test]
fn lists_of_plc4x_with_data_blocks_become_an_s7_client_that_writes_only_inputs() {
    let imported = read(
        "Start;%DB1.DBX0.0:BOOL\nSpeed;%DB1.DBD4:REAL\nDoor;%I0.3:BOOL\nLamp;%Q1.0:BOOL\nCount;%MW20:INT\n",
    );
    assert!(
        imported.text.contains("kind    = \"s7-client\""),
        "{}",
        imported.text
    );
    assert_eq!(
        signals(&imported),
        expected(&[
            ("Start", "%QX6.0", "BOOL"),
            ("Speed", "%QD0", "REAL"),
            ("Door", "%IX0.0", "BOOL"),
            ("Lamp", "%QX6.1", "BOOL"),
            ("Count", "%QW4", "INT"),
        ])
    );
    let config = Config::parse("driver.cfg", &imported.text, &tickbus::KINDS).expect("right");
    assert_eq!(config.bus.kind(), "s7-client");
}

#[test]
fn an_export_of_kepserver_keeps_types_units_scales_and_who_may_write() {
    let heading = "Tag Name,Address,Data Type,Respect Data Type,Client Access,Scan Rate,Scaling,Raw Low,Raw High,Scaled Low,\
                   Scaled High,Scaled Data Type,Clamp Low,Clamp High,Eng Units,Description,Negate Value\n";
    let imported = read(&format!(
        "{heading}\"Tank.Level\",400021,Word,1,RO,100,Linear,0,27648,0,100,Double,0,0,\"l\",\"in the tank\",0\n\
         \"Tank.Valve\",000005,Boolean,1,WO,100,,,,,,,,,,\"\",\n\
         \"Tank.Flow\",400031,Float,1,R/W,100,,,,,,,,,\"m3/h\",\"\",\n"
    ));
    assert_eq!(
        signals(&imported),
        expected(&[
            ("Tank.Level", "%QW4", "UINT"),
            ("Tank.Valve", "%IX0.0", "BOOL"),
            ("Tank.Flow", "%QD0", "REAL"),
        ])
    );
    for line in [
        "kind    = \"modbus-client\"",
        "\"Tank.Level\" = \"400021\"",
        "scale   = { raw = [0.0, 27648.0], value = [0.0, 100.0] }",
        "unit    = \"l\"",
        "comment = \"in the tank\"",
    ] {
        assert!(imported.text.contains(line), "{line}\n{}", imported.text);
    }
    let imported = read(&format!(
        "{heading}\"Speed\",\"DB10,REAL4\",Float,1,R/W,100,,,,,,,,,,,\n\"Run\",\"DB10,X0.3\",Boolean,1,RO,100,,,,,,,,,,,\n"
    ));
    assert!(
        imported.text.contains("\"Speed\" = \"DB10,REAL4\""),
        "{}",
        imported.text
    );
    assert!(
        imported.text.contains("kind    = \"s7-client\""),
        "{}",
        imported.text
    );
}

#[test]
fn an_address_of_either_bus_is_read_as_the_one_that_is_asked_for() {
    let text = "name;address;type\nLevel;%MW20;INT\n";
    assert!(told(text).contains("--bus s7-client"), "{}", told(text));
    for client in [Client::S7, Client::Modbus] {
        let reading = ImportOptions {
            client: Some(client),
            ..ImportOptions::default()
        };
        let imported =
            import("tags.csv", text.as_bytes(), reading, &tickbus::KINDS).expect("a list");
        let config = Config::parse("driver.cfg", &imported.text, &tickbus::KINDS).expect("right");
        assert_eq!(config.bus.kind(), client.kind());
    }
}

#[test]
fn wrong_addresses_types_and_directions_of_a_client_are_told_with_their_places() {
    let told = told(
        "name;address;type;direction\n\
         a;holding-register:21;UINT;\n\
         b;holding-register:22:UINT[10];;\n\
         c;400030;BOOL;\n\
         d;coil:7;INT;\n\
         e;holding-register:40;String;\n\
         f;holding-register:41;INT;sideways\n",
    );
    let starts = [
        "tags.csv:3:3: ",
        "tags.csv:4:10: ",
        "tags.csv:5:10: ",
        "tags.csv:6:23: ",
        "tags.csv:7:27: ",
    ];
    assert_eq!(told.lines().count(), starts.len(), "{told}");
    for (line, start) in told.lines().zip(starts) {
        assert!(line.starts_with(start), "{start}\n{told}");
    }
    assert!(
        told.contains("name a bit of the register, such as 400021.0"),
        "{told}"
    );
}

/// The positions and messages of lines that are left out, if wrong lines may be.
fn left_out(text: &str) -> Vec<String> {
    let reading = ImportOptions {
        lenient: true,
        ..ImportOptions::default()
    };
    let imported = import("tags.csv", text.as_bytes(), reading, &tickbus::KINDS).expect("the rest");
    let skipped = imported.skipped.iter();
    skipped
        .map(|found| {
            let place = found.place.expect("a place");
            format!("{place:?} {}", found.mistake.what)
        })
        .collect()
}

#[test]
fn a_type_that_contradicts_its_address_is_told_at_its_cell() {
    for (address, kind) in [
        ("holding-register:21:UINT", "REAL"),
        ("%DB10.DBW2:INT", "UINT"),
        ("%DB10.DBD4:REAL", "DINT"),
    ] {
        let told = left_out(&format!(
            "name;address;type\nA;{address};{kind}\nB;{address};\n"
        ));
        assert_eq!(told.len(), 1, "{told:?}");
        assert!(
            told[0].starts_with(&format!("(2, {})", 4 + address.len())),
            "{told:?}"
        );
        assert!(
            told[0].contains(&format!("{kind} is not the type")),
            "{told:?}"
        );
    }
    // Text that is no type is a comment.
    assert_eq!(
        signals(&read("Level;holding-register:21:UINT;in the tank\n")).len(),
        1
    );
}

#[test]
fn what_the_bus_would_refuse_is_told_at_its_cell_and_left_out_when_asked_for() {
    let told = left_out(
        "name;address;type;direction\n\
         Half;400021;USINT;\nLow;400022.0;USINT;\nHigh;400022.8;BYTE;\n\
         Ambient;300007;INT;WO\nSecond;400023.4;BYTE;\n",
    );
    assert_eq!(
        told,
        [
            "(2, 13) USINT does not fit \"400021\": the one has 8 bits, the other 16",
            "(5, 20) the simulation cannot write \"300007\"",
            "(6, 17) BYTE does not fit \"400023.4\": the one has 8 bits, the other 1",
        ]
    );
}

#[test]
fn an_input_of_the_cpu_is_written_even_where_the_list_only_reads_it() {
    let imported = read("name;address;type;direction\nDoor;%I0.3:BOOL;;RO\nLamp;%Q1.0:BOOL;;RO\n");
    assert_eq!(
        signals(&imported),
        expected(&[("Door", "%IX0.0", "BOOL"), ("Lamp", "%QX0.0", "BOOL")])
    );
}

#[test]
fn a_falling_scale_of_kepserver_is_kept() {
    let heading = "Tag Name,Address,Data Type,Respect Data Type,Client Access,Scan Rate,Scaling,Raw Low,Raw High,Scaled Low,\
                   Scaled High,Scaled Data Type,Clamp Low,Clamp High,Eng Units,Description,Negate Value\n";
    let imported = read(&format!(
        "{heading}\"Level\",400021,Word,1,RO,100,Linear,0,27648,100,0,Double,0,0,\"\",\"\",0\n"
    ));
    assert!(
        imported.text.contains("value = [100.0, 0.0]"),
        "{}",
        imported.text
    );
    let flat = told(&format!(
        "{heading}\"Level\",400021,Word,1,RO,100,Linear,0,27648,5,5,Double,0,0,\"\",\"\",0\n"
    ));
    assert!(flat.contains("the linear scale has wrong values"), "{flat}");
}
