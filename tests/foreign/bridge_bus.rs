//! `tickbus bridge bus`: foreign devices and PLCs as clients of the dispatcher. Each is read and written, dies, and is back.
#![allow(clippy::unnecessary_wraps, reason = "tests of one shape")]

use std::net::TcpListener;
use std::path::Path;

use serde_json::json;

use crate::commands::{LabClient, Running, bridge, dispatch};
use crate::harness::{self, Absent, Test};
use crate::modbus::Server;
#[cfg(feature = "opcua")]
use crate::opcua;
use crate::s7::Cpu;

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("a_device_of_pymodbus_is_a_process_on_the_board", modbus),
    ("a_cpu_of_python_snap7_is_a_controller_on_the_board", s7),
    #[cfg(feature = "opcua")]
    ("a_server_of_asyncua_is_a_controller_on_the_board", opc_ua),
    (
        "the_logo_of_the_document_switches_the_pump_at_its_adam",
        document,
    ),
];

/// A laboratory with a bridge to a device.
struct Lab {
    folder: tempfile::TempDir,
    dispatch: Running,
    dispatcher: String,
    bridge: Running,
}

impl Lab {
    /// A bridge with this driver.cfg; it has joined.
    fn new(config: &str) -> Self {
        Self::with_patch(config, "REAL", "")
    }

    /// The same for a device with this name, with connections in the dispatcher's file.
    fn with_patch(config: &str, name: &str, patch: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let patched = folder.path().join("lab.toml");
        if !patch.is_empty() {
            std::fs::write(&patched, patch).expect("a file");
        }
        let mut dispatch = dispatch(&patched, "127.0.0.1:0");
        let dispatcher = dispatch.after("dispatch: listening on ");
        let bridge = join(folder.path(), config, name, &dispatcher);
        Self {
            folder,
            dispatch,
            dispatcher,
            bridge,
        }
    }

    fn end(self) {
        end(self.bridge);
        self.dispatch.interrupt();
    }
}

/// Starts a bridge with this driver.cfg, until it has joined.
fn join(folder: &Path, config: &str, name: &str, dispatcher: &str) -> Running {
    let file = folder.join(format!("{name}.cfg"));
    std::fs::write(&file, config).expect("a file");
    let file = file.to_str().expect("text");
    let mut bridge = bridge(&["bus", file, "--dispatcher", dispatcher]);
    // A bus that is fast runs before the bridge has said that it waits for it.
    loop {
        let state = bridge.after(&format!("bridge: {name} "));
        if state.starts_with("opening: joined ") || state.starts_with("running") {
            return bridge;
        }
    }
}

fn end(bridge: Running) {
    let (last, code) = bridge.interrupt();
    assert!(last.starts_with("bridge: ok ticks="), "{last}");
    assert_eq!(code, Some(0));
}

fn free_port() -> u16 {
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    free.local_addr().expect("it is bound").port()
}

fn modbus() -> Result<(), Absent> {
    let port = free_port().to_string();
    let start = || Server::start(&["tcp", "127.0.0.1", &port]);
    let device = start()?;
    let mut lab = Lab::new(&format!(
        "[driver]\nid = 1\nname = \"REAL\"\n[fieldbus]\nkind = \"modbus-client\"\nrole = \"controller\"\n\
         address = \"127.0.0.1:{port}\"\ncycle = \"10ms\"\nwrite_to = \"ACME PLC 7 1.2\"\nreconnect = [\"50ms\"]\n\
         [fieldbus.at]\n\"back\" = \"holding-register offset:1\"\n\
         [[signal]]\nname = \"level\"\naddress = \"%IW2\"\ntype = \"INT\"\nscale = {{ raw = [0, 700], value = [0.0, 10.0] }}\n\
         [[signal]]\nname = \"back\"\naddress = \"%IW4\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"setpoint\"\naddress = \"%QW2\"\ntype = \"INT\"\nfail_safe = -5\n"
    ));
    let mut logo = LabClient::connect(&lab.dispatcher, "VR LOGO AQ1 AI2 V=3");
    logo.say("CONNECT AI1:REAL:AQ1 AI2:REAL:AQ2 AQ1:REAL:AI1");
    logo.until_values("AI1=0.1");
    for value in ["330", "-2"] {
        logo.say(&format!("P AQ1={value}"));
        logo.until_values(&format!("AI2={value}"));
    }
    // Without a source the device gets the fail-safe value.
    logo.say("DISCONNECT AQ1");
    logo.until_values("AI2=-5");
    logo.say("CONNECT AQ1:REAL:AI1");
    logo.until_values("AI2=-2");
    drop(device);
    logo.until_values("AI1=?");
    logo.say("LIST");
    assert!(logo.until("END").ends_with('1'), "it has left");
    let _device = start()?;
    // The registers of the new device are 0 until the value that stands on the board is there.
    logo.until_values("AI1=0.1");
    logo.until_values("AI2=-2");
    lab.bridge.after("bridge: REAL running: joined ");
    lab.end();
    Ok(())
}

fn s7() -> Result<(), Absent> {
    let port = free_port();
    let start = || {
        let python = harness::python_with("main", &["snap7"])?;
        Ok(Cpu::start_at(python, "snap7_server.py", port))
    };
    let cpu = start()?;
    let lab = Lab::new(&format!(
        "[driver]\nid = 1\nname = \"REAL\"\n[fieldbus]\nkind = \"s7-client\"\naddress = \"127.0.0.1:{port}\"\n\
         cycle = \"10ms\"\nslot = 2\ninput = \"DB2\"\noutput = \"DB1\"\nreconnect = [\"50ms\"]\n\
         write_to = \"6ES7 315-2EH14-0AB0 CPU 315-2 PN/DP S C-C2UR28922012\"\n\
         [[signal]]\nname = \"position\"\naddress = \"%IW2\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"speed\"\naddress = \"%QW2\"\ntype = \"INT\"\n"
    ));
    let mut tank = LabClient::connect(&lab.dispatcher, "VP TANK AQ1 AI1 V=3");
    tank.say("CONNECT AI1:REAL:AQ1 AQ1:REAL:AI1");
    // The CPU adds 1.
    for value in [70, -300] {
        tank.say(&format!("P AQ1={value}"));
        tank.until_values(&format!("AI1={}", (value + 1) & 0x7FFF));
    }
    drop(cpu);
    tank.until_values("AI1=?");
    let _cpu = start()?;
    tank.say("P AQ1=9");
    tank.until_values("AI1=10");
    lab.end();
    Ok(())
}

#[cfg(feature = "opcua")]
fn opc_ua() -> Result<(), Absent> {
    let address = opcua::free_address();
    let mut plc = opcua::plc(address, &json!({}))?;
    let lab = Lab::new(&format!(
        "[driver]\nid = 1\nname = \"REAL\"\n[fieldbus]\nkind = \"opcua-client\"\nurl = \"opc.tcp://{address}\"\n\
         security = \"None\"\nwrite_to = \"{}\"\nmax_age = \"2s\"\nreconnect = [\"50ms\"]\n\
         [[signal]]\nname = \"speed\"\naddress = \"%QW2\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"position\"\naddress = \"%IW2\"\ntype = \"INT\"\n",
        opcua::IDENTITY
    ));
    let mut tank = LabClient::connect(&lab.dispatcher, "VP TANK AQ1 AI1 V=3");
    tank.say("CONNECT AI1:REAL:AQ1 AQ1:REAL:AI1");
    tank.until_values("AI1=7");
    plc.ask(&json!({"set": {"speed": -1234}}));
    tank.until_values("AI1=-1234");
    tank.say("P AQ1=138");
    while plc.ask(&json!({"get": "position"}))["value"] != 138 {}
    drop(plc);
    tank.until_values("AI1=?");
    let _plc = opcua::plc(address, &json!({}))?;
    tank.until_values("AI1=7");
    lab.end();
    Ok(())
}

/// The block in docs/dispatcher.md that contains these words, with other words in place of some of them.
fn documented(words: &str, replaced: &[(&str, &str)]) -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/dispatcher.md");
    let text = std::fs::read_to_string(path).expect("it is there");
    let mut blocks = text.split("```toml\n").skip(1);
    let block = blocks.find_map(|rest| {
        let (block, _) = rest.split_once("```")?;
        block.contains(words).then(|| block.to_owned())
    });
    let mut block = block.expect(words);
    for (from, to) in replaced {
        assert!(block.contains(from), "{from}: {block}");
        block = block.replace(from, to);
    }
    block
}

fn document() -> Result<(), Absent> {
    let (adam, logo) = (free_port().to_string(), free_port());
    let _adam = Server::start_script("adam.py", &["127.0.0.1", &adam])?;
    let python = harness::python_with("main", &["snap7"])?;
    let _logo = Cpu::start_at(python, "logo.py", logo);
    let place = format!("127.0.0.1:{adam}");
    let adam = documented("name = \"ADAM\"", &[("192.168.0.20:502", &place)]);
    let place = format!("\"127.0.0.1:{logo}\"");
    // The name that this CPU states.
    let identity = "write_to = \"6ES7 315-2EH14-0AB0 CPU 315-2 PN/DP S C-C2UR28922012\" #";
    let logo = documented(
        "kind        = \"s7-client\"",
        &[("\"192.168.0.3\"", &place), ("# write_to", identity)],
    );
    let patch = documented("\"LOGO:I1\" = \"ADAM:Q1\"", &[])
        + "\"WATCH:I1\" = \"ADAM:Q1\"\n\"WATCH:I2\" = \"LOGO:Q1\"\n\"WATCH:AI1\" = \"LOGO:AQ1\"\n";
    let lab = Lab::with_patch(&adam, "ADAM", &patch);
    let mut watch = LabClient::connect(&lab.dispatcher, "VP WATCH I2 AI1 V=3");
    let second = join(lab.folder.path(), &logo, "LOGO", &lab.dispatcher);
    // The tank is filled, and runs empty, again and again.
    for _ in 0..3 {
        for value in ["I2=24", "I1=24", "I2=0", "I1=0"] {
            watch.until_values(value);
        }
    }
    let starts = |line: &str| line.split_once("AI1=")?.1.parse().ok();
    while starts(&watch.until("P ")).is_none_or(|starts: u32| starts <= 3) {}
    end(second);
    lab.end();
    Ok(())
}
