//! The OPC UA buses with the third-party library asyncua at the other end.
#![allow(clippy::float_cmp, reason = "the values are small whole numbers")]

mod device;
mod places;
mod served;
mod structures;

use std::path::{Path, PathBuf};

use crate::harness::{self, Absent, Test, pcap};
use device::{Device, Peer, nodes};
pub(crate) use device::{IDENTITY, free_address, plc};
use serde_json::{Value, json};
use tickbus::driver::Code;
use tickbus::fieldbus::LinkState;
use tickbus_conformance::rig::logged;

pub(crate) const TESTS: &[(&str, Test)] = &[
    (
        "the_client_reads_and_writes_an_asyncua_server",
        reads_and_writes,
    ),
    ("the_client_comes_back_when_the_server_does", comes_back),
    (
        "a_client_that_closes_leaves_its_fail_safe_values_behind",
        closes,
    ),
    ("bad_quality_is_told_and_is_not_fresh", bad_quality),
    ("types_that_differ_are_told_with_the_signal", wrong_types),
    (
        "nothing_is_written_into_a_server_that_was_not_named",
        guarded,
    ),
    (
        "an_unknown_certificate_is_refused_until_it_is_moved",
        untrusted,
    ),
    ("a_wrong_password_is_told", wrong_password),
    (
        "an_endpoint_that_is_not_there_is_told_with_those_that_are",
        no_endpoint,
    ),
    (
        "asyncua_finds_reads_writes_and_subscribes_to_the_server",
        serves,
    ),
    ("one_write_of_asyncua_is_one_commit", one_commit),
    ("pulses_reach_a_subscriber_that_has_no_queue", pulses),
    ("a_secured_server_lets_in_whom_it_knows", secured),
    (
        "tshark_finds_nothing_malformed_in_what_the_server_says",
        nothing_malformed,
    ),
    (
        "a_server_that_asks_for_a_user_lets_nobody_else_in",
        no_anonymous,
    ),
    ("a_plc_in_stop_is_stale_until_it_runs_again", in_stop),
    ("the_nodes_of_fieldbus_at_are_read_and_written", placed),
    (
        "asyncua_finds_a_device_at_its_own_node_ids",
        places::finds_a_device,
    ),
    (
        "asyncua_meets_answers_late_and_in_error",
        places::meets_faults,
    ),
    (
        "asyncua_finds_the_address_space_of_a_nodeset",
        places::has_an_address_space,
    ),
    (
        "asyncua_reads_and_writes_arrays_and_structures_whose_parts_are_signals",
        places::has_arrays_and_structures,
    ),
    (
        "asyncua_reaches_every_member_of_structures_in_arrays_and_of_unions",
        structures::reach_every_member,
    ),
    (
        "asyncua_meets_a_moulding_machine_of_euromap_77",
        structures::make_a_moulding_machine,
    ),
    (
        "each_station_has_an_age_of_its_own_and_what_was_just_written_is_good",
        served::ages_apart,
    ),
    (
        "a_client_that_reads_stays_connected_when_another_leaves",
        served::undisturbed,
    ),
    (
        "the_status_of_the_server_goes_on_and_its_host_is_announced",
        served::tells_of_itself,
    ),
    (
        "the_time_of_the_server_goes_on_for_a_subscriber_whose_items_it_lists",
        served::tells_the_time,
    ),
    (
        "a_client_with_the_certificate_of_another_application_gets_no_values",
        served::impostor,
    ),
];

fn reads_and_writes() -> Result<(), Absent> {
    let address = free_address();
    let mut plc = plc(address, &json!({}))?;
    let mut device = Device::plain(address);
    device.until("the first values", |end| {
        let state = end.link().state;
        end.get("speed") == 7.0 && end.get("torque") == 1.5 && state == LinkState::Running
    });
    plc.ask(&json!({"set": {"speed": -1234, "torque": 0.25, "run": true}}));
    device.until("new values", |end| {
        end.get("speed") == -1234.0 && end.get("torque") == 0.25 && end.get("run") == 1.0
    });
    device.end.set("position", 138.24);
    device.end.set("temperature", 21.5);
    device.end.set("sensor", 1.0);
    for (name, value) in [
        ("position", json!(13824)),
        ("temperature", json!(21.5)),
        ("sensor", json!(true)),
    ] {
        device.until("the PLC has it", |_| {
            plc.ask(&json!({"get": name}))["value"] == value
        });
    }
    assert_eq!(device.end.statistic("identity"), IDENTITY);
    assert_eq!(device.end.statistic("writes"), "allowed");
    assert_eq!(device.end.statistic("quality"), "good");
    // A pulse that ends before the next cycle reaches the PLC as a visible level.
    for level in [0.0, 1.0, 0.0] {
        device.end.set("sensor", level);
        device.end.tick();
    }
    Ok(())
}

fn closes() -> Result<(), Absent> {
    for (at_close, position, sensor) in [("fail_safe", 0, false), ("hold", 13_824, true)] {
        let address = free_address();
        let mut plc = plc(address, &json!({}))?;
        let keys =
            format!("security = \"None\"\nwrite_to = \"{IDENTITY}\"\nat_close = \"{at_close}\"");
        let mut device = Device::client(address, &keys);
        device.end.set("position", 138.24);
        device.end.set("sensor", 1.0);
        device.until("the PLC has it", |_| {
            let has = |plc: &mut Peer, name: &str| plc.ask(&json!({"get": name}))["value"].clone();
            has(&mut plc, "position") == 13_824 && has(&mut plc, "sensor") == true
        });
        device.end.driver.close();
        let left =
            ["position", "sensor"].map(|name| plc.ask(&json!({"get": name}))["value"].clone());
        assert_eq!(left, [json!(position), json!(sensor)], "{at_close}");
    }
    Ok(())
}

fn comes_back() -> Result<(), Absent> {
    let address = free_address();
    let first = plc(address, &json!({}))?;
    let mut device = Device::plain(address);
    device.until("values", |end| end.get("speed") == 7.0);
    drop(first);
    device.until("it is told", |end| end.link().state == LinkState::Failed);
    device.until("fail-safe values", |end| {
        end.tick().code == Code::Stale && end.get("speed") == -1.0
    });
    device.end.set("position", 1.0);
    let mut second = plc(address, &json!({}))?;
    second.ask(&json!({"set": {"speed": 8}}));
    device.until("values again", |end| end.get("speed") == 8.0);
    device.until("the PLC has the inputs again", |_| {
        second.ask(&json!({"get": "position"}))["value"] == json!(100)
    });
    assert_eq!(device.end.link().state, LinkState::Running);
    Ok(())
}

fn in_stop() -> Result<(), Absent> {
    const SUSPENDED: i32 = 3;
    let address = free_address();
    let mut plc = plc(address, &json!({}))?;
    let mut device = Device::plain(address);
    device.until("values", |end| end.get("speed") == 7.0);
    device.until("it is told", |end| {
        end.driver.statistics().contains("cpu=run\n")
    });
    plc.ask(&json!({"state": SUSPENDED}));
    device.until("fail-safe values", |end| {
        end.tick().code == Code::Stale && end.get("speed") == -1.0
    });
    assert_eq!(device.end.link().cause.name(), "stopped");
    assert_eq!(device.end.statistic("cpu"), "stop");
    // Nothing has changed in the meantime, so the server does not report any value again.
    plc.ask(&json!({"state": 0}));
    device.until("values again", |end| end.get("speed") == 7.0);
    assert_eq!(device.end.link().state, LinkState::Running);
    Ok(())
}

fn placed() -> Result<(), Absent> {
    let address = free_address();
    let mut nodes = nodes();
    let list = nodes.as_object_mut().expect("a table");
    for (name, other) in [("speed", "\"DB\".\"Speed\""), ("position", "DB.Position")] {
        let value = list.remove(name).expect("it is there");
        list.insert(other.to_owned(), value);
    }
    list.insert("DB.Spare".to_owned(), json!(["Int16", 55]));
    let mut plc = plc(address, &json!({"nodes": nodes}))?;
    let mut device = Device::client(
        address,
        &format!(
            "security = \"None\"\nwrite_to = \"{IDENTITY}\"\n[fieldbus.at]\n\
             \"speed\" = \"nsu=urn:test:signals;s=\\\"DB\\\".\\\"Speed\\\"\"\n\
             \"position\" = \"ns=2;s=DB.Position\""
        ),
    );
    device.until("values", |end| {
        end.get("speed") == 7.0 && end.get("torque") == 1.5
    });
    device.end.set("position", 138.24);
    device.until("the PLC has it", |_| {
        plc.ask(&json!({"get": "DB.Position"}))["value"] == json!(13824)
    });
    assert_eq!(plc.ask(&json!({"get": "DB.Spare"}))["value"], json!(55));
    Ok(())
}

fn bad_quality() -> Result<(), Absent> {
    let address = free_address();
    let mut plc = plc(address, &json!({}))?;
    let mut device = Device::plain(address);
    device.until("values", |end| end.get("speed") == 7.0);
    plc.ask(&json!({"status": {"speed": "BadDeviceFailure"}}));
    let reason = device.until_reason("no good value of \"speed\"");
    assert!(reason.contains("BadDeviceFailure"), "{reason}");
    device.until("stale", |end| end.tick().code == Code::Stale);
    assert_eq!(device.end.get("speed"), -1.0, "the fail-safe value");
    assert_eq!(device.end.statistic("quality"), "bad: speed");
    plc.ask(&json!({"status": {"speed": "UncertainLastUsableValue"}}));
    device.until("values again", |end| end.get("speed") == 7.0);
    device.until("it is told", |end| {
        end.statistic("quality") == "uncertain: speed"
    });
    plc.ask(&json!({"set": {"speed": 9}}));
    device.until("good again", |end| {
        end.get("speed") == 9.0 && end.statistic("quality") == "good"
    });
    assert_eq!(device.end.link().state, LinkState::Running);
    Ok(())
}

fn wrong_types() -> Result<(), Absent> {
    let address = free_address();
    let mut nodes = nodes();
    nodes["speed"] = json!(["Double", 7.0]);
    nodes["temperature"] = json!(["Int32", 7]);
    nodes.as_object_mut().expect("a table").remove("torque");
    let _plc = plc(address, &json!({"nodes": nodes}))?;
    let mut device = Device::plain(address);
    let reason = device.until_reason("speed");
    for part in [
        "\"speed\" is INT, which is Int16 in OPC UA, but ns=2;s=speed is Double on the server",
        "\"temperature\" is REAL, which is Float in OPC UA, but ns=2;s=temperature is Int32",
        "\"torque\" is ns=2;s=torque, which the server does not have",
        "node_pattern",
    ] {
        assert!(reason.contains(part), "\"{part}\" in {reason}");
    }
    assert_eq!(device.end.link().cause.name(), "refused");
    Ok(())
}

fn guarded() -> Result<(), Absent> {
    logged::expect("nothing is written into the PLC \"urn:test:plc ACME PLC\"");
    let address = free_address();
    let mut plc = plc(address, &json!({}))?;
    let mut device = Device::client(address, "security = \"None\"");
    device.end.set("position", 100.0);
    device.until("values", |end| end.get("speed") == 7.0);
    assert_eq!(device.end.statistic("writes"), "blocked");
    assert_eq!(device.end.statistic("identity"), IDENTITY);
    plc.ask(&json!({"set": {"speed": 8}}));
    device.until("more values", |end| end.get("speed") == 8.0);
    assert_eq!(plc.ask(&json!({"get": "position"}))["value"], json!(0));
    Ok(())
}

fn untrusted() -> Result<(), Absent> {
    let address = free_address();
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("secret"), "swordfish\n").expect("a file");
    for security in ["Basic256Sha256", "Aes256_Sha256_RsaPss"] {
        let mut plc = plc(
            address,
            &json!({"security": [security], "folder": folder.path(), "user": "rig",
                    "password": "swordfish"}),
        )?;
        let secret = folder.path().join("secret");
        let mut device = Device::client(
            address,
            &format!(
                "security = \"{security}\"\nuser = \"rig\"\npassword_file = {:?}\nwrite_to = \"{IDENTITY}\"",
                secret.display().to_string()
            ),
        );
        let reason = device.until_reason("is not trusted");
        let rejected: Vec<_> = files(&device.pki().join("rejected"));
        assert_eq!(rejected.len(), 1, "{rejected:?}");
        assert!(
            reason.contains(&rejected[0].display().to_string()),
            "{reason}"
        );
        let trusted = device.pki().join("trusted");
        assert!(reason.contains(&trusted.display().to_string()), "{reason}");
        let name = rejected[0].file_name().expect("a name");
        std::fs::rename(&rejected[0], trusted.join(name)).expect("as the message says");
        device.until("values", |end| end.get("speed") == 7.0);
        device.end.set("position", 100.0);
        device.until("the PLC has it", |_| {
            plc.ask(&json!({"get": "position"}))["value"] == json!(10_000)
        });
        assert!(device.pki().join("own/tickbus-7.der").exists());
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let key = device.pki().join("private/tickbus-7.pem");
            let mode = std::fs::metadata(key)
                .expect("it is there")
                .permissions()
                .mode();
            assert_eq!(mode & 0o077, 0, "the key is for nobody else");
        }
    }
    Ok(())
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).expect("a folder");
    files.map(|file| file.expect("a file").path()).collect()
}

fn wrong_password() -> Result<(), Absent> {
    let address = free_address();
    let folder = tempfile::tempdir().expect("a folder");
    let _plc = plc(
        address,
        &json!({"security": ["Basic256Sha256"], "folder": folder.path(), "user": "rig",
                "password": "swordfish"}),
    )?;
    let mut device = Device::client(
        address,
        "trust = \"any\"\nuser = \"rig\"\npassword_in_clear = \"herring\"",
    );
    device.until_reason("the server does not let user \"rig\" in");
    assert_eq!(device.end.link().cause.name(), "refused");
    let mut device = Device::client(
        address,
        "trust = \"any\"\nuser = \"rig\"\npassword_env = \"NO_SUCH_VARIABLE_TICKBUS\"",
    );
    device.until_reason("the environment variable NO_SUCH_VARIABLE_TICKBUS has no password");
    Ok(())
}

fn no_endpoint() -> Result<(), Absent> {
    let address = free_address();
    let _plc = plc(address, &json!({}))?;
    let mut device = Device::client(address, "");
    let reason = device.until_reason("the server has no endpoint with");
    assert!(
        reason.contains(
            "security = \"Basic256Sha256\" and mode = \"SignAndEncrypt\"; it has \"None\""
        ),
        "{reason}"
    );
    Ok(())
}

/// A server without protection, and an asyncua client of it.
fn open_server() -> Result<(Device, Peer), Absent> {
    let device = Device::open(
        "opcua-server",
        "address = \"127.0.0.1:0\"\nsecurity = \"None\"\nanonymous = true\nevents = true\ncycle = \"5ms\"",
    );
    let url = format!("opc.tcp://{}", device.address());
    let client = Peer::ready("opcua_client.py", &json!({"url": url}))?;
    Ok((device, client))
}

fn serves() -> Result<(), Absent> {
    let (mut device, mut client) = open_server()?;
    let mut tree = client.ask(&json!({"browse": true}))["tree"].take();
    let found = tree["Test rig"].as_array_mut().expect("a folder");
    found.sort_by_key(Value::to_string);
    assert_eq!(
        *found,
        [
            "count",
            "position",
            "run",
            "sensor",
            "speed",
            "temperature",
            "torque"
        ]
    );
    let read = client.ask(&json!({"read": "speed"}));
    assert_eq!(
        (&read["value"], &read["status"]),
        (&Value::Null, &json!("BadWaitingForInitialData")),
        "nobody has written it"
    );
    let properties = client.ask(&json!({"properties": "temperature"}));
    let unit = properties["EngineeringUnits"].as_str().expect("a unit");
    assert!(unit.contains("4408652") && unit.contains("°C"), "{unit}");
    let properties = client.ask(&json!({"properties": "position.scaled"}));
    let range = properties["EURange"].as_str().expect("a range");
    assert!(
        range.contains("Low=0.0") && range.contains("High=276.48"),
        "{range}"
    );
    assert!(properties["EngineeringUnits"].to_string().contains("mm"));

    device.end.set("position", 138.24);
    device.end.set("temperature", -3.5);
    device.end.set("count", 5.0);
    device.end.tick();
    let nodes = json!(["position", "temperature", "sensor"]);
    client.ask(&json!({"subscribe": [nodes, 10, 10]}));
    let read = client.ask(&json!({"read": "position"}));
    assert_eq!(
        (
            &read["value"],
            &read["type"],
            &read["status"],
            &read["source"]
        ),
        (&json!(13824), &json!("Int16"), &json!("Good"), &json!(true))
    );
    assert_eq!(
        client.ask(&json!({"read": "position.scaled"}))["value"],
        json!(138.24)
    );
    device.until("the change is reported", |_| {
        let values = &client.ask(&json!({"changes": "temperature"}))["values"];
        values
            .as_array()
            .is_some_and(|values| values.contains(&json!(-3.5)))
    });

    let statuses = client.ask(&json!({"write": {
        "speed": ["Int16", 77], "run": ["Boolean", true], "torque": ["Double", 1.0],
        "position": ["Int16", 1], "position.scaled": ["Double", 1.0], "nothing": ["Int16", 1],
    }}));
    // By name: nothing, position, position.scaled, run, speed, torque.
    assert_eq!(
        statuses["statuses"],
        json!([
            "BadNodeIdUnknown",
            "BadUserAccessDenied",
            "BadNotWritable",
            "Good",
            "Good",
            "BadTypeMismatch"
        ])
    );
    device.until("the values", |end| {
        end.get("speed") == 77.0 && end.get("run") == 1.0
    });
    assert_eq!(device.end.get("torque"), 0.0);
    assert_eq!(device.end.link().state, LinkState::Running);
    let read = client.ask(&json!({"read": "speed"}));
    assert_eq!(
        (&read["value"], &read["status"]),
        (&json!(77), &json!("Good"))
    );
    // The subscription alone keeps the line alive: the client keeps requesting publishes.
    let mut age = device.end.tick().age;
    device.until("the client is heard of again", |end| {
        assert_ne!(end.link().state, LinkState::Stale);
        let before = std::mem::replace(&mut age, end.tick().age);
        age < before
    });
    drop(client);
    device.until_reason("closed its session");
    device.until("stale", |end| end.tick().code == Code::Stale);
    assert_eq!(device.end.get("speed"), -1.0, "the fail-safe value");
    Ok(())
}

fn one_commit() -> Result<(), Absent> {
    let (mut device, mut client) = open_server()?;
    for round in 1..=50 {
        let value = f64::from(round);
        client.ask(&json!({"write": {"speed": ["Int16", round], "torque": ["Float", value]}}));
        device.until("the values", |end| {
            assert_eq!(end.get("speed").max(0.0), end.get("torque"), "a torn image");
            end.get("speed") == value
        });
    }
    assert_eq!(device.end.statistic("bus_cycles"), "50", "one each");
    Ok(())
}

fn pulses() -> Result<(), Absent> {
    let (mut device, mut client) = open_server()?;
    device.end.tick();
    client.ask(&json!({"subscribe": [["sensor"], 50, 1]}));
    for pulse in 0..10 {
        for level in [1.0, 0.0] {
            device.end.set("sensor", level);
            device.end.tick();
        }
        let mut seen = Vec::new();
        device.until("the pulse is reported, and its end", |_| {
            let values = client.ask(&json!({"changes": "sensor"}))["values"].clone();
            seen.extend(values.as_array().expect("a list").iter().cloned());
            seen.ends_with(&[json!(true), json!(false)])
        });
        let rises = seen.iter().filter(|value| **value == json!(true)).count();
        assert_eq!(rises, 1, "pulse {pulse}: {seen:?}");
    }
    Ok(())
}

/// A complete conversation with asyncua, and one of our client, checked by tshark.
fn nothing_malformed() -> Result<(), Absent> {
    let tshark = || harness::command("tshark", "tshark");
    tshark()?;
    let mut device = Device::open(
        "opcua-server",
        "address = \"127.0.0.1:0\"\nsecurity = \"None\"\nanonymous = true\ncycle = \"5ms\"",
    );
    let tap = pcap::Tap::before(device.address());
    let url = format!("opc.tcp://{}", tap.address);
    let mut client = Peer::ready("opcua_client.py", &json!({"url": url}))?;
    client.ask(&json!({"browse": true}));
    client.ask(&json!({"subscribe": [["sensor", "position"], 10, 10]}));
    client.ask(&json!({"write": {"speed": ["Int16", 77], "torque": ["Double", 1.0]}}));
    client.ask(&json!({"read": "position.scaled"}));
    client.ask(&json!({"properties": "position.scaled"}));
    device.end.set("sensor", 1.0);
    device.until("the change is reported", |_| {
        client.ask(&json!({"changes": "sensor"}))["values"]
            .as_array()
            .is_some_and(|values| values.contains(&json!(true)))
    });
    drop(client);
    device.until_reason("closed its session");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("opcua.pcap");
    pcap::write(&file, 4840, &tap.conversations()).expect("written");
    let decode = "tcp.port==4840,opcua";
    let said = pcap::tshark(tshark()?, &file, decode, "opcua", &["opcua.transport.type"]);
    let count = |kind: &str| said.matches(kind).count();
    assert!(
        count("MSG") >= 20 && count("OPN") >= 2 && count("CLO") >= 1,
        "{said}"
    );
    let wrong = "_ws.malformed || _ws.expert.severity == error";
    let wrong = pcap::tshark(
        tshark()?,
        &file,
        decode,
        wrong,
        &["frame.number", "_ws.expert.message"],
    );
    assert_eq!(wrong, "");
    Ok(())
}

fn secured() -> Result<(), Absent> {
    logged::expect("a client with an unknown certificate was turned away");
    let folder = tempfile::tempdir().expect("a folder");
    let uri = "urn:test:client";
    let made = json!({"certificate": folder.path(), "uri": uri});
    drop(Peer::ready("opcua_client.py", &made)?);
    let mut device = Device::open(
        "opcua-server",
        "address = \"127.0.0.1:0\"\nuser = \"plc\"\npassword_in_clear = \"swordfish\"\ncycle = \"5ms\"",
    );
    let url = format!("opc.tcp://{}", device.address());
    let own = folder.path().display().to_string();
    let theirs = device.pki().join("own/tickbus-7.der").display().to_string();
    let asked = |policy: &str, password: &str| {
        json!({"url": url, "uri": uri, "user": "plc", "password": password,
               "security": format!("{policy},SignAndEncrypt,{own}/client.der,{own}/client.pem,{theirs}")})
    };
    let (_, refused) = Peer::start("opcua_client.py", &asked("Basic256Sha256", "swordfish"))?;
    assert!(
        refused.starts_with("refused"),
        "an unknown certificate: {refused}"
    );
    let rejected = files(&device.pki().join("rejected"));
    assert_eq!(rejected.len(), 1, "{rejected:?}");
    let name = rejected[0].file_name().expect("a name");
    std::fs::rename(&rejected[0], device.pki().join("trusted").join(name)).expect("it is there");

    for policy in [
        "Basic256Sha256",
        "Aes128Sha256RsaOaep",
        "Aes256Sha256RsaPss",
    ] {
        let (_, refused) = Peer::start("opcua_client.py", &asked(policy, "herring"))?;
        assert!(
            refused.starts_with("refused"),
            "a wrong password: {refused}"
        );
        let mut client = Peer::ready("opcua_client.py", &asked(policy, "swordfish"))?;
        client.ask(&json!({"write": {"speed": ["Int16", 77]}}));
        device.until("the value", |end| end.get("speed") == 77.0);
        client.ask(&json!({"write": {"speed": ["Int16", 78]}}));
        device.until("the value", |end| end.get("speed") == 78.0);
        drop(client);
        device.until_reason("closed its session");
    }
    Ok(())
}

fn no_anonymous() -> Result<(), Absent> {
    let device = Device::open(
        "opcua-server",
        "address = \"127.0.0.1:0\"\nsecurity = \"None\"\nuser = \"plc\"\n\
         password_in_clear = \"swordfish\"",
    );
    let url = format!("opc.tcp://{}", device.address());
    let (_, line) = Peer::start("opcua_client.py", &json!({"url": url}))?;
    assert!(line.starts_with("refused"), "{line}");
    Ok(())
}
