//! Several dispatchers, and a network between them that loses letters and is cut.

use std::collections::{BTreeSet, VecDeque};
use std::sync::mpsc::channel;

use tickbus_base::time::Nanos;
use tickbus_dispatcher::{HostId, Identity, Number, Order, Patch, Pin, Reply, Settings};

use super::Lab;

/// The names of the hosts.
pub(crate) const NAMES: [&str; 3] = ["alpha", "beta", "gamma"];

pub(crate) struct Hosts {
    pub(crate) labs: Vec<Lab>,
    /// Pairs of hosts, the smaller first, whose letters are held back.
    cuts: BTreeSet<(usize, usize)>,
    /// Letters on their way: from, to.
    on_the_way: VecDeque<(usize, usize, Vec<u8>)>,
    /// How many of the next letters get lost.
    pub(crate) to_lose: usize,
}

pub(crate) fn id(host: usize) -> HostId {
    HostId(host as u128 + 1)
}

impl Hosts {
    pub(crate) fn new(settings: Settings) -> Self {
        let names = NAMES.iter().enumerate();
        let labs = names.map(|(at, name)| {
            let mut lab = Lab::with(settings, Patch::new());
            // Each client in all hosts has its own port.
            lab.next_port += 1000 * u16::try_from(at).expect("few");
            lab.dispatcher.federate(Identity::new(id(at), name, 0));
            lab
        });
        let mut hosts = Self {
            labs: labs.collect(),
            cuts: BTreeSet::new(),
            on_the_way: VecDeque::new(),
            to_lose: 0,
        };
        hosts.meet();
        hosts.settle();
        hosts
    }

    /// Makes every host appear to all others that it reaches.
    fn meet(&mut self) {
        for one in 0..self.labs.len() {
            for other in 0..self.labs.len() {
                if self.reaches(one, other) {
                    let now = self.labs[one].now;
                    self.labs[one].dispatcher.host_appeared(now, id(other));
                }
            }
        }
    }

    fn reaches(&self, one: usize, other: usize) -> bool {
        one != other && !self.cuts.contains(&(one.min(other), one.max(other)))
    }

    pub(crate) fn cut(&mut self, one: usize, other: usize) {
        self.cuts.insert((one.min(other), one.max(other)));
        self.on_the_way
            .retain(|(from, to, _)| (*from, *to) != (one, other) && (*to, *from) != (one, other));
    }

    /// Ends all cuts and losses, and lets the network report that.
    pub(crate) fn heal(&mut self) {
        self.mend();
        self.meet();
    }

    /// Ends all cuts and losses, without a report by the network.
    pub(crate) fn mend(&mut self) {
        self.cuts.clear();
        self.to_lose = 0;
    }

    /// Carries one letter; returns whether there was one.
    pub(crate) fn carry_one(&mut self) -> bool {
        for from in 0..self.labs.len() {
            while let Some((to, letter)) = self.labs[from].dispatcher.next_letter() {
                let to = usize::try_from(to.0).expect("few") - 1;
                if !self.reaches(from, to) {
                } else if self.to_lose > 0 {
                    self.to_lose -= 1;
                } else {
                    self.on_the_way.push_back((from, to, letter));
                }
            }
        }
        let Some((_, to, letter)) = self.on_the_way.pop_front() else {
            return false;
        };
        let lab = &mut self.labs[to];
        lab.dispatcher.letter_arrived(lab.now, &letter);
        lab.settle();
        true
    }

    /// Carries all letters.
    pub(crate) fn settle(&mut self) {
        for _ in 0..100_000 {
            if !self.carry_one() {
                return;
            }
        }
        panic!("letters beget letters");
    }

    pub(crate) fn wait(&mut self, seconds: i64) {
        for _ in 0..seconds {
            for lab in &mut self.labs {
                lab.wait(Nanos::from_secs(1));
            }
            self.settle();
        }
    }

    /// Sends a line, and returns the lines for its client once all letters are carried.
    pub(crate) fn ask(&mut self, host: usize, seat: usize, line: &str) -> Vec<String> {
        self.labs[host].say(seat, line);
        self.settle();
        self.labs[host].hear(seat)
    }

    pub(crate) fn hear(&mut self, host: usize, seat: usize) -> Vec<String> {
        self.settle();
        self.labs[host].hear(seat)
    }

    pub(crate) fn join(&mut self, host: usize, identification: &str) -> usize {
        let seat = self.labs[host].join(identification);
        self.settle();
        seat
    }

    /// The connections that a host keeps.
    pub(crate) fn patch(&self, host: usize) -> Vec<String> {
        let patch = self.labs[host].dispatcher.patch().iter();
        patch
            .map(|(sink, source)| format!("{sink} = {source}"))
            .collect()
    }

    pub(crate) fn news(&mut self, host: usize) -> Vec<String> {
        let dispatcher = &mut self.labs[host].dispatcher;
        std::iter::from_fn(|| dispatcher.next_news()).collect()
    }
}

pub(crate) fn pin(text: &str) -> Pin {
    Pin::parse(text).expect(text)
}

pub(crate) fn number(text: &str) -> Number {
    Number::parse(text.as_bytes()).expect(text)
}

/// Carries out an operator's order at a host; returns the answer once all letters are carried.
pub(crate) fn order(hosts: &mut Hosts, host: usize, order: Order) -> Result<(), String> {
    let (sender, answer) = channel();
    let reply = Reply::new(move |outcome| sender.send(outcome).expect("it is waited for"));
    let lab = &mut hosts.labs[host];
    lab.dispatcher.operate(order, reply);
    lab.settle();
    hosts.settle();
    let answer = answer.try_recv().expect("an answer");
    answer.map_err(|refusal| refusal.to_string())
}
