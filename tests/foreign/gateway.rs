//! The gateway with PLCs made of foreign software: pymodbus polls it as its remote I/O, rust7 reads and writes it by S7
//! communication, asyncua by OPC UA.
#![allow(missing_docs, clippy::unnecessary_wraps, reason = "tests of one shape")]

use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::process::Stdio;
use std::thread;

use crate::harness::{self, Absent, Test};
use tickbus::driver_cfg::Config;
use tickbus::gateway::{Gateway, GatewayOptions};
use tickbus::net::Address;
use tickbus::signal::DataType;
use tickbus::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus::virtual_time::{
    Controls, Declaration, Hosting, Logic, Meeting, Outcome, Participant, Settings, StartCondition,
    Step, Variable, tcp,
};
use tickbus_conformance::rig::eventually;

/// Steps of the PLC.
const STEPS: u64 = 400;

const CONFIG: &str = r#"
[driver]
id   = 1
name = "cell"

[fieldbus]
address = "127.0.0.1:0"
max_age = "20s"
{kind}

[[signal]]
name    = "sync.go"
address = "%ID0"
type    = "UDINT"

[[signal]]
name    = "sync.time"
address = "%ID4"
type    = "UDINT"

[[signal]]
name    = "position"
address = "%IW8"
type    = "INT"

[[signal]]
name    = "sync.done"
address = "%QD0"
type    = "UDINT"

[[signal]]
name    = "speed"
address = "%QW4"
type    = "INT"
"#;

const MODBUS: &str = "kind = \"modbus-server\"";

const S7: &str = "kind = \"s7-server\"\n\
    db = [{ number = 1, area = \"%Q\" }, { number = 2, area = \"%I\" }]";

#[cfg(feature = "opcua")]
const OPC_UA: &str =
    "kind = \"opcua-server\"\nsecurity = \"None\"\nanonymous = true\ncycle = \"5ms\"";

/// A PLC that uses the gateway at this address, and delays its answers according to this seed. The returned function
/// waits for its end, and returns the number of its steps.
type Plc = fn(SocketAddr, u32) -> Result<Box<dyn FnOnce() -> u64>, Absent>;

pub(crate) const TESTS: &[(&str, Test)] = &[(
    "plcs_of_other_libraries_are_in_step_whatever_time_they_take",
    plcs_in_step,
)];

/// A machine that follows the PLC, with a step of 1 ms.
struct Machine(u64);

impl Participant for Machine {
    fn declare(&self) -> Declaration {
        Declaration {
            writes: vec![Variable::new("position", DataType::Int)],
            reads: vec!["speed".to_owned()],
            ..Declaration::new("machine")
        }
    }

    fn initial(&mut self, _writes: &mut [u64]) {}

    fn run(&mut self, _step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.0 += 1;
        writes[0] = reads[0] / 2 + self.0 % 7;
        Ok(())
    }
}

/// A PLC of pymodbus.
fn pymodbus(address: SocketAddr, seed: u32) -> Result<Box<dyn FnOnce() -> u64>, Absent> {
    python_plc("pymodbus", "modbus_sync_plc.py", address, seed)
}

/// A PLC of asyncua.
#[cfg(feature = "opcua")]
fn asyncua(address: SocketAddr, seed: u32) -> Result<Box<dyn FnOnce() -> u64>, Absent> {
    python_plc("asyncua", "opcua_sync_plc.py", address, seed)
}

fn python_plc(
    library: &str,
    script: &str,
    address: SocketAddr,
    seed: u32,
) -> Result<Box<dyn FnOnce() -> u64>, Absent> {
    let mut python = harness::python_with("main", &[library])?;
    python.arg(format!(
        "{}/tests/peers/{script}",
        env!("CARGO_MANIFEST_DIR")
    ));
    python.arg("127.0.0.1");
    python.args([u64::from(address.port()), STEPS, seed.into()].map(|n| n.to_string()));
    let mut plc = python
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    Ok(Box::new(move || {
        drop(plc.stdin.take());
        let output = plc.wait_with_output().expect("it ends");
        let output = String::from_utf8_lossy(&output.stdout).into_owned();
        let (_, steps) = output.split_once("ok steps=").expect(&output);
        steps.trim().parse().expect("a number")
    }))
}

/// The same with rust7.
fn rust7(address: SocketAddr, seed: u32) -> Result<Box<dyn FnOnce() -> u64>, Absent> {
    let ended = Stop::new();
    let thread = thread::spawn({
        let ended = ended.clone();
        move || s7_plc(address.port(), seed, &ended)
    });
    Ok(Box::new(move || {
        ended.stop();
        thread.join().expect("no panic")
    }))
}

fn s7_plc(port: u16, seed: u32, ended: &Stop) -> u64 {
    let mut client = rust7::client::S7Client::new();
    client.set_connection_port(port).expect("not connected yet");
    let connected = client.connect_rack_slot("127.0.0.1", 0, 1);
    connected.expect("connects");
    client.write_db(1, 0, &[0; 6]).expect("DB 1 is there");
    let clock = Monotonic::shared();
    let (mut last, mut count, mut random) = (0_u32, 0_u32, seed);
    while !ended.is_stopped() {
        let mut inputs = [0; 10];
        client.read_db(2, 0, &mut inputs).expect("DB 2 is there");
        let double = |at| u32::from_be_bytes(*inputs[at..].first_chunk().expect("four bytes"));
        let (go, millis) = (double(0), double(4));
        if go == last {
            continue;
        }
        assert_eq!((go, millis), (last + 1, 10 * count));
        (last, count) = (go, count + 1);
        client.write_db(1, 4, &[0xFF; 2]).expect("DB 1 is there");
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let pause = Nanos::from_micros(i64::from(random >> 22));
        clock.wait_until(clock.now() + pause, ended);
        let position = u32::from(u16::from_be_bytes([inputs[8], inputs[9]]));
        let speed = u16::try_from((position + count) % 1000).expect("small");
        let written = client.write_db(1, 4, &speed.to_be_bytes());
        written.expect("DB 1 is there");
        let answered = client.write_db(1, 0, &go.to_be_bytes());
        answered.expect("DB 1 is there");
    }
    count.into()
}

fn run(kind: &str, plc: Plc, seed: u32) -> Result<Outcome, Absent> {
    let text = CONFIG.replace("{kind}", kind);
    let config =
        Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let options = GatewayOptions {
        client: None,
        multiple: NonZeroU32::new(10).expect("not 0"),
        timeout: Nanos::from_secs(20),
    };
    let gateway = Gateway::open(&config, options, Monotonic::shared(), &Stop::new());
    let mut gateway = gateway.expect("opens");
    let address = eventually("it listens", || gateway.fact("address"));
    let end_of_plc = plc(address.parse().expect("an address"), seed)?;
    gateway.await_plc().expect("it is there");

    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    let mut settings = Settings::new(Nanos::from_millis(1), StartCondition::Count(2));
    settings.steps = Some(10 * STEPS);
    let outcome = thread::scope(|scope| {
        scope.spawn(|| tcp::join(&address, &mut Machine(0)).expect("as planned"));
        let server = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            };
            listener.run(settings, Logic::new(), hosting)
        });
        let meeting = Meeting::Tcp(address.clone());
        gateway.take_part(&meeting).expect("as planned");
        server.join().expect("no panic").expect("as planned")
    });
    assert_eq!(end_of_plc(), STEPS);
    gateway.close();
    Ok(outcome)
}

/// Neither the bus nor the time that a PLC takes changes the trace.
fn plcs_in_step() -> Result<(), Absent> {
    let one = run(S7, rust7, 1)?;
    assert_eq!(one.steps, 10 * STEPS);
    assert_eq!(run(S7, rust7, 2)?, one, "it took other times");
    assert_eq!(run(MODBUS, pymodbus, 1)?, one, "over another bus");
    assert_eq!(run(MODBUS, pymodbus, 2)?, one, "it took other times");
    #[cfg(feature = "opcua")]
    assert_eq!(run(OPC_UA, asyncua, 1)?, one, "over OPC UA");
    Ok(())
}
