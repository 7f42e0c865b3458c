//! Clients for tests.

#![allow(dead_code, reason = "each test uses some of it")]

use std::num::NonZeroU32;
use std::sync::Mutex;
use std::thread;

use tickbus_base::time::{Monotonic, Nanos, Stop};
use tickbus_image::signal::DataType;
use tickbus_net::Address;
use tickbus_virtual_time::client::{Asked, Client as ClientOf, Connection};
use tickbus_virtual_time::{
    Controls, Declaration, Ended, Hosting, Logic, Outcome, Participant, Settings, StartCondition,
    Step, Variable, tcp,
};

/// A client made of a function.
pub(crate) struct Client<F> {
    pub(crate) declaration: Declaration,
    run: F,
}

/// A client that runs every `multiple` steps, writes ULINTs and runs `run`.
pub(crate) fn client<F: FnMut(Step, &[u64], &mut [u64]) -> Result<(), String>>(
    name: &str,
    multiple: u32,
    writes: &[&str],
    reads: &[&str],
    run: F,
) -> Client<F> {
    let mut declaration = Declaration::new(name);
    declaration.multiple = NonZeroU32::new(multiple).expect("above zero");
    let ulint = |name: &&str| Variable::new(*name, DataType::Ulint);
    declaration.writes = writes.iter().map(ulint).collect();
    declaration.reads = reads.iter().map(|name| (*name).to_owned()).collect();
    Client { declaration, run }
}

impl<F: FnMut(Step, &[u64], &mut [u64]) -> Result<(), String>> Participant for Client<F> {
    fn declare(&self) -> Declaration {
        self.declaration.clone()
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        (self.run)(step, reads, writes)
    }
}

/// A chaotic client: its writes depend on every bit that it reads and has written, so that any difference between two
/// runs persists.
pub(crate) struct Mixer {
    declaration: Declaration,
    state: u64,
}

/// The mixers `m0` to `m(count - 1)`, each with its own multiple, each reading the two variables of all of them.
pub(crate) fn mixers(count: u32) -> Vec<Mixer> {
    let variable = |at: u32| [format!("x{at}"), format!("y{at}")];
    (0..count)
        .map(|at| {
            let mut declaration = Declaration::new(format!("m{at}"));
            declaration.multiple = NonZeroU32::new(1 + at % 3).expect("above zero");
            let [x, y] = variable(at);
            declaration.writes = vec![
                Variable::new(x, DataType::Lword),
                Variable::new(y, DataType::Uint),
            ];
            declaration.reads = (0..count).flat_map(variable).collect();
            Mixer {
                declaration,
                state: u64::from(at) + 1,
            }
        })
        .collect()
}

impl Mixer {
    /// Lets it run at every multiple of `interval`.
    pub(crate) fn every(&mut self, interval: Nanos) {
        self.declaration.multiple = NonZeroU32::MIN;
        self.declaration.interval = Some(interval);
    }
}

impl Mixer {
    /// The state between two steps.
    pub(crate) fn state(&mut self) -> &mut u64 {
        &mut self.state
    }
}

impl Participant for Mixer {
    fn declare(&self) -> Declaration {
        self.declaration.clone()
    }

    fn initial(&mut self, writes: &mut [u64]) {
        writes[0] = self.state;
    }

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        let time = step.time.0.cast_unsigned();
        for read in reads.iter().chain([&step.sequence, &time]) {
            let mixed = (self.state ^ read).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            self.state = mixed.rotate_left(29);
        }
        writes[0] = self.state;
        writes[1] = self.state & 0xFFFF;
        Ok(())
    }
}

/// Settings with this many steps of 1 ms, and clients of these names.
pub(crate) fn settings(steps: u64, names: &[&str]) -> Settings {
    let names = names.iter().map(|name| (*name).to_owned()).collect();
    Settings {
        steps: Some(steps),
        ..Settings::new(Nanos::from_millis(1), StartCondition::Names(names))
    }
}

/// Settings for this many mixers.
pub(crate) fn mixer_settings(steps: u64, count: u32) -> Settings {
    let start = StartCondition::Names((0..count).map(|at| format!("m{at}")).collect());
    Settings {
        steps: Some(steps),
        ..Settings::new(Nanos::from_millis(1), start)
    }
}

/// A run over TCP, with what `clients` does at its address, and its news.
pub(crate) fn serve<T>(
    settings: Settings,
    logic: Logic<'_>,
    clients: impl FnOnce(&Address, &Controls, &Mutex<Vec<String>>) -> T,
) -> (Result<Outcome, Ended>, Vec<String>, T) {
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    let controls = Controls::default();
    let news = Mutex::new(Vec::new());
    let (outcome, made) = thread::scope(|scope| {
        let server = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &controls,
                news: &mut |line| news.lock().expect("no panic").push(line.to_owned()),
            };
            listener.run(settings, logic, hosting)
        });
        let made = clients(&address, &controls, &news);
        (server.join().expect("no panic"), made)
    });
    (outcome, news.into_inner().expect("no panic"), made)
}

fn connect(address: &Address, declaration: Declaration) -> Connection {
    let client = ClientOf::new(declaration).expect("right");
    let clock = Monotonic::shared() as _;
    tcp::connect(address, client, &clock, &Stop::new()).expect("it listens")
}

/// Runs `participant` until it has got the step `last`, and breaks the connection: before it has answered if `owing`, otherwise
/// afterwards.
pub(crate) fn run_until(
    address: &Address,
    participant: &mut dyn Participant,
    last: u64,
    owing: bool,
) {
    let declaration = participant.declare();
    let mut writes = vec![0; declaration.writes.len()];
    let mut connection = connect(address, declaration);
    loop {
        match connection.wait(Nanos::from_secs(20)).expect("it runs") {
            Asked::Initial => participant.initial(&mut writes),
            Asked::Step(step) if step.sequence >= last && owing => return,
            Asked::Step(step) => {
                let reads = connection.client().reads().to_vec();
                participant.run(step, &reads, &mut writes).expect("it can");
                if step.sequence >= last {
                    return connection.answer_until(&writes, participant.next_update());
                }
            }
            Asked::End(end) => panic!("it ended: {end:?}"),
        }
        connection.answer_until(&writes, participant.next_update());
    }
}
