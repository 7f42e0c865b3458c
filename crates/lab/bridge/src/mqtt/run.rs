//! The bridge between a broker and the dispatcher.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::JoinHandle;

use rumqttc::{
    Client, Connection, Event, LastWill, MqttOptions, Outgoing, Packet, QoS, SubscribeFilter,
    SubscribeReasonCode,
};
use tickbus_base::os::PollSet;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_net::Host;

use super::mapping::Mapping;
use super::tls;
use crate::link::Link;
use crate::speaker::Speaker as _;

/// The messages of the state's topic.
const ONLINE: &str = "online";
const OFFLINE: &str = "offline";

/// After this time without a sign of life, broker and bridge regard each other as gone.
const ALIVE: Nanos = Nanos::from_secs(10);

/// The pause before calling a lost broker again.
const PAUSE: Nanos = Nanos::from_secs(1);

/// The most messages that may wait between the threads, in each direction.
const QUEUE: usize = 256;

/// The longest accepted message, in bytes: a message that is no number is reported, and does not end the connection.
const LONGEST: usize = 16 * 1024 * 1024;

/// The environment of a bridge.
pub struct Hosting<'h> {
    /// The clock.
    pub clock: Arc<dyn Clock>,
    /// Ends the bridge.
    pub stop: &'h Stop,
    /// Takes news for an operator, one line each.
    pub news: &'h mut dyn FnMut(&str),
}

/// An event from the broker's side.
enum Heard {
    Connected,
    Lost(String),
    Message(String, Vec<u8>),
    /// The broker has room again.
    Room,
    Refused(usize),
}

/// Carries values between the broker and the dispatcher until stopped. Lost connections are restored.
///
/// # Errors
///
/// The system cannot wait for sockets, or has no more threads. [`io::ErrorKind::InvalidInput`]: a certificate cannot be used.
pub fn run(mapping: &mut Mapping, hosting: Hosting<'_>) -> io::Result<()> {
    let set = PollSet::new(hosting.stop);
    let (broker, left_out) = Broker::call(mapping, &hosting)?;
    if left_out > 0 {
        (hosting.news)(&format!(
            "certificates in ca_file that cannot be read, and do not count: {left_out}"
        ));
    }
    let mut host = Between {
        link: Link::new(&mapping.map().dispatcher, hosting.stop),
        mapping,
        set,
        is_connected: false,
        is_online: None,
        told: String::new(),
        broker,
        hosting,
    };
    while !host.hosting.stop.is_stopped() {
        host.turn()?;
    }
    host.set_online(false);
    host.link.close(&mut host.set);
    if host.is_connected {
        host.broker.leave();
    }
    Ok(())
}

struct Between<'b, 'h> {
    mapping: &'b mut Mapping,
    hosting: Hosting<'h>,
    set: PollSet,
    link: Link,
    broker: Broker,
    is_connected: bool,
    /// The state published in this connection with the broker, which may still have an old one.
    is_online: Option<bool>,
    /// The last reported reason for the missing broker.
    told: String,
}

impl Between<'_, '_> {
    fn turn(&mut self) -> io::Result<()> {
        let deadline = if self.is_connected {
            self.link.deadline(self.mapping)
        } else {
            Nanos::MAX
        };
        self.set.wait(&*self.hosting.clock, deadline)?;
        let now = self.hosting.clock.now();
        while let Some(heard) = self.broker.heard() {
            self.obey(heard);
        }
        if !self.is_connected {
            return Ok(());
        }
        let news = &mut *self.hosting.news;
        self.link.turn(now, self.mapping, &mut self.set, news)?;
        self.set_online(self.mapping.is_here());
        let broker = &self.broker.client;
        self.mapping.publish(&mut |entry, payload| {
            let topic = entry.topic.clone();
            let sent = broker.try_publish(topic, QoS::AtLeastOnce, entry.retain, payload);
            sent.is_ok()
        });
        let news = &mut *self.hosting.news;
        for line in self.mapping.news() {
            news(&line);
        }
        self.link.write(now, self.mapping, &mut self.set, news)
    }

    fn obey(&mut self, heard: Heard) {
        let address = &self.mapping.map().broker;
        match heard {
            Heard::Connected => {
                let line = format!("connected with the broker at {address}");
                (self.hosting.news)(&line);
                self.told.clear();
                self.is_connected = true;
                self.is_online = None;
                self.broker.subscribe(self.mapping);
            }
            Heard::Lost(why) => {
                let what = if self.is_connected {
                    "is lost"
                } else {
                    "is not reached"
                };
                let line = format!(
                    "the broker at {address} {what} ({why}); it is called again each second"
                );
                if self.is_connected {
                    self.is_connected = false;
                    self.is_online = None;
                    self.mapping.broker_lost();
                    self.link.close(&mut self.set);
                }
                if line != self.told {
                    (self.hosting.news)(&line);
                    self.told = line;
                }
            }
            Heard::Message(topic, payload) => {
                self.mapping.message(&topic, &payload);
            }
            Heard::Refused(at) => {
                let topic = topics(self.mapping).nth(at).unwrap_or_default();
                let line = format!(
                    "the broker refuses the subscription of \"{topic}\"; let this client read it"
                );
                (self.hosting.news)(&line);
            }
            Heard::Room => {}
        }
    }

    /// Publishes the state of the bridge: true if values go through.
    fn set_online(&mut self, is_online: bool) {
        if self.is_online == Some(is_online) || !self.is_connected {
            return;
        }
        if let Some(status) = &self.mapping.map().status {
            let payload = if is_online { ONLINE } else { OFFLINE };
            let sent = self
                .broker
                .client
                .try_publish(status, QoS::AtLeastOnce, true, payload);
            if sent.is_err() {
                return;
            }
        }
        self.is_online = Some(is_online);
    }
}

/// The subscribed topics.
fn topics(mapping: &Mapping) -> impl Iterator<Item = &str> {
    let outputs = mapping.map().channels.iter();
    let outputs = outputs.filter(|entry| entry.channel.kind.is_output());
    outputs.map(|entry| &*entry.topic)
}

/// The connection with the broker: a thread that drives it.
struct Broker {
    client: Client,
    receiver: Receiver<Heard>,
    thread: JoinHandle<()>,
    stop: Stop,
}

impl Broker {
    /// Calls the broker; returns also how many certificates of `ca_file` were left out.
    fn call(mapping: &Mapping, hosting: &Hosting<'_>) -> io::Result<(Self, usize)> {
        let mut left_out = 0;
        let map = mapping.map();
        // Without the brackets of an IPv6 address.
        let host = match &map.broker.host {
            Host::Ip(ip) => ip.to_string(),
            Host::Name(name) => name.clone(),
        };
        let mut options = MqttOptions::new(&map.name, host, map.broker.port);
        options.set_keep_alive(ALIVE.to_duration());
        options.set_max_packet_size(LONGEST, LONGEST);
        if let Some(login) = &map.access.login {
            options.set_credentials(&*login.user, &*login.password);
        }
        if let Some(tls) = &map.access.tls {
            let made = tls::transport(tls);
            let (transport, broken) =
                made.map_err(|mistake| io::Error::new(io::ErrorKind::InvalidInput, mistake))?;
            options.set_transport(transport);
            left_out = broken;
        }
        if let Some(status) = &map.status {
            options.set_last_will(LastWill::new(status, OFFLINE, QoS::AtLeastOnce, true));
        }
        let (client, connection) = Client::new(options, QUEUE);
        let (sender, receiver) = mpsc::sync_channel(QUEUE);
        let stop = Stop::new();
        let driver = Driver {
            sender,
            clock: Arc::clone(&hosting.clock),
            stop: stop.clone(),
            waker: hosting.stop.clone(),
        };
        let thread = std::thread::Builder::new().name("tickbus-mqtt".to_owned());
        let thread = thread.spawn(move || driver.run(connection))?;
        let broker = Self {
            client,
            receiver,
            thread,
            stop,
        };
        Ok((broker, left_out))
    }

    fn heard(&self) -> Option<Heard> {
        self.receiver.try_recv().ok()
    }

    fn subscribe(&self, mapping: &Mapping) {
        let filters: Vec<_> = topics(mapping)
            .map(|topic| SubscribeFilter::new(topic.to_owned(), QoS::AtLeastOnce))
            .collect();
        if !filters.is_empty() {
            // If the broker was lost meanwhile, this is repeated with the next connection.
            let _ = self.client.try_subscribe_many(filters);
        }
    }

    /// Says good-bye, so that the broker does not publish the will.
    fn leave(self) {
        self.stop.stop();
        if self.client.try_disconnect().is_ok() {
            drop(self.client);
            // Discard what still arrives; the thread ends once the DISCONNECT is written or fails.
            while self.receiver.recv().is_ok() {}
            let _ = self.thread.join();
        }
    }
}

/// Drives the connection, on its own thread.
struct Driver {
    sender: SyncSender<Heard>,
    clock: Arc<dyn Clock>,
    /// Ends this thread.
    stop: Stop,
    /// Wakes the other one.
    waker: Stop,
}

impl Driver {
    fn run(self, mut connection: Connection) {
        for event in connection.iter() {
            let goes_on = match event {
                Ok(Event::Outgoing(Outgoing::Disconnect)) => false,
                Ok(Event::Incoming(packet)) => self.heard(packet),
                Ok(Event::Outgoing(_)) => true,
                Err(_) if self.stop.is_stopped() => false,
                Err(error) => {
                    let goes_on = self.tell(Heard::Lost(tls::reason(&error)));
                    self.clock.wait_until(self.clock.now() + PAUSE, &self.stop);
                    goes_on
                }
            };
            if !goes_on {
                return;
            }
        }
    }

    fn heard(&self, packet: Packet) -> bool {
        match packet {
            Packet::ConnAck(_) => self.tell(Heard::Connected),
            Packet::Publish(message) => {
                self.tell(Heard::Message(message.topic, message.payload.to_vec()))
            }
            Packet::PubAck(_) => self.tell(Heard::Room),
            Packet::SubAck(answer) => {
                let codes = answer.return_codes.iter().enumerate();
                let mut refused = codes.filter(|(_, code)| **code == SubscribeReasonCode::Failure);
                refused.all(|(at, _)| self.tell(Heard::Refused(at)))
            }
            _ => true,
        }
    }

    /// Sends the other thread an event; false if that thread has ended.
    fn tell(&self, heard: Heard) -> bool {
        let is_told = self.sender.send(heard).is_ok();
        self.waker.wake();
        is_told
    }
}
