//! The board as viewers know it, and what has changed since they last looked.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tickbus_base::time::Nanos;
use tickbus_dispatcher::{ClientState, Connection, Pin, Snapshot};

use crate::layout::{BoxShape, Layout};

/// The number of clients and cables that are remembered after they have gone, for viewers who do not know it yet.
const REMEMBERED: usize = 4096;

/// A client, and the numbers of the states in which it changed.
#[derive(Debug)]
pub(crate) struct Shown {
    pub(crate) state: ClientState,
    /// When the client came, or got other channels, names or another address.
    pub(crate) shaped: u64,
    /// When a value last changed.
    pub(crate) newest: u64,
    /// When each value last changed.
    pub(crate) changed: Vec<u64>,
}

/// A cable, by its input.
#[derive(Debug)]
pub(crate) struct Cable {
    pub(crate) source: Pin,
    pub(crate) is_awake: bool,
    pub(crate) changed: u64,
}

#[derive(Debug)]
pub(crate) enum Gone {
    Client(String),
    Cable(Pin),
}

/// The board.
#[derive(Debug, Default)]
pub(crate) struct Model {
    pub(crate) number: u64,
    /// Viewers with an older state than this get everything.
    floor: u64,
    pub(crate) clients: Vec<Shown>,
    pub(crate) cables: BTreeMap<Pin, Cable>,
    /// The things that have gone, and when.
    pub(crate) gone: VecDeque<(u64, Gone)>,
    pub(crate) layout: Layout,
}

impl Shown {
    fn new(state: ClientState, number: u64) -> Self {
        let changed = vec![number; state.channels.len()];
        Self {
            state,
            shaped: number,
            newest: number,
            changed,
        }
    }

    /// Takes over the client's present state; returns whether it has another shape.
    fn renew(&mut self, new: ClientState, number: u64) -> bool {
        let old = &self.state;
        let is_same = old.device == new.device
            && old.host == new.host
            && old.channels.len() == new.channels.len()
            && old
                .channels
                .iter()
                .zip(&new.channels)
                .all(|(old, new)| old.channel == new.channel && old.label == new.label);
        if !is_same {
            *self = Self::new(new, number);
            return true;
        }
        let pairs = old.channels.iter().zip(&new.channels);
        for (changed, (old, new)) in self.changed.iter_mut().zip(pairs) {
            if old.value != new.value || old.forced != new.forced {
                *changed = number;
                self.newest = number;
            }
        }
        self.state = new;
        false
    }

    fn name(&self) -> &str {
        &self.state.device.name
    }
}

impl Model {
    fn take(&mut self, snapshot: Snapshot, now: Nanos) {
        let number = self.number + 1;
        let is_other = self.take_clients(snapshot.clients, number)
            | self.take_cables(snapshot.connections, number);
        let is_placed = is_other && {
            let (boxes, links) = self.boxes();
            self.layout.settle(&boxes, &links, now, number)
        };
        if is_other || is_placed || self.clients.iter().any(|it| it.newest == number) {
            self.number = number;
        }
        while self.gone.len() > REMEMBERED {
            self.floor = self
                .gone
                .pop_front()
                .map_or(self.floor, |(number, _)| number);
        }
    }

    /// Returns whether a client came, went, or has another shape.
    fn take_clients(&mut self, new: Vec<ClientState>, number: u64) -> bool {
        let is_same = self.clients.len() == new.len()
            && self
                .clients
                .iter()
                .zip(&new)
                .all(|(old, new)| old.name() == new.device.name);
        if is_same {
            let pairs = self.clients.iter_mut().zip(new);
            return pairs.fold(false, |is_other, (old, new)| {
                old.renew(new, number) | is_other
            });
        }
        let old = std::mem::take(&mut self.clients);
        let mut old: HashMap<String, Shown> = old
            .into_iter()
            .map(|it| (it.name().to_owned(), it))
            .collect();
        for new in new {
            let shown = match old.remove(&new.device.name) {
                Some(mut shown) => {
                    shown.renew(new, number);
                    shown
                }
                None => Shown::new(new, number),
            };
            self.clients.push(shown);
        }
        let gone = old.into_keys().map(|name| (number, Gone::Client(name)));
        self.gone.extend(gone);
        true
    }

    /// Returns whether there are other cables.
    fn take_cables(&mut self, new: Vec<Connection>, number: u64) -> bool {
        let mut old = std::mem::take(&mut self.cables);
        let mut is_other = false;
        for Connection {
            sink,
            source,
            is_awake,
        } in new
        {
            let changed = match old.remove(&sink) {
                Some(old) if old.source == source && old.is_awake == is_awake => old.changed,
                _ => number,
            };
            is_other |= changed == number;
            self.cables.insert(
                sink,
                Cable {
                    source,
                    is_awake,
                    changed,
                },
            );
        }
        is_other |= !old.is_empty();
        let gone = old
            .into_keys()
            .filter(|sink| !self.cables.contains_key(sink));
        let gone: Vec<_> = gone.map(|sink| (number, Gone::Cable(sink))).collect();
        self.gone.extend(gone);
        is_other
    }

    /// All boxes of the page: clients, and those that only cables remember; and which feeds which.
    pub(crate) fn boxes(&self) -> (Vec<BoxShape>, Vec<(usize, usize)>) {
        let mut boxes: Vec<BoxShape> = Vec::new();
        let mut places: HashMap<&str, usize> = HashMap::new();
        for client in &self.clients {
            places.insert(client.name(), boxes.len());
            boxes.push(BoxShape::of(&client.state));
        }
        let here = boxes.len();
        let mut links = Vec::new();
        for (sink, Cable { source, .. }) in &self.cables {
            let mut ends = [0, 0];
            for (end, pin) in ends.iter_mut().zip([source, sink]) {
                let at = *places.entry(&pin.client).or_insert(boxes.len());
                if at == boxes.len() {
                    boxes.push(BoxShape::absent(&pin.client));
                }
                if at >= here {
                    boxes[at].add(pin.channel);
                }
                *end = at;
            }
            links.push((ends[0], ends[1]));
        }
        (boxes, links)
    }

    /// The state that a viewer has seen, if what has gone since then is still known.
    pub(crate) fn seen(&self, seen: Option<u64>) -> Option<u64> {
        seen.filter(|seen| *seen >= self.floor)
    }
}

/// The model, for the room and the dispatcher's thread.
#[derive(Debug)]
pub(crate) struct Shared {
    model: Mutex<Model>,
    /// The last picture of the board, until the room's thread takes it over. The dispatcher's thread must not wait for a
    /// model that is being formatted.
    pending: Mutex<Option<(Snapshot, Nanos)>>,
}

impl Shared {
    pub(crate) fn new(layout: Layout) -> Self {
        let model = Model {
            layout,
            ..Model::default()
        };
        Self {
            model: Mutex::new(model),
            pending: Mutex::default(),
        }
    }

    /// Leaves a picture of the board.
    pub(crate) fn leave(&self, snapshot: Snapshot, now: Nanos) {
        let last = lock(&self.pending).replace((snapshot, now));
        drop(last);
    }

    /// Works on the model with the last picture of the board.
    pub(crate) fn with<R>(&self, work: impl FnOnce(&mut Model) -> R) -> R {
        let mut model = lock(&self.model);
        let pending = lock(&self.pending).take();
        if let Some((snapshot, now)) = pending {
            model.take(snapshot, now);
        }
        work(&mut model)
    }
}

/// After a panic the next picture updates every client anyway.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
