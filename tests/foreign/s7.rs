//! S7 with third-party software at the other end: Snap7 in Python and in C, rust7; checked by tshark.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    clippy::unnecessary_wraps,
    reason = "tests of one shape; the values are small whole numbers"
)]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{Ipv4Addr, TcpListener};
use std::process::{Child, ChildStdout, Command, Stdio};

use crate::harness::machine::{Machine, SIGNALS};
use crate::harness::{self, Absent, Test, pcap};
use tickbus_conformance::rig::logged;

pub(crate) const TESTS: &[(&str, Test)] = &[
    (
        "python_snap7_reads_writes_and_asks_the_server",
        python_snap7_reads_writes_and_asks_the_server,
    ),
    (
        "python_snap7_finds_places_and_names",
        python_snap7_finds_places_and_names,
    ),
    (
        "our_client_reads_and_writes_a_server_of_python_snap7",
        our_client_reads_and_writes_a_server_of_python_snap7,
    ),
    (
        "snap7_in_c_reads_writes_and_asks_the_server",
        snap7_in_c_reads_writes_and_asks_the_server,
    ),
    (
        "our_client_writes_signals_alone_into_snap7_in_c_and_sees_its_stop",
        our_client_writes_signals_alone_into_snap7_in_c_and_sees_its_stop,
    ),
    (
        "closing_leaves_the_fail_safe_values_in_snap7_in_c",
        closing_leaves_the_fail_safe_values_in_snap7_in_c,
    ),
    (
        "rust7_reads_and_writes_the_server",
        rust7_reads_and_writes_the_server,
    ),
    (
        "python_snap7_waits_and_is_refused",
        python_snap7_waits_and_is_refused,
    ),
    (
        "tshark_finds_nothing_malformed",
        tshark_finds_nothing_malformed,
    ),
];

fn open(fieldbus: &str) -> Machine {
    open_with(fieldbus, "")
}

/// With additional signals.
fn open_with(fieldbus: &str, further: &str) -> Machine {
    Machine::open(&format!(
        "[driver]\nid = 1\nname = \"Test rig\"\n[fieldbus]\n{fieldbus}\n{SIGNALS}{further}"
    ))
}

/// Runs a Python script with these arguments while `end` ticks; returns its output.
#[track_caller]
fn run(end: &mut Machine, mut python: Command, script: &str, arguments: &[String]) -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/");
    python.arg(format!("{path}{script}")).args(arguments);
    end.until_the_end_of(python, Machine::tick)
}

/// A client's last written values stay after it has gone.
const SERVER: &str = "kind = \"s7-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"\n\
    db = [{ number = 1, area = \"%Q\" }, { number = 2, area = \"%I\", offset = 2, length = 6 }]";

fn python_snap7_reads_writes_and_asks_the_server() -> Result<(), Absent> {
    let python = harness::python_with("main", &["snap7"])?;
    let mut end = open(SERVER);
    end.set("sensor", 1.0);
    end.set("position", -2.0);
    end.set("pressure", 1.5);
    let pinned = harness::stated("tests/peers/requirements.txt", "python-snap7==");
    let address = end.address_for("python-snap7", &format!("python-snap7 {pinned}"));
    let port = address.port().to_string();
    let told = run(&mut end, python, "snap7_client.py", &[port]);
    assert!(told.contains("snap7_client: ok\n"), "{told}");
    end.tick();
    assert_eq!(
        (end.get("run"), end.get("speed"), end.get("torque")),
        (1.0, 1234.0, 2.5)
    );
    Ok(())
}

/// A CPU whose program has its variables in blocks of its own, with the names that a real one reports.
const PLACES: &str = "kind = \"s7-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"\n\
    db = [{ number = 10, length = 100 }]\n\
    [fieldbus.identity]\norder = \"6ES7 315-2EH14-0AB0\"\nfirmware = \"V3.2.6\"\nname = \"PLC_1\"\n\
    system = \"S7-300 station_1\"\nmodule = \"CPU 315-2 PN/DP\"\nserial = \"S C-X4U421302009\"\n\
    copyright = \"Original Siemens Equipment\"\n\
    [fieldbus.at]\nrun = \"DB500.DBX0.7\"\nspeed = \"DB10.DBW20\"\ntorque = \"%QD8:REAL\"\n\
    sensor = \"%M100.3\"\nposition = \"DB10,INT4\"\npressure = \"DB65535.DBD1000\"\n";

fn python_snap7_finds_places_and_names() -> Result<(), Absent> {
    for _ in 0..2 {
        let python = harness::python_with("main", &["snap7"])?;
        let mut end = open(PLACES);
        end.set("sensor", 1.0);
        end.set("position", -2.0);
        end.set("pressure", 1.5);
        let port = end.address().port().to_string();
        let told = run(&mut end, python, "snap7_places.py", &[port]);
        assert!(told.contains("snap7_places: ok\n"), "{told}");
        end.tick();
        assert_eq!(
            (end.get("run"), end.get("speed"), end.get("torque")),
            (1.0, 1234.0, 2.5)
        );
    }
    Ok(())
}

/// A server of Snap7 with data blocks 1 and 2.
pub(crate) struct Cpu {
    process: Child,
    pub(crate) port: u16,
    out: BufReader<ChildStdout>,
}

impl Cpu {
    pub(crate) fn start(python: Command, script: &str) -> Self {
        let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
        let port = free.local_addr().expect("it is bound").port();
        drop(free);
        Self::start_at(python, script, port)
    }

    pub(crate) fn start_at(mut python: Command, script: &str, port: u16) -> Self {
        let path = format!(
            concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/{}"),
            script
        );
        let mut process = python
            .args([path, port.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python starts");
        let mut line = String::new();
        let out = process.stdout.take().expect("it was piped");
        let mut out = BufReader::new(out);
        out.read_line(&mut line).expect("text");
        assert_eq!(line, "ready\n");
        Self { process, port, out }
    }

    /// Sends it a line on stdin.
    pub(crate) fn tell(&mut self, line: &str) {
        let stdin = self.process.stdin.as_mut().expect("it was piped");
        writeln!(stdin, "{line}").expect("it reads");
    }

    /// Ends it; returns its final output.
    fn end(mut self) -> String {
        drop(self.process.stdin.take());
        let mut rest = String::new();
        self.out.read_to_string(&mut rest).expect("text");
        rest
    }
}

impl Drop for Cpu {
    fn drop(&mut self) {
        // The CPU ends with its stdin.
        drop(self.process.stdin.take());
        let _ = self.process.wait();
    }
}

/// The client's warnings about a CPU that its driver.cfg does not name, and that does not report whether it is in RUN.
fn expect_warnings() {
    logged::expect("nothing is written into the PLC \"6ES7 315-2EH14-0AB0");
    logged::expect("does not say whether it is in RUN");
}

fn our_client_reads_and_writes_a_server_of_python_snap7() -> Result<(), Absent> {
    expect_warnings();
    let cpu = Cpu::start(harness::python_with("main", &["snap7"])?, "snap7_server.py");
    let who = "6ES7 315-2EH14-0AB0 CPU 315-2 PN/DP S C-C2UR28922012";
    let fieldbus = |further: &str| {
        format!(
            "kind = \"s7-client\"\naddress = \"127.0.0.1:{}\"\ncycle = \"2ms\"\nslot = 2\n\
             input_bytes = 600\noutput_bytes = 600\ninput = \"DB2\"\noutput = \"DB1\"\n{further}",
            cpu.port
        )
    };
    // Of a job that writes, this server only executes the first item, so the written data have no gaps.
    let mut further = String::from(
        "[[signal]]\nname = \"last\"\naddress = \"%IW598\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"last back\"\naddress = \"%QW598\"\ntype = \"INT\"\n",
    );
    let bits = (1..8).map(|bit| format!("%IX0.{bit}"));
    let longs = (8..592).step_by(8).map(|byte| format!("%IL{byte}"));
    let words = (592..598).step_by(2).map(|byte| format!("%IW{byte}"));
    for address in bits.chain(["%IB1".to_owned()]).chain(longs).chain(words) {
        further += "[[signal]]\nname = \"here\"\naddress = \"here\"\n"
            .replace("here", &address)
            .as_str();
    }
    let last = &*further;
    logged::expect("nothing is written into the PLC");
    logged::expect("does not say whether it is in RUN");
    let mut end = open_with(&fieldbus(""), last);
    end.set("position", 70.0);
    end.until("it reads", |end| end.get("speed") == 1.0);
    assert_eq!(end.statistic("identity"), who);
    assert_eq!(end.statistic("writes"), "blocked");
    let cycles = end.statistic("bus_cycles");
    end.until("more is read", |end| end.statistic("bus_cycles") != cycles);
    assert_eq!(end.get("speed"), 1.0, "nothing was written");
    end.end.driver.close();

    let mut end = open_with(&fieldbus(&format!("write_to = \"{who}\"")), last);
    for value in [70.0, 71.0, 72.0] {
        end.set("position", value);
        end.set("last", value + 100.0);
        end.until("it comes back", |end| {
            (end.get("speed"), end.get("last back")) == (value + 1.0, value + 101.0)
        });
    }
    assert_eq!(end.statistic("writes"), "allowed");
    end.end.driver.close();

    let gone = fieldbus("").replace("\"DB1\"", "\"DB7\"");
    let mut end = open_with(&gone, last);
    end.until("it is told", |end| {
        let reason = end.driver.link().reason;
        reason.contains("refuses reading DB7 bytes 0 to")
            && reason.contains("optimized block access")
    });
    assert_eq!(end.driver.link().cause.name(), "refused");
    Ok(())
}

/// The environment of the wheel that brings the C library.
pub(crate) fn snap7_in_c() -> Result<Command, Absent> {
    harness::python_with("snap7", &["snap7.common", "snap7.protocol"])
}

fn snap7_in_c_reads_writes_and_asks_the_server() -> Result<(), Absent> {
    let python = snap7_in_c()?;
    let mut end = open(SERVER);
    end.set("sensor", 1.0);
    end.set("position", -2.0);
    end.set("pressure", 1.5);
    let pinned = harness::stated("tests/peers/requirements-snap7.txt", "python-snap7==");
    let client = format!("Snap7 in C, of python-snap7 {pinned}");
    let address = end.address_for("snap7", &client);
    let port = address.port().to_string();
    let told = run(&mut end, python, "snap7c_client.py", &[port]);
    assert!(told.contains("snap7c_client: ok\n"), "{told}");
    end.tick();
    assert_eq!(
        (end.get("run"), end.get("speed"), end.get("torque")),
        (1.0, 1234.0, 2.5)
    );
    Ok(())
}

fn our_client_writes_signals_alone_into_snap7_in_c_and_sees_its_stop() -> Result<(), Absent> {
    expect_warnings();
    let mut cpu = Cpu::start(snap7_in_c()?, "snap7c_server.py");
    let fieldbus = |further: &str| snap7_keys(&cpu, further);
    logged::expect("nothing is written into the PLC");
    let mut end = open(&fieldbus(""));
    // The initial content of the data block, plus 1.
    end.until("it reads", |end| end.get("speed") == 28_399.0);
    let who = end.statistic("identity");
    end.end.driver.close();

    let mut end = open(&fieldbus(&format!(
        "write_to = \"{who}\"\nat_close = \"hold\""
    )));
    for value in [70.0, 71.0] {
        end.set("position", value);
        end.set("pressure", 1.5);
        end.set("sensor", 1.0);
        end.until("it comes back", |end| end.get("speed") == value + 1.0);
    }
    assert_eq!(end.statistic("cpu"), "run");
    cpu.tell("stop");
    end.until("it is in STOP", |end| {
        end.driver.link().cause.name() == "stopped" && end.get("speed") == -1.0
    });
    assert_eq!(end.statistic("cpu"), "stop");
    cpu.tell("run");
    end.until("it runs again", |end| end.get("speed") == 72.0);
    end.end.driver.close();
    // A WORD, a bit that was 0 in 0xEE, and a REAL of 1.5.
    assert_eq!(cpu.end(), "changed 2 3 20 40 41 42 43\n");
    Ok(())
}

/// The `[fieldbus]` of a client of Snap7 in C.
fn snap7_keys(cpu: &Cpu, further: &str) -> String {
    format!(
        "kind = \"s7-client\"\naddress = \"127.0.0.1:{}\"\ncycle = \"2ms\"\nslot = 2\n\
         input = \"DB2\"\noutput = \"DB1\"\n{further}\n[fieldbus.at]\n\"sensor\" = \"%DB2.DBX20.4\"\n\
         \"pressure\" = \"DB2,REAL40\"\n",
        cpu.port
    )
}

fn closing_leaves_the_fail_safe_values_in_snap7_in_c() -> Result<(), Absent> {
    let cpu = Cpu::start(snap7_in_c()?, "snap7c_server.py");
    let fieldbus = |further: &str| snap7_keys(&cpu, further);
    logged::expect("nothing is written into the PLC");
    let mut end = open(&fieldbus(""));
    end.until("it reads", |end| end.get("speed") == 28_399.0);
    let who = end.statistic("identity");
    end.end.driver.close();

    let mut end = open(&fieldbus(&format!("write_to = \"{who}\"")));
    end.set("position", 70.0);
    end.set("sensor", 1.0);
    end.until("it comes back", |end| end.get("speed") == 71.0);
    end.end.driver.close();
    // The bit is 0 again, as it was in 0xEE; position and pressure are 0.
    assert_eq!(cpu.end(), "changed 2 3 40 41 42 43\n");
    Ok(())
}

fn rust7_reads_and_writes_the_server() -> Result<(), Absent> {
    let mut end = open(SERVER);
    end.set("position", 258.0);
    let stated = harness::stated("Cargo.toml", "rust7 = \"");
    let port = end.address_for("rust7", &format!("rust7 {stated}")).port();
    end.tick();
    let client = std::thread::spawn(move || {
        let mut client = rust7::client::S7Client::new();
        client.set_connection_port(port).expect("not connected yet");
        client
            .connect_rack_slot("127.0.0.1", 0, 1)
            .expect("connects");
        let mut inputs = [0xFF; 6];
        client.read_db(2, 0, &mut inputs).expect("DB 2 is there");
        assert_eq!(inputs, [1, 2, 0, 0, 0, 0]);
        client.write_db(1, 2, &[0, 7]).expect("DB 1 is there");
        client
            .write_bit(0x84, 1, 0, 0, true)
            .expect("so is its first bit");
        assert!(client.read_bit(0x82, 0, 0, 0).expect("an output"));
        client
            .read_db(3, 0, &mut inputs)
            .expect_err("there is no DB 3");
        client
            .read_db(2, 1, &mut inputs)
            .expect_err("nor byte 6 of DB 2");
        client.disconnect();
    });
    end.until("the client ends", |_| client.is_finished());
    client.join().expect("all as it should be");
    end.tick();
    assert_eq!((end.get("run"), end.get("speed")), (1.0, 7.0));
    Ok(())
}

/// A job that is answered late and an item that is refused, as python-snap7 sees them.
fn python_snap7_waits_and_is_refused() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["snap7"])?;
    logged::expect("injected fault ");
    let mut end = open(&format!(
        "{SERVER}\n[[fault]]\nkind = \"answer-late\"\nby = \"300ms\"\nfunction = 4\nwhile = \"speed == 1\"\n\
         [[fault]]\nkind = \"answer-error\"\ncode = 1\nfunction = 4\nwhile = \"speed == 2\"\n"
    ));
    let port = end.address().port().to_string();
    python.args([
        "-c",
        "import struct, sys, time\n\
         import snap7\n\
         client = snap7.client.Client()\n\
         client.connect('127.0.0.1', 0, 1, int(sys.argv[1]))\n\
         def case(number, done):\n\
         \x20   client.db_write(1, 2, bytearray(struct.pack('>h', number)))\n\
         \x20   limit = time.monotonic() + 20\n\
         \x20   while not done():\n\
         \x20       assert time.monotonic() < limit\n\
         def is_late():\n\
         \x20   began = time.monotonic()\n\
         \x20   client.db_read(1, 2, 2)\n\
         \x20   return time.monotonic() - began >= 0.3\n\
         def is_refused():\n\
         \x20   try:\n\
         \x20       client.db_read(1, 2, 2)\n\
         \x20   except Exception:\n\
         \x20       return True\n\
         case(1, is_late)\n\
         case(2, is_refused)\n\
         case(0, lambda: not is_refused())\n\
         assert bytes(client.db_read(1, 2, 2)) == bytes(2)\n",
        &port,
    ]);
    end.until_the_end_of(python, Machine::tick);
    Ok(())
}

fn tshark_finds_nothing_malformed() -> Result<(), Absent> {
    let python = harness::python_with("main", &["snap7"])?;
    let tshark = || harness::command("tshark", "tshark");
    tshark()?;
    let mut end = open(SERVER);
    end.set("sensor", 1.0);
    end.set("position", -2.0);
    end.set("pressure", 1.5);
    let tap = pcap::Tap::before(end.address());
    run(
        &mut end,
        python,
        "snap7_client.py",
        &[tap.address.port().to_string()],
    );
    let us = format!(
        "kind = \"s7-client\"\naddress = \"{}\"\nrole = \"controller\"\nwrite_to = \"tickbus Test rig\"",
        tap.address
    );
    let mut controller = open(&us);
    controller.until("our client reads", |controller| {
        end.tick();
        controller.get("position") == -2.0
    });
    controller.end.driver.close();

    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("s7.pcap");
    let conversations = tap.conversations();
    assert_eq!(conversations.len(), 4, "three of python-snap7, and ours");
    pcap::write(&file, 1102, &conversations).expect("written");
    let decode = "tcp.port==1102,tpkt";
    let said = "tcp.srcport == 1102 && tcp.len > 0";
    let said = pcap::tshark(tshark()?, &file, decode, said, &["_ws.col.Protocol"]);
    let count = |name| said.lines().filter(|line| *line == name).count();
    assert_eq!(count("COTP"), conversations.len(), "each was confirmed");
    assert_eq!(count("COTP") + count("S7COMM"), said.lines().count());
    assert!(count("S7COMM") > 50, "{said}");
    // The server counts the same.
    assert_eq!(
        end.statistic("line.frames_out"),
        said.lines().count().to_string()
    );
    for (port, key) in [
        ("dstport", "line.octets_in"),
        ("srcport", "line.octets_out"),
    ] {
        let filter = format!("tcp.{port} == 1102");
        let lengths = pcap::tshark(tshark()?, &file, decode, &filter, &["tcp.len"]);
        let sum: u64 = lengths
            .lines()
            .filter_map(|length| length.parse::<u64>().ok())
            .sum();
        assert_eq!(end.statistic(key), sum.to_string(), "{key}");
    }
    let wrong = "tcp.srcport == 1102 && (_ws.malformed || _ws.expert.severity == error)";
    let wrong = pcap::tshark(
        tshark()?,
        &file,
        decode,
        wrong,
        &["frame.number", "_ws.expert.message"],
    );
    assert_eq!(wrong, "");
    // With our server, also what the client sends.
    let ours = "tcp.port == 50003 && (_ws.malformed || _ws.expert.severity == error)";
    let wrong = pcap::tshark(
        tshark()?,
        &file,
        decode,
        ours,
        &["frame.number", "_ws.expert.message"],
    );
    assert_eq!(wrong, "");
    Ok(())
}
