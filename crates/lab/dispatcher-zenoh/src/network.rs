//! The session of Zenoh.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use tickbus_base::Mistake;
use tickbus_dispatcher::{Door, HostId, Post};
use zenoh::config::EndPoint;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::sample::SampleKind;
use zenoh::{Config, Session, Wait as _};

use crate::{Failure, Joined, Options};

/// The most letters that wait for Zenoh. Further values wait on the board, where a new value of a channel replaces an
/// old one.
const MOST_LETTERS: usize = 64;

/// How long a letter waits for a host that accepts nothing before the letter is dropped, in microseconds. Meanwhile no
/// other host gets a letter, so this is far below the silence after which a host is cut off.
const PATIENCE: &str = "100000";

/// Any error of Zenoh, as a failure of this operation.
fn failed<E: std::fmt::Display>(what: &'static str) -> impl FnOnce(E) -> Failure {
    move |why| Failure::Network(format!("{what} ({why})"))
}

pub(crate) fn join(options: &Options, door: &Door) -> Result<Joined, Failure> {
    let session = zenoh::open(config(options)?).wait().map_err(failed(
        "Zenoh cannot be started; end the program that has the port, or give another --zenoh-listen",
    ))?;
    let host = HostId(u128::from_le_bytes(session.zid().to_le_bytes()));
    let laboratory = format!("tickbus/{}", options.laboratory);

    // A dispatcher that appears is sent letters at once, so it must be able to receive them first.
    let letters = session.declare_subscriber(format!("{laboratory}/to/{host}"));
    let letters = letters.callback({
        let door = door.clone();
        move |sample| {
            let letter = sample.payload().to_bytes().into_owned();
            door.send(move |dispatcher, now| dispatcher.letter_arrived(now, &letter));
        }
    });
    let letters = letters
        .wait()
        .map_err(failed("Zenoh takes no subscription"))?;
    let liveliness = session.liveliness();
    let hosts = liveliness.declare_subscriber(format!("{laboratory}/here/*"));
    let hosts = hosts.history(true).callback({
        let door = door.clone();
        move |sample| {
            let key = sample.key_expr().as_str();
            let Some(id) = key.rsplit('/').next().and_then(parse) else {
                return;
            };
            let has_come = sample.kind() == SampleKind::Put;
            door.send(move |dispatcher, now| {
                if has_come {
                    dispatcher.host_appeared(now, id);
                } else {
                    dispatcher.host_vanished(id);
                }
            });
        }
    });
    let hosts = hosts
        .wait()
        .map_err(failed("Zenoh takes no subscription"))?;
    let token = liveliness
        .declare_token(format!("{laboratory}/here/{host}"))
        .wait()
        .map_err(failed("Zenoh takes no liveliness token"))?;

    let (sender, receiver) = channel();
    let waiting = Arc::new(AtomicUsize::new(0));
    let carrier = Carrier {
        session: session.clone(),
        address: format!("{laboratory}/to/"),
        waiting: Arc::clone(&waiting),
        door: door.clone(),
    };
    thread::Builder::new()
        .name("tickbus-zenoh".to_owned())
        .spawn(move || carrier.carry(&receiver))
        .map_err(failed("the system has no more threads"))?;
    let post = Box::new(Network {
        sender,
        waiting,
        _here: (token, hosts, letters, session),
    });
    Ok(Joined { host, post })
}

fn config(options: &Options) -> Result<Config, Failure> {
    let wrong = |text: &str, why: String| {
        Failure::Options(Mistake::new(
            format!("\"{text}\" is no endpoint of Zenoh ({why})"),
            "write one of the transport tcp, such as tcp/192.168.0.10:7447",
        ))
    };
    let mut config = Config::default();
    let mut set = |key: &str, value: &str| {
        config
            .insert_json5(key, value)
            .map_err(failed("Zenoh does not take its configuration"))
    };
    for (key, endpoints) in [
        ("connect/endpoints", &options.connect),
        ("listen/endpoints", &options.listen),
    ] {
        for text in endpoints {
            let endpoint: EndPoint = text.parse().map_err(|why| wrong(text, format!("{why}")))?;
            // Zenoh would notice later, and continue without the endpoint.
            if endpoint.protocol().as_str() != "tcp" {
                return Err(wrong(text, "its transport is not built in".to_owned()));
            }
        }
        if !endpoints.is_empty() {
            // The possible characters of an endpoint have the same form in both notations.
            set(key, &format!("{endpoints:?}"))?;
        }
    }
    set(
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop",
        PATIENCE,
    )?;
    Ok(config)
}

fn parse(id: &str) -> Option<HostId> {
    u128::from_str_radix(id, 16).ok().map(HostId)
}

/// The declarations that keep a dispatcher in its laboratory.
type Here = (LivelinessToken, Subscriber<()>, Subscriber<()>, Session);

struct Network {
    sender: Sender<(HostId, Vec<u8>)>,
    waiting: Arc<AtomicUsize>,
    _here: Here,
}

impl Post for Network {
    fn has_room(&self) -> bool {
        self.waiting.load(Ordering::Acquire) < MOST_LETTERS
    }

    fn send(&mut self, to: HostId, letter: Vec<u8>) {
        self.waiting.fetch_add(1, Ordering::AcqRel);
        // The carrier ends after this.
        let _ = self.sender.send((to, letter));
    }
}

/// Puts letters into Zenoh, which may take its time.
struct Carrier {
    session: Session,
    address: String,
    waiting: Arc<AtomicUsize>,
    door: Door,
}

impl Carrier {
    fn carry(&self, letters: &Receiver<(HostId, Vec<u8>)>) {
        while let Ok((to, letter)) = letters.recv() {
            let put = self.session.put(format!("{}{to}", self.address), letter);
            // The other side notices lost letters.
            let _ = put.congestion_control(CongestionControl::Drop).wait();
            if self.waiting.fetch_sub(1, Ordering::AcqRel) == MOST_LETTERS {
                self.door.send(|_, _| {});
            }
        }
    }
}
