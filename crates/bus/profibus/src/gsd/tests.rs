//! Tests of the reader, on the fixtures of tests/gsd.

use super::*;
use crate::Identity;
use crate::user_parameters::{Allowed, ParameterKind, UserParameters};
use proptest::prelude::*;

/// A modular device: comments, continued lines, texts that look like keywords.
const REMOTE_IO: &str = include_str!("../../../../../tests/gsd/remote_io.gsd");

/// A device of one fixed module.
const ENCODER: &str = include_str!("../../../../../tests/gsd/encoder.gsd");

/// DPV1, slots, and parameters of every kind.
const DRIVE: &str = include_str!("../../../../../tests/gsd/drive.gsd");

/// Fixed modules, and parameters as the first revision has them.
const VALVES: &str = include_str!("../../../../../tests/gsd/valves.gsd");

const ALL: [&str; 4] = [REMOTE_IO, ENCODER, DRIVE, VALVES];

/// The bytes of a file in the usual encoding.
fn latin_1(text: &str) -> Vec<u8> {
    let text = text.replace('\n', "\r\n");
    let octets = text.chars().map(|c| u8::try_from(c).expect("Latin-1"));
    octets.collect()
}

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn read(text: &str) -> Gsd {
    let gsd = Gsd::read(text.as_bytes()).expect("a right file");
    assert_eq!(Gsd::read(&latin_1(text)), Ok(gsd.clone()));
    gsd
}

fn identity(gsd: &Gsd, modules: &[&str]) -> Identity {
    gsd.identity(&names(modules)).expect("modules that it has")
}

fn refused(gsd: &Gsd, modules: &[&str]) -> String {
    gsd.identity(&names(modules))
        .expect_err("refused")
        .to_string()
}

#[test]
fn a_modular_device_is_read_with_all_its_modules() {
    let gsd = read(REMOTE_IO);
    assert_eq!((gsd.vendor.as_str(), gsd.ident), ("Prüfstand", 0x0B1C));
    assert_eq!(gsd.model, "Remote I/O; 4 slots");
    assert!(gsd.modular && gsd.sync && gsd.freeze && gsd.dpv1 && !gsd.fail_safe);
    assert_eq!(gsd.modules.len(), 4);
    assert_eq!(gsd.modules[3].identifiers, [0xC1, 0x43, 0x81, 0xAA]);
    let all = identity(&gsd, &["Head", "2 words in", "2 words out"]);
    assert_eq!(all.ident, 0x0B1C);
    assert_eq!(all.configuration.bytes(), [0x00, 0x51, 0x61]);
    let sizes = |identity: &Identity| {
        let own = &identity.configuration;
        (own.inputs(), own.outputs())
    };
    assert_eq!(sizes(&all), (4, 4));
    assert_eq!(
        all.user.defaults(),
        [0xC0, 0, 0, 0, 0, 0x11, 0xFF, 0xFF, 0xFF, 0xFE]
    );
    assert_eq!(sizes(&identity(&gsd, &["Head", "Axis"])), (2, 8));
}

#[test]
fn a_drive_is_read_with_rates_limits_texts_and_slots() {
    let gsd = read(DRIVE);
    let rates: Vec<u32> = gsd.rates.keys().copied().collect();
    let all = [
        9_600, 19_200, 45_450, 93_750, 187_500, 500_000, 1_500_000, 3_000_000,
    ];
    assert_eq!(rates, all);
    assert_eq!((gsd.rates[&45_450], gsd.rates[&500_000]), (250, 100));
    assert!(gsd.set_slave_add && gsd.fail_safe);
    assert_eq!(
        (
            gsd.max_inputs,
            gsd.max_outputs,
            gsd.max_data,
            gsd.max_parameters,
            gsd.max_diagnosis
        ),
        (Some(28), Some(28), Some(56), Some(32), Some(32))
    );
    assert_eq!((gsd.max_module, gsd.min_slave_interval), (Some(3), Some(5)));
    assert_eq!(gsd.diagnosis.bits[&1], "Encoder lost; no position");
    assert_eq!(
        gsd.diagnosis.bits.len(),
        2,
        "those of other types are not the device's"
    );
    let area = &gsd.diagnosis.areas[0];
    assert_eq!(
        (area.first, area.last, area.values[&3].as_str()),
        (8, 11, "Overcurrent")
    );
    assert_eq!(gsd.slots[1].fitting, [2..=2, 4..=4]);
    assert_eq!(
        (gsd.slots[2].name.as_str(), gsd.slots[2].default),
        ("Terminals", 3)
    );
    assert_eq!(gsd.slots[2].fitting, [3..=4]);
}

#[test]
fn parameters_are_read_with_kinds_values_and_texts() {
    let gsd = read(DRIVE);
    let own = &gsd.parameters;
    let [(3, stop), (3, brake), (4, ramp)] = &own.parameters[..] else {
        panic!("{own:?}")
    };
    assert_eq!(stop.kind, ParameterKind::Bits { first: 0, last: 1 });
    assert_eq!((stop.default, &stop.allowed), (1, &Allowed::Range(0, 2)));
    assert_eq!(stop.texts[&2], "Quick stop");
    assert_eq!(brake.kind, ParameterKind::Bits { first: 2, last: 2 });
    assert_eq!(
        (ramp.default, &ramp.allowed),
        (500, &Allowed::Range(10, 30_000))
    );
    let of_module = |module: usize| {
        gsd.modules[module]
            .parameters
            .parameters
            .iter()
            .map(|(_, own)| own)
    };
    let torque = of_module(0).next().expect("it has one");
    assert_eq!(
        (torque.kind, torque.default),
        (ParameterKind::Signed(2), -100)
    );
    assert_eq!(torque.allowed, Allowed::Range(-300, 300));
    let [temperature, lines, code] = of_module(1).collect::<Vec<_>>()[..] else {
        panic!("three")
    };
    assert_eq!(
        (temperature.kind, &temperature.allowed),
        (ParameterKind::Signed(1), &Allowed::Any)
    );
    assert_eq!(lines.allowed, Allowed::List(vec![512, 1024, 2048, 65_536]));
    assert!(lines.is_changeable && lines.is_visible && !code.is_changeable && !code.is_visible);
}

#[test]
fn the_default_parameters_are_those_of_the_device_and_of_each_slot() {
    let drive = identity(
        &read(DRIVE),
        &[
            "Standard telegram 1",
            "Position, 4 bytes",
            "Digital outputs",
        ],
    );
    let right = [
        &[0xC0, 0x60, 0x00, 0x01, 0x01, 0xF4][..],
        &[0x01, 0xFF, 0x9C],
        &[0x00, 0x00, 0x00, 0x08, 0x00, 0xA5],
    ];
    assert_eq!(drive.user.defaults(), right.concat());
    let words: Vec<String> = drive.user.in_words().collect();
    assert_eq!(
        words,
        [
            "the device: Stop mode = 1 (Ramp), Brake = 0 (off), Ramp time = 500",
            "slot 1 \"Standard telegram 1\": Torque limit = -100",
            "slot 2 \"Position, 4 bytes\": Temperature offset = 0, Encoder lines = 2048, Factory code = 165",
        ]
    );
    let mut sent = right.concat();
    sent[13] = 9;
    let why = "slot 2 \"Position, 4 bytes\": parameter \"Encoder lines\" is 2057; the GSD allows 512, 1024, 2048, 65536";
    assert_eq!(drive.user.check(&sent), Err(why.to_owned()));
    let valves = identity(&read(VALVES), &[]);
    assert_eq!(valves.user.defaults(), [0x11, 0, 0x22, 0]);
    assert_eq!(
        identity(&read(ENCODER), &[]).user,
        UserParameters::default()
    );
}

/// Another parser, by profirust's author, which reads most of the parameters that a tool sends.
#[test]
fn another_parser_reads_the_same_parameters() {
    let foreign = |text: &str| {
        let path = std::path::Path::new("x.gsd");
        gsd_parser::parser::parse(path, text).expect("a right file")
    };
    for (text, modules) in [
        (DRIVE, &["Standard telegram 1", "Position, 4 bytes"][..]),
        (VALVES, &[]),
    ] {
        let theirs = foreign(text);
        let mut sent = gsd_parser::PrmBuilder::new(&theirs.user_prm_data).into_bytes();
        sent.resize(sent.len().max(theirs.user_prm_data.length.into()), 0);
        for name in modules {
            let mut all = theirs.available_modules.iter();
            let module = all.find(|module| module.name == *name).expect("it has it");
            sent.extend(gsd_parser::PrmBuilder::new(&module.module_prm_data).into_bytes());
        }
        assert_eq!(identity(&read(text), modules).user.defaults(), sent);
    }
}

#[test]
fn a_device_with_fixed_modules_needs_none_to_be_named() {
    let encoder = identity(&read(ENCODER), &[]);
    assert_eq!(encoder.configuration.bytes(), [0xF1]);
    assert!(encoder.fail_safe);
    assert_eq!(
        identity(&read(VALVES), &[]).configuration.bytes(),
        [0x61, 0x10]
    );
}

#[test]
fn modules_that_do_not_fit_are_refused_with_what_does() {
    let gsd = read(REMOTE_IO);
    let why = refused(&gsd, &[]);
    let right = "needs its modules; write their names, such as modules = [\"Head\", \"2 words in\", \"2 words out\"]";
    assert!(why.contains(right), "{why}");
    assert!(refused(&gsd, &["Head", "2 word in"]).contains("did you mean \"2 words in\"?"));
    let why = refused(&gsd, &["Axis"]);
    let right = "\"Axis\" does not fit into slot 1 of \"Remote I/O; 4 slots\"; its GSD file allows \"Head\"";
    assert_eq!(why, right);
    let many = ["Head", "Axis", "Axis", "Axis", "Axis"];
    assert!(
        refused(&gsd, &many).contains("there are 5 modules; \"Remote I/O; 4 slots\" has at most 4")
    );
}

#[test]
fn more_data_or_parameters_than_the_device_has_are_refused() {
    let head = "#Profibus_DP\nIdent_Number=1\nModel_Name=\"m\"\nModular_Station=1\n";
    let module = "Module=\"a\" 0x53,0x63\nExt_Module_Prm_Data_Len=9\nEndModule\n";
    for (limit, words) in [
        (
            "Max_Input_Len=15",
            "the modules have 16 bytes of inputs; \"m\" has at most 15",
        ),
        (
            "Max_Output_Len=15",
            "the modules have 16 bytes of outputs; \"m\" has at most 15",
        ),
        (
            "Max_Data_Len=31",
            "the modules have 32 bytes in all; \"m\" has at most 31",
        ),
        (
            "Max_User_Prm_Data_Len=17",
            "the modules have 18 octets of the user's parameters; \"m\" has at most 17",
        ),
    ] {
        let gsd = read(&format!("{head}{limit}\n{module}"));
        assert_eq!(refused(&gsd, &["a", "a"]), words);
    }
    let gsd = read(&format!("{head}{module}"));
    let _ = identity(&gsd, &["a"; 26]);
    assert!(refused(&gsd, &["a"; 27]).contains("has at most 237"));
    assert!(refused(&gsd, &["a"; 31]).contains("has at most 244"));
}

#[test]
fn mistakes_name_the_line() {
    let cut = "ExtUserPrmData=1 \"a\"\nUnsigned8 0 0-1\n";
    let with_parameter = format!("{cut}EndExtUserPrmData\n");
    for (text, words) in [
        ("", "line 3: the file ends, and there is no Ident_Number"),
        (
            "Ident_Number=0x12345",
            "line 4: 74565 is out of range; write 0 to 65535",
        ),
        ("Ident_Number=twelve", "line 4: \"twelve\" is no number"),
        ("Ident_Number=", "line 4: the line ends too early"),
        (
            "Ident_Number=1 2",
            "line 4: \"2\" is too much here; remove it",
        ),
        (
            "Module=\"a\" 0x150\n",
            "line 4: 336 is out of range; write 0 to 255",
        ),
        (
            "Module=\"a\" 0x50\nModule=\"b\" 0x50",
            "line 5: the module of line 4 has no \"EndModule\"",
        ),
        (
            "Module=\"a\" 0x50\n",
            "line 4: the block that begins here has no \"EndModule\"",
        ),
        (
            "UnitDiagType=3\n\n",
            "line 4: the block that begins here has no \"EndUnitDiagType\"",
        ),
        ("Module=a 0x50", "line 4: there is no text in quotes"),
        ("Slot(1)=\"x\" 1 0-", "line 4: the line ends too early"),
        ("Slot=\"x\" 1 0", "line 4: there is no number in brackets"),
        (
            cut,
            "line 4: the block that begins here has no \"EndExtUserPrmData\"",
        ),
        (
            "ExtUserPrmData=1 \"a\"\nUnsigned9 0",
            "line 5: \"unsigned9\" is no kind of parameter",
        ),
        (
            "ExtUserPrmData=1 \"a\"\nBitArea(3-1) 0",
            "line 5: the bits are 3 to 1",
        ),
        (
            "ExtUserPrmData=1 \"a\"\nBitArea(0-8) 0",
            "line 5: the bits are 0 to 8",
        ),
        (
            "ExtUserPrmData=1 \"a\"\nBitArea(1-2) 4 0-3",
            "line 5: the default 4 does not fit its kind; write 0 to 3",
        ),
        (
            "\nExt_User_Prm_Data_Ref(0)=7",
            "line 5: there is no ExtUserPrmData = 7",
        ),
        (
            "User_Prm_Data_Len=238",
            "line 4: there are 238 octets of parameters",
        ),
        (
            "Ext_User_Prm_Data_Const(236)=1,2",
            "line 4: it reaches to octet 238, and there are 237",
        ),
        (
            &format!(
                "{with_parameter}Module=\"a\" 0\nExt_Module_Prm_Data_Len=1\nExt_User_Prm_Data_Ref(1)=1\nEndModule"
            ),
            "line 9: it reaches to octet 2, and there are 1",
        ),
    ] {
        // The first line is a comment, the third one empty.
        let ident = if words.contains("ident") || words.contains("Ident") {
            ""
        } else {
            "Ident_Number=1"
        };
        let file = format!("; a device\n#Profibus_DP\n{ident}\n{text}");
        let why = Gsd::read(file.as_bytes()).expect_err(words).to_string();
        assert!(why.starts_with(words), "{why}\n{words}");
    }
    let why = Gsd::read(b"GSD_Revision=3")
        .expect_err("no first line")
        .to_string();
    assert!(
        why.starts_with("line 1: there is no line \"#Profibus_DP\""),
        "{why}"
    );
}

#[test]
fn modules_of_one_name_are_told_apart_by_their_numbers() {
    let gsd = |numbers: [&str; 2], second: &str| {
        let text = format!(
            "#Profibus_DP\nIdent_Number=1\nModel_Name=\"CPU\"\nModular_Station=1\nMax_Module=4\n\
             Module=\"2 byte\" 0x40,0x01\n{}\nEndModule\nModule=\"2 byte\" {second}\n{}\nEndModule\n",
            numbers[0], numbers[1]
        );
        Gsd::read(text.as_bytes()).expect("a file")
    };
    let sizes = |gsd: &Gsd, name: &str| {
        let identity = gsd.identity(&[name.to_owned()]);
        identity.map(|own| (own.configuration.inputs(), own.configuration.outputs()))
    };
    let two = gsd(["11", "12"], "0x80,0x01");
    let why = sizes(&two, "2 byte").expect_err("two").to_string();
    assert_eq!(
        why,
        "\"CPU\" has different modules \"2 byte\" (\"#11\", 40 01; \"#12\", 80 01); write the number of the one that the PLC's \
         project has"
    );
    assert_eq!(sizes(&two, "#11"), Ok((2, 0)));
    assert_eq!(sizes(&two, "#12"), Ok((0, 2)));
    assert!(sizes(&two, "#13").is_err());
    let why = sizes(&gsd(["", ""], "0x80,0x01"), "2 byte").expect_err("two");
    assert!(
        why.to_string().ends_with("in a copy of the GSD file"),
        "{why}"
    );
    assert_eq!(sizes(&gsd(["11", "12"], "0x40,0x01"), "2 byte"), Ok((2, 0)));
}

/// Checks that the reader does not panic, and that an error names an existing line.
fn endure(file: &[u8]) {
    let lines = file.split(|byte| *byte == b'\n').count();
    match Gsd::read(file) {
        Err(error) => assert!((1..=lines).contains(&error.line), "{error}"),
        Ok(gsd) => {
            let all: Vec<String> = gsd
                .modules
                .iter()
                .map(|module| module.name.clone())
                .collect();
            for chosen in [&[][..], &all] {
                if let Ok(identity) = gsd.identity(chosen) {
                    let defaults = identity.user.defaults();
                    assert_eq!(identity.user.check(defaults), Ok(None));
                    assert_eq!(
                        identity
                            .configuration
                            .difference(identity.configuration.bytes()),
                        None
                    );
                }
            }
        }
    }
}

#[test]
fn no_piece_of_a_file_makes_it_panic() {
    for file in ALL.map(latin_1) {
        for length in 0..file.len() {
            endure(&file[..length]);
            endure(&file[length..]);
        }
    }
}

proptest! {
    /// Octets replaced by others, with or without a meaning in such files.
    #[test]
    fn no_change_of_a_file_makes_it_panic(
        which in 0..ALL.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), any::<bool>()), 1..8),
    ) {
        const MEANT: &[u8] = b"\"=(),-;\\\r\n 0123456789xEM";
        let mut file = latin_1(ALL[which]);
        for (at, octet, any) in changes {
            let at = at.index(file.len());
            file[at] = if any { octet } else { MEANT[usize::from(octet) % MEANT.len()] };
        }
        endure(&file);
    }

    /// Missing and duplicate lines.
    #[test]
    fn no_order_of_lines_makes_it_panic(
        which in 0..ALL.len(),
        lines in prop::collection::vec(any::<prop::sample::Index>(), 1..200),
    ) {
        let all: Vec<&str> = ALL[which].lines().collect();
        let text: Vec<&str> = lines.iter().map(|line| all[line.index(all.len())]).collect();
        endure(format!("#Profibus_DP\nIdent_Number=1\n{}", text.join("\n")).as_bytes());
    }
}
