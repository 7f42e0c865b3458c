//! The dispatcher on a port: real sockets, a foreign client, crowds, and kill -9.
#![cfg(unix)]

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader, Lines, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;

use tickbus_base::time::{Manual, Monotonic, Nanos, Stop};
use tickbus_dispatcher::tcp::{Hosting, Listener};
use tickbus_dispatcher::{
    Dispatcher, Door, HostId, Identity, Order, Patch, PatchFile, Pin, Post, Reply, Settings,
    Traffic,
};
use tickbus_net::Address;

/// Runs `test` with a dispatcher on a free port; returns its traffic.
fn serve(settings: Settings, test: impl FnOnce(SocketAddr)) -> Traffic {
    let listener = Listener::bind(&Address::local(0)).expect("a free port");
    let address = listener.address();
    let stop = Stop::new();
    thread::scope(|scope| {
        let served = scope.spawn(|| {
            let mut dispatcher = Dispatcher::new(settings, Patch::new());
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                stop: &stop,
                door: None,
                patch_file: None,
                news: &mut |_| {},
            };
            listener.run(&mut dispatcher, hosting).expect("it serves");
            dispatcher.traffic()
        });
        // Stop the server even if the test fails; otherwise the failure would never be reported.
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| test(address)));
        stop.stop();
        let traffic = served.join().expect("no panic");
        outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        traffic
    })
}

struct Client {
    stream: TcpStream,
    lines: Lines<BufReader<TcpStream>>,
}

impl Client {
    fn connect(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).expect("it listens");
        stream.set_nodelay(true).expect("a TCP option");
        let lines = BufReader::new(stream.try_clone().expect("a descriptor")).lines();
        Self { stream, lines }
    }

    /// A client that has joined with this line, and has read the list.
    fn join(address: SocketAddr, identification: &str) -> Self {
        let mut client = Self::connect(address);
        client.say(&format!("{identification} V=2"));
        while !client.hear().starts_with("END") {}
        client
    }

    fn say(&mut self, line: &str) {
        self.stream
            .write_all(format!("{line}\r\n").as_bytes())
            .expect("it reads");
    }

    fn hear(&mut self) -> String {
        self.lines.next().expect("a further line").expect("text")
    }

    fn ask(&mut self, line: &str) -> String {
        self.say(line);
        self.hear()
    }

    /// The list of devices.
    fn list(&mut self) -> String {
        let mut all = self.ask("LIST");
        while !all.contains("END ") {
            all += &self.hear();
        }
        all
    }
}

#[test]
fn clients_are_patched_together_over_sockets() {
    let traffic = serve(Settings::default(), |address| {
        let mut pump = Client::join(address, "VP PUMP Q01 I01");
        let mut logo = Client::join(address, "VR LOGO Q01 I01");
        assert_eq!(logo.ask("CONNECT I1:PUMP:Q1 Q1:P1:I1"), "OK CONNECT");
        pump.say("P Q1=20");
        assert_eq!(logo.hear(), "P I1=20");
        logo.say("P Q1=24");
        assert_eq!(pump.hear(), "P I1=24");
        drop(pump);
        assert_eq!(logo.hear(), "P I1=0");
        assert_eq!(logo.ask("BYE"), "OK BYE");
        assert!(logo.lines.next().is_none(), "the connection is closed");
    });
    assert_eq!(
        (traffic.values, traffic.overtaken, traffic.refused),
        (3, 0, 0)
    );
}

/// A transport that takes one letter at a time, to another loop in this process.
struct Pipe {
    own: Door,
    other: Door,
    is_busy: Arc<AtomicBool>,
    cable: Arc<Cable>,
}

/// The fate of the letters.
#[derive(Default)]
struct Cable {
    /// Letters are lost.
    is_cut: AtomicBool,
    /// How many letters were lost.
    lost: AtomicUsize,
    /// How often a loop has asked whether there is room: once per turn, and once per letter.
    asked: AtomicUsize,
}

impl Post for Pipe {
    fn has_room(&self) -> bool {
        self.cable.asked.fetch_add(1, Ordering::Relaxed);
        !self.is_busy.load(Ordering::Relaxed)
    }

    fn send(&mut self, _: HostId, letter: Vec<u8>) {
        if self.cable.is_cut.load(Ordering::Relaxed) {
            self.cable.lost.fetch_add(1, Ordering::Relaxed);
            return;
        }
        self.is_busy.store(true, Ordering::Relaxed);
        let (own, is_busy) = (self.own.clone(), Arc::clone(&self.is_busy));
        self.other.send(move |dispatcher, now| {
            dispatcher.letter_arrived(now, &letter);
            is_busy.store(false, Ordering::Relaxed);
            own.send(|_, _| {});
        });
    }
}

/// Runs `test` with two dispatchers that are joined by a cable, once each has reported the other.
fn serve_two(test: impl FnOnce([SocketAddr; 2], &Cable)) {
    let stops = [Stop::new(), Stop::new()];
    let doors = [Door::new(&stops[0]), Door::new(&stops[1])];
    let cable = Arc::new(Cable::default());
    let (news, told) = channel();
    thread::scope(|scope| {
        let mut addresses = Vec::new();
        for (at, stop) in stops.iter().enumerate() {
            let listener = Listener::bind(&Address::local(0)).expect("a free port");
            addresses.push(listener.address());
            let (own, other) = (doors[at].clone(), doors[1 - at].clone());
            let door = &doors[at];
            let (news, cable) = (news.clone(), Arc::clone(&cable));
            scope.spawn(move || {
                let mut dispatcher = Dispatcher::new(Settings::default(), Patch::new());
                let id = |at: usize| HostId(at as u128 + 1);
                dispatcher.federate(Identity::new(id(at), ["left", "right"][at], 0));
                dispatcher.host_appeared(Nanos::ZERO, id(1 - at));
                let is_busy = Arc::default();
                let post = Box::new(Pipe {
                    own,
                    other,
                    is_busy,
                    cable,
                });
                let hosting = Hosting {
                    clock: &*Monotonic::shared(),
                    stop,
                    door: Some(door),
                    patch_file: None,
                    news: &mut |line| drop(news.send(line.to_owned())),
                };
                let listener = listener.with_post(post);
                listener.run(&mut dispatcher, hosting).expect("it serves");
            });
        }
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let lines = [0, 1].map(|_| told.recv().expect("news"));
            assert!(
                lines
                    .iter()
                    .all(|line| line.contains("is here; its clients: 0"))
            );
            test([addresses[0], addresses[1]], &cable);
        }));
        stops.iter().for_each(Stop::stop);
        outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}

#[test]
fn two_loops_pass_letters_to_each_other_and_tell_their_news() {
    serve_two(|[left, right], _| {
        let mut pump = Client::join(left, "VP PUMP Q01");
        let mut logo = Client::join(right, "VR LOGO I01");
        pump.say("P Q1=0");
        while !logo.ask("CONNECT I1:PUMP:Q1").starts_with("OK") {}
        assert_eq!(logo.hear(), "P I1=0");
        for value in 1..100 {
            pump.say(&format!("P Q1={value}"));
        }
        for value in 1..100 {
            assert_eq!(logo.hear(), format!("P I1={value}"));
        }
    });
}

#[test]
fn a_client_that_waits_for_another_host_keeps_no_loop_awake_and_is_heard_again() {
    serve_two(|[left, right], cable| {
        let mut other = Client::join(left, "VP OTHER Q01");
        let _logo = Client::join(right, "VR LOGO I01");
        // A client of version 1 gets no answer, and is read again anyway.
        let mut pump = Client::connect(left);
        pump.say("VP PUMP Q01");
        while !other.list().contains("VR:LOGO:") {}
        cable.is_cut.store(true, Ordering::Relaxed);
        pump.say("CONNECT Q1:LOGO:I1");
        // The other client is answered after that line was read.
        assert_eq!(other.ask("PING"), "OK PING");
        // While the answer is awaited, more bytes arrive.
        pump.say("PING");
        // Signs of life come once a second. By then, a loop that is kept awake would have made thousands of turns.
        let lost = || cable.lost.load(Ordering::Relaxed);
        let (before, beats) = (cable.asked.load(Ordering::Relaxed), lost() + 3);
        while lost() < beats {
            thread::yield_now();
        }
        let turns = cable.asked.load(Ordering::Relaxed) - before;
        assert!(turns < 100, "{turns} turns");
        cable.is_cut.store(false, Ordering::Relaxed);
        while pump.hear() != "OK PING" {}
    });
}

#[test]
fn a_foreign_client_plays_the_published_session() {
    const SCRIPT: &str = r#"
import socket, sys
address = ("127.0.0.1", int(sys.argv[1]))
def join(line):
    client = socket.create_connection(address)
    lines = client.makefile("r", newline="\r\n")
    client.sendall(line.encode() + b"\n")
    while True:
        heard = lines.readline().rstrip("\r\n")
        if heard.split(":")[1] == line.split()[1]:
            return client, lines
p1, p1_lines = join("VP PUMP Q08 I08")
p2, p2_lines = join("VP TESTING_BOARD Q32 I32 AQ16 AI16")
logo, logo_lines = join("VR SIEMENS_LOGO001 Q08 I08 AQ02 AI03")
logo.sendall(b"CONNECT I1:P1:Q2 Q1 :P2:I4\nP Q1=20 Q2=20 Q3=5 Q4=24 Q5=0 Q6=0 Q7=0 AQ0=10 AQ1=15 AQ2=0\n")
print(p2_lines.readline().rstrip())
p1.sendall(b"P Q2=24\r\n")
print(logo_lines.readline().rstrip())
"#;
    serve(Settings::default(), |address| {
        let python = Command::new("python3")
            .args(["-c", SCRIPT, &address.port().to_string()])
            .output();
        let Ok(output) = python else {
            eprintln!("SKIPPED: there is no python3 to play the foreign client");
            return;
        };
        let wrong = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{wrong}");
        assert_eq!(
            String::from_utf8_lossy(&output.stdout),
            "P I4=20\nP I1=24\n"
        );
    });
}

#[test]
fn ten_thousand_connects_and_disconnects_leave_nothing() {
    serve(Settings::default(), |address| {
        let mut stays = Client::join(address, "VR STAYS I01");
        for round in 0..10_000 {
            let mut stream = TcpStream::connect(address).expect("it listens");
            match round % 4 {
                0 => {}
                1 => stream.write_all(b"VP").expect("it reads"),
                2 => stream
                    .write_all(b"VP COMES Q08 I08\r\nCONNECT Q1:STAYS:I1\r\nBYE\r\n")
                    .expect("it reads"),
                _ => {
                    let line = format!("VP GOES{round} Q08 I08 V=2\r\n");
                    stream.write_all(line.as_bytes()).expect("it reads");
                    let mut some = [0; 5];
                    stream.read_exact(&mut some).expect("an answer");
                    assert_eq!(&some, b"OK VP");
                }
            }
        }
        // The last client is gone when its name is free.
        while Client::connect(address)
            .ask("VP GOES9999 Q1")
            .starts_with("ERR 409")
        {}
        assert_eq!(stays.ask("PING"), "OK PING");
    });
}

#[test]
fn nobody_waits_for_a_client_that_never_reads_nor_for_a_flood() {
    let traffic = serve(Settings::default(), |address| {
        let mut deaf = Client::join(address, "VR DEAF I01");
        let mut quick = Client::join(address, "VR QUICK I01");
        let mut from = Client::join(address, "VP FROM Q01");
        assert_eq!(deaf.ask("CONNECT I1:FROM:Q1"), "OK CONNECT");
        assert_eq!(quick.ask("CONNECT I1:FROM:Q1"), "OK CONNECT");
        let flood = Client::connect(address);
        thread::scope(|scope| {
            let stop = Stop::new();
            let (flood, is_over) = (&flood.stream, stop.clone());
            flood.set_nonblocking(true).expect("a socket option");
            scope.spawn(move || {
                let mut flood = flood;
                while !is_over.is_stopped() {
                    // The client never reads the answers, so at some point the system accepts no more.
                    let _ = flood.write(&[b'\n', b'x'].repeat(10_000));
                    thread::yield_now();
                }
            });
            // More than systems buffer for one connection; each answer is read before the next value is sent.
            for block in 0..400 {
                let line = |value| format!("P Q1={}{:017}\r\n", 1 + block * 1000 + value, 1);
                let lines: String = (0..1000).map(line).collect();
                from.stream.write_all(lines.as_bytes()).expect("it reads");
                let last = line(999).trim_end().replace('Q', "I");
                while quick.hear() != last {}
            }
            stop.stop();
        });
        assert_eq!(from.ask("PING"), "OK PING");
        from.say("P Q1=7");
        let mut before = String::new();
        loop {
            let heard = deaf.hear();
            if heard == "P I1=7" {
                break;
            }
            let key = |text: &str| (text.len(), text.to_owned());
            assert!(key(&heard) > key(&before), "{heard} behind {before}");
            before = heard;
        }
    });
    assert!(traffic.overtaken > 0, "{traffic:?}");
}

#[test]
fn the_idle_rule_holds_on_the_clock_that_is_handed_in() {
    let clock = Manual::new();
    let stop = Stop::new();
    let listener = Listener::bind(&Address::local(0)).expect("a free port");
    let address = listener.address();
    thread::scope(|scope| {
        let served = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*clock,
                stop: &stop,
                door: None,
                patch_file: None,
                news: &mut |_| {},
            };
            listener.run(
                &mut Dispatcher::new(Settings::default(), Patch::new()),
                hosting,
            )
        });
        let mut client = Client::join(address, "VR LOGO Q01");
        clock.advance(Nanos::from_secs(60));
        assert!(client.hear().starts_with("ERR 408 "));
        assert!(client.lines.next().is_none(), "the connection is closed");
        stop.stop();
        served.join().expect("no panic").expect("it serves");
    });
}

#[test]
fn other_threads_come_in_by_the_door_and_know_when_it_closes() {
    let stop = Stop::new();
    let door = Door::new(&stop);
    let listener = Listener::bind(&Address::local(0)).expect("a free port");
    let address = listener.address();
    thread::scope(|scope| {
        let served = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                stop: &stop,
                door: Some(&door),
                patch_file: None,
                news: &mut |_| {},
            };
            listener.run(
                &mut Dispatcher::new(Settings::default(), Patch::new()),
                hosting,
            )
        });
        let mut pump = Client::join(address, "VP PUMP Q01 I01");
        let mut logo = Client::join(address, "VR LOGO Q01 I01");
        assert_eq!(pump.ask("P Q1=20\r\nPING"), "OK PING");
        let pin = |text| Pin::parse(text).expect("a pin");
        let (sender, answer) = channel();
        let reply = Reply::new(move |outcome| sender.send(outcome).expect("it is waited for"));
        // Nothing else wakes the loop now.
        door.operate(Order::Connect(pin("PUMP:Q1"), pin("LOGO:I1")), reply);
        assert_eq!(answer.recv().expect("an answer"), Ok(()));
        assert_eq!(logo.hear(), "P I1=20");
        let (sender, answer) = channel();
        door.send(move |dispatcher, _| {
            let clients = dispatcher.snapshot().clients.len();
            sender.send(clients).expect("it is waited for");
        });
        assert_eq!(answer.recv(), Ok(2));
        stop.stop();
        served.join().expect("no panic").expect("it serves");
        let (sender, answer) = channel::<()>();
        door.send(move |_, _| drop(sender));
        assert!(answer.recv().is_err(), "nobody is there");
    });
}

/// The argument and the variable that turn this program into a separate dispatcher with a file.
const CHILD: &str = "TICKBUS_TEST_PATCH_FILE";

/// Not a test, but the process that is killed.
#[test]
fn the_process_that_is_killed() {
    let Some(path) = std::env::var_os(CHILD) else {
        return;
    };
    let file = PatchFile::new(Path::new(&path));
    let patch = file.load().expect("it is whole");
    let listener = Listener::bind(&Address::local(0)).expect("a free port");
    println!("\nlistening on {}", listener.address());
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        stop: &Stop::new(),
        door: None,
        patch_file: Some(&file),
        news: &mut |line| panic!("{line}"),
    };
    let _ = listener.run(&mut Dispatcher::new(Settings::default(), patch), hosting);
}

struct Victim(Child, SocketAddr);

impl Victim {
    fn start(file: &Path) -> Self {
        let mut child = Command::new(std::env::current_exe().expect("a path"))
            .args([
                "--exact",
                "sockets::the_process_that_is_killed",
                "--nocapture",
            ])
            .env(CHILD, file)
            .stdout(Stdio::piped())
            .spawn()
            .expect("this program");
        let mut lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
        let address = lines.find_map(|line| {
            let line = line.expect("text");
            line.strip_prefix("listening on ")?.parse().ok()
        });
        Self(child, address.expect("it tells its address"))
    }

    fn kill(mut self) {
        self.0.kill().expect("it runs");
        self.0.wait().expect("it ends");
    }
}

#[test]
fn whenever_it_is_killed_the_patch_is_the_old_one_or_the_new_one_and_what_was_confirmed_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let path: PathBuf = folder.path().join("patch.toml");
    let file = PatchFile::new(&path);
    let size = |patch: &Patch| {
        (
            patch.len(),
            patch
                .iter()
                .map(|(sink, _)| sink.to_string())
                .collect::<BTreeSet<_>>(),
        )
    };
    let mut cut_short = 0;
    for round in 0_u32..40 {
        let before = size(&file.load().expect("it is whole"));
        let victim = Victim::start(&path);
        let mut from = Client::join(victim.1, "VP FROM Q02 I64");
        let mut confirmed = before.clone();
        // Some confirmed changes, then one that may come too late, or be interrupted.
        let turns = ["CONNECT", "DISCONNECT"];
        for turn in 0..round % 3 {
            let is_connected = confirmed.0 > 0;
            let line = change(is_connected);
            assert_eq!(
                from.ask(&line),
                format!("OK {}", turns[usize::from(is_connected)]),
                "{turn}"
            );
            confirmed = size(&file.load().expect("it is whole"));
            assert_eq!(confirmed.0, if is_connected { 0 } else { 60 });
        }
        from.say(&change(confirmed.0 > 0));
        for _ in 0..u64::from(round) * 40 {
            thread::yield_now();
        }
        victim.kill();
        let after = size(&file.load().expect("it is whole"));
        let new = if confirmed.0 > 0 { 0 } else { 60 };
        assert!(
            after == confirmed || after.0 == new,
            "round {round}: {after:?}"
        );
        cut_short += u32::from(after == confirmed);
    }
    println!("{cut_short} of 40 changes came too late");
}

/// A line that connects 60 inputs, or one that cuts them all.
fn change(is_connected: bool) -> String {
    if is_connected {
        return "DISCONNECT Q1".to_owned();
    }
    (1..=60).fold("CONNECT".to_owned(), |line, at| {
        line + &format!(" Q1:FROM:I{at}")
    })
}

#[test]
fn a_link_in_the_place_of_the_next_patch_is_not_followed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (other, patch) = (folder.path().join("other"), folder.path().join("p.toml"));
    std::fs::write(&other, "of another user").expect("there is room");
    std::os::unix::fs::symlink(&other, folder.path().join("p.toml.new")).expect("a link");
    let file = PatchFile::new(&patch);
    file.save(&Patch::new()).expect("it is saved");
    assert_eq!(
        std::fs::read_to_string(&other).expect("it is there"),
        "of another user"
    );
    assert_eq!(file.load().expect("right"), Patch::new());
}
