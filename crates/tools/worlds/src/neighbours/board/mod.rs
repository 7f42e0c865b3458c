//! The dispatcher's board, with an operator and a slow disk. Its clients join, leave, connect, set values, fall silent,
//! stop reading and make mistakes. The model knows nothing of seats, routes and outboxes.

mod model;
mod rig;
mod words;

use crate::broken::Broken;
use crate::random::{Random, scramble};
use crate::seed::Seed;

use rig::Rig;
use words::{CHANNELS, Identity, NAMES, Peer, Pin, Request, SHAPES, is_input};

/// The maximum number of simultaneous connections.
const SLOTS: u64 = 5;

/// The features that a world may have: the bits of a seed's features.
#[derive(Clone, Copy)]
enum Feature {
    Holds,
    Pieces,
    Deaf,
    Versions,
    Promises,
    Operator,
    SlowDisk,
    Idle,
    Leaving,
    Mistakes,
    Pauses,
    Sloppy,
    Roles,
    Floods,
}

/// An event.
#[derive(Clone, Debug)]
enum Step {
    Say(usize, Request),
    /// A client sends many values of a channel.
    Flood(usize, usize),
    /// The connection of a client breaks.
    Leave(usize),
    /// A client stops reading.
    Deafen(usize),
    /// A client reads this many bytes.
    Sip(usize, usize),
    /// A client reads again.
    Hear(usize),
    /// A client stops or starts sending signs of life.
    Ping(usize, bool),
    /// This many quarters of a second pass.
    Wait(i64),
    /// This many seconds pass while the dispatcher is paused.
    Pause(i64),
    /// The disk has written the patch, or failed to.
    Disk(bool),
    Patch(Pin, Pin),
    Pull(Pin),
    Force(Pin, Option<u64>),
}

/// The features and the events of a seed.
struct Plan {
    seed: Seed,
    features: u64,
}

impl Plan {
    fn draw(seed: Seed) -> Self {
        let features = Random::new(scramble(seed.number)).number() & seed.features;
        Self { seed, features }
    }

    fn has(&self, feature: Feature) -> bool {
        self.features >> feature as u32 & 1 == 1
    }

    /// The event of a moment. Each is drawn from its own number, so that leaving one out does not change the others.
    fn step(&self, at: u64) -> Option<(Step, Random)> {
        if u64::from(self.seed.events) >> (at % 8) & 1 == 0 {
            return None;
        }
        let mut random = Random::new(scramble(self.seed.number ^ (at << 40)) ^ at);
        let step = self.draw_step(&mut random, at)?;
        Some((step, random))
    }

    fn draw_step(&self, random: &mut Random, at: u64) -> Option<Step> {
        let slot = index(random.below(SLOTS));
        // Most worlds begin with clients that are connected.
        if at < 3 || random.once_in(10) {
            let slot = if at < 3 { index(at) } else { slot };
            return Some(Step::Say(slot, Request::Identify(self.identity(random))));
        }
        Some(match random.below(24) {
            0..8 => Step::Say(slot, Request::Values(items(random))),
            8..12 => Step::Say(slot, Request::Connect(self.joints(random))),
            12 => {
                let count = 1 + random.below(2);
                let channels = (0..count).map(|_| channel(random)).collect();
                Step::Say(slot, Request::Disconnect(channels))
            }
            13 => Step::Say(
                slot,
                random.of(&[Ask::List, Ask::Ping, Ask::Nothing]).request(),
            ),
            14 if self.has(Feature::Mistakes) => {
                Step::Say(slot, random.of(&[Ask::Wrong, Ask::WrongValues]).request())
            }
            15 if self.has(Feature::Leaving) && random.once_in(2) => {
                let bye = Step::Say(slot, Request::Bye);
                if random.once_in(2) {
                    bye
                } else {
                    Step::Leave(slot)
                }
            }
            16 if self.has(Feature::Deaf) => Step::Deafen(slot),
            17 if self.has(Feature::Deaf) => match random.below(2) {
                0 => Step::Sip(slot, index(random.below(20_000))),
                _ => Step::Hear(slot),
            },
            18 if self.has(Feature::Promises) => Step::Ping(slot, random.once_in(2)),
            19 if self.has(Feature::Promises) || self.has(Feature::Idle) => {
                Step::Wait(self.wait(random))
            }
            20 if self.has(Feature::Pauses) => Step::Pause(random.within(1, 3)),
            21 if self.has(Feature::SlowDisk) => Step::Disk(!random.once_in(5)),
            22 if self.has(Feature::Operator) => match random.below(4) {
                0 => Step::Patch(pin(random), pin(random)),
                1 => Step::Pull(pin(random)),
                2 => Step::Force(pin(random), Some(random.below(4))),
                _ => Step::Force(pin(random), None),
            },
            23 if self.has(Feature::Floods) => Step::Flood(slot, channel(random)),
            _ => return None,
        })
    }

    fn wait(&self, random: &mut Random) -> i64 {
        match random.below(4) {
            0 if self.has(Feature::Idle) => 48,
            0 | 1 => 1,
            2 => 4,
            _ => 12,
        }
    }

    fn identity(&self, random: &mut Random) -> Identity {
        let version = random.of(&[1, 2, 2, 3, 3]);
        let alive = random.of(&[None, Some(600), Some(600), Some(1600), Some(2600)]);
        Identity {
            is_controller: random.once_in(2) && self.has(Feature::Roles),
            name: index(random.below(NAMES.len() as u64)),
            shape: index(random.below(SHAPES.len() as u64)),
            version: if self.has(Feature::Versions) {
                version
            } else {
                2
            },
            alive: alive.filter(|_| self.has(Feature::Promises)),
        }
    }

    fn joints(&self, random: &mut Random) -> Vec<(usize, Peer, usize)> {
        let count = 1 + random.below(4) / 3;
        let joint = |_| {
            let own = channel(random);
            let peer = match random.below(4) {
                0 if self.has(Feature::Roles) => Peer::Nth {
                    is_controller: random.once_in(2),
                    number: index(1 + random.below(2)),
                },
                _ => Peer::Name(index(random.below(NAMES.len() as u64))),
            };
            // Mostly a channel that fits.
            let fits = |peer: &usize| {
                is_input(*peer) != is_input(own) && words::is_analog(*peer) == words::is_analog(own)
            };
            let fitting: Vec<usize> = (0..CHANNELS.len()).filter(fits).collect();
            let peer_channel = if random.once_in(8) {
                channel(random)
            } else {
                random.of(&fitting)
            };
            (own, peer, peer_channel)
        };
        (0..count).map(joint).collect()
    }
}

/// Requests without parameters.
#[derive(Clone, Copy)]
enum Ask {
    List,
    Ping,
    Nothing,
    Wrong,
    WrongValues,
}

impl Ask {
    const fn request(self) -> Request {
        match self {
            Self::List => Request::List,
            Self::Ping => Request::Ping,
            Self::Nothing => Request::Nothing,
            Self::Wrong => Request::Wrong,
            Self::WrongValues => Request::WrongValues,
        }
    }
}

fn index(number: u64) -> usize {
    usize::try_from(number).expect("a small number")
}

fn channel(random: &mut Random) -> usize {
    index(random.below(CHANNELS.len() as u64))
}

fn pin(random: &mut Random) -> Pin {
    (index(random.below(NAMES.len() as u64)), channel(random))
}

/// Values, mostly of outputs.
fn items(random: &mut Random) -> Vec<(usize, u64)> {
    let count = random.of(&[1, 1, 1, 2, 3]);
    let item = |_| {
        let any = channel(random);
        let output = random.of(&[0, 1, 4, 5]);
        (
            if random.once_in(12) { any } else { output },
            random.below(4),
        )
    };
    (0..count).map(item).collect()
}

/// Runs all events, and judges after each.
pub(super) fn run(seed: Seed, trace: &mut Vec<String>) -> Result<(), Broken> {
    let plan = Plan::draw(seed);
    let mut rig = Rig::new(&plan);
    let steps = 20 + scramble(seed.number ^ 7) % 80;
    for at in 0..steps {
        if let Some((step, mut random)) = plan.step(at) {
            trace.push(format!("{at}: {step:?}"));
            rig.take(step, &mut random);
            rig.judge(trace)?;
        }
    }
    trace.push("the end".to_owned());
    rig.quieten();
    rig.judge(trace)
}
