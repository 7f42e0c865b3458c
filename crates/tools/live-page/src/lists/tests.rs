use super::*;
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use tickbus_image::signal::{Area, DataType};

const FILE: &str = "# Lists of the tank.\n\n[[list]]\nname = \"Level control\"\norder = \"changed\"   # what moves\n\
                    pins = [\n    \"Level\",\n    \"Levle\",\n]\n[list.formats]\n\"Level\" = \"hex\"\n\n\
                    # For the start.\n[[set]]\nname = \"start position\"\nvalues = { Valve = true, Level = 12 }\n";

struct Folder {
    folder: tempfile::TempDir,
    beside: Beside,
}

impl Folder {
    fn new(text: Option<&str>) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("tank.lists.toml");
        if let Some(text) = text {
            fs::write(&path, text).expect("there is room");
        }
        let signal = |name, data_type| Signal::new(name, Area::Input, 0, data_type);
        let signals = vec![
            signal("Level", DataType::Int),
            signal("Valve", DataType::Bool),
        ];
        let beside = Beside { path, signals };
        Self { folder, beside }
    }

    fn text(&self) -> String {
        fs::read_to_string(&self.beside.path).expect("the file")
    }

    fn seen(&self) -> Value {
        serde_json::from_str(&document(&self.beside)).expect("JSON")
    }

    fn put(&self, what: &str, was: &Value, is: &Value) -> Result<(), (u16, String)> {
        let body = json!({ "was": was, "is": is }).to_string();
        change(&self.beside, what, &body).map_err(|refused| (refused.status, refused.text))
    }
}

fn list(name: &str, pins: &[&str]) -> Value {
    json!({ "name": name, "pins": pins, "group": "station", "order": "file", "formats": {} })
}

#[test]
fn lists_are_read_and_what_they_name_in_vain_is_told() {
    let seen = Folder::new(Some(FILE)).seen();
    assert_eq!(seen["mistakes"], json!([]));
    let right = json!({
        "name": "Level control", "pins": ["Level", "Levle"], "group": "station", "order": "changed",
        "formats": { "Level": "hex" },
    });
    assert_eq!(seen["lists"], json!([right]));
    let values = json!([["Valve", "TRUE"], ["Level", "12"]]);
    assert_eq!(
        seen["sets"],
        json!([{ "name": "start position", "values": values }])
    );
    let told = "line 8: the list \"Level control\" has \"Levle\", and there is no such signal; did you mean \"Level\"?";
    assert_eq!(seen["told"], json!([told]));
}

#[test]
fn a_change_keeps_everything_else_as_it_is_written() {
    let folder = Folder::new(Some(FILE));
    let was = folder.seen()["lists"][0].clone();
    let mut is = was.clone();
    is["pins"] = json!(["Valve", "Levle", "Level"]);
    folder.put("list", &was, &is).expect("it is saved");
    assert_eq!(folder.seen()["lists"][0], is);
    let pins = "    \"Level\",\n    \"Levle\",\n";
    let right = FILE.replace(pins, "    \"Valve\",\n    \"Levle\",\n    \"Level\",\n");
    let text = folder.text().replace("group = \"station\"\n", "");
    assert_eq!(text, right);
    // Away again, and only it.
    folder
        .put("list", &is, &Value::Null)
        .expect("it is removed");
    let seen = folder.seen();
    assert_eq!(seen["lists"], json!([]));
    assert_eq!(seen["sets"][0]["name"], "start position");
    assert!(
        folder.text().contains("# For the start."),
        "{}",
        folder.text()
    );
}

#[test]
fn a_new_file_gets_a_list_and_a_set() {
    let folder = Folder::new(None);
    assert_eq!(folder.seen()["lists"], json!([]));
    folder
        .put("list", &Value::Null, &list("A \"b\"", &["Level"]))
        .expect("saved");
    let values = json!([["Valve", "FALSE"], ["Level", "16#7F"]]);
    let set = json!({ "name": "start", "values": values });
    folder.put("set", &Value::Null, &set).expect("saved");
    let seen = folder.seen();
    assert_eq!(
        (&seen["lists"][0], &seen["sets"][0]),
        (&list("A \"b\"", &["Level"]), &set)
    );
    let names: Vec<_> = fs::read_dir(folder.folder.path())
        .expect("a folder")
        .collect();
    assert_eq!(names.len(), 1, "no part of a file is left");
}

#[test]
fn what_others_have_changed_is_not_overwritten() {
    let folder = Folder::new(Some(FILE));
    let was = folder.seen()["lists"][0].clone();
    let theirs = FILE.replace("\"Levle\"", "\"Valve\"");
    fs::write(&folder.beside.path, &theirs).expect("there is room");
    let (status, text) = folder
        .put("list", &was, &list("Level control", &[]))
        .expect_err("it is another one");
    assert_eq!(status, 409, "{text}");
    assert!(
        text.contains("has been changed in tank.lists.toml meanwhile"),
        "{text}"
    );
    // A list that is there already is not replaced by a new one of its name.
    let new = list("Level control", &["Valve"]);
    assert_eq!(
        folder.put("list", &Value::Null, &new).expect_err("there").0,
        409
    );
    assert_eq!(folder.text(), theirs);
    // A change of another list does not touch theirs.
    folder
        .put("list", &Value::Null, &list("B", &[]))
        .expect("saved");
    let new = "[[list]]\nname = \"B\"\ngroup = \"station\"\norder = \"file\"\npins = []\n\n";
    assert_eq!(folder.text().replace(new, ""), theirs);
}

#[test]
fn a_file_with_mistakes_is_told_by_line_and_never_overwritten() {
    for (text, told) in [
        (
            "[[list]]\nname = \"a\"\npins = \"Level\"\n",
            "tank.lists.toml:3:8: ",
        ),
        (
            "[[list]]\nname = \"a\"\ngroup = \"prefx\"\n",
            "did you mean \"prefix\"?",
        ),
        (
            "[[list]]\nname = \"a\"\npin = []\n",
            "did you mean \"pins\"?",
        ),
        (
            "[[list]]\nname = \"a\"\n[[list]]\nname = \"a\"\n",
            "tank.lists.toml:4:8: the name \"a\" stands twice",
        ),
        (
            "[[list]]\nname = \"a\"\npins = [\"x\", \"x\"]\n",
            "\"x\" is pinned twice; remove one",
        ),
        ("[[list]\nname = \"a\"\n", "tank.lists.toml:1:"),
        (
            "[[set]]\nname = \"a\"\n",
            "has no \"values\"; write [set.values]",
        ),
        (
            "[list]\nname = \"a\"\n",
            "write [[list]], with two brackets",
        ),
    ] {
        let folder = Folder::new(Some(text));
        let mistakes = folder.seen()["mistakes"].to_string().replace("\\\"", "\"");
        assert!(mistakes.contains(told), "{text}: {mistakes}");
        let (status, why) = folder
            .put("list", &Value::Null, &list("b", &[]))
            .expect_err(text);
        assert_eq!(status, 409, "{why}");
        assert!(
            why.contains(told) && why.contains("nothing is saved"),
            "{why}"
        );
        assert_eq!(folder.text(), text);
    }
}

#[test]
fn what_does_not_fit_is_refused_with_what_would() {
    let folder = Folder::new(None);
    let set = |name: &str, value: &str| json!({ "name": "s", "values": [[name, value]] });
    for (what, is, told) in [
        ("list", list(" a", &[]), "write \"a\""),
        ("list", list("", &[]), "\"name\" is empty"),
        ("list", list("a", &["x", "x"]), "pinned twice"),
        (
            "list",
            json!({ "name": "a", "group": "x" }),
            "is not one of the groups",
        ),
        (
            "list",
            json!({ "name": "a", "pin": [] }),
            "unknown field `pin`",
        ),
        ("set", set("Valve", "2"), "a BOOL takes TRUE or FALSE"),
        (
            "set",
            set("Level", "40000"),
            "INT goes from -32768 to 32767",
        ),
        ("set", set("Vlave", "1"), "did you mean \"Valve\"?"),
        (
            "set",
            json!({ "name": "s", "values": [] }),
            "at least one signal",
        ),
    ] {
        let (status, text) = folder.put(what, &Value::Null, &is).expect_err(told);
        assert_eq!(status, 400, "{text}");
        assert!(text.contains(told), "{text}");
    }
    assert!(!folder.beside.path.exists());
}

#[test]
fn a_file_with_an_empty_array_takes_a_list() {
    let folder = Folder::new(Some("# None yet.\nlist = []\nset = []\n"));
    assert_eq!(folder.seen()["mistakes"], json!([]));
    let new = list("B", &["Level"]);
    folder.put("list", &Value::Null, &new).expect("saved");
    assert_eq!(folder.seen()["lists"], json!([new]));
    assert_eq!(folder.seen()["mistakes"], json!([]));
}

#[test]
#[cfg(unix)]
fn a_link_stays_and_what_it_names_is_written() {
    let folder = Folder::new(None);
    let target = folder.folder.path().join("shared.toml");
    fs::write(&target, FILE).expect("there is room");
    std::os::unix::fs::symlink(&target, &folder.beside.path).expect("a link");
    folder
        .put("list", &Value::Null, &list("B", &[]))
        .expect("saved");
    assert!(folder.beside.path.is_symlink());
    assert!(
        fs::read_to_string(&target)
            .expect("the file")
            .contains("\"B\"")
    );
    // A link to nothing is not replaced by a file.
    fs::remove_file(&target).expect("it is there");
    let (status, text) = folder
        .put("list", &Value::Null, &list("B", &[]))
        .expect_err("no file");
    assert_eq!(status, 409);
    assert!(text.contains("this link names no file"), "{text}");
    assert!(folder.beside.path.is_symlink());
    let mistakes = folder.seen()["mistakes"].to_string();
    assert!(
        mistakes.contains("\"tank.lists.toml: this link names no file"),
        "{mistakes}"
    );
}

/// A folder in which no file can be made stands for a full disk.
#[test]
#[cfg(target_os = "linux")]
fn a_file_that_cannot_be_written_is_as_it_was() {
    let beside = Beside {
        path: PathBuf::from("/proc/self/tank.lists.toml"),
        signals: Vec::new(),
    };
    let body = json!({ "was": null, "is": list("a", &[]) }).to_string();
    let refused = change(&beside, "list", &body).expect_err("no such disk");
    assert_eq!(refused.status, 409);
    let told =
        "tank.lists.toml is not saved, and is as it was: no new file can be made in /proc/self";
    assert!(refused.text.starts_with(told), "{}", refused.text);
}

#[test]
fn a_mistake_is_told_without_the_folder_and_with_all_else() {
    let Folder { folder, mut beside } = Folder::new(None);
    fs::write(&beside.path, [0xff]).expect("there is room");
    fs::create_dir(folder.path().join("sub")).expect("there is room");
    beside.path = folder.path().join("sub/../tank.lists.toml");
    let folder = Folder { folder, beside };
    let name = folder.folder.path().display().to_string();
    let mistakes = folder.seen()["mistakes"].to_string();
    let (_, why) = folder
        .put("list", &Value::Null, &list("b", &[]))
        .expect_err("no text");
    for told in [mistakes, why] {
        assert!(
            told.contains("tank.lists.toml") && !told.contains(&name),
            "{told}"
        );
    }
    let other = "half of the file is on and/or off";
    assert_eq!(without_folder(Path::new("tank.lists.toml"), other), other);
}
