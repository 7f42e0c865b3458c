//! A driver that runs takes the changes of its driver.cfg, which its page edits: without a restart.

use serde_json::json;
use tickbus::time::Monotonic;
use tickbus_conformance::rig::{End, eventually};

use crate::edited::Edited;

const SIGNALS: &str = "[[signal]]\nname = \"Back\" # to the PLC\naddress = \"%IW0\"\ntype = \"INT\"\n\
                       [[signal]]\nname = \"Speed\"\naddress = \"%QW2\"\ntype = \"INT\"\n";

fn text(fieldbus: &str) -> String {
    format!("[driver]\nid = 7\nname = \"Cell\"\n\n[fieldbus]\n{fieldbus}\n{SIGNALS}")
}

/// A machine whose PLC is at this address.
fn machine(address: &str) -> String {
    text(&format!(
        "# The PLC of hall 3.\nkind    = \"modbus-client\"\naddress = \"{address}\" # moves\ncycle   = \"5ms\"\nreconnect = [\"20ms\"]\n"
    ))
}

/// A PLC that has this speed.
fn plc(speed: f64) -> (End, String) {
    let fieldbus = "kind = \"modbus-server\"\nrole = \"controller\"\naddress = \"127.0.0.1:0\"\n";
    let mut plc = End::open(&text(fieldbus), &Monotonic::shared(), &tickbus::KINDS);
    plc.set("Speed", speed);
    plc.tick();
    let address = plc.address().to_string();
    (plc, address)
}

/// Waits until the machine has this speed.
fn await_speed(machine: &Edited, plcs: &mut [&mut End], speed: i32) {
    eventually("it has the speed of this PLC", || {
        for plc in &mut *plcs {
            plc.tick();
        }
        (machine.value(1) == json!(speed)).then_some(())
    });
}

#[test]
fn a_modbus_plc_moves_to_another_port_while_the_machine_runs() {
    let ((mut first, here), (mut second, there)) = (plc(11.0), plc(22.0));
    let machine = Edited::start(&machine(&here), &["--edit"]);
    await_speed(&machine, &mut [&mut first], 11);
    let (status, why) = machine.set("address", &here, &there);
    assert_eq!(status, 200, "{why}");
    await_speed(&machine, &mut [&mut second], 22);
    assert_eq!(machine.text(), self::machine(&there), "comments stay");

    // What needs a restart is said before and refused, and the line goes on.
    let edit = json!({ "set": { "at": ["signal", 1, "type"], "was": "INT", "to": "UINT", "of": "Speed" } });
    let (status, why) = machine.ask("PUT /studio/edit", &edit.to_string());
    assert_eq!(status, 200, "{why}");
    let state = machine.get("/studio/state/0");
    let told = "signal 2 \"Speed\" has another type";
    assert_eq!(state["line"]["owner"]["restart"], json!([told]));
    let (status, why) = machine.ask("PUT /studio/line", "take");
    assert!(
        status == 409 && why.contains("restart the simulation"),
        "{why}"
    );
    second.set("Speed", 23.0);
    await_speed(&machine, &mut [&mut second], 23);
    machine.ask("PUT /studio/undo", "");

    // A mistake is told with its place.
    let (status, why) = machine.set("cycle", "5ms", "often");
    assert!(status == 409 && why.contains("driver.cfg:"), "{why}");
    assert!(why.contains("often"), "{why}");
    second.set("Speed", 24.0);
    await_speed(&machine, &mut [&mut second], 24);
    machine.ask("PUT /studio/undo", "");

    // No PLC is there: an outage. Back by the same way.
    let nowhere = "127.0.0.1:1";
    let (status, why) = machine.set("address", &there, nowhere);
    assert_eq!(status, 200, "{why}");
    eventually("the line is down", || {
        (machine.state() == "failed").then_some(())
    });
    // Its page names the PLC that is meant now, which has never come.
    let line = machine.get("/line")["drivers"][0].take();
    let told = (&line["end"], &line["address"], &line["has_run"]);
    assert_eq!(told, (&json!("client"), &json!(nowhere), &json!(false)));
    let (status, why) = machine.set("address", nowhere, &here);
    assert_eq!(status, 200, "{why}");
    first.set("Speed", 12.0);
    await_speed(&machine, &mut [&mut first], 12);
    let (last, code) = machine.command.interrupt();
    assert!(last.starts_with("mirror: ok"), "{last}");
    assert_eq!(code, Some(0));
}

#[test]
fn without_edit_a_page_has_no_studio() {
    let machine = Edited::start(&machine("127.0.0.1:1"), &[]);
    for path in ["/studio", "/studio.js", "/studio/state/0", "/studio/schema"] {
        assert_eq!(machine.ask(&format!("GET {path}"), "").0, 404, "{path}");
    }
    for path in ["/studio/edit", "/studio/line", "/studio/of/7/line"] {
        assert_eq!(machine.ask(&format!("PUT {path}"), "take").0, 404, "{path}");
    }
    let tabs = machine.get("/tabs");
    let views = tabs.as_array().expect("a list").iter();
    assert!(views.clone().count() > 1, "{tabs}");
    for tab in views {
        let path = tab["path"].as_str().expect("a path");
        assert_eq!(path.split('#').next(), Some("/"), "{tabs}");
    }
}

#[test]
fn only_who_has_the_token_edits_and_no_other_site() {
    let text = machine("127.0.0.1:1");
    let machine = Edited::start(&text, &["--edit"]);
    let tabs = machine.get("/tabs");
    let last = tabs.as_array().and_then(|tabs| tabs.last());
    assert_eq!(last.expect("a tab")["path"], json!("/studio"));
    let edit = json!({ "text": { "was": 0, "to": "" } }).to_string();
    let foreign = format!(
        "Authorization: Bearer {}\r\nOrigin: http://evil.example\r\n",
        machine.token
    );
    let wrong = "Authorization: Bearer 00000000000000000000000000000000\r\n";
    for head in ["", wrong, &foreign] {
        for line in [
            "GET /studio/state/0",
            "GET /studio/of/7/state/0",
            "PUT /studio/edit",
            "PUT /studio/line",
        ] {
            let (status, told) = machine.ask_as(line, head, &edit);
            assert!(
                [401, 403].contains(&status),
                "{line} {head}: {status} {told}"
            );
        }
    }
    assert_eq!(machine.text(), text);
    let (status, why) = machine.ask("PUT /studio/line", "stop");
    assert!(status == 409 && why.contains("owns this line"), "{why}");
}

#[test]
fn a_page_that_other_computers_reach_edits_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("driver.cfg");
    std::fs::write(&file, machine("127.0.0.1:1")).expect("there is room");
    let mirror = std::process::Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["mirror", "--edit", "--page", "0.0.0.0:0"])
        .arg(&file)
        .output()
        .expect("it starts");
    assert_eq!(mirror.status.code(), Some(1));
    let told = String::from_utf8_lossy(&mirror.stderr);
    assert!(told.contains("other computers must not edit"), "{told}");
}

#[test]
fn a_bus_knows_which_end_opens_its_connection() {
    for (bus, connects) in [
        ("kind = \"socket\"\nrole_tcp = \"connect\"", true),
        ("kind = \"socket\"", false),
        ("kind = \"dispatcher\"", true),
        ("kind = \"modbus-client\"", true),
        ("kind = \"modbus-server\"", false),
    ] {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\n{bus}\naddress = \"127.0.0.1:1999\"\n\
             [[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n"
        );
        let config = tickbus::driver_cfg::Config::parse("driver.cfg", &text, &tickbus::KINDS);
        let config = config.unwrap_or_else(|wrong| panic!("{wrong}"));
        assert_eq!(config.bus.connects(), connects, "{bus}");
        assert_eq!(
            config.bus.address().as_deref(),
            Some("127.0.0.1:1999"),
            "{bus}"
        );
    }
}
