//! The gateway with a PLC that somebody else wrote behind it: pymodbus polls it as its remote I/O.
#![allow(missing_docs, reason = "a test")]

mod foreign;

use std::num::NonZeroU32;
use std::process::{ExitCode, Stdio};
use std::thread;

use foreign::Absent;
use tickbus::driver::{Gateway, GatewayOptions};
use tickbus::driver_cfg::Config;
use tickbus::fieldbus::tcp::Address;
use tickbus::signal::DataType;
use tickbus::time::{Monotonic, Nanos, Stop};
use tickbus::virtual_time::{
    Controls, Declaration, Hosting, Logic, Meeting, Outcome, Participant, Settings, StartCondition,
    Step, Variable, tcp,
};
use tickbus_conformance::rig::eventually;

/// Steps of the PLC.
const STEPS: u64 = 1000;

const CONFIG: &str = r#"
[driver]
id   = 1
name = "cell"

[fieldbus]
kind    = "modbus-server"
address = "127.0.0.1:0"
max_age = "20s"

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

fn main() -> ExitCode {
    foreign::main(&[(
        "a_plc_of_pymodbus_is_in_step_whatever_time_it_takes",
        pymodbus_in_step,
    )])
}

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

fn run(seed: u32) -> Result<Outcome, Absent> {
    let mut python = foreign::python_with("main", &["pymodbus"])?;
    let config = Config::parse("driver.cfg", CONFIG).unwrap_or_else(|why| panic!("{why}"));
    let options = GatewayOptions {
        client: None,
        multiple: NonZeroU32::new(10).expect("not 0"),
        timeout: Nanos::from_secs(20),
    };
    let gateway = Gateway::open(&config, options, Monotonic::shared(), &Stop::new());
    let mut gateway = gateway.expect("opens");
    let address = eventually("it listens", || gateway.fact("address"));
    let (host, port) = address.rsplit_once(':').expect("an address");
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/modbus_sync_plc.py"
    );
    let (steps, seed) = (STEPS.to_string(), seed.to_string());
    python.args([script, host, port, &steps, &seed]);
    let plc = python.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut plc = plc.spawn().expect("it runs");
    gateway.await_plc().expect("it is there");

    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let meeting = Meeting::Tcp(Address::local(listener.address().port()));
    let mut settings = Settings::new(Nanos::from_millis(1), StartCondition::Count(2));
    settings.steps = Some(10 * STEPS);
    let outcome = thread::scope(|scope| {
        scope.spawn(|| {
            let Meeting::Tcp(address) = &meeting else {
                unreachable!("it is")
            };
            tcp::join(address, &mut Machine(0)).expect("as planned")
        });
        let server = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            };
            listener.run(settings, Logic::new(), hosting)
        });
        gateway.take_part(&meeting).expect("as planned");
        server.join().expect("no panic").expect("as planned")
    });
    drop(plc.stdin.take());
    let told = plc.wait_with_output().expect("it ends");
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(told.contains(&format!("ok steps={STEPS}")), "{told}");
    gateway.close();
    Ok(outcome)
}

fn pymodbus_in_step() -> Result<(), Absent> {
    let one = run(1)?;
    assert_eq!(one.steps, 10 * STEPS);
    assert_eq!(run(2)?, one, "the PLC took other times");
    Ok(())
}
