//! Files in the formats of PLC editors.

use std::fmt::Write as _;

use tickbus::import::{Client, ImportOptions, Imported, condensed, import};
use tickbus_image::signal::Addressing;

use crate::import::{notes, signals};

fn read_as(file: &str, text: &str, reading: ImportOptions) -> Result<Imported, String> {
    import(file, text.as_bytes(), reading, &tickbus::KINDS).map_err(|mistakes| mistakes.to_string())
}

fn read(file: &str, text: &str) -> Imported {
    read_as(file, text, ImportOptions::default()).unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

fn told(file: &str, text: &str) -> String {
    read_as(file, text, ImportOptions::default()).expect_err("mistakes")
}

/// Name, address and type of each signal.
fn lines(imported: &Imported) -> Vec<String> {
    let signals = signals(imported).into_iter();
    signals
        .map(|(name, address, kind)| format!("{name} {address} {kind}"))
        .collect()
}

/// A module in a chassis, with `data` as that of its `side`, such as `Input`.
fn module(slot: usize, side: &str, comments: &str, data: &str) -> String {
    format!(
        "<Module Name=\"M{slot}\" ParentModule=\"Local\"><Ports><Port Id=\"1\" Address=\"{slot}\" Type=\"ICP\" Upstream=\"true\"/></Ports>\
         <Communications><Connections><Connection><{side}Tag>{comments}<Data Format=\"L5K\"><![CDATA[[0]]]></Data>\
         <Data Format=\"Decorated\"><Structure DataType=\"x\">{data}</Structure></Data></{side}Tag></Connection></Connections>\
         </Communications></Module>"
    )
}

fn l5x(modules: &str, tags: &str) -> String {
    format!(
        "<RSLogix5000Content><Controller><Modules>{modules}</Modules><Tags>{tags}</Tags></Controller></RSLogix5000Content>"
    )
}

const DATA: &str = "<DataValueMember Name=\"Fault\" DataType=\"DINT\"/><DataValueMember Name=\"Data\" DataType=\"DINT\"/>";

#[test]
fn the_data_of_modules_are_signals_and_commented_bits_are_bits() {
    let comments = "<Comments><Comment Operand=\".DATA.3\"><![CDATA[door\nclosed]]></Comment>\
                    <Comment Operand=\".DATA.10\">lid</Comment></Comments>";
    let array = "<ArrayMember Name=\"Value\" DataType=\"INT\" Dimensions=\"2\"><Element Index=\"[0]\" Value=\"0\"/>\
                 <Element Index=\"[1]\" Value=\"0\"/></ArrayMember><StructureMember Name=\"Ch0\" DataType=\"y\">\
                 <DataValueMember Name=\"Data\" DataType=\"REAL\"/></StructureMember>";
    let modules = module(1, "Input", comments, DATA) + module(2, "Output", "", array).as_str();
    let imported = read("cell.L5X", &l5x(&modules, ""));
    assert_eq!(
        lines(&imported),
        [
            "Local:1:I.Fault %ID0 DINT",
            "Local:1:I.Data.3 %IX4.0 BOOL",
            "Local:1:I.Data.10 %IX4.1 BOOL",
            "Local:2:O.Value[0] %QW4 INT",
            "Local:2:O.Value[1] %QW6 INT",
            "Local:2:O.Ch0.Data %QD0 REAL",
        ]
    );
    assert_eq!(
        notes(&imported),
        [
            "Local:1:I.Data.3: door closed []",
            "Local:1:I.Data.10: lid []"
        ]
    );
    assert_eq!((imported.signals, imported.assigned), (6, 6));
}

#[test]
fn aliases_give_names_to_points_bits_and_whole_structures() {
    let modules = module(1, "Input", "", DATA) + module(2, "Input", "", DATA).as_str();
    let tags = "<Tag Name=\"Door\" TagType=\"Alias\" AliasFor=\"local:1:i.data.3\"/>\
                <Tag Name=\"Faults\" TagType=\"Alias\" AliasFor=\"Local:1:I.Fault\"/>\
                <Tag Name=\"Rack\" TagType=\"Alias\" AliasFor=\"Local:2:I\"/>";
    assert_eq!(
        lines(&read("cell.L5X", &l5x(&modules, tags))),
        [
            "Door %IX12.0 BOOL",
            "Faults %ID0 DINT",
            "Rack.Fault %ID4 DINT",
            "Rack.Data %ID8 DINT"
        ]
    );
}

#[test]
fn a_module_in_a_remote_rack_is_a_part_of_its_adapters_data() {
    let slot = "<ArrayMember Name=\"Slot\" DataType=\"z\" Dimensions=\"2\"><Element Index=\"[0]\"><Structure DataType=\"z\">\
                <DataValueMember Name=\"Data\" DataType=\"DINT\"/></Structure></Element><Element Index=\"[1]\"><Structure DataType=\"z\">\
                <DataValueMember Name=\"Data\" DataType=\"DINT\"/></Structure></Element></ArrayMember>";
    let adapter = format!(
        "<Module Name=\"Rack\" ParentModule=\"Local\"><Ports><Port Address=\"192.168.0.2\" Type=\"Ethernet\" Upstream=\"true\"/></Ports>\
         <InputTag><Data Format=\"Decorated\"><Structure DataType=\"s\">{slot}</Structure></Data></InputTag></Module>"
    );
    let card = "<Module Name=\"Card\" ParentModule=\"Rack\"><Ports><Port Address=\"1\" Type=\"ICP\" Upstream=\"true\"/></Ports>\
                <InAliasTag><Comments><Comment Operand=\".DATA.5\">lid</Comment></Comments></InAliasTag></Module>";
    let imported = read(
        "cell.L5X",
        &l5x(
            &(adapter + card),
            "<Tag Name=\"Door\" TagType=\"Alias\" AliasFor=\"Rack:1:I.Data.2\"/>",
        ),
    );
    assert_eq!(
        lines(&imported),
        [
            "Door %IX4.0 BOOL",
            "Rack:I.Slot[0].Data %ID0 DINT",
            "Rack:I.Slot[1].Data.5 %IX4.1 BOOL"
        ]
    );
    assert_eq!(notes(&imported), ["Rack:I.Slot[1].Data.5: lid []"]);
}

#[test]
fn an_l5x_without_module_data_is_refused_in_its_own_words() {
    let told = told(
        "cell.L5X",
        &l5x("", "<Tag Name=\"Count\" DataType=\"DINT\"/>"),
    );
    assert!(
        told.contains("none of its tags is an input or output of a module"),
        "{told}"
    );
    assert!(
        told.contains("\"Count\" the first") && !told.contains("%I0.0"),
        "{told}"
    );
}

#[test]
fn the_tag_table_of_studio_5000_gives_aliases_and_commented_points() {
    let text = "remark,\"CSV-Import-Export\"\nremark,\"Version = RSLogix 5000 v33.00\"\n0.3\n\
                TYPE,SCOPE,NAME,DESCRIPTION,DATATYPE,SPECIFIER,ATTRIBUTES\n\
                TAG,,Local:1:I,\"\",\"AB:1756_DI:I:0\",\"\",\"\"\n\
                TAG,,Count,\"\",\"DINT\",\"\",\"(RADIX := Decimal)\"\n\
                COMMENT,,Local:1:I,\"lid$Nopen\",\"\",\"Local:1:I.Data.4\",\"\"\n\
                COMMENT,,Local:1:I,\"the same\",\"\",\"Local:1:I.DATA.3\",\"\"\n\
                ALIAS,,Door,\"closed\",\"\",\"Local:1:I.Data.3\",\"\"\n\
                ALIAS,Main,Lamp,\"\",\"\",\"Local:2:O.Data.0\",\"\"\n\
                ALIAS,,Drive,\"\",\"\",\"Drive:I\",\"\"\n";
    let imported = read("tags.csv", text);
    assert_eq!(
        lines(&imported),
        [
            "Door %IX0.0 BOOL",
            "Main.Lamp %QX0.0 BOOL",
            "Local:1:I.Data.4 %IX0.1 BOOL"
        ]
    );
    assert_eq!(
        notes(&imported),
        [
            "Door: closed []",
            "Main.Lamp:  [Main]",
            "Local:1:I.Data.4: lid open []"
        ]
    );
    let skipped = &imported.skipped[0].mistake;
    assert!(
        skipped.what.contains("\"Drive:I\"") && skipped.right.contains("L5X"),
        "{skipped}"
    );
}

/// An alias of the whole input structure of a module that is not in the file.
const CARD: &str = "<Tag Name=\"Card\" TagType=\"Alias\" AliasFor=\"Rack:1:I\"><Comments>\
                    <Comment Operand=\".PT00\">lid</Comment><Comment Operand=\".CH01\">level</Comment>\
                    <Comment Operand=\".PT00.DATA\">lid</Comment><Comment Operand=\".DATA.7\">door</Comment>\
                    <Comment Operand=\".STATUS\">unknown</Comment></Comments></Tag>";

#[test]
fn a_program_without_its_modules_gives_the_points_whose_type_its_tags_tell() {
    let tags = "<Tag Name=\"Valve\" TagType=\"Alias\" Radix=\"Float\" AliasFor=\"Rack:2:O.Ch03.Out\"/>\
                <Tag Name=\"Level\" TagType=\"Alias\" AliasFor=\"Rack:3:I.Ch00.Data\"/>\
                <Tag Name=\"Lid\" TagType=\"Alias\" AliasFor=\"rack:3:i.pt04.data\"/>\
                <Tag Name=\"Count\" TagType=\"Alias\" Radix=\"Decimal\" AliasFor=\"Rack:4:I.Ctr00.Value\"/>";
    let imported = read("Main_Program.L5X", &l5x("", &format!("{tags}{CARD}")));
    assert_eq!(
        lines(&imported),
        [
            "Valve %QD0 REAL",
            "Level %ID0 REAL",
            "Lid %IX8.0 BOOL",
            "Card.PT00.DATA %IX8.1 BOOL",
            "Card.CH01.DATA %ID4 REAL",
            "Card.DATA.7 %IX8.2 BOOL",
        ]
    );
    assert_eq!(
        notes(&imported),
        [
            "Card.PT00.DATA: lid []",
            "Card.CH01.DATA: level []",
            "Card.DATA.7: door []"
        ]
    );
    let skipped: Vec<&str> = imported
        .skipped
        .iter()
        .map(|skipped| skipped.mistake.what.as_str())
        .collect();
    assert_eq!(
        skipped,
        [
            "the type of \"Rack:4:I.Ctr00.Value\" stands nowhere in the file: skipped",
            "of \"Rack:1:I\" only the points with a comment stand in the file: the others are skipped",
        ]
    );
}

#[test]
fn the_table_of_studio_5000_tells_types_by_radix_and_by_comments_on_members_of_aliases() {
    let text = "TYPE,SCOPE,NAME,DESCRIPTION,DATATYPE,SPECIFIER,ATTRIBUTES\n\
                ALIAS,,Valve,\"\",\"\",\"Rack:2:O.Ch03.Out\",\"(RADIX := Float, ExternalAccess := Read/Write)\"\n\
                ALIAS,,Card,\"\",\"\",\"Rack:1:I\",\"\"\n\
                COMMENT,,Card,\"lid\",\"\",\"CARD.PT00\",\"\"\n\
                COMMENT,,Card,\"level\",\"\",\"Card.CH01\",\"\"\n\
                COMMENT,,Other,\"no module's\",\"\",\"Other.CH01\",\"\"\n\
                ALIAS,Main,Drive,\"\",\"\",\"Drive:I\",\"(RADIX := Decimal)\"\n";
    let imported = read("tags.csv", text);
    assert_eq!(
        lines(&imported),
        [
            "Valve %QD0 REAL",
            "Card.PT00.DATA %IX4.0 BOOL",
            "Card.CH01.DATA %ID0 REAL"
        ]
    );
    assert_eq!(
        notes(&imported),
        ["Card.PT00.DATA: lid []", "Card.CH01.DATA: level []"]
    );
    let skipped: Vec<&str> = imported
        .skipped
        .iter()
        .map(|skipped| skipped.mistake.what.as_str())
        .collect();
    assert_eq!(
        skipped,
        [
            "of \"Rack:1:I\" only the points with a comment stand in the table: the others are skipped",
            "the type of \"Drive:I\" stands nowhere in the table: skipped",
        ]
    );
}

#[test]
fn variables_of_twincat_without_a_place_get_one_in_order_behind_the_others() {
    let text = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\r\n<TcPlcObject Version=\"1.1.0.1\">\r\n  <GVL Name=\"IO\">\r\n    \
                <Declaration><![CDATA[VAR_GLOBAL\r\n\tstart AT%I* : BOOL; // the button\r\n\tlevel AT %I* : INT;\r\n\
                \tlamps AT %Q* : ARRAY[1..2] OF BOOL;\r\n\tfixed AT %IB3 : BYTE;\r\n\tserial AT %I* : EL6inData22B;\r\nEND_VAR]]>\
                </Declaration>\r\n  </GVL>\r\n</TcPlcObject>\r\n";
    let imported = read("IO.TcGVL", text);
    assert_eq!(
        lines(&imported),
        [
            "start %IX10.0 BOOL",
            "level %IW8 INT",
            "lamps[1] %QX0.0 BOOL",
            "lamps[2] %QX0.1 BOOL",
            "fixed %IB3 BYTE"
        ]
    );
    assert_eq!(imported.assigned, 4);
    assert!(
        imported.text.contains("address = \"%IX10.0\"   # %I*\n"),
        "{}",
        imported.text
    );
    assert_eq!(notes(&imported)[0], "start: the button [IO]");
    assert_eq!(notes(&imported)[3], "lamps[2]:  [IO]");
    assert!(
        imported.notes[0].contains("4 inputs and outputs have no place"),
        "{:?}",
        imported.notes
    );
    assert_eq!(
        imported.skipped[0].place,
        Some((9, 18)),
        "{:?}",
        imported.skipped
    );
    let method = "<TcPlcObject><POU Name=\"Main\"><Method Name=\"Scan\"><Declaration><![CDATA[VAR\nx AT %IX0.0 : BOOL;\nEND_VAR]]>\
                  </Declaration></Method></POU></TcPlcObject>";
    assert_eq!(notes(&read("Main.TcPOU", method)), ["x:  [Main]"]);
    let none = told(
        "IO.TcGVL",
        "<TcPlcObject><GVL><Declaration><![CDATA[VAR_GLOBAL\nx AT %I* : ST_In;\nEND_VAR]]></Declaration></GVL></TcPlcObject>",
    );
    assert!(
        none.contains("none of its variables can be a signal"),
        "{none}"
    );
    assert!(
        none.contains("IO.TcGVL:2:12: \"ST_In\" is no type"),
        "{none}"
    );
}

const OPENPLC: &str = "<project xmlns=\"http://www.plcopen.org/xml/tc6_0201\"><types><pous><pou name=\"Main\"><interface><localVars>\
    <variable name=\"door\" address=\"%IX0.6\"><type><BOOL/></type></variable>\
    <variable name=\"level\" address=\"%IW0\"><type><INT/></type></variable>\
    <variable name=\"valve\" address=\"%QW100\"><type><INT/></type></variable>\
    <variable name=\"far\" address=\"%IW0.0.1.0\"><type><WORD/></type></variable>\
    </localVars></interface></pou></pous></types></project>";

#[test]
fn openplc_counts_elements_and_its_memories_stand_apart() {
    let imported = read("plc.xml", OPENPLC);
    assert_eq!(
        lines(&imported),
        [
            "door %IX0.6 BOOL",
            "level %IW8 INT",
            "valve %QW200 INT",
            "far %IW10 WORD"
        ]
    );
    assert!(
        imported.text.contains("\"%IW4\"   # %IW0"),
        "{}",
        imported.text
    );
    assert!(
        imported.notes[0].contains("count elements"),
        "{:?}",
        imported.notes
    );
    assert!(
        imported.notes[1].contains("separate memories"),
        "{:?}",
        imported.notes
    );
    let bytes = ImportOptions {
        addressing: Some(Addressing::Bytes),
        ..ImportOptions::default()
    };
    let imported = read_as("plc.xml", OPENPLC, bytes).expect("bytes");
    assert_eq!(lines(&imported)[2], "valve %QW100 INT");
    assert!(!imported.text.contains("addressing"), "{}", imported.text);
    // Where they do not overlap, all addresses are kept.
    let apart = OPENPLC.replace("%IW0\"", "%IW1\"");
    assert_eq!(lines(&read("plc.xml", &apart))[1], "level %IW2 INT");
}

#[test]
fn structured_text_with_a_configuration_is_openplcs() {
    let text = "PROGRAM Main\n  VAR\n    level AT %IW100 : INT;\n    door AT %IX0.0 : BOOL; (* closed *)\n  END_VAR\n  level := 1;\n\
                END_PROGRAM\n";
    assert_eq!(
        lines(&read("main.st", text)),
        ["level %IW100 INT", "door %IX0.0 BOOL"]
    );
    let text = format!("{text}\nCONFIGURATION c\nEND_CONFIGURATION\n");
    let imported = read("main.st", &text);
    assert_eq!(lines(&imported), ["level %IW200 INT", "door %IX0.0 BOOL"]);
    assert_eq!(notes(&imported), ["door: closed []"]);
    // A hosted program takes the unit of the driver.cfg, so its addresses are those of the signals.
    for kept in ["\naddressing = \"iec\" ", "\"%IW100\""] {
        assert!(imported.text.contains(kept), "{}", imported.text);
    }
}

#[test]
fn the_tag_tables_of_tia_portal_as_xml_are_read() {
    let table = "<?xml version='1.0' encoding='utf-8'?>\n<Tagtable name='Default tag table'>\n\
                 <Tag type='Bool' hmiVisible='True' remark='the button' addr='%I0.0'>Start</Tag>\n\
                 <Tag type='Real' remark='' addr='%QD4'>Speed &amp; way</Tag>\n<Tag type='DInt' remark='' addr='%MD1000'>Zero</Tag>\n\
                 <Constant type='Int' remark='' value='2'>Two</Constant>\n</Tagtable>\n";
    let imported = read("tags.xml", table);
    assert_eq!(
        lines(&imported),
        ["Start %IX0.0 BOOL", "Speed & way %QD4 REAL"]
    );
    assert_eq!(
        notes(&imported),
        [
            "Start: the button [Default tag table]",
            "Speed & way:  [Default tag table]"
        ]
    );
    assert_eq!(imported.skipped.len(), 1);
    let openness = "<Document><SW.Tags.PlcTagTable>\
                    <AttributeList><Name>Lamps</Name></AttributeList><ObjectList><SW.Tags.PlcTag><AttributeList><DataTypeName>Bool</DataTypeName>\
                    <LogicalAddress>%Q0.1</LogicalAddress><Name>Lamp</Name></AttributeList><ObjectList><MultilingualText>\
                    <ObjectList><MultilingualTextItem><AttributeList><Text/></AttributeList></MultilingualTextItem>\
                    <MultilingualTextItem><AttributeList><Text>green</Text></AttributeList></MultilingualTextItem>\
                    </ObjectList></MultilingualText></ObjectList></SW.Tags.PlcTag></ObjectList></SW.Tags.PlcTagTable></Document>";
    let imported = read("tags.xml", openness);
    assert_eq!(lines(&imported), ["Lamp %QX0.1 BOOL"]);
    assert_eq!(notes(&imported), ["Lamp: green [Lamps]"]);
}

#[test]
fn a_tag_table_of_openness_with_constants_alone_has_no_inputs_and_outputs() {
    let text = "<?xml version=\"1.0\"?><Document><Engineering version=\"V17\"/><SW.Tags.PlcTagTable ID=\"0\">\
                <AttributeList><Name>Numbers</Name></AttributeList><ObjectList><SW.Tags.PlcUserConstant ID=\"1\">\
                <AttributeList><DataTypeName>Int</DataTypeName><Name>Most</Name><Value>5</Value></AttributeList>\
                </SW.Tags.PlcUserConstant></ObjectList></SW.Tags.PlcTagTable></Document>";
    let told = told("Numbers.xml", text);
    assert!(
        told.contains("no variable in this file is an input or output"),
        "{told}"
    );
}

#[test]
fn the_mapping_export_of_codesys_counts_elements_and_leaves_free_channels_out() {
    let text = "//CoDeSys Mapping Export V1.2\n\
                //Mapped variable;//Parameter name @ counter in device;//Unit;//Description;//IEC address;//Device name;\n\
                //Important: change only first, third or fourth column in Excel or add variable name before first ;\n\
                ;Inputs;;;%IW1;Card;\nApplication.IO.Door;Bit0;;closed;%IX2.0;Card;\n;Bit1;;;%IX2.1;Card;\n\
                Application.IO.Level;AI;;;%IW2;Card;\nApplication.PLC_PRG.arr[0].x;Q0;;;%QX0.0;Card;\n";
    let imported = read("map.csv", text);
    assert_eq!(
        lines(&imported),
        [
            "Application.IO.Door %IX2.0 BOOL",
            "Application.IO.Level %IW4 WORD",
            "Application.PLC_PRG.arr[0].x %QX0.0 BOOL"
        ]
    );
    assert_eq!(
        notes(&imported),
        [
            "Application.IO.Door: closed [Application.IO]",
            "Application.IO.Level:  [Application.IO]",
            "Application.PLC_PRG.arr[0].x:  [Application.PLC_PRG]"
        ]
    );
    assert_eq!(imported.skipped.len(), 1);
    assert!(
        imported.skipped[0]
            .mistake
            .what
            .starts_with("2 channels without a variable")
    );
}

#[test]
fn timers_and_counters_are_left_out_of_an_s7_client() {
    let text =
        "name;address;type\nDoor;%I0.3;Bool\nDelay;%T1;Timer\nParts;C 4;Counter\nFlag;%M1.0;Bool\n";
    let reading = ImportOptions {
        client: Some(Client::S7),
        ..ImportOptions::default()
    };
    let imported = read_as("tags.csv", text, reading).expect("a list");
    assert_eq!(lines(&imported), ["Door %IX0.0 BOOL", "Flag %QX0.0 BOOL"]);
    let skipped: Vec<&str> = imported
        .skipped
        .iter()
        .map(|found| found.mistake.what.as_str())
        .collect();
    assert_eq!(
        skipped,
        [
            "\"%T1\" is a timer, which the bus s7-client does not read: skipped",
            "\"C 4\" is a counter, which the bus s7-client does not read: skipped"
        ]
    );
}

#[test]
fn messages_of_one_kind_are_told_three_times_with_their_number() {
    let mut text = "Name;Address;Data type\n".to_owned();
    for number in 0..10 {
        writeln!(text, "Tag {number};<No Value>;Int").expect("a String takes all");
    }
    let mistakes = import(
        "hmi.csv",
        text.as_bytes(),
        ImportOptions::default(),
        &tickbus::KINDS,
    )
    .expect_err("no addresses");
    assert_eq!(mistakes.len(), 11);
    let list: Vec<_> = mistakes.iter().cloned().collect();
    let told: Vec<String> = condensed(&list)
        .iter()
        .map(|found| found.mistake.to_string())
        .collect();
    assert_eq!(told.len(), 4, "{told:?}");
    assert!(
        told[1].contains("has no address, as a tag with symbolic access"),
        "{told:?}"
    );
    assert!(told[3].ends_with("; and 7 more like it"), "{told:?}");
    assert!(!told[2].contains("more like it"), "{told:?}");
}
