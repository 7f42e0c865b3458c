//! Edits of texts, and the desk with its file.

mod tags;

use std::fs;
use std::path::PathBuf;

use serde_json::{Value as Json, json};
use tickbus_driver_cfg::{Kind, Kinds};

use crate::desk::Desk;
use crate::edit::Edit;

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_socket::Options>()]);

/// A file as people write it: columns, comments, an odd order.
const FILE: &str = r#"# The rig of line 3.

[driver]
id   = 4711                    # unique in the folder
name = "Test rig"

[fieldbus]
kind = "loopback"
link = "rig"

# Conveyor
[[signal]]
name    = "Belt on"
address = "%QX0.0"             # K1
latch   = "rising"

[[signal]]
name    = "Part seen"
address = "%IX0.0"

# Measured by B7.
[[signal]]
name    = "Level"
address = "%IW2"
type    = "INT"
scale   = { raw = [0, 27648], value = [0.0, 250.0] } # see the data sheet
"#;

struct Fixture {
    folder: tempfile::TempDir,
    desk: Desk,
}

impl Fixture {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("there is room");
        let path = folder.path().join("driver.cfg");
        fs::write(&path, text).expect("there is room");
        let desk = Desk::open(&path, &KINDS).expect("it can be read");
        Self { folder, desk }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("driver.cfg")
    }

    fn text(&self) -> String {
        fs::read_to_string(self.path()).expect("it is there")
    }

    /// Makes an edit as the page sends it.
    fn edit(&mut self, edit: Json) -> Result<(), (u16, String)> {
        let edit: Edit = serde_json::from_value(edit).expect("this is an edit");
        self.desk.edit(&edit)
    }

    fn mistakes(&self) -> Vec<Json> {
        let json = self.desk.json();
        let mistakes = json["checked"]["mistakes"].as_array();
        mistakes.expect("there is a list").clone()
    }
}

fn set(at: &Json, was: &str, to: &str) -> Json {
    json!({ "set": { "at": at, "was": was, "to": to } })
}

#[test]
fn a_cell_changes_its_value_alone() {
    let mut fixture = Fixture::new(FILE);
    let done = fixture.edit(set(&json!(["signal", 0, "address"]), "%QX0.0", "%QX0.3"));
    assert_eq!(done, Ok(()));
    assert_eq!(fixture.text(), FILE.replace("\"%QX0.0\" ", "\"%QX0.3\" "));
}

#[test]
fn a_new_key_stands_in_the_column_of_its_table() {
    let mut fixture = Fixture::new(FILE);
    let done = fixture.edit(set(&json!(["signal", 2, "fail_safe"]), "", "12,5"));
    assert_eq!(done, Ok(()));
    let wanted = "# see the data sheet\nfail_safe = 12.5\n";
    assert_eq!(
        fixture.text(),
        FILE.replace("# see the data sheet\n", wanted)
    );
    assert_eq!(
        fixture.edit(set(&json!(["signal", 1, "unit"]), "", "mm")),
        Ok(())
    );
    assert!(
        fixture
            .text()
            .contains("address = \"%IX0.0\"\nunit    = \"mm\"\n")
    );
}

#[test]
fn an_emptied_cell_removes_its_key() {
    let mut fixture = Fixture::new(FILE);
    assert_eq!(
        fixture.edit(set(&json!(["signal", 0, "latch"]), "rising", "")),
        Ok(())
    );
    assert_eq!(fixture.text(), FILE.replace("latch   = \"rising\"\n", ""));
}

#[test]
fn a_signal_is_added_removed_and_moved_with_its_comment() {
    let mut fixture = Fixture::new(FILE);
    let cells = json!([["name", "Pump"], ["address", "%QX0.1"], ["latch", ""]]);
    let add = json!({ "add": { "list": "signal", "index": 1, "cells": cells } });
    assert_eq!(fixture.edit(add), Ok(()));
    let pump = "latch   = \"rising\"\n\n[[signal]]\nname    = \"Pump\"\naddress = \"%QX0.1\"\n";
    assert_eq!(fixture.text(), FILE.replace("latch   = \"rising\"\n", pump));
    let remove = json!({ "remove": { "list": "signal", "index": 1, "was": "Pump" } });
    assert_eq!(fixture.edit(remove), Ok(()));
    assert_eq!(fixture.text(), FILE);
    let shift = json!({ "move": { "list": "signal", "index": 2, "was": "Level", "to": 1 } });
    assert_eq!(fixture.edit(shift), Ok(()));
    let text = fixture.text();
    let places = ["Belt on", "# Measured by B7.", "\"Level\"", "\"Part seen\""];
    let places: Vec<usize> = places.map(|it| text.find(it).expect("it is there")).into();
    assert!(places.is_sorted(), "{text}");
}

#[test]
fn the_same_cell_changed_by_two_editors_is_a_conflict() {
    let mut fixture = Fixture::new(FILE);
    let at = || json!(["signal", 0, "address"]);
    assert_eq!(fixture.edit(set(&at(), "%QX0.0", "%QX0.3")), Ok(()));
    let second = fixture.edit(set(&at(), "%QX0.0", "%QX0.4"));
    let (status, why) = second.expect_err("the first was there");
    assert_eq!(status, 409);
    assert!(why.contains("%QX0.3"), "{why}");
    // Another cell of the same signal is no conflict.
    assert_eq!(
        fixture.edit(set(&json!(["signal", 0, "unit"]), "", "x")),
        Ok(())
    );
    let gone = json!({ "remove": { "list": "signal", "index": 0, "was": "Level" } });
    assert_eq!(fixture.edit(gone).expect_err("another is there").0, 409);
}

#[test]
fn every_edit_can_be_undone_and_done_again() {
    let mut fixture = Fixture::new(FILE);
    let at = |key| json!(["signal", 0, key]);
    assert_eq!(
        fixture.edit(set(&at("address"), "%QX0.0", "%QX0.3")),
        Ok(())
    );
    let first = fixture.text();
    assert_eq!(fixture.edit(set(&at("unit"), "", "mm")), Ok(()));
    let second = fixture.text();
    assert_eq!(fixture.desk.json()["undo"], "Belt on: unit \"mm\"");
    assert_eq!(fixture.desk.undo(), Ok(()));
    assert_eq!(fixture.text(), first);
    assert_eq!(fixture.desk.undo(), Ok(()));
    assert_eq!(fixture.text(), FILE);
    assert_eq!(fixture.desk.undo().expect_err("that was all").0, 409);
    assert_eq!(fixture.desk.redo(), Ok(()));
    assert_eq!(fixture.desk.redo(), Ok(()));
    assert_eq!(fixture.text(), second);
}

#[test]
fn a_file_changed_outside_is_shown_and_not_overwritten() {
    let mut fixture = Fixture::new(FILE);
    let theirs = FILE.replace("Test rig", "Another rig");
    fs::write(fixture.path(), &theirs).expect("there is room");
    let edit = set(&json!(["signal", 0, "address"]), "%QX0.0", "%QX0.3");
    assert_eq!(fixture.edit(edit), Ok(()), "another place of the file");
    let both = theirs.replace("\"%QX0.0\" ", "\"%QX0.3\" ");
    assert_eq!(fixture.text(), both);
    fs::write(fixture.path(), &theirs).expect("there is room");
    fixture.desk.look();
    assert_eq!(
        fixture.desk.json()["sheet"]["signals"][0]["address"],
        "%QX0.0"
    );
    assert_eq!(fixture.desk.undo(), Ok(()));
    assert_eq!(fixture.text(), both, "what they replaced comes back");
}

#[test]
fn a_read_only_file_keeps_its_text_and_the_edit_is_not_lost() {
    let mut fixture = Fixture::new(FILE);
    let mut permissions = fs::metadata(fixture.path())
        .expect("it is there")
        .permissions();
    permissions.set_readonly(true);
    fs::set_permissions(fixture.path(), permissions.clone()).expect("it is ours");
    let edit = set(&json!(["signal", 0, "address"]), "%QX0.0", "%QX0.3");
    assert_eq!(fixture.edit(edit), Ok(()));
    assert_eq!(fixture.text(), FILE);
    let json = fixture.desk.json();
    assert_eq!(json["sheet"]["signals"][0]["address"], "%QX0.3");
    let why = json["unsaved"].as_str().expect("it says why");
    assert!(why.contains("read-only"), "{why}");
    #[expect(
        clippy::permissions_set_readonly_false,
        reason = "it is in a folder of this test"
    )]
    permissions.set_readonly(false);
    fs::set_permissions(fixture.path(), permissions).expect("it is ours");
    fixture.desk.save();
    assert_eq!(fixture.text(), FILE.replace("\"%QX0.0\" ", "\"%QX0.3\" "));
    assert_eq!(fixture.desk.json()["unsaved"], Json::Null);
}

#[test]
fn the_checkers_words_are_at_their_cell() {
    let mut fixture = Fixture::new(FILE);
    assert_eq!(fixture.mistakes(), Vec::<Json>::new());
    let at = |key| json!(["signal", 2, key]);
    assert_eq!(fixture.edit(set(&at("type"), "INT", "INTT")), Ok(()));
    let [mistake] = &fixture.mistakes()[..] else {
        panic!("{:?}", fixture.mistakes());
    };
    assert_eq!(mistake["at"], at("type"));
    assert!(mistake["right"].as_str().expect("a text").contains("INT"));
    assert_eq!(fixture.edit(set(&at("type"), "INTT", "INT")), Ok(()));
    let scale = "{ raw = [0, 27648], value = [0.0, 250.0] }";
    assert_eq!(fixture.edit(set(&at("scale"), scale, "twice")), Ok(()));
    assert_eq!(fixture.mistakes()[0]["at"], at("scale"));
    assert_eq!(fixture.desk.undo(), Ok(()));
    assert_eq!(
        fixture.edit(set(&json!(["fieldbus", "kind"]), "loopback", "lopback")),
        Ok(())
    );
    assert_eq!(fixture.mistakes()[0]["at"], json!(["fieldbus", "kind"]));
}

#[test]
fn a_text_that_is_no_toml_is_shown_with_its_place_and_can_be_mended() {
    let mut fixture = Fixture::new(FILE);
    let version = fixture.desk.version();
    let broken = FILE.replace("[driver]", "[driver");
    let text = |was, to: &str| json!({ "text": { "was": was, "to": to } });
    assert_eq!(fixture.edit(text(version, &broken)), Ok(()));
    let json = fixture.desk.json();
    assert_eq!(json["sheet"], Json::Null);
    assert!(json["broken"].is_string());
    assert_eq!(json["checked"]["mistakes"][0]["line"], 3);
    let edit = set(&json!(["signal", 0, "address"]), "%QX0.0", "%QX0.3");
    assert_eq!(fixture.edit(edit).expect_err("it is no table").0, 400);
    assert_eq!(
        fixture
            .edit(text(version, FILE))
            .expect_err("an old version")
            .0,
        409
    );
    let version = fixture.desk.version();
    assert_eq!(fixture.edit(text(version, FILE)), Ok(()));
    assert_eq!(fixture.text(), FILE);
}

#[test]
fn ends_of_lines_and_a_byte_order_mark_stay() {
    let windows = format!("\u{feff}{}", FILE.replace('\n', "\r\n"));
    let mut fixture = Fixture::new(&windows);
    assert_eq!(
        fixture.edit(set(&json!(["signal", 1, "unit"]), "", "mm")),
        Ok(())
    );
    let new = "address = \"%IX0.0\"\r\nunit    = \"mm\"\r\n";
    assert_eq!(
        fixture.text(),
        windows.replace("address = \"%IX0.0\"\r\n", new)
    );
}

#[test]
fn free_addresses_are_behind_all_others() {
    let fixture = Fixture::new(FILE);
    let next = &fixture.desk.json()["sheet"]["next"][""];
    assert_eq!(next["QX"], "%QX0.1");
    assert_eq!(next["QW"], "%QW2");
    assert_eq!(next["IX"], "%IX4.0");
    assert_eq!(next["ID"], "%ID4");
    let counted = FILE.replace("[fieldbus]", "addressing = \"iec\"\n\n[fieldbus]");
    let next = &Fixture::new(&counted).desk.json()["sheet"]["next"][""];
    assert_eq!(next["IW"], "%IW3", "bytes 4 and 5 are the last word");
    // Each station has addresses of its own.
    let two = FILE.replace("\"%QX0.0\"", "\"%QX4.0\"\nstation = \"A\"");
    let two = two.replace("\"%IX0.0\"", "\"%QX0.0\"\nstation = \"B\"");
    let next = &Fixture::new(&two).desk.json()["sheet"]["next"];
    assert_eq!(next["A"]["QX"], "%QX4.1");
    assert_eq!(next["B"]["QX"], "%QX0.1");
    assert_eq!(next["B"]["IX"], "%IX0.0");
}

#[test]
fn a_dropped_list_adds_the_signals_that_are_not_there() {
    let mut fixture = Fixture::new(FILE);
    let list = "Name;Path;Data Type;Logical Address\nPart seen;T;Bool;%I0.0\nValve;T;Bool;%Q0.5\n";
    let body = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, list);
    assert_eq!(fixture.desk.import("tags.csv", &body), Ok(()));
    let text = fixture.text();
    assert!(text.starts_with(FILE), "{text}");
    assert!(text[FILE.len()..].contains("\"Valve\""), "{text}");
    assert!(!text[FILE.len()..].contains("Part seen"), "{text}");
    let told = fixture.desk.json()["told"]
        .as_str()
        .expect("a text")
        .to_owned();
    assert!(
        told.contains("1 signals of tags.csv, 1 were there already"),
        "{told}"
    );
    let (status, why) = fixture
        .desk
        .import("x.csv", "bm9uc2Vuc2U=")
        .expect_err("nonsense");
    assert_eq!(status, 400);
    assert!(why.starts_with("x.csv"), "{why}");
}

#[test]
fn a_file_that_is_not_there_is_made_by_the_first_edit() {
    let folder = tempfile::tempdir().expect("there is room");
    let path = folder.path().join("new.cfg");
    let mut desk = Desk::open(&path, &KINDS).expect("an empty file");
    assert!(!path.exists());
    for (at, to) in [
        (json!(["fieldbus", "kind"]), "loopback"),
        (json!(["fieldbus", "link"]), "rig"),
    ] {
        let edit = serde_json::from_value(set(&at, "", to)).expect("this is an edit");
        assert_eq!(desk.edit(&edit), Ok(()));
    }
    let cells = json!([["name", "Pump"], ["address", "%QX0.0"]]);
    let add = json!({ "add": { "list": "signal", "index": 0, "cells": cells } });
    let add = serde_json::from_value(add).expect("this is an edit");
    assert_eq!(desk.edit(&add), Ok(()));
    let wanted = "[driver]\nid   = 1\nname = \"Machine\"\n\n[fieldbus]\nkind = \"loopback\"\nlink = \"rig\"\n\n[[signal]]\nname    = \"Pump\"\naddress = \"%QX0.0\"\n";
    assert_eq!(fs::read_to_string(&path).expect("it is there"), wanted);
    assert_eq!(desk.mistakes(), 0);
}

#[test]
fn a_file_that_is_no_text_any_more_is_not_overwritten() {
    let mut fixture = Fixture::new(FILE);
    let theirs = b"# Pr\xfcfstand, saved as Latin-1\n".as_slice();
    fs::write(fixture.path(), theirs).expect("there is room");
    let edit = set(&json!(["signal", 0, "address"]), "%QX0.0", "%QX0.3");
    assert_eq!(fixture.edit(edit), Ok(()));
    assert_eq!(fs::read(fixture.path()).expect("it is there"), theirs);
    let json = fixture.desk.json();
    let why = json["unsaved"].as_str().expect("it says why");
    assert!(why.contains("UTF-8"), "{why}");
    // As soon as it is a text again, that is shown, and Undo has the edit.
    fs::write(fixture.path(), FILE).expect("there is room");
    fixture.desk.save();
    let edited = FILE.replace("\"%QX0.0\" ", "\"%QX0.3\" ");
    assert_eq!(fixture.text(), edited, "the text that it had before");
}

#[test]
fn a_file_that_cannot_be_written_is_one_state_as_long_as_the_reason_stays() {
    let mut fixture = Fixture::new(FILE);
    let theirs = b"\xff".as_slice();
    fs::write(fixture.path(), theirs).expect("there is room");
    let edit = set(&json!(["signal", 0, "address"]), "%QX0.0", "%QX0.3");
    assert_eq!(fixture.edit(edit), Ok(()));
    let version = fixture.desk.version();
    fixture.desk.save();
    assert_eq!(fixture.desk.version(), version);
    let text = json!({ "text": { "was": version, "to": "# mine\n" } });
    assert_eq!(
        fixture.edit(text),
        Ok(()),
        "nobody has changed it meanwhile"
    );
    // The words of the system would have a random name.
    let folder = tempfile::tempdir().expect("there is room");
    let path = folder.path().join("gone/driver.cfg");
    let mut desk = Desk::open(&path, &KINDS).expect("an empty file");
    let edit = serde_json::from_value(set(&json!(["driver", "name"]), "Machine", "Rig"));
    assert_eq!(desk.edit(&edit.expect("this is an edit")), Ok(()));
    let version = desk.version();
    desk.save();
    assert_eq!(desk.version(), version, "{:?}", desk.unsaved());
}

#[test]
fn an_edit_meant_for_a_signal_that_has_moved_changes_no_other() {
    let mut fixture = Fixture::new(FILE);
    let remove = json!({ "remove": { "list": "signal", "index": 0, "was": "Belt on" } });
    assert_eq!(fixture.edit(remove), Ok(()));
    let after = fixture.text();
    // Another page still sees "Part seen" as the second.
    let edit = json!({ "set": { "at": ["signal", 1, "unit"], "was": "", "to": "bar", "of": "Part seen" } });
    let (status, why) = fixture.edit(edit).expect_err("the second is Level now");
    assert_eq!(status, 409);
    assert!(why.contains("Part seen"), "{why}");
    assert_eq!(fixture.text(), after);
}

#[test]
fn a_signal_moves_to_the_first_place_although_another_table_of_the_bus_is_last() {
    let text = format!("{FILE}\n[fieldbus.at]\n\"Level\" = \"holding:3\"\n");
    let mut fixture = Fixture::new(&text);
    let shift = json!({ "move": { "list": "signal", "index": 2, "was": "Level", "to": 0 } });
    assert_eq!(fixture.edit(shift), Ok(()));
    let names = |text: &str| {
        let json = crate::sheet::Sheet::of(text).expect("it is TOML");
        let json = serde_json::to_value(json).expect("it is JSON");
        let signals = json["signals"].as_array().expect("a list").clone();
        signals
            .iter()
            .map(|it| it["name"].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(
        names(&fixture.text()),
        ["Level", "Belt on", "Part seen"],
        "{}",
        fixture.text()
    );
}

fn dropped(fixture: &mut Fixture, file: &str, list: &str) -> Result<String, (u16, String)> {
    let body = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, list);
    fixture.desk.import(file, &body)?;
    let json = fixture.desk.json();
    Ok(json["told"].as_str().expect("a text").to_owned())
}

#[test]
fn a_dropped_list_of_known_signals_alone_is_told_too() {
    let mut fixture = Fixture::new(FILE);
    let version = fixture.desk.version();
    let list = "Name;Path;Data Type;Logical Address\nPart seen;T;Bool;%I0.0\n";
    let told = dropped(&mut fixture, "tags.csv", list).expect("a list");
    assert!(told.contains("1 were there already"), "{told}");
    assert_ne!(fixture.desk.version(), version, "pages read it");
    assert_eq!(fixture.text(), FILE);
}

#[test]
fn a_dropped_list_leaves_the_byte_order_mark() {
    let mut fixture = Fixture::new(&format!("\u{feff}{FILE}"));
    let list = "Name;Path;Data Type;Logical Address\nValve;T;Bool;%Q0.5\n";
    dropped(&mut fixture, "tags.csv", list).expect("a list");
    let text = fixture.text();
    assert!(text.starts_with(&format!("\u{feff}{FILE}")), "{text:?}");
}

/// As CODESYS writes it: the numbers of its addresses count elements.
const COUNTED: &str = r#"<project xmlns="http://www.plcopen.org/xml/tc6_0200"><fileHeader productName="CODESYS"/><types><pous><pou name="P"><interface><localVars>
<variable name="Speed" address="%QW1"><type><INT/></type></variable>
<variable name="Pump" address="%QX7.0"><type><BOOL/></type></variable>
</localVars></interface></pou></pous></types></project>"#;

#[test]
fn the_addresses_of_a_dropped_list_mean_in_the_file_what_they_mean_in_the_list() {
    let mut fixture = Fixture::new(FILE);
    dropped(&mut fixture, "plc.xml", COUNTED).expect("a list");
    let sheet = fixture.desk.json()["sheet"].clone();
    assert_eq!(sheet["signals"][3]["name"], "Speed", "{sheet}");
    assert_eq!(sheet["signals"][3]["address"], "%QW2", "bytes 2 and 3");
    assert_eq!(sheet["signals"][4]["address"], "%QX7.0");
    // A file without signals takes them as the list has them.
    let (empty, _) = FILE.split_once("# Conveyor").expect("it is there");
    let mut fixture = Fixture::new(empty);
    dropped(&mut fixture, "plc.xml", COUNTED).expect("a list");
    let sheet = fixture.desk.json()["sheet"].clone();
    assert_eq!(sheet["driver"]["addressing"], "iec");
    assert_eq!(sheet["signals"][0]["address"], "%QW1");
    // What lies between two elements cannot be said in a file that counts them.
    let counted = FILE.replace("[fieldbus]", "addressing = \"iec\"\n\n[fieldbus]");
    let mut fixture = Fixture::new(&counted);
    let list = "Name;Path;Data Type;Logical Address\nSpeed;T;Int;%QW6\nOdd;T;Int;%QW9\n";
    let (_, why) = dropped(&mut fixture, "tags.csv", list).expect_err("it cannot");
    assert!(why.contains("Odd") && why.contains("%QW9"), "{why}");
    let list = list.replace("%QW9", "%QW8");
    dropped(&mut fixture, "tags.csv", &list).expect("a list");
    let sheet = fixture.desk.json()["sheet"].clone();
    assert_eq!(sheet["signals"][3]["address"], "%QW3");
}

#[test]
fn signals_in_brackets_are_not_shown_as_none() {
    let text = "driver.id = 1\ndriver.name = \"x\"\nsignal = [ { name = \"A\", address = \"%IX0.0\" } ]\n\
                [fieldbus]\nkind = \"loopback\"\nlink = \"rig\"\n";
    let mut fixture = Fixture::new(text);
    assert_eq!(fixture.mistakes(), Vec::<Json>::new());
    let notes = fixture.desk.json()["checked"]["notes"].to_string();
    assert!(notes.contains("[[signal]]"), "{notes}");
    let named = set(&json!(["driver", "name"]), "x", "y");
    assert_eq!(fixture.edit(named), Ok(()));
    assert_eq!(fixture.text(), text.replace("\"x\"", "\"y\""));
    assert_eq!(
        Fixture::new(FILE).desk.json()["checked"]["notes"],
        json!([])
    );
}

#[test]
fn what_another_program_replaced_at_the_end_is_kept() {
    let mut fixture = Fixture::new(FILE);
    assert_eq!(fixture.desk.settle(), None);
    fs::write(fixture.path(), b"\xff").expect("there is room");
    let edit = set(&json!(["signal", 0, "address"]), "%QX0.0", "%QX0.3");
    assert_eq!(fixture.edit(edit), Ok(()));
    fs::write(fixture.path(), "# theirs\n").expect("there is room");
    let (text, why) = fixture.desk.settle().expect("the file has another text");
    assert_eq!(*text, *FILE.replace("\"%QX0.0\" ", "\"%QX0.3\" "));
    assert!(why.contains("another program"), "{why}");
    assert_eq!(fixture.text(), "# theirs\n");
    assert_eq!(fixture.desk.settle(), None, "it is kept once");
}

#[test]
fn the_place_in_the_device_follows_the_name_with_its_comment() {
    let at = "\n[fieldbus.at]\n\"Belt on\"   = \"coil:1\" # K1\n\"Part seen\" = \"input:1\"\n";
    let mut fixture = Fixture::new(&format!("{FILE}{at}"));
    let name = || json!(["signal", 0, "name"]);
    assert_eq!(fixture.edit(set(&name(), "Belt on", "Belt")), Ok(()));
    let renamed = FILE.replace("\"Belt on\"", "\"Belt\"");
    let moved = at.replace("\"Belt on\"  ", "Belt       ");
    assert_eq!(fixture.text(), format!("{renamed}{moved}"));
    assert_eq!(fixture.desk.undo(), Ok(()), "in one step");
    assert_eq!(fixture.text(), format!("{FILE}{at}"));
    // The place of another signal is not taken, and one of two signals with a name leaves it to the other.
    assert_eq!(fixture.edit(set(&name(), "Belt on", "Part seen")), Ok(()));
    assert!(fixture.text().ends_with(at), "{}", fixture.text());
    assert_eq!(fixture.edit(set(&name(), "Part seen", "Third")), Ok(()));
    assert!(fixture.text().ends_with(at), "{}", fixture.text());
}
