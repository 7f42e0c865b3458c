use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::thread::{scope, yield_now};
use std::time::Duration;

use socket2::SockRef;

use super::*;
use crate::{LinkStatus, Role};
use tickbus_base::time::{Clock, Manual, Monotonic};
use tickbus_image::image;
use tickbus_net::prepare;

const SECOND: Nanos = Nanos::from_secs(1);

/// A caller that sends the given bytes, records the received ones, and ends when the test asks for that.
#[derive(Debug)]
struct Speaker {
    heard: Vec<u8>,
    /// The bytes to be written, and the bytes that follow them.
    says: Vec<u8>,
    written: usize,
    then: Vec<u8>,
    deadline: Nanos,
    /// The time by which the peer must send something.
    limit: Nanos,
    /// The number of turns after which the speaker ends the connection.
    turns: usize,
    /// The calls so far, without those that only ask.
    calls: Vec<&'static str>,
}

impl Default for Speaker {
    fn default() -> Self {
        Self {
            heard: Vec::new(),
            says: Vec::new(),
            written: 0,
            then: Vec::new(),
            deadline: Nanos::MAX,
            limit: Nanos::MAX,
            turns: 1000,
            calls: Vec::new(),
        }
    }
}

impl Caller for Speaker {
    fn hear(&mut self, _now: Nanos, bytes: &[u8], _port: &mut Port) -> Result<(), BusError> {
        self.heard.extend_from_slice(bytes);
        self.limit = Nanos::MAX;
        self.calls.push("hear");
        Ok(())
    }

    fn turn(&mut self, _now: Nanos, _port: &mut Port) -> Result<(), BusError> {
        self.calls.push("turn");
        self.turns -= 1;
        if self.turns == 0 {
            return Err(BusError::Refused("it has talked enough".to_owned()));
        }
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        &self.says[self.written..]
    }

    fn wrote(&mut self, _now: Nanos, count: usize, _port: &mut Port) {
        self.calls.push("wrote");
        self.written += count;
        if self.written == self.says.len() {
            self.says = std::mem::take(&mut self.then);
            self.written = 0;
        }
    }

    fn check(&mut self, now: Nanos, _port: &mut Port) -> Result<(), BusError> {
        self.calls.push("check");
        if now >= self.limit {
            return Err(BusError::Link(format!("silent at {now}")));
        }
        Ok(())
    }

    fn deadline(&self, _port: &Port) -> Nanos {
        self.deadline
    }

    fn left(&mut self) -> BusError {
        BusError::Left(format!("after {:?}", self.heard))
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        BusError::Link(format!("broke ({:?})", error.kind()))
    }
}

/// A port over an image without stations, with a manual clock.
fn port() -> (Port, Arc<Manual>, LinkStatus) {
    let clock = Manual::new();
    let status = LinkStatus::new("test", Nanos::from_secs(3600));
    let (_, end) = image(Vec::new());
    let port = Port::new(
        end,
        Arc::clone(&clock) as _,
        Role::Device,
        None,
        status.clone(),
    );
    (port, clock, status)
}

/// A call and its peer.
fn connected() -> (Call<TcpStream>, TcpStream) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    let stream = TcpStream::connect(address).expect("it listens");
    prepare(&stream, SECOND).expect("options");
    let (peer, _) = listener.accept().expect("a client");
    let limit = Some(Duration::from_secs(20));
    peer.set_read_timeout(limit).expect("an option");
    (Call::new(stream), peer)
}

/// Waits with a limit in real time.
#[track_caller]
fn until(what: &str, done: impl Fn() -> bool) {
    let real = Monotonic::shared();
    let limit = real.now() + Nanos::from_secs(20);
    while !done() {
        assert!(real.now() < limit, "waited in vain: {what}");
        yield_now();
    }
}

/// Waits until the other thread waits only for the clock and its socket.
#[track_caller]
fn settle(clock: &Manual) {
    until("it comes to rest", || clock.is_settled(1));
}

/// Stops a call when dropped, so that the call ends even if the test fails.
struct Stopping<'a>(&'a Stop);

impl Drop for Stopping<'_> {
    fn drop(&mut self) {
        self.0.stop();
    }
}

/// Runs a call that ends without a stop, after `act`; returns the reason.
fn run(call: &mut Call<TcpStream>, speaker: &mut Speaker, act: impl FnOnce(&Manual)) -> String {
    let (mut port, clock, _) = port();
    let stop = Stop::new();
    let ended = scope(|scope| {
        let _stopping = Stopping(&stop);
        let thread = scope.spawn(|| call.run(speaker, &mut port, &stop));
        act(&clock);
        until("it ends", || thread.is_finished());
        thread.join().expect("no panic")
    });
    ended.expect_err("it ends by itself").to_string()
}

#[test]
fn a_peer_that_closes_has_left_after_all_it_said() {
    let (mut call, mut peer) = connected();
    peer.write_all(&[7, 8]).expect("room");
    drop(peer);
    let error = run(&mut call, &mut Speaker::default(), |_| ());
    assert!(error.contains("after [7, 8]"), "{error}");
}

#[test]
fn a_connection_that_is_reset_is_broken() {
    let (mut call, peer) = connected();
    let now = Some(Duration::ZERO);
    SockRef::from(&peer).set_linger(now).expect("an option");
    drop(peer);
    let error = run(&mut call, &mut Speaker::default(), |_| ());
    assert!(error.contains("broke (ConnectionReset)"), "{error}");
}

#[test]
fn a_peer_that_says_nothing_is_waited_for_until_the_deadline() {
    let (mut call, _peer) = connected();
    let mut speaker = Speaker {
        deadline: SECOND,
        limit: SECOND,
        ..Speaker::default()
    };
    let error = run(&mut call, &mut speaker, |clock| {
        settle(clock);
        clock.advance(SECOND);
    });
    assert!(error.contains("silent at 1s"), "{error}");
}

#[test]
fn what_has_arrived_in_the_meantime_counts_before_the_time_is_checked() {
    let (mut call, mut peer) = connected();
    let (mut port, clock, _) = port();
    let mut speaker = Speaker {
        limit: SECOND,
        says: vec![1],
        then: vec![2],
        ..Speaker::default()
    };
    peer.write_all(&[7]).expect("room");
    clock.advance(SECOND);
    let stop = Stop::new();
    let mut set = PollSet::new(&stop);
    let added = set.add(0, call.stream(), Interest::Read);
    added.expect("it is open");
    set.wait(&*clock, Nanos::MAX).expect("it can wait");
    let turned = call.turn(port.clock().now(), true, &mut speaker, &mut port);
    turned.expect("it goes on");
    assert_eq!(speaker.calls, ["hear", "turn", "wrote", "wrote", "check"]);
    let mut said = [0; 2];
    peer.read_exact(&mut said).expect("both at once");
    assert_eq!(said, [1, 2]);
}

#[test]
fn what_the_peer_does_not_take_waits_for_it_and_nothing_is_lost() {
    let (mut call, mut peer) = connected();
    let (mut port, ..) = port();
    // More bytes than the system accepts while the peer reads none.
    let size = 64 * 1024;
    let room = SockRef::from(call.stream()).set_send_buffer_size(size);
    room.expect("an option");
    let room = SockRef::from(&peer).set_recv_buffer_size(size);
    room.expect("an option");
    let all: Vec<u8> = (0..4_000_000_u32)
        .map(|index| index.to_be_bytes()[2])
        .collect();
    let mut speaker = Speaker {
        says: all.clone(),
        turns: usize::MAX,
        ..Speaker::default()
    };
    let turned = call.turn(port.clock().now(), false, &mut speaker, &mut port);
    turned.expect("it goes on");
    assert_eq!(call.interest(), Interest::ReadWrite);
    assert!(!speaker.says.is_empty());
    let stop = Stop::new();
    let taken = scope(|scope| {
        let _stopping = Stopping(&stop);
        let thread = scope.spawn(|| call.run(&mut speaker, &mut port, &stop));
        let mut taken = vec![0; all.len()];
        peer.read_exact(&mut taken).expect("all of it");
        stop.stop();
        thread.join().expect("no panic").expect("no error");
        taken
    });
    assert!(taken == all, "other bytes");
    let turned = call.turn(port.clock().now(), false, &mut speaker, &mut port);
    turned.expect("it goes on");
    assert_eq!(call.interest(), Interest::Read);
}

#[test]
fn a_stop_ends_the_wait_and_the_peer_gets_a_proper_end() {
    let (mut call, mut peer) = connected();
    let (mut port, clock, _) = port();
    let stop = Stop::new();
    scope(|scope| {
        let _stopping = Stopping(&stop);
        let thread = scope.spawn(|| call.run(&mut Speaker::default(), &mut port, &stop));
        settle(&clock);
        stop.stop();
        thread.join().expect("no panic").expect("no error");
    });
    // Unread bytes would make the system reset the connection.
    peer.write_all(&[7]).expect("room");
    drop(call);
    assert_eq!(peer.read(&mut [0]).expect("an end, no reset"), 0);
}

#[test]
fn a_deadline_in_the_past_means_at_once() {
    let (mut call, _peer) = connected();
    let mut speaker = Speaker {
        deadline: Nanos(i64::MIN),
        turns: 5,
        ..Speaker::default()
    };
    let error = run(&mut call, &mut speaker, |_| ());
    assert!(error.contains("talked enough"), "{error}");
}

#[test]
fn dialling_connects_and_tells_the_address_reached() {
    let (mut port, clock, status) = port();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let bound = listener.local_addr().expect("it is bound");
    let stop = Stop::new();
    let address = Address::local(bound.port());
    let dialled = dial(&address, SECOND, &mut port, &stop).expect("it listens");
    let (_call, peer) = dialled.expect("no stop came");
    assert_eq!(peer, bound);
    let mut statistics = tickbus_base::statistics::Statistics::default();
    status.write(clock.now(), &mut statistics);
    let text = statistics.to_string();
    assert!(text.contains(&format!("address={bound}\n")), "{text}");
    drop(listener);
    let error = dial(&address, SECOND, &mut port, &stop).expect_err("nobody listens");
    let error = error.to_string();
    assert!(error.contains("start the program"), "{error}");
    stop.stop();
    let dialled = dial(&address, SECOND, &mut port, &stop).expect("no failure");
    assert!(dialled.is_none());
}
