//! Tags that become signals, names that are followed, and a file that goes.

use super::*;

const AT: &str = "\n[fieldbus.at]\nLevel = \"ns=2;s=L\"\n";

fn take(tags: &Json, index: usize) -> Json {
    json!({ "take": { "tags": tags, "index": index } })
}

fn tag(name: &str, at: &str, data_type: &str, area: &str) -> Json {
    json!({ "name": name, "within": "Tank", "at": at, "data_type": data_type, "area": area })
}

#[test]
fn tags_become_signals_with_free_names_and_addresses_in_one_step() {
    let before = format!("{FILE}{AT}");
    let mut fixture = Fixture::new(&before);
    let mut commented = tag("Level", "ns=2;s=A", "INT", "Q");
    commented["comment"] = json!(" of the\ntank ");
    let tags = json!([
        commented,
        tag("Level", "ns=2;s=B", "REAL", "I"),
        tag("Known", "ns=2;s=L", "INT", "Q"),
        tag(" ", "ns=2;s=C", "BOOL", "Q"),
    ]);
    assert_eq!(fixture.edit(take(&tags, 1)), Ok(()));
    let text = fixture.text();
    let new = "latch   = \"rising\"\n\n[[signal]]\nname    = \"Tank.Level\"\naddress = \"%QW2\"\ntype    = \"INT\"\ncomment = \"of the tank\"\n\n\
               [[signal]]\nname    = \"Level 2\"\naddress = \"%ID4\"\ntype    = \"REAL\"\n\n\
               [[signal]]\nname    = \"Tag\"\naddress = \"%QX4.0\"\n";
    let lines = "\"ns=2;s=L\"\n\"Tank.Level\" = \"ns=2;s=A\"\n\"Level 2\" = \"ns=2;s=B\"\nTag = \"ns=2;s=C\"\n";
    let wanted = before.replace("latch   = \"rising\"\n", new);
    assert_eq!(text, wanted.replace("\"ns=2;s=L\"\n", lines));
    let told = fixture.desk.json()["told"].clone();
    assert_eq!(told, "added 3 signals; 1 tag was a signal already");
    assert_eq!(fixture.desk.undo(), Ok(()));
    assert_eq!(fixture.text(), before);
    let wrong = json!([tag("A", "ns=2;s=A", "STRING", "Q")]);
    let (status, why) = fixture
        .edit(take(&wrong, 0))
        .expect_err("no type of a signal");
    assert_eq!(status, 400);
    assert!(why.contains("browse again"), "{why}");
}

#[test]
fn a_new_name_is_followed_by_all_that_names_the_signal() {
    let more = r#"
[[reply]]
kind = "motor"
contactor = "Level"  # the pump
running = "Part seen"
trip = ["not Level", "Levels > 3", "Level >= 5", "Level changes"]

[[reply]]
kind = "rule"
name = "Level"
when = { "Level" = 3 }
set  = { Level = 1, "Part seen" = 0 }

[[reply]]
kind = "track"
sensors = [ { signal = "Level", at = 300 }, { signal = "Other", at = 5 } ]

[[fault]]
kind = "stuck"
signal = "Level"
while = "Level rises"

[[drive]]
name = "Level"
fault = "Level"
"#;
    let watch = "kind = \"loopback\"\nalive = { signal = \"Level\", within = \"1s\" }\n";
    let before = FILE.replace("kind = \"loopback\"\n", watch);
    let before = format!("{before}{AT}{more}");
    let mut fixture = Fixture::new(&before);
    let edit = set(&json!(["signal", 2, "name"]), "Level", "Tank level");
    assert_eq!(fixture.edit(edit), Ok(()));
    let told = "also renamed in 3 replies, 1 fault, 1 drive, fieldbus.at and alive";
    assert_eq!(fixture.desk.json()["told"], told);
    let mut wanted = before.clone();
    for (was, now) in [
        ("name    = \"Level\"", "name    = \"Tank level\""),
        ("Level = \"ns", "\"Tank level\" = \"ns"),
        (
            "contactor = \"Level\"  # the",
            "contactor = \"Tank level\"  # the",
        ),
        ("\"not Level\"", "\"not Tank level\""),
        ("\"Level >= 5\"", "\"Tank level >= 5\""),
        ("\"Level changes\"", "\"Tank level changes\""),
        ("{ \"Level\" = 3 }", "{ \"Tank level\" = 3 }"),
        ("{ Level = 1", "{ \"Tank level\" = 1"),
        ("{ signal = \"Level\", at", "{ signal = \"Tank level\", at"),
        (
            "{ signal = \"Level\", within",
            "{ signal = \"Tank level\", within",
        ),
        ("\nsignal = \"Level\"", "\nsignal = \"Tank level\""),
        ("\"Level rises\"", "\"Tank level rises\""),
        ("fault = \"Level\"", "fault = \"Tank level\""),
    ] {
        assert!(wanted.contains(was), "{was}");
        wanted = wanted.replacen(was, now, 1);
    }
    assert_eq!(fixture.text(), wanted);
    assert_eq!(fixture.desk.undo(), Ok(()), "in one step");
    assert_eq!(fixture.text(), before);
    // A name that another signal has leaves the rest to that one.
    let edit = set(&json!(["signal", 2, "name"]), "Level", "Part seen");
    assert_eq!(fixture.edit(edit), Ok(()));
    assert_eq!(fixture.desk.json()["told"], "");
    assert!(fixture.text().contains("contactor = \"Level\""));
}

#[test]
fn a_file_that_goes_is_told_and_written_again_by_the_next_edit() {
    let mut fixture = Fixture::new(FILE);
    fs::remove_file(fixture.path()).expect("it is there");
    fixture.desk.look();
    assert_eq!(fixture.desk.json()["isGone"], false, "it may be replaced");
    let version = fixture.desk.version();
    fixture.desk.look();
    assert_eq!(fixture.desk.json()["isGone"], true);
    assert_ne!(fixture.desk.version(), version, "pages read it");
    assert!(!fixture.path().exists());
    let edit = set(&json!(["signal", 0, "address"]), "%QX0.0", "%QX0.3");
    assert_eq!(fixture.edit(edit), Ok(()));
    assert_eq!(fixture.text(), FILE.replace("\"%QX0.0\" ", "\"%QX0.3\" "));
    assert_eq!(fixture.desk.json()["isGone"], false);
    // One that comes back is no news but that.
    let text = fixture.text();
    fs::remove_file(fixture.path()).expect("it is there");
    fixture.desk.look();
    fixture.desk.look();
    fs::write(fixture.path(), &text).expect("there is room");
    fixture.desk.look();
    assert_eq!(fixture.desk.json()["isGone"], false);
    assert_eq!(fixture.desk.json()["told"], "");
}

#[test]
fn tags_are_browsed_while_the_signals_have_mistakes() {
    let text = crate::browse::settings(&FILE.replace("%IX0.0", "%IX0.9")).expect("it is TOML");
    let config = tickbus_driver_cfg::Config::parse("driver.cfg", &text, &KINDS);
    assert!(config.is_ok(), "{config:?}");
}

#[test]
fn a_new_name_does_not_take_the_place_that_a_removed_signal_has_left() {
    let at = "\n[fieldbus.at]\nGone = \"ns=2;s=G\"\n\"Belt on\" = \"ns=2;s=B\" # here\n";
    let mut fixture = Fixture::new(&format!("{FILE}{at}"));
    let edit = set(&json!(["signal", 0, "name"]), "Belt on", "Gone");
    assert_eq!(fixture.edit(edit), Ok(()));
    let (_, after) = fixture
        .text()
        .split_once("[fieldbus.at]\n")
        .map(|(a, b)| (a.to_owned(), b.to_owned()))
        .expect("it is there");
    assert_eq!(after, "Gone      = \"ns=2;s=B\" # here\n");
}

#[test]
fn a_tag_of_two_folders_becomes_one_signal() {
    let mut fixture = Fixture::new(&format!("{FILE}{AT}"));
    let both = json!([
        tag("A", "ns=2;s=A", "INT", "Q"),
        tag("Also", "ns=2;s=A", "INT", "Q")
    ]);
    assert_eq!(fixture.edit(take(&both, 1)), Ok(()));
    let told = fixture.desk.json()["told"].clone();
    assert_eq!(told, "added signal \"A\"; 1 tag was a signal already");
}
