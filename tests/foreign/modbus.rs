//! The Modbus buses with third-party software at the other end: pymodbus as client and as server, mbpoll, and tshark to
//! check our server's data.
#![allow(missing_docs, clippy::float_cmp, reason = "a test")]

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};

use crate::harness::machine::Machine;
use crate::harness::pcap::{self, Tap};
use crate::harness::{self, Absent, Test};
#[cfg(unix)]
use crate::pty;
use tickbus::fieldbus::LinkState;
use tickbus::signal::Slot;
use tickbus_conformance::rig::{logged, statistic};

/// Bytes of %I and of %Q.
const BYTES: usize = 64;

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("pymodbus_drives_our_server", pymodbus_drives_our_server),
    (
        "pymodbus_drives_our_server_with_rtu_over_tcp",
        pymodbus_drives_our_server_with_rtu,
    ),
    ("pymodbus_meets_units_and_gateways", pymodbus_meets_units),
    (
        "pymodbus_finds_a_device_where_its_maker_put_it",
        pymodbus_finds_places,
    ),
    (
        "pymodbus_waits_is_refused_and_recovers",
        pymodbus_meets_wrong_answers,
    ),
    ("our_client_drives_pymodbus", our_client_drives_pymodbus),
    (
        "our_client_drives_pymodbus_with_rtu_over_tcp",
        our_client_drives_pymodbus_with_rtu,
    ),
    (
        "our_client_writes_only_into_the_device_that_was_named",
        our_client_writes_only_where_it_may,
    ),
    (
        "our_client_reads_inputs_of_pymodbus",
        our_client_reads_inputs,
    ),
    ("mbpoll_reads_and_writes_our_server", mbpoll_over_tcp),
    #[cfg(unix)]
    (
        "pymodbus_drives_our_server_on_a_serial_line",
        pymodbus_drives_our_server_on_a_line,
    ),
    #[cfg(unix)]
    (
        "our_client_drives_pymodbus_on_a_serial_line",
        our_client_drives_pymodbus_on_a_line,
    ),
    #[cfg(unix)]
    (
        "mbpoll_reads_and_writes_our_server_on_a_serial_line",
        mbpoll_on_a_line,
    ),
    (
        "tshark_finds_no_malformed_packet_of_our_server",
        tshark_finds_nothing,
    ),
];

pub(crate) fn open(fieldbus: &str, signals: &str) -> Machine {
    Machine::open(&format!(
        "[driver]\nid = 1\nname = \"Cell 4\"\n[fieldbus]\n{fieldbus}\nreconnect = [\"50ms\"]\n{signals}"
    ))
}

/// A machine that mirrors each byte of %Q to the byte of %I at the same offset.
pub(crate) trait Mirror {
    /// A tick that copies the bytes `q N` to `i N`.
    fn mirror(&mut self);
    fn mirror_until_the_end_of(&mut self, command: Command) -> String;
}

impl Mirror for Machine {
    fn mirror(&mut self) {
        self.tick();
        for index in 0..self.slots.len() {
            let name = self.driver.config().table.signals[index].name.clone();
            if let Some(number) = name.strip_prefix("i ") {
                let value = self.get(&format!("q {number}"));
                self.slots[index] = Slot::from_real(value);
            }
        }
        self.tick();
    }

    #[track_caller]
    fn mirror_until_the_end_of(&mut self, command: Command) -> String {
        self.until_the_end_of(command, Self::mirror)
    }
}

/// The version of pymodbus that is installed for the tests.
fn pymodbus_version() -> String {
    let pinned = harness::stated("tests/peers/requirements.txt", "pymodbus==");
    format!("pymodbus {pinned}")
}

/// A byte in each direction at every offset, except for some of %Q with REALs in two byte orders.
pub(crate) fn signals() -> String {
    let mut text = format!("input_bytes = {BYTES}\noutput_bytes = {BYTES}\n");
    for byte in 0..BYTES {
        let _ = write!(
            text,
            "[[signal]]\nname = \"i {byte}\"\naddress = \"%IB{byte}\"\n"
        );
        if !(20..28).contains(&byte) {
            let _ = write!(
                text,
                "[[signal]]\nname = \"q {byte}\"\naddress = \"%QB{byte}\"\n"
            );
        }
    }
    text.push_str(
        "[[signal]]\nname = \"abcd\"\naddress = \"%QD20\"\ntype = \"REAL\"\n\
         [[signal]]\nname = \"cdab\"\naddress = \"%QD24\"\ntype = \"REAL\"\norder = \"CDAB\"\n",
    );
    // The bytes below the REALs are copied starting at byte 0.
    for byte in 20..28 {
        text = text.replace(&format!("\"i {byte}\""), &format!("\"in {byte}\""));
    }
    text
}

pub(crate) fn pymodbus(script: &str) -> Result<Command, Absent> {
    let mut python = harness::python_with("main", &["pymodbus", "serial"])?;
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/");
    python.arg(format!("{folder}{script}"));
    Ok(python)
}

fn pymodbus_drives_our_server() -> Result<(), Absent> {
    pymodbus_drives("tcp", "")
}

fn pymodbus_drives_our_server_with_rtu() -> Result<(), Absent> {
    pymodbus_drives("rtu-over-tcp", "framing = \"rtu\"\n")
}

fn pymodbus_drives(mode: &str, framing: &str) -> Result<(), Absent> {
    let mut client = pymodbus("modbus_client.py")?;
    let server = "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"";
    let mut machine = open(&format!("{server}\n{framing}"), &signals());
    let address = machine.address_for("pymodbus", &pymodbus_version());
    client.args([mode, &address.ip().to_string(), &address.port().to_string()]);
    let told = machine.mirror_until_the_end_of(client);
    assert!(told.contains("modbus_client: ok checks="), "{told}");
    machine.until("the last write is through", |machine| {
        machine.get("cdab") != 0.0
    });
    assert_eq!((machine.get("abcd"), machine.get("cdab")), (1234.5, -0.125));
    let refused = if mode == "tcp" { "4" } else { "3" };
    assert_eq!(machine.statistic("modbus-server.illegal_function"), refused);
    Ok(())
}

fn pymodbus_meets_units() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["pymodbus"])?;
    let mut text = String::new();
    for (name, unit) in [("press", 3), ("oven", 7)] {
        let _ = write!(text, "[[station]]\nname = \"{name}\"\nunit = {unit}\n");
    }
    for name in ["press", "oven"] {
        let _ = write!(
            text,
            "[[signal]]\nname = \"{name} out\"\nstation = \"{name}\"\naddress = \"%QW0\"\n"
        );
    }
    let server = "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"";
    let mut machine = open(server, &text);
    let address = machine.address_for("pymodbus-units", &pymodbus_version());
    python.args([
        "-c",
        "import sys\n\
         from pymodbus.client import ModbusTcpClient\n\
         client = ModbusTcpClient('127.0.0.1', port=int(sys.argv[1]), retries=0)\n\
         client.connect()\n\
         assert not client.write_register(0, 33, device_id=3).isError()\n\
         assert not client.write_register(0, 77, device_id=7).isError()\n\
         assert client.read_holding_registers(0, device_id=3).registers == [33]\n\
         for unit in (0, 1, 255):\n\
         \x20   assert client.read_holding_registers(0, device_id=unit).exception_code == 0x0B\n\
         if sys.platform == 'linux':\n\
         \x20   import socket, struct\n\
         \x20   info = client.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 208)\n\
         \x20   for kind, at in ('Q', 200), ('I', 156), ('Q', 128), ('I', 152):\n\
         \x20       print(*struct.unpack_from(kind, info, at))\n",
        &address.port().to_string(),
    ]);
    let told = machine.mirror_until_the_end_of(python);
    machine.until("both have theirs", |machine| {
        machine.get("oven out") == 77.0
    });
    assert_eq!(machine.get("press out"), 33.0);
    // The system's own counts of the client's connection: tcpi_bytes_sent, tcpi_data_segs_out, tcpi_bytes_received,
    // tcpi_data_segs_in.
    let keys = ["octets_in", "frames_in", "octets_out", "frames_out"];
    let counted: Vec<&str> = told.lines().collect();
    assert!(!cfg!(target_os = "linux") || counted.len() == keys.len());
    for (key, counted) in keys.iter().zip(counted) {
        assert_eq!(machine.statistic(&format!("line.{key}")), counted, "{key}");
    }
    Ok(())
}

/// A drive at the registers that its manual names, with its maker's name, asked by a program that knows only those.
fn pymodbus_finds_places() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["pymodbus"])?;
    let server = "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"\n\
                  reserved = [{ at = \"408503\", count = 2 }]\n\
                  identity = { vendor = \"ACME\", product = \"FD-7\", revision = \"V2.1\", server_id = \"FD7\" }\n\
                  at = { \"q 0\" = \"408502\", \"i 0\" = \"303202\", \"q 1\" = \"coil:65536\", \"i 1\" = \"100008\" }";
    let mut text = String::new();
    for (area, way) in [("I", "i"), ("Q", "q")] {
        let _ = write!(
            text,
            "[[signal]]\nname = \"{way} 0\"\naddress = \"%{area}W0\"\ntype = \"INT\"\n\
             [[signal]]\nname = \"{way} 1\"\naddress = \"%{area}X2.0\"\n"
        );
    }
    let mut machine = open(server, &text);
    let address = machine.address_for("pymodbus-places", &pymodbus_version());
    python.args([
        "-c",
        "import sys, time\n\
         from pymodbus.client import ModbusTcpClient\n\
         client = ModbusTcpClient('127.0.0.1', port=int(sys.argv[1]), retries=0)\n\
         client.connect()\n\
         def code(answer): return answer.exception_code\n\
         assert not client.write_registers(8501, [1500, 1, 2]).isError()\n\
         assert client.read_holding_registers(8501, count=3).registers == [1500, 0, 0]\n\
         assert not client.write_coil(65535, True).isError()\n\
         limit = time.monotonic() + 10\n\
         while client.read_input_registers(3201, count=1).registers != [1500]:\n\
         \x20   assert time.monotonic() < limit\n\
         while not client.read_discrete_inputs(7, count=1).bits[0]:\n\
         \x20   assert time.monotonic() < limit\n\
         assert code(client.read_holding_registers(8501, count=4)) == 2\n\
         assert code(client.read_holding_registers(0, count=1)) == 2\n\
         assert code(client.read_holding_registers(3201, count=1)) == 2\n\
         assert code(client.read_coils(65534, count=2)) == 2\n\
         assert code(client.write_register(8504, 1)) == 2\n\
         who = client.read_device_information(read_code=1).information\n\
         assert who == {0: b'ACME', 1: b'FD-7', 2: b'V2.1'}, who\n\
         who = client.report_device_id()\n\
         assert (who.identifier, who.status) == (b'FD7', True), who\n",
        &address.port().to_string(),
    ]);
    machine.mirror_until_the_end_of(python);
    assert_eq!(machine.get("q 0"), 1500.0);
    Ok(())
}

/// Answers that are late, refused and malformed, each after the other, as pymodbus sees them.
fn pymodbus_meets_wrong_answers() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["pymodbus"])?;
    let server = "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"";
    let faults = "\
        [[fault]]\nkind = \"answer-late\"\nby = \"300ms\"\nwhile = \"case == 1\"\n\
        [[fault]]\nkind = \"answer-late\"\nname = \"too late\"\nby = \"3s\"\nfunction = 3\nwhile = \"case == 2\"\n\
        [[fault]]\nkind = \"answer-error\"\ncode = 6\nfunction = 3\nwhile = \"case == 3\"\n\
        [[fault]]\nkind = \"answer-wrong\"\nhow = \"transaction\"\nfunction = 3\nwhile = \"case == 4\"\n";
    let signals = "[[signal]]\nname = \"case\"\naddress = \"%QW0\"\ntype = \"INT\"\n\
                   [[signal]]\nname = \"now\"\naddress = \"%IW0\"\ntype = \"INT\"\n";
    logged::expect("injected fault ");
    let mut machine = open(server, &format!("{signals}{faults}"));
    let address = machine.address_for("pymodbus-answers", &pymodbus_version());
    python.args([
        "-c",
        "import sys, time\n\
         from pymodbus.client import ModbusTcpClient\n\
         from pymodbus.exceptions import ModbusIOException\n\
         client = ModbusTcpClient('127.0.0.1', port=int(sys.argv[1]), retries=0, timeout=1)\n\
         client.connect()\n\
         def case(number):\n\
         \x20   assert not client.write_register(0, number).isError()\n\
         \x20   limit = time.monotonic() + 20\n\
         \x20   while client.read_input_registers(0, count=1).registers != [number]:\n\
         \x20       assert time.monotonic() < limit\n\
         def read(): return client.read_holding_registers(0, count=1)\n\
         case(1)\n\
         began = time.monotonic()\n\
         assert read().registers == [1]\n\
         assert time.monotonic() - began >= 0.3\n\
         case(2)\n\
         try:\n\
         \x20   read()\n\
         \x20   sys.exit('it did not wait')\n\
         except ModbusIOException:\n\
         \x20   client.close()\n\
         client.connect()\n\
         case(3)\n\
         assert read().exception_code == 6\n\
         case(4)\n\
         try:\n\
         \x20   read()\n\
         \x20   sys.exit('it took the answer to something else')\n\
         except ModbusIOException:\n\
         \x20   client.close()\n\
         client.connect()\n\
         case(0)\n\
         assert read().registers == [0]\n",
        &address.port().to_string(),
    ]);
    machine.until_the_end_of(python, |machine| {
        machine.tick();
        let case = machine.get("case");
        machine.set("now", case);
    });
    Ok(())
}

/// A running server of pymodbus, which ends when it is dropped.
pub(crate) struct Server(Child);

impl Server {
    pub(crate) fn start(arguments: &[&str]) -> Result<Self, Absent> {
        Self::start_script("modbus_server.py", arguments)
    }

    /// Starts another server of tests/peers.
    pub(crate) fn start_script(script: &str, arguments: &[&str]) -> Result<Self, Absent> {
        let mut child = pymodbus(script)?
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        let told = child.stdout.take().expect("a pipe");
        let first = BufReader::new(told).lines().next();
        let first = first.expect("it prints").expect("UTF-8");
        assert_eq!(first, "modbus_server: ready");
        Ok(Self(child))
    }

    fn tcp() -> Result<(Self, SocketAddr), Absent> {
        Self::at_address("tcp")
    }

    pub(crate) fn at_address(mode: &str) -> Result<(Self, SocketAddr), Absent> {
        Self::at_address_with(mode, &[])
    }

    /// As `at_address`, with further arguments.
    pub(crate) fn at_address_with(
        mode: &str,
        further: &[&str],
    ) -> Result<(Self, SocketAddr), Absent> {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        drop(listener);
        let (ip, port) = (address.ip().to_string(), address.port().to_string());
        let arguments = [&[mode, &ip, &port], further].concat();
        Ok((Self::start(&arguments)?, address))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// More words in each direction than fit into one request.
pub(crate) fn words(count: usize) -> String {
    let mut text = String::new();
    for word in 0..count {
        let byte = 2 * word;
        let _ = write!(
            text,
            "[[signal]]\nname = \"i {word}\"\naddress = \"%IW{byte}\"\n\
             [[signal]]\nname = \"q {word}\"\naddress = \"%QW{byte}\"\n"
        );
    }
    text
}

/// Sends values out and back, with %I and %Q at the same place.
#[track_caller]
pub(crate) fn loop_through(fieldbus: &str, count: usize) -> Machine {
    let mut machine = open(fieldbus, &words(count));
    for round in 1..=3 {
        for word in 0..count {
            let value = (word * 7 + round * 1000) % 65536;
            machine.set(
                &format!("i {word}"),
                f64::from(u32::try_from(value).expect("small")),
            );
        }
        machine.until("all values are back", |machine| {
            (0..count)
                .all(|word| machine.get(&format!("i {word}")) == machine.get(&format!("q {word}")))
        });
    }
    assert_eq!(machine.driver.link().state, LinkState::Running);
    assert_eq!(machine.statistic("writes"), "allowed");
    machine
}

pub(crate) const ALLOWED: &str = "write_to = \"ACME PLC 7 1.2\"";

fn our_client_drives_pymodbus() -> Result<(), Absent> {
    let (server, address) = Server::tcp()?;
    let client = format!("kind = \"modbus-client\"\naddress = \"{address}\"\n{ALLOWED}\n");
    // Function 23; functions 16 and 3; 15 and 1; and more than fits into one request.
    for (keys, count) in [
        ("inputs = \"offset:0\"", 64),
        ("inputs = \"offset:0\"\nread_write = false", 64),
        ("inputs = \"offset:1000\"\noutputs = \"401001\"", 300),
        ("inputs = \"coil:17\"\noutputs = \"0x00017\"", 10),
        ("inputs = \"coil offset:8\"\noutputs = \"coil:9\"", 200),
        (
            "inputs = [{ at = \"coil:1\", bytes = 2 }, { at = \"4x00501\" }]\n\
             outputs = [{ at = \"coil:1\", bytes = 2 }, { at = \"offset:500\" }]",
            20,
        ),
    ] {
        let machine = loop_through(&format!("{client}{keys}"), count);
        machine.end.driver.close();
    }
    // The server dies and is restarted.
    let mut machine = loop_through(&format!("{client}inputs = \"offset:0\""), 4);
    drop(server);
    machine.until("the line is lost", |machine| {
        machine.driver.link().state != LinkState::Running
    });
    let (ip, port) = (address.ip().to_string(), address.port().to_string());
    let _server = Server::start(&["tcp", &ip, &port])?;
    machine.set("i 0", 99.0);
    machine.until("the value is back", |machine| machine.get("q 0") == 99.0);
    Ok(())
}

fn our_client_drives_pymodbus_with_rtu() -> Result<(), Absent> {
    let (_server, address) = Server::at_address("rtu-over-tcp")?;
    let client = format!(
        "kind = \"modbus-client\"\naddress = \"{address}\"\nframing = \"rtu\"\n{ALLOWED}\n"
    );
    for (keys, count) in [
        ("inputs = \"offset:0\"", 64),
        ("inputs = \"offset:0\"\nread_write = false", 150),
        ("inputs = \"coil:1\"\noutputs = \"coil:1\"", 10),
    ] {
        let machine = loop_through(&format!("{client}{keys}"), count);
        machine.end.driver.close();
    }
    Ok(())
}

fn our_client_writes_only_where_it_may() -> Result<(), Absent> {
    logged::expect("nothing is written into the PLC \"ACME PLC 7 1.2\"");
    let (_server, address) = Server::tcp()?;
    logged::expect("nothing is written into the PLC \"ACME PLC 7 1.2\"");
    for write_to in ["", "write_to = \"ACME PLC 7\""] {
        let fieldbus = format!(
            "kind = \"modbus-client\"\naddress = \"{address}\"\ninputs = \"offset:0\"\n{write_to}"
        );
        let mut machine = open(&fieldbus, &words(2));
        machine.set("i 0", 5.0);
        machine.until("it runs", |machine| {
            machine.statistic("bus_cycles").len() > 1
        });
        assert_eq!(machine.get("q 0"), 0.0, "nothing was written");
        assert_eq!(machine.statistic("identity"), "ACME PLC 7 1.2");
        assert_eq!(machine.statistic("writes"), "blocked");
    }
    Ok(())
}

fn our_client_reads_inputs() -> Result<(), Absent> {
    logged::expect("nothing is written into the PLC \"ACME PLC 7 1.2\"");
    let (_server, address) = Server::tcp()?;
    logged::expect("nothing is written into the PLC \"ACME PLC 7 1.2\"");
    let client =
        format!("kind = \"modbus-client\"\nrole = \"controller\"\naddress = \"{address}\"\n");
    let mut registers = open(&client, &words(300));
    registers.until("input registers come", |machine| {
        machine.get("i 299") == 2093.0
    });
    let keys = format!("{client}inputs = \"discrete-input:1\"\n");
    let mut bits = open(&keys, "[[signal]]\nname = \"i\"\naddress = \"%IW0\"\n");
    // Every third bit, from bit 0 of byte 0 on.
    bits.until("discrete inputs come", |machine| {
        machine.get("i") == f64::from(0b0100_1001_1001_0010_u16)
    });
    let keys = format!("{client}inputs = \"input-register:2047\"\n");
    let mut beyond = open(&keys, &words(3));
    beyond.until("it says what was refused", |machine| {
        machine.driver.link().cause.name() == "refused"
    });
    let reason = beyond.driver.link().reason;
    let expected = "refused to read input-register offset:2046 (3x02047) to 2048 (function 4): exception 02 \
                    (illegal data address); correct \"inputs\"";
    assert!(reason.contains(expected), "{reason}");
    Ok(())
}

/// Runs mbpoll once; returns its output.
fn mbpoll(machine: &mut Machine, arguments: &[&str]) -> Result<String, Absent> {
    let mut mbpoll = harness::command("mbpoll", "mbpoll")?;
    mbpoll.args(["-1", "-q"]).args(arguments);
    Ok(machine.mirror_until_the_end_of(mbpoll))
}

fn mbpoll_version() -> Result<String, Absent> {
    let told = harness::command("mbpoll", "mbpoll")?.arg("-V").output();
    let told = String::from_utf8(told.expect("it runs").stdout).expect("UTF-8");
    Ok(told.lines().next().unwrap_or_default().trim().to_owned())
}

fn mbpoll_over_tcp() -> Result<(), Absent> {
    let server = "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"";
    let mut machine = open(server, &signals());
    let port = machine.address_for("mbpoll", &mbpoll_version()?).port();
    let port = port.to_string();
    let tcp = ["-m", "tcp", "-p", port.as_str()];
    mbpoll_everything(&mut machine, &tcp, "127.0.0.1")
}

fn mbpoll_everything(machine: &mut Machine, mode: &[&str], host: &str) -> Result<(), Absent> {
    let run =
        |machine: &mut Machine, arguments: &[&str]| mbpoll(machine, &[mode, arguments].concat());
    run(machine, &["-t", "4", "-r", "1", host, "258", "772"])?;
    let told = run(machine, &["-t", "4", "-r", "1", "-c", "2", host])?;
    assert!(
        told.contains("[1]: \t258") && told.contains("[2]: \t772"),
        "{told}"
    );
    machine.until("the machine has it", |machine| machine.get("q 3") == 4.0);
    let told = run(machine, &["-t", "3", "-r", "1", "-c", "2", host])?;
    assert!(
        told.contains("[1]: \t258") && told.contains("[2]: \t772"),
        "{told}"
    );
    run(machine, &["-t", "0", "-r", "65", host, "1", "0", "1"])?;
    let told = run(machine, &["-t", "0", "-r", "65", "-c", "3", host])?;
    assert!(
        told.contains("[65]: \t1") && told.contains("[66]: \t0"),
        "{told}"
    );
    machine.until("the machine has it", |machine| machine.get("q 8") == 5.0);
    let told = run(machine, &["-t", "1", "-r", "65", "-c", "3", host])?;
    assert!(told.contains("[67]: \t1"), "{told}");
    // A REAL with swapped words, mbpoll's default, and big-endian with -B.
    run(machine, &["-t", "4:float", "-r", "13", host, "1.5"])?;
    run(machine, &["-t", "4:float", "-B", "-r", "11", host, "2.5"])?;
    machine.until("the machine has both", |machine| machine.get("abcd") == 2.5);
    assert_eq!(machine.get("cdab"), 1.5);
    Ok(())
}

#[cfg(unix)]
fn pymodbus_drives_our_server_on_a_line() -> Result<(), Absent> {
    let mut client = pymodbus("modbus_client.py")?;
    let line = pty::Line::new();
    let mut machine = open(&serial("server", line.end(0)), &signals());
    machine.until("it listens", |machine| {
        statistic(&machine.driver, "device").is_some()
    });
    client.arg("rtu").arg(line.end(1));
    let told = machine.mirror_until_the_end_of(client);
    assert!(told.contains("modbus_client: ok checks="), "{told}");
    assert_eq!(machine.get("abcd"), 1234.5);
    Ok(())
}

#[cfg(unix)]
fn serial(end: &str, device: &std::path::Path) -> String {
    let device = device.display();
    // However slow the other end is, its last written values stay.
    format!(
        "kind = \"modbus-{end}\"\nmax_age = \"1h\"\ndevice = \"{device}\"\nbaud = 115200\nparity = \"none\"\nstop_bits = 1\n"
    )
}

#[cfg(unix)]
fn our_client_drives_pymodbus_on_a_line() -> Result<(), Absent> {
    let line = pty::Line::new();
    let device = line.end(1).display().to_string();
    let _server = Server::start(&["rtu", &device])?;
    let client = format!("{}{ALLOWED}\n", serial("client", line.end(0)));
    for (keys, count) in [
        ("inputs = \"offset:0\"", 64),
        ("inputs = \"offset:0\"\nread_write = false", 150),
        ("inputs = \"coil:1\"\noutputs = \"coil:1\"", 10),
    ] {
        let machine = loop_through(&format!("{client}{keys}"), count);
        machine.end.driver.close();
    }
    Ok(())
}

#[cfg(unix)]
fn mbpoll_on_a_line() -> Result<(), Absent> {
    let line = pty::Line::new();
    let mut machine = open(&serial("server", line.end(0)), &signals());
    machine.until("it listens", |machine| {
        statistic(&machine.driver, "device").is_some()
    });
    let device = line.end(1).display().to_string();
    let rtu = ["-m", "rtu", "-b", "115200", "-P", "none"];
    mbpoll_everything(&mut machine, &rtu, &device)
}

/// Every function, answered and refused.
const REQUESTS: [&[u8]; 19] = [
    &[1, 0, 3, 0, 19],
    &[2, 0, 0, 0, 100],
    &[3, 0, 0, 0, 32],
    &[4, 0, 0, 0, 32],
    &[5, 0, 9, 0xFF, 0],
    &[6, 0, 1, 0xAB, 0xCD],
    &[15, 0, 3, 0, 10, 2, 0xFF, 3],
    &[16, 0, 0, 0, 2, 4, 1, 2, 3, 4],
    &[22, 0, 1, 0, 0xF2, 0, 0x25],
    &[23, 0, 0, 0, 4, 0, 0, 0, 1, 2, 7, 8],
    &[43, 14, 1, 0],
    &[43, 14, 4, 1],
    &[1, 2, 0, 0, 1],
    &[3, 0, 0, 0, 0],
    &[4, 0, 0, 1, 0],
    &[16, 0, 31, 0, 2, 4, 1, 2, 3, 4],
    &[23, 0, 99, 0, 4, 0, 0, 0, 1, 2, 7, 8],
    &[7],
    &[43, 14, 4, 9],
];

fn tshark_finds_nothing() -> Result<(), Absent> {
    let server = "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"";
    let machine = open(server, &signals());
    let tap = Tap::before(machine.address());
    let mut stream = TcpStream::connect(tap.address).expect("it listens");
    for (transaction, pdu) in (1_u16..).zip(REQUESTS) {
        let mut telegram = transaction.to_be_bytes().to_vec();
        let length = u8::try_from(pdu.len() + 1).expect("it is short");
        telegram.extend([0, 0, 0, length, 1]);
        telegram.extend(pdu);
        stream.write_all(&telegram).expect("the server reads");
        let mut answer = [0; 260];
        let count = stream.read(&mut answer).expect("an answer");
        assert!(count > 8 && answer[7] & 0x7F == pdu[0], "{answer:?}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("modbus.pcap");
    pcap::write(&file, 502, &tap.conversations()).expect("it is written");
    let ask = |filter: &str, field: &str| {
        let tshark = harness::command("tshark", "tshark")?;
        Ok(pcap::tshark(
            tshark,
            &file,
            "tcp.port==502,mbtcp",
            filter,
            &[field],
        ))
    };
    let telegrams = ask("mbtcp", "modbus.func_code")?;
    assert_eq!(telegrams.lines().count(), 2 * REQUESTS.len(), "{telegrams}");
    // Some of the requests are wrong on purpose.
    let bad = "tcp.srcport == 502 && (_ws.malformed || _ws.expert.severity >= 0x600000)";
    let complaints = ask(bad, "_ws.expert.message")?;
    assert_eq!(complaints, "");
    for (port, key) in [("dstport", "octets_in"), ("srcport", "octets_out")] {
        let lengths = ask(&format!("tcp.{port} == 502"), "tcp.len")?;
        let sum: u64 = lengths
            .lines()
            .filter_map(|length| length.parse::<u64>().ok())
            .sum();
        assert_eq!(machine.statistic(&format!("line.{key}")), sum.to_string());
    }
    let names = ask("modbus.object_str_value", "modbus.object_str_value")?;
    assert!(
        names.contains("tickbus") && names.contains("Cell 4"),
        "{names}"
    );
    let refused = ask("modbus.exception_code", "modbus.exception_code")?;
    assert_eq!(
        refused.split_whitespace().collect::<Vec<_>>(),
        ["2", "3", "3", "2", "2", "1", "2"]
    );
    Ok(())
}
