use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::thread::{JoinHandle, yield_now};
use std::time::Duration;

use super::*;
use crate::faults::{
    AnswerEffect, AnswerTrouble, Begin, Effect, Elements, Fault, FaultBoard, Faults, Lasts,
    LineEffect, Slots, TickTime,
};
use crate::{LinkState, LinkStatus, Role};
use tickbus_base::time::{Clock, Manual, Monotonic};
use tickbus_image::image;
use tickbus_image::signal::{Area, SignalTable};
use tickbus_test_log as logged;

/// A protocol whose telegrams are a length byte and that many bytes, which are echoed. A length of 255 violates the
/// protocol, and 200 gets a very long answer.
struct Echo;

const LIMITS: Limits = Limits {
    telegram: 200,
    clients: 3,
    patience: Nanos::from_millis(100),
};

impl Service for Echo {
    type Client = usize;

    fn limits(&self) -> Limits {
        LIMITS
    }

    fn welcome(&mut self, _peer: SocketAddr, _now: Nanos) -> usize {
        0
    }

    fn telegram(
        &mut self,
        count: &mut usize,
        now: Nanos,
        bytes: &[u8],
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Result<usize, BusError> {
        let length = usize::from(bytes[0]);
        if length == 255 {
            return Err(BusError::Protocol("a telegram of 255".to_owned()));
        }
        if bytes.len() <= length {
            return Ok(0);
        }
        *count += 1;
        port.count("test.heard");
        if let Some(function) = bytes[..=length].get(1) {
            assert_eq!(port.answer(0, *function, now), None);
        }
        reply.extend_from_slice(&bytes[..=length]);
        if length == 199 {
            reply.resize(reply.len() + 100_000, 7);
        }
        Ok(length + 1)
    }

    fn replied(&mut self, _count: &mut usize, port: &mut Port) {
        port.count("test.replied");
    }

    fn unheard(&mut self, _count: &mut usize, _now: Nanos, port: &mut Port) {
        port.count("test.unheard");
    }
}

const MAX_AGE: Nanos = Nanos::from_secs(3600);

/// A server on its own thread, with a manual clock.
struct Running {
    clock: Arc<Manual>,
    stop: Stop,
    status: LinkStatus,
    address: SocketAddr,
    faults: Faults,
    thread: Option<JoinHandle<Result<(), BusError>>>,
    /// Checks the log once the thread has ended.
    _logged: logged::Watch,
}

/// Waits with a limit in real time.
struct Waiting {
    clock: Arc<Monotonic>,
    limit: Nanos,
}

impl Waiting {
    fn begin() -> Self {
        let clock = Monotonic::shared();
        let limit = clock.now() + Nanos::from_secs(20);
        Self { clock, limit }
    }

    #[track_caller]
    fn check(&self, what: &str) {
        assert!(self.clock.now() < self.limit, "waited in vain: {what}");
    }
}

impl Running {
    fn new() -> Self {
        let logged = logged::Watch::over("tickbus_fieldbus");
        let clock = Manual::new();
        let stop = Stop::new();
        let status = LinkStatus::new("test", MAX_AGE);
        let (_, end) = image(Vec::new());
        let board = Arc::<FaultBoard>::default();
        let mut port = Port::new(
            end,
            Arc::clone(&clock) as _,
            Role::Device,
            None,
            status.clone(),
        )
        .with_faults(Arc::clone(&board));
        let thread = std::thread::spawn({
            let stop = stop.clone();
            move || serve(&Address::local(0), &mut Echo, &mut port, &stop)
        });
        let mut server = Self {
            clock,
            stop,
            status,
            address: "127.0.0.1:0".parse().expect("an address"),
            faults: Faults::new(board),
            thread: Some(thread),
            _logged: logged,
        };
        server.until(|server| server.fact("address").is_some());
        server.address = server
            .fact("address")
            .expect("it is told")
            .parse()
            .expect("an address");
        server
    }

    fn fact(&self, key: &str) -> Option<String> {
        let mut statistics = tickbus_base::statistics::Statistics::default();
        self.status.write(self.clock.now(), &mut statistics);
        let text = statistics.to_string();
        let mut lines = text.lines();
        lines.find_map(|line| Some(line.strip_prefix(key)?.strip_prefix('=')?.to_owned()))
    }

    #[track_caller]
    fn until(&self, done: impl Fn(&Self) -> bool) {
        let waiting = Waiting::begin();
        while !done(self) {
            waiting.check(&self.status.link().reason);
            yield_now();
        }
    }

    /// Advances the clock once the server waits for nothing else.
    fn pass(&self, span: Nanos) {
        self.until(|server| server.clock.is_settled(1));
        self.clock.advance(span);
    }

    /// Takes the line down. Returns the fault.
    fn take_down(&mut self) -> u32 {
        self.inject(LineEffect::LinkDown)
    }

    fn inject(&mut self, effect: LineEffect) -> u32 {
        let fault = Fault {
            name: "cable".to_owned(),
            effect: Effect::Line(effect),
            begin: Begin::AtOnce,
            lasts: Lasts::UntilEnded,
            times: 1,
            seed: 1,
        };
        let slots = Slots {
            table: &SignalTable::default(),
            writes: Area::Input,
            edges: &[],
        };
        let id = self.faults.add(&fault, slots).expect("there is room");
        self.begin_tick();
        id
    }

    fn bring_up(&mut self, fault: u32) {
        assert!(self.faults.end(fault));
        self.begin_tick();
    }

    fn begin_tick(&mut self) {
        let moment = TickTime {
            time: Nanos::ZERO,
            tick: 1,
        };
        self.faults.begin_tick(moment, &mut []);
    }

    fn client(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).expect("it listens");
        stream
            .set_read_timeout(Some(Duration::from_secs(20)))
            .expect("an option");
        stream
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.stop();
        let ended = self.thread.take().map(JoinHandle::join);
        if !std::thread::panicking() {
            ended.expect("it ran").expect("no panic").expect("no error");
        }
    }
}

#[track_caller]
fn ask(client: &mut TcpStream, telegram: &[u8]) {
    client.write_all(telegram).expect("the server reads");
    let mut reply = vec![0; telegram.len()];
    client.read_exact(&mut reply).expect("the server answers");
    assert_eq!(reply, telegram);
}

#[track_caller]
fn await_end(client: &mut TcpStream) {
    let mut rest = Vec::new();
    match client.read_to_end(&mut rest) {
        Ok(_) => {}
        Err(error) => assert_eq!(error.kind(), ErrorKind::ConnectionReset),
    }
}

#[test]
fn clients_are_served_side_by_side_whatever_the_pieces() {
    let server = Running::new();
    let (mut one, mut two) = (server.client(), server.client());
    one.write_all(&[2, 8]).expect("the server reads");
    ask(&mut two, &[3, 1, 2, 3]);
    one.write_all(&[9, 1, 5, 0]).expect("the server reads");
    let mut reply = [0; 6];
    one.read_exact(&mut reply).expect("three answers");
    assert_eq!(reply, [2, 8, 9, 1, 5, 0]);
    server.until(|server| server.status.state() == LinkState::Running);
    assert_eq!(server.fact("clients").as_deref(), Some("2"));
}

#[test]
fn the_line_is_running_until_the_last_one_that_spoke_leaves() {
    let server = Running::new();
    let (mut one, mut two) = (server.client(), server.client());
    ask(&mut one, &[1, 1]);
    ask(&mut two, &[1, 2]);
    drop(one);
    server.until(|server| server.fact("clients").as_deref() == Some("1"));
    assert_eq!(server.status.state(), LinkState::Running);
    drop(two);
    server.until(|server| server.fact("clients").as_deref() == Some("0"));
    assert_eq!(
        server.status.state(),
        LinkState::Running,
        "it may come back"
    );
    server.pass(MAX_AGE);
    server.until(|server| server.status.state() == LinkState::Opening);
    let reason = server.status.link().reason;
    assert!(
        reason.contains("closed the connection; listening on"),
        "{reason}"
    );
}

#[test]
fn a_client_that_connects_for_each_telegram_keeps_the_line_running() {
    let server = Running::new();
    for count in 1..=50 {
        ask(&mut server.client(), &[1, count]);
        server.until(|server| server.fact("clients").as_deref() == Some("0"));
    }
    assert_eq!(server.fact("link.running").as_deref(), Some("1"));
    assert_eq!(server.fact("cause.left"), None);
}

#[test]
fn who_breaks_the_protocol_is_dropped_and_nobody_else_is() {
    let server = Running::new();
    let (mut good, mut bad) = (server.client(), server.client());
    ask(&mut good, &[1, 1]);
    bad.write_all(&[1, 9, 255]).expect("the server reads");
    await_end(&mut bad);
    ask(&mut good, &[1, 2]);
    assert_eq!(server.fact("clients.dropped").as_deref(), Some("1"));
    assert_eq!(server.status.state(), LinkState::Running);
}

#[test]
fn what_a_client_sends_while_the_line_is_down_is_unheard_and_half_a_telegram_is_forgotten() {
    let mut server = Running::new();
    let mut client = server.client();
    // One segment: with the answer, the server has also read the half.
    client.write_all(&[1, 1, 5, 1]).expect("the server reads");
    let mut reply = [0; 2];
    client.read_exact(&mut reply).expect("an answer");
    server.pass(LIMITS.patience - Nanos(1));
    let down = server.take_down();
    client.write_all(&[2, 3]).expect("the server reads");
    server.until(|server| server.fact("test.unheard").as_deref() == Some("1"));
    server.bring_up(down);
    server.pass(LIMITS.patience);
    ask(&mut client, &[1, 2]);
    assert_eq!(server.fact("test.unheard").as_deref(), Some("1"));
}

#[test]
fn half_a_telegram_has_its_time() {
    let server = Running::new();
    let (mut good, mut slow) = (server.client(), server.client());
    ask(&mut good, &[1, 1]);
    ask(&mut slow, &[1, 1]);
    slow.write_all(&[5, 1]).expect("the server reads");
    // The answer to another client shows that the server has read the half telegram, or will read it before it checks
    // the time.
    ask(&mut good, &[1, 2]);
    server.until(|server| {
        server.clock.advance(Nanos::from_millis(10));
        server.fact("clients.dropped").is_some()
    });
    await_end(&mut slow);
    ask(&mut good, &[1, 3]);
}

#[test]
fn each_of_those_who_owe_has_a_time_of_its_own() {
    let server = Running::new();
    let (mut early, mut late) = (server.client(), server.client());
    let half = LIMITS.patience.0 / 2;
    for client in [&mut early, &mut late] {
        // One segment: with the answer, the server has also read the half.
        client.write_all(&[1, 1, 5, 1]).expect("the server reads");
        client.read_exact(&mut [0; 2]).expect("an answer");
        server.pass(Nanos(half));
    }
    await_end(&mut early);
    late.write_all(&[1, 1, 1, 1]).expect("the server reads");
    let mut reply = [0; 6];
    late.read_exact(&mut reply).expect("it is complete in time");
    server.pass(LIMITS.patience);
    ask(&mut late, &[1, 2]);
    assert_eq!(server.fact("clients.dropped").as_deref(), Some("1"));
}

#[test]
fn who_completes_each_telegram_in_time_is_served_though_another_one_is_always_begun() {
    let server = Running::new();
    let mut client = server.client();
    client.write_all(&[2]).expect("the server reads");
    for _ in 0..30 {
        client.write_all(&[8, 9, 2]).expect("the server reads");
        let mut reply = [0; 3];
        client.read_exact(&mut reply).expect("an answer");
        assert_eq!(reply, [2, 8, 9]);
        server.pass(Nanos::from_millis(10));
    }
    assert_eq!(server.fact("clients.dropped"), None);
}

#[test]
fn who_does_not_read_is_not_read_and_dropped_in_the_end() {
    let server = Running::new();
    let (mut good, slow) = (server.client(), server.client());
    ask(&mut good, &[1, 1]);
    slow.set_nonblocking(true).expect("an option");
    let mut greedy = vec![0; 200];
    greedy[0] = 199;
    let waiting = Waiting::begin();
    // Sends until the system accepts no more: the server has then stopped reading.
    while server.fact("clients.dropped").is_none() {
        waiting.check("a server that reads for ever");
        if (&slow).write(&greedy).is_err() {
            server.clock.advance(Nanos::from_millis(10));
        }
        yield_now();
    }
    ask(&mut good, &[1, 2]);
}

#[test]
fn a_full_house_turns_newcomers_away_until_somebody_is_silent_for_long() {
    logged::expect("was turned away");
    let server = Running::new();
    let mut clients: Vec<_> = (0..LIMITS.clients).map(|_| server.client()).collect();
    for client in &mut clients {
        ask(client, &[1, 1]);
    }
    let mut newcomer = server.client();
    await_end(&mut newcomer);
    assert_eq!(server.fact("clients.turned_away").as_deref(), Some("1"));
    server.pass(LIMITS.patience);
    for client in &mut clients[1..] {
        ask(client, &[1, 2]);
    }
    let mut newcomer = server.client();
    ask(&mut newcomer, &[1, 3]);
    await_end(&mut clients[0]);
}

#[test]
fn a_port_in_use_is_told_with_its_cure() {
    let first = Running::new();
    let clock = Manual::new();
    let status = LinkStatus::new("second", Nanos::from_secs(1));
    let (_, end) = image(Vec::new());
    let mut port = Port::new(end, clock, Role::Device, None, status);
    let address = Address::local(first.address.port());
    let error = serve(&address, &mut Echo, &mut port, &Stop::new()).expect_err("refused");
    assert!(
        error
            .to_string()
            .contains("end the program that has this port"),
        "{error}"
    );
}

#[test]
fn answers_that_a_fault_holds_back_go_out_in_order_at_their_time() {
    let mut server = Running::new();
    let mut client = server.client();
    ask(&mut client, &[1, 1]);
    let fault = server.inject(LineEffect::Answer(AnswerEffect {
        station: None,
        function: Some(7),
        elements: Elements::default(),
        chance: 1.0,
        trouble: AnswerTrouble::Late {
            by: Nanos::from_millis(50),
            pause: Nanos::ZERO,
        },
    }));
    // The middle one is late, and the last one waits behind it.
    client
        .write_all(&[1, 1, 1, 7, 1, 2])
        .expect("the server reads");
    let mut reply = [0; 2];
    client.read_exact(&mut reply).expect("an answer");
    assert_eq!(reply, [1, 1]);
    client.set_nonblocking(true).expect("an option");
    server.pass(Nanos::from_millis(49));
    server.until(|server| server.clock.is_settled(1));
    let early = client.read(&mut reply).expect_err("nothing has come yet");
    assert_eq!(early.kind(), ErrorKind::WouldBlock);
    client.set_nonblocking(false).expect("an option");
    server.clock.advance(Nanos::from_millis(1));
    let mut rest = [0; 4];
    client.read_exact(&mut rest).expect("both answers");
    assert_eq!(rest, [1, 7, 1, 2]);
    // What is held back when the line goes down is lost.
    client.write_all(&[1, 7]).expect("the server reads");
    server.until(|server| server.fact("test.heard").as_deref() == Some("5"));
    let down = server.take_down();
    server.pass(Nanos::from_millis(60));
    server.until(|server| server.clock.is_settled(1));
    server.bring_up(down);
    server.bring_up(fault);
    ask(&mut client, &[2, 5, 6]);
}

#[test]
fn the_bytes_of_an_answer_can_go_out_one_by_one() {
    let mut server = Running::new();
    let mut client = server.client();
    ask(&mut client, &[1, 1]);
    server.inject(LineEffect::Answer(AnswerEffect {
        station: None,
        function: None,
        elements: Elements::default(),
        chance: 1.0,
        trouble: AnswerTrouble::Late {
            by: Nanos::ZERO,
            pause: Nanos::from_millis(5),
        },
    }));
    client.write_all(&[3, 7, 8, 9]).expect("the server reads");
    let mut byte = [0];
    client.read_exact(&mut byte).expect("the first one");
    for expected in [7, 8, 9] {
        client.set_nonblocking(true).expect("an option");
        server.pass(Nanos::from_millis(4));
        server.until(|server| server.clock.is_settled(1));
        let early = client.read(&mut byte).expect_err("the next one has time");
        assert_eq!(early.kind(), ErrorKind::WouldBlock);
        client.set_nonblocking(false).expect("an option");
        server.clock.advance(Nanos::from_millis(1));
        client.read_exact(&mut byte).expect("it is due");
        assert_eq!(byte, [expected]);
    }
    server.until(|server| server.fact("test.replied").as_deref() == Some("2"));
}
