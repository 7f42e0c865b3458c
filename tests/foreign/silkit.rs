//! `tickbus sync join silkit`, with the registry, the system controller and the library of a release of SIL Kit, which is
//! in no package registry: the environment variable `SILKIT_LIBRARY` names its library.
#![allow(missing_docs, reason = "tests")]

use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;

use crate::harness::{Absent, Test};
use crate::helics::join;
use tickbus::net::Address;
use tickbus::signal::DataType;
use tickbus::time::{Monotonic, Nanos};
use tickbus::virtual_time::server::Control;
use tickbus::virtual_time::{
    Controls, Declaration, Ended, Hosting, Logic, Outcome, Participant, Settings, StartCondition,
    Step, Variable, tcp,
};

pub(crate) const TESTS: &[(&str, Test)] = &[
    (
        "two_runs_meet_in_a_simulation_and_one_step_is_between_them",
        two_runs,
    ),
    ("a_missing_registry_is_told", missing),
];

/// Steps of the run that ends, and their length.
const STEPS: u64 = 300;
const STEP: Nanos = Nanos::from_millis(5);

/// A program of the release, ended with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The library, and a program of the same release.
fn program(name: &str) -> Result<PathBuf, Absent> {
    let library = std::env::var_os("SILKIT_LIBRARY")
        .filter(|path| !path.is_empty())
        .map(PathBuf::from)
        .ok_or_else(|| {
            Absent("SILKIT_LIBRARY does not name the library of a release of SIL Kit 5".to_owned())
        })?;
    let folder = library.parent().expect("a file");
    let mut found = [folder.join(name), folder.join("../bin").join(name)].into_iter();
    found
        .find(|program| program.exists())
        .ok_or_else(|| Absent(format!("there is no {name} with SILKIT_LIBRARY")))
}

/// The registry, and its address.
fn registry() -> Result<(Running, String), Absent> {
    let mut registry = Command::new(program("sil-kit-registry")?)
        .args(["-u", "silkit://127.0.0.1:0"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    let stdout = registry.stdout.take().expect("it is piped");
    let registry = Running(registry);
    let mut lines = BufReader::new(stdout).lines().map_while(Result::ok);
    let address = lines.find_map(|line| {
        let address = line.split("listening on ").nth(1)?;
        Some(address.trim().to_owned())
    });
    // Whoever does not read on blocks it.
    thread::spawn(move || lines.for_each(drop));
    Ok((registry, address.expect("it listens")))
}

/// Writes a number for each step.
struct Counter;

impl Participant for Counter {
    fn declare(&self) -> Declaration {
        Declaration {
            writes: vec![Variable::new("count", DataType::Int)],
            ..Declaration::new("counter")
        }
    }

    fn initial(&mut self, writes: &mut [u64]) {
        writes[0] = (-7_i64).cast_unsigned();
    }

    fn run(&mut self, step: Step, _: &[u64], writes: &mut [u64]) -> Result<(), String> {
        writes[0] = (step.sequence.cast_signed() - 100).cast_unsigned();
        Ok(())
    }
}

/// Keeps what it reads.
#[derive(Default)]
struct Reader(Vec<i64>);

impl Participant for Reader {
    fn declare(&self) -> Declaration {
        Declaration {
            reads: vec!["count".to_owned()],
            ..Declaration::new("reader")
        }
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, _: Step, reads: &[u64], _: &mut [u64]) -> Result<(), String> {
        self.0.push(reads[0].cast_signed());
        Ok(())
    }
}

/// A run with one member and the simulation: its outcome, and the last line of the command.
fn run(
    mapping: &str,
    steps: Option<u64>,
    member: &mut (dyn Participant + Send),
) -> (Result<Outcome, Ended>, String) {
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    let (child, _file) = join("silkit", mapping, &address, &["--timeout", "30s"]);
    let controls = Controls::default();
    let settings = Settings {
        steps,
        ..Settings::new(STEP, StartCondition::Count(2))
    };
    thread::scope(|scope| {
        let server = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &controls,
                news: &mut |_| {},
            };
            listener.run(settings, Logic::new(), hosting)
        });
        scope.spawn(|| tcp::join(&address, member));
        let output = child.wait_with_output().expect("it ends");
        let printed = BufReader::new(&*output.stdout).lines();
        let last = printed.map_while(Result::ok).last().unwrap_or_default();
        // A command that has not joined leaves the server waiting.
        controls.send(Control::Stop);
        (server.join().expect("no panic"), last)
    })
}

fn two_runs() -> Result<(), Absent> {
    let (_registry, address) = registry()?;
    let controller = Command::new(program("sil-kit-system-controller")?)
        .args(["-u", &address, "first", "second"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let _controller = Running(controller.expect("it runs"));
    let mapping = |name: &str, kind: &str, initial: &str| {
        format!(
            "[silkit]\nclient = \"silkit\"\nparticipant = \"{name}\"\nstep = \"{STEP}\"\nregistry = \"{address}\"\n\
             [[silkit.{kind}]]\nvariable = \"count\"\ntopic = \"Count\"\ntype = \"INT\"\n{initial}\
             labels = [{{ key = \"Line\", value = \"1\" }}]\n"
        )
    };
    let mut reader = Reader::default();
    let (first, second) = thread::scope(|scope| {
        let first = mapping("first", "publish", "");
        let first = scope.spawn(move || run(&first, Some(STEPS), &mut Counter));
        let second = run(
            &mapping("second", "subscribe", "initial = 5\n"),
            None,
            &mut reader,
        );
        (first.join().expect("no panic"), second)
    });
    let outcome = first.0.expect(&first.1);
    assert_eq!(outcome.steps, STEPS, "{}", first.1);
    let ended = second.0.expect_err(&second.1);
    let told = "the participant \"first\" has stopped the simulation: the run of tickbus has ended as planned";
    assert!(ended.reason.contains(told), "{}", ended.reason);
    // The mapping's own, what the other run began with, and then its steps.
    let steps = i64::try_from(STEPS).expect("few");
    let expected: Vec<i64> = [5, -7]
        .into_iter()
        .chain((1..=steps).map(|at| at - 100))
        .collect();
    assert!(reader.0.len() as u64 >= STEPS, "{}", reader.0.len());
    assert_eq!(reader.0, expected[..reader.0.len()]);
    Ok(())
}

fn missing() -> Result<(), Absent> {
    program("sil-kit-registry")?;
    let mapping = "[silkit]\nclient = \"a\"\nstep = \"1ms\"\nregistry = \"silkit://127.0.0.1:1\"\n\
                   subscribe = [{ variable = \"b\", type = \"BOOL\" }]\n";
    let arguments = ["--timeout", "1s"];
    let (child, _file) = join("silkit", mapping, &Address::local(1), &arguments);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(3));
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        printed.contains("start sil-kit-registry first"),
        "{printed}"
    );
    Ok(())
}
